"""The equations of a tendon as a model of acados."""

import casadi as ca
import numpy as np

import tendonff as tf
from tendonff.ocp.codegen.smoothing import smoothed, switches

try:
    from acados_template import AcadosModel
except ImportError:  # the same attributes on a plain record
    from types import SimpleNamespace as AcadosModel

scenario = tf.load_scenario("examples/finger.toml")
page = tf.mechanism_equations(scenario.transmission, tf.Level.PRESLIDING)
law = ca.Function("law", [page.state, page.inputs], [page.rate])
smooth = smoothed(law, np.full(switches(law).size1_out(0), 1e-5))  # widths [m/s] of sliding speeds, [N] of tensions

model = AcadosModel()
model.name = "finger"
model.x, model.u, model.p = page.state, page.inputs, []
model.xdot = ca.SX.sym("xdot", page.state.numel())
model.f_expl_expr = smooth(page.state, page.inputs)
model.f_impl_expr = model.xdot - model.f_expl_expr  # stiff: take acados' implicit Runge-Kutta integrator
model.cost_y_expr = page.tension_N[-1]
print(f"{model.name}: {model.x.numel()} states, {model.u.numel()} inputs")
