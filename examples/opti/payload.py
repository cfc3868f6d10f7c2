"""A wrist that follows a reference with a tool on a spring, by constraints of one's own."""

from dataclasses import replace

import casadi as ca
import numpy as np

import tendonff as tf

wrist = tf.load_scenario("examples/instrument_pair.toml")
wrist = replace(wrist, reference=replace(wrist.reference, duration_s=0.1, fade_in_s=0.05))
problem = tf.opti(wrist, payload=True, smoothing=1e-2)
opti, h, wanted = problem.opti, problem.time_s[1], problem.wanted_rad.ravel()

angle, speed = opti.variable(len(wanted)), opti.variable(len(wanted))
opti.set_initial(angle, wanted)  # the tool where it shall be
opti.set_initial(speed, np.append(0.0, np.diff(wanted) / h))
spring = 0.1 * (problem.angle_rad - angle)
opti.subject_to(problem.contact_N_m[1:] == spring[1:])  # what the joint gives to the tool
opti.subject_to(ca.diff(angle) == h * speed[1:])
opti.subject_to(2e-6 / h * ca.diff(speed) == spring[1:])
opti.subject_to(angle[0] == problem.angle_rad[0])
opti.subject_to(speed[0] == 0)

steps = ca.diff(problem.motor_rad, 1, 1)  # of two motors only one follows from the joint
opti.minimize(1e3 * (ca.sumsqr(angle - wanted) + 1e-4 * ca.sumsqr(steps)))
answer = problem.solve()
off = np.degrees(np.abs(answer.value(angle) - wanted).max())
print(f"the tool is off by {off:.2g} deg at most, after {answer.iterations} iterations")
