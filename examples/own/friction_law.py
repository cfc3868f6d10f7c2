"""Friction that falls with the square of the sliding speed, in place of the first power: a law of one's own."""

from dataclasses import dataclass, fields, replace

import casadi as ca
import numpy as np

import tendonff as tf
from tendonff.models.tendon.elements import whole_of
from tendonff.models.tendon.friction import LuGreBristle


@dataclass(frozen=True, slots=True, kw_only=True)
class SquareBristle(LuGreBristle):
    """A LuGre bristle with mu_d + (mu_c - mu_d) exp(-(v/omega)^2)."""

    def coefficient(self, v: ca.SX) -> ca.SX:
        """The coefficient at a sliding speed [-]."""
        return self.mu_dynamic_pull + (self.mu_static_pull - self.mu_dynamic_pull) * ca.exp(
            -((v / self.stribeck_velocity_m_per_s) ** 2)
        )


scenario = tf.load_scenario("examples/finger_stribeck.toml")
whole = whole_of(scenario.transmission, tf.Level.PRESLIDING)
law = SquareBristle(**{field.name: getattr(whole.friction, field.name) for field in fields(whole.friction)})
chain = tf.Chain.of(scenario.transmission, tf.Level.PRESLIDING)
mine = replace(chain, elements=replace(whole, friction=law).divided(chain.count, chain.motion))

reference = tf.sample_reference(scenario)
force = tf.invert(mine, reference.tension_N, reference.step_s).force_N
output = tf.simulate(mine, force, reference.step_s).output_tension_N
print(f"RMS error of its exact inverse: {np.std(output - reference.tension_N):.1e} N")
