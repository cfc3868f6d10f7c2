"""The chain as a system of python-control."""

import control
import numpy as np

import tendonff as tf

transmission = tf.load_scenario("examples/finger.toml").transmission
chain = tf.Chain.of(transmission, tf.Level.PRESLIDING, segments=2)

plant = tf.as_iosystem(chain, name="tendon")  # force_N -> tension_1_N .. tension_3_N, end positions
rest = chain.rest_state(30.0)

time = np.linspace(0.0, 0.2, 201)
force = 30 + 10 * np.sin(2 * np.pi * 5 * time)
stiff = {"solve_ivp_method": "Radau", "solve_ivp_kwargs": {"rtol": 1e-4}}
response = control.input_output_response(plant, time, force, rest.vector(), **stiff)

linear = tf.linear_system(chain, rest)  # around rest, where the tendon sticks
print(control.dcgain(linear)[chain.count])  # share of a small change of the force that reaches the output
