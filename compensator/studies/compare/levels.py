"""Differences between model levels, as numbers.

Two probes, the same for every level: a force that goes up, down, up and down at a steady rate (the loop of output over
force, its deadband, and how smoothly the output starts to move after a reversal), and a motor that pulls the tendon
up and then holds its position (how much tension relaxes away).
"""

from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.models.capstan import Branch, CapstanLaw, behind_drive_N
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs, ChainState
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import Simulator, simulate

_RAMP_S = 1.0
_MOVED = 0.02  # of the loop's output range: the output counts as moving
_HOLD_RELAXATION_TIMES = 5.0
_HOLD_S = (0.5, 10.0)
_MOST_ROWS = 100_000.0  # of one ramp
_STIFF = 10.0  # holding motor against tendon


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelTraits:
    """Responses to the probes.

    Attributes
    ----------
    force_N, output_N : numpy.ndarray
        Shape (n,); the closed loop: output tension over force.
    loop_area_percent : float
        Area of the loop, of the rectangle around it [%].
    deadband_N : float
        Fall of the force, after pulling, before the output follows [N].
    reversal_width_N : float
        Further fall of the force until the output follows at its full rate [N]: 0 is a corner.
    relaxation_percent : float
        Stress relaxation: fall of the tension at the actuator's end while its position is held, of its start [%].
    hold_time_s, hold_input_N : numpy.ndarray
        Shape (m,); course of that tension.
    """

    force_N: FloatArray
    output_N: FloatArray
    loop_area_percent: float
    deadband_N: float
    reversal_width_N: float
    relaxation_percent: float
    hold_time_s: FloatArray
    hold_input_N: FloatArray


def level_traits(transmission: Transmission, level: Level | None, reference: Reference) -> LevelTraits:
    """Probe a level as far as the extremes of the reference; None is the capstan law."""
    law, step, start = CapstanLaw.of(transmission), reference.step_s, reference.initial_tension_N
    low, high = _probe_forces(transmission, law, reference)
    ramp_s = max(_RAMP_S, (high - low) / (0.5 * transmission.actuator.force_rate_max_N_per_s), 20 * step)
    rows = round(min(ramp_s / step, _MOST_ROWS))  # an actuator that hardly moves is probed faster than it can
    ramps = [np.linspace(a, b, rows, endpoint=False) for a, b in ((start, high), (high, low), (low, high))]
    force = np.concatenate([*ramps, np.linspace(high, low, rows + 1)])
    if level is None:
        output = law.output_history_N(behind_drive_N(transmission.actuator.law, force, start), start)
        hold_time, hold = np.array([0.0, _hold_s(transmission)]), np.array([high, high])
        relaxed = 0.0
    else:
        chain = Chain.of(transmission, level)
        output = simulate(chain, force, step, initial_tension_N=start).require().output_tension_N
        hold_time, hold = _hold(transmission, chain, start, high, step)
        relaxed = 100 * float((hold[0] - hold[-1]) / hold[0]) if hold[0] > 0 else 0.0
    loop = slice(rows, 3 * rows + 1)  # from high to low and back
    dead, width = _reversal(force[rows : 2 * rows], output[rows : 2 * rows])
    return LevelTraits(
        force_N=force[loop],
        output_N=output[loop],
        loop_area_percent=_area_percent(force[loop], output[loop]),
        deadband_N=dead,
        reversal_width_N=width,
        relaxation_percent=relaxed,
        hold_time_s=hold_time,
        hold_input_N=hold,
    )


def _probe_forces(transmission: Transmission, law: CapstanLaw, reference: Reference) -> tuple[float, float]:
    """Forces that bring the output to the reference's extremes, within the actuator's limits."""
    actuator, start = transmission.actuator, reference.initial_tension_N
    highest, lowest = float(reference.tension_N.max()), float(reference.tension_N.min())
    drive = actuator.law
    high = min(float(drive.force_N(law.input_for_N(max(highest, 1.1 * start), Branch.PULL), 1.0)), actuator.force_max_N)
    low = float(drive.force_N(law.input_for_N(min(lowest, 0.9 * start), Branch.RELEASE), -1.0))
    # A tenth of the tension is kept: near slack everything is different, and not the subject here.
    return max(low, actuator.force_min_N, 0.1 * start), max(high, 1.01 * start)


def _area_percent(force: FloatArray, output: FloatArray) -> float:
    """Area inside the closed loop, in % of the rectangle around it."""
    area = abs(float(np.trapezoid(output, force)))
    box = float(np.ptp(force) * np.ptp(output))
    return 100 * area / box if box > 0 else 0.0


def _reversal(force: FloatArray, output: FloatArray) -> tuple[float, float]:
    """Deadband and width of the transition while the force falls [N]."""
    fallen, followed = force[0] - force, output[0] - output
    span = float(followed[-1])
    if not span > 0:
        return float(fallen[-1]), 0.0
    first = int(np.argmax(followed >= _MOVED * span))
    # Rate over windows of a hundredth of the ramp: one row is rough where the tendon sticks and slips.
    window = max(1, len(force) // 100)
    rate = (followed[window:] - followed[:-window]) / (fallen[window:] - fallen[:-window])
    full = float(np.median(rate[-(len(rate) // 4) :]))
    reached = int(np.argmax(rate >= 0.9 * full)) + window // 2
    return float(fallen[first]), max(0.0, float(fallen[reached] - fallen[first]))


def _hold(
    transmission: Transmission, chain: Chain, start_N: float, high_N: float, step_s: float
) -> tuple[FloatArray, FloatArray]:
    """Pull up with a motor that is stiff beside the tendon, stop, and watch its own end."""
    tendon = transmission.tendon
    holding = _STIFF * tendon.quick_stiffness_N_per_m
    held = chain.with_end_stiffness(holding, chain.far.stiffness_N_per_m)
    state: ChainState = held.rest_state(start_N)
    rest = state.near_position_m + start_N / holding
    simulator = Simulator(held, step_s, state, ChainInputs.of(1, near_rest_m=rest))
    # Travel of the near end that brings it to the high tension, if friction did not take a part: never too little.
    soft = 1 / tendon.stiffness_N_per_m + 1 / holding + 1 / max(chain.far.stiffness_N_per_m, 1e-9)
    rate = (high_N - start_N) * soft / _RAMP_S
    chunk = max(1, round(0.01 * _RAMP_S / step_s))
    position = float(rest)
    for _ in range(200):
        moving = position + rate * step_s * np.arange(1, chunk + 1, dtype=np.float64)
        tension = simulator.advance(ChainInputs.of(chunk, near_rest_m=moving)).tension_N
        position = float(moving[-1])
        if len(tension) < chunk or tension[-1, 0] >= high_N:
            break
    rows = max(2, round(_hold_s(transmission) / step_s))
    near = simulator.advance(ChainInputs.of(rows, near_rest_m=position)).tension_N[:, 0]
    # The stop itself rings for a moment; relaxation is what comes after.
    settled = min(len(near) // 10, round(0.05 / step_s))
    return np.arange(len(near) - settled, dtype=np.float64) * step_s, near[settled:]


def _hold_s(transmission: Transmission) -> float:
    return float(np.clip(_HOLD_RELAXATION_TIMES * transmission.tendon.relaxation_time_s, *_HOLD_S))
