"""A wrist that follows a reference with a tool on a spring, by constraints of one's own."""

from dataclasses import replace

import casadi as ca
import numpy as np

import tendonff as tf

wrist = tf.load_scenario("examples/instrument_pair.toml")
wrist = replace(wrist, reference=replace(wrist.reference, duration_s=0.1, fade_in_s=0.05))
problem = tf.opti(wrist, payload=True)
opti, h = problem.opti, problem.time_s[1]

angle, speed = opti.variable(len(problem.time_s)), opti.variable(len(problem.time_s))
spring = 0.1 * (problem.angle_rad - angle)
opti.subject_to(problem.contact_N_m[1:] == spring[1:])  # what the joint gives to the tool
opti.subject_to(ca.diff(angle) == h * speed[1:])
opti.subject_to(2e-6 * ca.diff(speed) == h * spring[1:])
opti.subject_to(angle[0] == problem.angle_rad[0])
opti.subject_to(speed[0] == 0)

steps = ca.diff(problem.motor_rad, 1, 1)  # of two motors only one follows from the joint
opti.minimize(1e3 * (ca.sumsqr(angle - problem.wanted_rad) + 1e-4 * ca.sumsqr(steps)))
answer = problem.solve()
print(f"the tool is off by {np.degrees(np.abs(answer.value(angle) - problem.wanted_rad).max()):.2g} deg at most")
