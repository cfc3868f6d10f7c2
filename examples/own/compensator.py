"""A compensator of one's own: the capstan law with friction taken 15 % too low, as in a feedback loop."""

from dataclasses import replace

import tendonff as tf


class Cautious(tf.Compensator):
    """The inverted capstan law for 85 % of the friction, within the actuator's limits."""

    name = "cautious"
    label = "capstan law, 85 % of mu"

    def profile(self, problem: tf.Problem, *, progress: object = None) -> tf.Profile:  # noqa: ARG002
        """Force of the reference of a problem."""
        friction = problem.transmission.friction
        less = replace(friction, mu_dynamic=0.85 * friction.mu_dynamic, mu_static=0.85 * friction.mu_static)
        law = tf.CapstanLaw.of(replace(problem.transmission, friction=less))
        actuator = problem.transmission.actuator
        force = law.input_history_N(problem.reference.tension_N, problem.reference.initial_tension_N)
        return tf.Profile(force_N=force.clip(actuator.force_min_N, actuator.force_max_N))


result = tf.design(tf.load_scenario("examples/finger.toml"), compensators=["none", "capstan", Cautious()])
for each in result.proof:
    print(f"{each.compensator:10} RMS error {each.score.rmse_percent_of_range:.1f} % of range")
