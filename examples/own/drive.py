"""A drive of one's own: a motor whose torque falls with its speed, on a tendon."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

import tendonff as tf
from tendonff.models.mechanism import Arm, Attachment, Body, Damper, Mechanism, Spring, Tendon, rest_state


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectCurrentMotor:
    """Torque k (U - k w)/R of a motor under the voltage U."""

    leads: ClassVar[bool] = False
    body: str
    constant: float = 0.02  # k [N m/A]
    resistance_ohm: float = 0.5

    def effort(self, q: ca.SX, w: ca.SX, command: ca.SX) -> ca.SX:  # noqa: ARG002
        """Torque on the motor's body [N m]."""
        return self.constant * (command - self.constant * w) / self.resistance_ohm

    def command_name(self, unit: object) -> str:  # noqa: ARG002
        """Name of its input."""
        return f"{self.body}_V"


rig = tf.load_scenario("examples/finger.toml").transmission
drum, hook = (Attachment(arms=(Arm(body=b, metres_per_unit=m),)) for b, m in (("motor", 0.008), ("load", 1.0)))
tendon = Tendon(name="flexor", path=rig.path, tendon=rig.tendon, friction=rig.friction, near=drum, far=hook)
load = Body(name="load", unit="m", inertia=0.1, loads=(Spring(stiffness=2e3), Damper(damping=20.0)))
motor = Body(name="motor", unit="rad", inertia=1e-5)
mechanism = Mechanism(bodies=(motor, load), tendons=(tendon,), drives=(DirectCurrentMotor(body="motor"),))
page = tf.mechanism_equations(mechanism, tf.Level.ELASTIC)
start = rest_state(mechanism.cut(tf.Level.ELASTIC), {"flexor": 2.0}, {"motor": 0.0, "load": 1e-3})
run = tf.integrate(page, start, np.linspace(0.4, 6.0, 301)[:, None], 1e-3).require()  # volts, 0.3 s
print(f"the load moves by {1e3 * (run.states[-1, page.rows('load_m')[0]] - 1e-3):.1f} mm")
