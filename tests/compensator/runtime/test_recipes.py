"""Recipes of `examples/recipes` against the packages that they are for."""

import importlib.util
import math
from types import SimpleNamespace

import pytest

import tendonff as tf

pytestmark = pytest.mark.compiler
WANTED = [0.0, 0.01, 0.03, 0.06, 0.08, 0.08, 0.07]


@pytest.fixture
def recipe(examples):
    def load(name):
        spec = importlib.util.spec_from_file_location(name, examples / "recipes" / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture
def knuckle(examples):
    return lambda: tf.Runtime(examples / "hand_joint.toml")


@pytest.mark.parametrize(("joint", "sign"), [("index_mcp", 1), ("wrist", -1)])
def test_a_motor_of_an_orca_hand_goes_where_the_inverse_says(recipe, knuckle, joint, sign):
    """Motors of the mock hand of orca-core are where they are commanded; one of them is mounted the other way round."""
    core = pytest.importorskip("orca_core", reason="orca-core is not installed")
    hand, runtime, commanded = core.MockOrcaHand(), knuckle(), []
    assert hand.connect()[0]
    step = runtime.step
    runtime.step = lambda *given, **more: commanded.append(step(*given, **more)) or commanded[-1]
    motor = hand.config.joint_to_motor_map[joint]
    home = hand.get_motor_pos(as_dict=True)[motor]
    recipe("orca_hand").follow(hand, joint, runtime, WANTED, period_s=0.002)
    hand_at = hand.get_motor_pos(as_dict=True)[motor]
    assert hand_at == pytest.approx(home + sign * commanded[-1], abs=1e-9)
    assert abs(commanded[-1]) > 1e-3  # how far it comes depends on the time that each call took
    hand.disconnect()


def test_the_loop_of_an_orca_hand_with_encoders_gets_what_the_runtime_commands_as_its_target(recipe):
    """The mock hand of orca-core has no encoders: a hand of four functions that it has, whose joint lags by a tenth."""
    core = pytest.importorskip("orca_core", reason="orca-core is not installed")

    class Hand:
        config = SimpleNamespace(joint_to_motor_map={"index_mcp": 3})
        calibration = SimpleNamespace(joint_to_motor_ratios_dict={3: 0.05})
        targets, gains = [20.0], None

        def set_pid_gains(self, **gains):
            self.gains = gains

        def get_measured_joints(self):
            return {"index_mcp": 20.0 + 0.9 * (self.targets[-1] - 20.0)}

        def set_joint_positions(self, positions):
            self.targets.append(positions["index_mcp"])

    class Runtime:
        start, measured = 0.3, []

        def step(self, reference, dt, measured):
            self.measured.append(measured)
            return 2 * reference

    hand, runtime = Hand(), Runtime()
    recipe("orca_hand").follow_with_feedback(hand, "index_mcp", runtime, WANTED, period_s=0.001)
    assert hand.gains == {"Kp": {"index_mcp": 0.0}, "Ki": {"index_mcp": 0.0}}
    assert hand.targets[1:] == pytest.approx([20 + 2 * angle / 0.05 for angle in WANTED])
    seen = [0.3 + math.radians(0.9 * (target - 20)) for target in hand.targets[:-1]]
    assert runtime.measured == pytest.approx(seen)
    for name in ("set_pid_gains", "get_measured_joints", "set_joint_positions"):
        assert callable(getattr(core.OrcaHandJointFeedback, name))


def test_a_packet_to_dynamixel_servos_holds_every_command(recipe, knuckle):
    """Bytes as the protocol states them, and the checksum of the SDK."""
    sdk = pytest.importorskip("dynamixel_sdk", reason="dynamixel-sdk is not installed")

    class Port:
        is_using, sent = False, b""

        def clearPort(self):
            self.sent = b""

        def writePort(self, packet):
            self.sent = bytes(packet)
            return len(packet)

    port, handler, home = Port(), sdk.PacketHandler(2.0), {3: 2048, 7: 100}
    joints, dynamixel = {3: knuckle(), 7: knuckle()}, recipe("dynamixel")
    for angle in WANTED:
        assert dynamixel.cycle(joints, {3: angle, 7: -angle}, 0.01, port, handler, home) == sdk.COMM_SUCCESS
    same = [knuckle(), knuckle()]
    expected = [[r.step(s * a, dt=0.01) for a in WANTED][-1] for r, s in zip(same, (1, -1), strict=True)]
    packet = port.sent
    assert packet[:5] == b"\xff\xff\xfd\x00\xfe"
    assert packet[7] == 0x83
    assert int.from_bytes(packet[8:10], "little") == 116
    for place, (servo, command) in zip((12, 17), zip((3, 7), expected, strict=True), strict=True):
        assert packet[place] == servo
        counts = int.from_bytes(packet[place + 1 : place + 5], "little", signed=True)
        assert abs((counts - home[servo]) / 4096 * 2 * math.pi - command) <= math.pi / 4096 + 1e-12
    assert int.from_bytes(packet[-2:], "little") == handler.updateCRC(0, list(packet), len(packet) - 2)
