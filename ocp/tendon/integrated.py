"""A single tendon advanced by CasADi's integrators, in the place of the compiled step."""

import casadi as ca
import numpy as np

from tendonff.models.layout import ChainInputs
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.integrate.integrator import Array, Integrator, evaluated, gave_up
from tendonff.ocp.integrate.method import Accuracy, Method
from tendonff.ocp.step.protocol import Rows, StepperMemory


class IntegratedStepper:
    """Advance one chain by an integrator; see `protocol.Stepper`."""

    def __init__(self, chain: Chain, step_s: float, method: Method, accuracy: Accuracy) -> None:
        equations = chain_equations(chain)
        self._chain, self._step_s, self._method = chain, step_s, method
        self._integrator = Integrator(equations, step_s, method, accuracy)
        at = [equations.state, equations.place, equations.place_rate]
        self._tension = ca.Function("tension", at, [equations.tension_N])

    def advance(self, memory: StepperMemory, inputs: ChainInputs, record: bool) -> Rows:
        """See `protocol.Stepper`."""
        times = memory.time_s + self._step_s * np.arange(len(inputs) + 1.0)
        places = self._chain.path_at(times).table()
        states = self._integrator.advance(memory.x, inputs.table(memory.inputs), places)
        done = len(states)
        rates = np.diff(places, axis=0)[:done] / self._step_s
        tension = evaluated(self._tension, states, places[1 : done + 1], rates)[0]
        if done:
            last: Array = states[-1]
            memory.x_old, memory.x = (states[-2] if done > 1 else memory.x).copy(), last.copy()
            memory.inputs, memory.time_s = inputs[done - 1 : done], memory.time_s + done * self._step_s
        return Rows(
            tension_N=tension,
            ends_m=states[:, -2:].copy(),
            states=states if record else None,
            iterations=done,  # at least; the integrators' own steps are not counted
            splits=0,
            residual_N=np.nan,
            worst_mass=0,
            reason=None if done == len(inputs) else gave_up(self._method),
        )
