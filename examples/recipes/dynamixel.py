"""Commands of joints to DYNAMIXEL servos, all in one packet a cycle; needs dynamixel-sdk.

Protocol 2.0, extended position mode: goal position at address 116, 4096 counts a turn.
"""

import math
from collections.abc import Mapping
from typing import Any

import tendonff as tf

GOAL_POSITION, COUNTS_PER_RAD = 116, 4096 / (2 * math.pi)


def write(port: Any, handler: Any, home_counts: Mapping[int, int], commands_rad: Mapping[int, float]) -> int:
    """Send motor angles since the start [rad] by servo; `home_counts` is where each stood then. Result of the SDK."""
    from dynamixel_sdk import GroupSyncWrite

    group = GroupSyncWrite(port, handler, GOAL_POSITION, 4)
    for servo, command in commands_rad.items():
        counts = home_counts[servo] + round(command * COUNTS_PER_RAD)
        group.addParam(servo, list(counts.to_bytes(4, "little", signed=True)))
    return int(group.txPacket())


def cycle(
    joints: Mapping[int, tf.Runtime], angles_rad: Mapping[int, float], dt: float, port: Any, handler: Any, home: Any
) -> int:
    """Run a cycle of a hand: runtime and wanted angle [rad] of each servo's joint, time since the last cycle [s]."""
    commands = {servo: float(runtime.step(angles_rad[servo], dt=dt)) for servo, runtime in joints.items()}
    return write(port, handler, home, commands)
