"""A profile with constraints of one's own: the force only rises, and the tension at the near end is bounded."""

from dataclasses import replace

import casadi as ca
import matplotlib.pyplot as plt

import tendonff as tf

scenario = tf.load_scenario("examples/finger_fast.toml")
short = replace(scenario.reference, duration_s=0.4)
scenario = replace(scenario, reference=short, optimal=tf.TrackOptions(stiffer_weight=0.0))
figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
for bound in (100.0, 62.0):
    problem = tf.opti(scenario, interval_s=0.01)
    problem.opti.subject_to(problem.tension_N[0, 1:] <= bound)
    problem.opti.subject_to(ca.diff(problem.force_N) >= 0.0)
    answer = problem.solve()
    axes.plot(problem.time_s, answer.value(problem.tension_N)[:, 0], label=f"at most {bound:.0f} N at the near end")
axes.set(xlabel="time [s]", ylabel="tension at the near end [N]")
axes.legend()
