"""Parts of a scenario's self-tuning: the recursion's numbers, the information of the reference, the interval."""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.certificate import feedback_certificate
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.settings import Adaptation
from tendonff.models.capstan import CapstanLaw
from tendonff.models.parameters.drive import Drive
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.parameters.transmission import Transmission
from tendonff.models.parameters.uncertainty import Spread
from tendonff.ocp.adaptation.bounds import CertifiedInterval
from tendonff.ocp.adaptation.code import TunedChain, nuisances_of
from tendonff.ocp.adaptation.information import Information, information
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig
from tendonff.ocp.adaptation.tuning import GATE, Sensor, Tunable, Tuning
from tendonff.ocp.tendon.simulate import simulate

BOUND_SPREAD = 0.2
"""Least relative half-width of mu theta of each direction that the interval admits, and of stiffness in its margin."""

BOUND_MASSES = 40
_SLACK_NOISE = 0.01  # error of the force that is admitted where it lets the tendon go slack, share of the range
_BOUNDED = (Tunable.MU_PULL, Tunable.MU_RELEASE, Tunable.TENDON_STIFFNESS, Tunable.LOAD_STIFFNESS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Certified:
    """The interval of two plays along a reference."""

    interval: CertifiedInterval
    # low_N, high_N: shape (n,); for the force of the exact inverse
    low_N: FloatArray
    high_N: FloatArray


def check_tuning(scenario: Scenario) -> None:
    """Refuse self-tuning behind a position servo, and that of a load exponent where friction differs from mass to mass.

    The model of the tuner is driven by the force that was applied.
    """
    if scenario.adaptation is None:
        return
    if scenario.transmission.actuator.drive is Drive.POSITION:
        raise InputError(
            f'{scenario.source.name} [adaptation]: self-tuning needs a force drive; leave it out, or use "force"'
        )
    sections = scenario.joints or scenario.transmission.path.sections
    if sections and Tunable.LOAD_EXPONENT in scenario.adaptation.parameters:
        raise InputError(
            f'{scenario.source.name} [adaptation] parameters: "load_exponent" is tuned on a path of one piece at rest '
            "only; leave it out here"
        )


def tuning_of(problem: Problem, settings: Adaptation) -> Tuning:
    """Numbers of the recursion: noise and delay from the scenario, the measured range from the design."""
    reference, layout = problem.reference, problem.chain.layout
    span = float(np.ptp(reference.tension_N))
    states = problem.inversion.states
    if settings.sensor is Sensor.ACTUATOR_POSITION and states is not None:
        span = float(np.ptp(states[:, layout.part("q_a")]))
    low, high = settings.range
    return Tuning.of(
        sensor=settings.sensor,
        parameters=settings.parameters,
        delay_samples=settings.delay_samples,
        joint_delay_samples=settings.joint_delay_samples,
        noise=settings.noise,
        span=span,
        step_s=reference.step_s,
        lowest=low,
        highest=high,
        integral_gain_per_s=integral_gain_per_s(problem, settings),
    )


def integral_gain_per_s(problem: Problem, settings: Adaptation) -> float:
    """Gain of the integral action [1/s]: the stated one, or a share of what is certified; 0 from the position."""
    if settings.integral_gain_per_s is not None:
        return settings.integral_gain_per_s
    if settings.sensor is not Sensor.OUTPUT_TENSION:
        return 0.0
    transmission, step = problem.transmission, problem.reference.step_s
    return feedback_certificate(transmission, step, settings.delay_samples, 0.0).default_gain_per_s


def tuned_chain(problem: Problem, tuning: Tuning) -> TunedChain:
    """The design model with the factors that are tuned."""
    return TunedChain.of(problem.transmission, problem.level, tuning.parameters)


def learnt(problem: Problem, tuning: Tuning) -> Information:
    """Information of the reference, on the scenario's own plant without noise."""
    tuned, reference = tuned_chain(problem, tuning), problem.reference
    start = reference.initial_tension_N
    tuner = SelfTuner(tuned, reference.step_s, tuning, problem.limits, start)
    rig = SimulatedRig(tuned.chain, reference.step_s, 1, start)
    run = tuner.run(rig, reference.tension_N[1:], np.zeros(len(reference.tension_N) - 1), adapt=False)
    weight = np.minimum(run.moved / tuning.full_speed, 1.0)
    gated = np.where(weight > GATE, weight, 0.0)
    return information(tuning, reference.time_s[1:], run.slopes, gated, nuisances_of(tuned, tuning), tuned.priors)


def friction_spread(problem: Problem) -> float:
    """Relative half-width of mu theta that the interval admits: what [robust] states, at least `BOUND_SPREAD`."""
    stated = sum(_change(problem, spread) for spread in problem.uncertainty.spreads)
    if stated >= 1:
        raise InputError(
            f"[robust] admits mu theta within {100 * stated:.3g} % of the scenario's value; the interval of the output "
            "tension needs less than 100 %: narrow the spreads of friction and angles"
        )
    return max(BOUND_SPREAD, stated)


def _at(problem: Problem, spread: Spread, place: float) -> Transmission:
    """The transmission with a stated number at a place in its interval."""
    return with_numbers(problem.transmission, spread.values(problem.transmission, place))


def _change(problem: Problem, spread: Spread) -> float:
    """Largest relative change of mu theta over the interval of a stated number."""
    law = CapstanLaw.of(problem.transmission)
    ends = [CapstanLaw.of(_at(problem, spread, place)) for place in (-1.0, 1.0)]
    both = [(end.pull_exponent, law.pull_exponent) for end in ends]
    both += [(end.release_exponent, law.release_exponent) for end in ends]
    return max((abs(there / here - 1) for there, here in both if here > 0), default=0.0)


def certified(problem: Problem) -> Certified:
    """The interval of two plays along the reference, with what the capstan law leaves out as its margin.

    The margin is the largest over plants of 40 masses: at every corner of what friction of the two directions may be,
    as the scenario, and with tendon, load and bristles all softer or all stiffer; and with each number of [robust] at
    the ends of its interval, where the directions are apart the most. Where a plant goes slack, the force is taken to
    be off by as much as makes the capstan law slack too.
    """
    start, step = problem.reference.initial_tension_N, problem.reference.step_s
    force, spread = problem.limited(problem.inversion.force_N), friction_spread(problem)
    plant = TunedChain.of(problem.transmission, problem.level, _BOUNDED, BOUND_MASSES)
    name = "bristle_stiffness_N_per_m"
    chains = []
    for elastic, bristle in ((1.0, 1.0), (1 - BOUND_SPREAD, 0.5), (1 + BOUND_SPREAD, 2.0)):
        rig = replace(plant, whole=plant.whole.changed({name: bristle * plant.whole.value(name)}))
        for places in ((0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)):
            factors = [*(1 + place * spread for place in places), elastic, elastic]
            chains.append(rig.with_factors(dict(zip(_BOUNDED, factors, strict=True))))
    for stated in problem.uncertainty.spreads:
        left = max(spread - _change(problem, stated), 0.0)
        for end in (-1.0, 1.0):
            rig = TunedChain.of(_at(problem, stated, end), problem.level, _BOUNDED[:2], BOUND_MASSES)
            corners = ({Tunable.MU_PULL: 1 + apart, Tunable.MU_RELEASE: 1 - apart} for apart in (-left, left))
            chains.extend(map(rig.with_factors, corners))
    outputs = np.stack(
        [simulate(chain, force, step, initial_tension_N=start).require().output_tension_N for chain in chains]
    )
    slack = np.any(outputs + problem.transmission.friction.adhesion_N <= 0, axis=0)
    noise_N = 0.0  # no ratio to the capstan law's output holds what is slack: an error of the force is admitted instead
    if float(force.min()) + problem.transmission.friction.adhesion_N <= 0 or slack.any():
        noise_N = float(force[slack].max(initial=0.0)) + _SLACK_NOISE * problem.reference.range_N
    bare = CertifiedInterval(law=CapstanLaw.of(problem.transmission), spread=spread, noise_N=noise_N)
    interval = bare.with_margin_for(force, outputs)
    low, high = interval.history_N(force, start)
    return Certified(interval=interval, low_N=low, high_N=high)
