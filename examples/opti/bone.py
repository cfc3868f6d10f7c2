"""A bone on a tendon that a motor winds: a mechanism written out as parts."""

import numpy as np

import tendonff as tf
from tendonff.models.mechanism import Arm, Attachment, Body, Damper, Force, Lead, Mechanism, Spring, Tendon, rest_state

finger = tf.load_scenario("examples/finger.toml").transmission
motor = Body(name="motor", unit="rad", inertia=1e-5)
bone = Body(name="bone", unit="rad", inertia=2e-5, loads=(Damper(damping=1e-3), Spring(stiffness=0.5, rest=-0.3)))
flexor = Tendon(
    name="flexor",
    path=finger.path,
    tendon=finger.tendon,
    friction=finger.friction,
    near=Attachment(arms=(Arm(body="motor", metres_per_unit=0.008),)),  # a drum of 8 mm
    far=Attachment(arms=(Arm(body="bone", metres_per_unit=0.010),)),  # a moment arm of 10 mm
)
mechanism = Mechanism(bodies=(motor, bone), tendons=(flexor,), drives=(Lead(body="motor"), Force(body="bone")))
page = tf.mechanism_equations(mechanism, tf.Level.PRESLIDING)

start = rest_state(mechanism.cut(tf.Level.PRESLIDING), {"flexor": 15.0}, {"motor": 0.0, "bone": 0.0})
turn = np.linspace(0.0, 0.5, 501)[:, None]
run = tf.integrate(page, start, np.zeros((501, 1)), 1e-3, places=turn, method="idas").require()
print(f"the bone turns by {run.states[-1, page.rows('bone_rad')[0]]:.2f} rad")
