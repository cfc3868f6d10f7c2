"""Least error and energy, with a bound on the tension at the middle of the path."""

from dataclasses import replace

import casadi as ca

import tendonff as tf

scenario = tf.load_scenario("examples/finger_fast.toml")
nominal = tf.TrackOptions(stiffer_weight=0.0)  # as the table [optimal] would state it
scenario = replace(scenario, reference=replace(scenario.reference, duration_s=0.4), optimal=nominal)
problem = tf.opti(scenario, interval_s=0.01)

energy = ca.sumsqr(problem.force_N) / len(problem.time_s)
middle = problem.tension_N[3, :]  # the fourth of seven links
problem.opti.minimize(100 * (problem.cost + 1e-4 * energy))  # of order one
problem.opti.subject_to(middle[1:] <= 51.0)

answer = problem.solve()
force_N = answer.value(problem.force_N)
print(f"{answer.message}: at most {answer.value(middle).max():.2f} N at the middle")
