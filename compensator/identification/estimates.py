"""Estimates in the words of the scenario file, from what each stage found."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from tendonff.compensator.identification.fitting.dynamic import DynamicFit, relevant_size
from tendonff.compensator.identification.fitting.model_selection import StaticSelection
from tendonff.compensator.identification.identifiability import ExcitationSummary, reason
from tendonff.compensator.identification.measured.reading import Array
from tendonff.compensator.identification.result import Estimate
from tendonff.compensator.scenario.measurement import Explain
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.ocp.fits.chain import DynamicParameter
from tendonff.ocp.fits.static import SPREADS, StaticParameter, in_gross_sliding

P, D = StaticParameter, DynamicParameter

POOR_SHARE = 0.35
"""Standard error over value from which on a value counts as not identified."""

TWINS = 0.985
"""Correlation from which on two values are told only together."""

BIASES = (D.INPUT_BIAS, D.OUTPUT_BIAS)
EXPONENTS = {"mu_dynamic": "mu_theta", "mu_dynamic_release": "mu_theta_release"}

LOAD_TERMS = (P.PULL, P.RELEASE, P.ADHESION)

NOT_DESCRIBED = "no law explains these files, so its parameters mean nothing here"

Answer = tuple[tuple[Estimate, ...], tuple[str, ...], Array]


def _scenario_value(scenario: Scenario, name: str) -> float | None:
    friction, tendon = scenario.transmission.friction, scenario.transmission.tendon
    if name == "mu_dynamic_release":
        return friction.release_dynamic
    if name == "mu_static_release":
        return friction.release_static
    value = next((getattr(table, name) for table in (friction, tendon) if hasattr(table, name)), None)
    return None if value is None else float(value)


def static_estimates(scenario: Scenario, stage: StaticSelection, now: ExcitationSummary, *, described: bool) -> Answer:
    """Estimates of the static stage alone.

    Parameters
    ----------
    described : bool
        The law describes the device.
    """
    theta, fit = scenario.transmission.path.total_angle_rad, stage.fit
    solution = fit.solution
    sliding = dict(zip((P.PULL, P.RELEASE), in_gross_sliding(fit.values), strict=True))
    per_own = {k: v / fit.values[k] / theta if fit.values[k] > 0 else 1 / theta for k, v in sliding.items()}
    names = {
        P.PULL: ("mu_dynamic", per_own[P.PULL]),
        P.RELEASE: ("mu_dynamic_release", per_own[P.RELEASE]),
        P.ADHESION: ("adhesion_N", 1.0),
        P.INPUT_BIAS: ("input_bias_N", 1.0),
        P.OUTPUT_BIAS: ("output_bias_N", 1.0),
        P.GUIDE: ("guide_stiffness_N_per_m", 1.0),
        P.BRISTLE: ("soft_bristle_stiffness_N_per_m", 1.0),
        **{k: (k.value, 1.0) for k in SPREADS},
    }
    estimates: list[Estimate] = []
    correlation = solution.correlation()
    free = list(solution.values)
    for parameter, (name, factor) in names.items():
        source = P.PULL if parameter is P.RELEASE and not fit.model.asymmetric else parameter
        own = _scenario_value(scenario, name)
        if source.value not in free:
            if parameter in (P.ADHESION, P.INPUT_BIAS, P.OUTPUT_BIAS):
                estimates.append(_kept(name, 0.0, own, _constants(fit.model.constants, parameter)))
            elif own is not None:
                estimates.append(_kept(name, own, own, reason(D.BRISTLE, now, scenario.transmission)))
            continue
        value, error = solution.values[source.value], solution.standard_error(source.value)
        low, high = solution.interval(source.value)
        size = abs(value)
        told = error < POOR_SHARE * size or parameter in (P.INPUT_BIAS, P.OUTPUT_BIAS, P.GUIDE)
        partner = _partner(free, correlation, source.value)
        if parameter in LOAD_TERMS and partner in LOAD_TERMS:
            told = False  # friction that grows with load and friction that does not look the same here
        if not described:
            why = NOT_DESCRIBED
        elif not told or not math.isfinite(error):
            share = error / size if size > 0 else float("inf")
            twin = f" It goes with {partner}: the files tell only their combination." if partner else ""
            key = {P.PULL: D.MU_PULL, P.RELEASE: D.MU_RELEASE, P.ADHESION: D.ADHESION, P.BRISTLE: D.BRISTLE}
            kind = key.get(parameter, D.INPUT_BIAS)
            why = reason(kind, now, scenario.transmission, share, fitted=True) + "." + twin
            if parameter in LOAD_TERMS and partner in LOAD_TERMS:
                why = f"it goes with {partner}, these files tell only their combination; repeat at several loads"
        else:
            why = "static stage" + (f"; mu theta = {sliding[parameter]:.4g}" if parameter in sliding else "")
        told = bool(told and described and math.isfinite(error))
        shown = factor * value if described or own is None else own
        estimates.append(
            Estimate(
                name=name,
                value=float(shown),
                standard_error=factor * error,
                interval=(factor * low, factor * high),
                identifiable=told,
                why=why,
                scenario=own,
                fitted=described,
            )
        )
    estimates = [*_exponents(estimates, theta), *estimates]
    if described and P.ADHESION.value in free:
        estimates.append(_without_load(stage))
    for dynamic_name in (D.STIFFNESS, D.RELAXING, D.RELAXATION_TIME, D.STRIBECK_VELOCITY, D.VISCOUS, D.DAMPING):
        own = _scenario_value(scenario, dynamic_name)
        why = reason(dynamic_name, now, scenario.transmission)
        if fit.explain is Explain.INPUT and dynamic_name is not D.VISCOUS and dynamic_name is not D.STRIBECK_VELOCITY:
            why = f"the output tension is imposed: what would tell {dynamic_name} needs a load that only follows"
        estimates.append(_kept(dynamic_name, own or 0.0, own, why if described else NOT_DESCRIBED))
    return tuple(estimates), tuple(free), correlation


def _without_load(stage: StaticSelection) -> Estimate:
    """Friction that remains at zero output tension, p (e^{mu theta} - 1), which is told better than its two factors."""
    solution, names = stage.fit.solution, list(stage.fit.solution.values)
    a, p = solution.values[P.PULL.value], solution.values[P.ADHESION.value]
    gradient = np.zeros(len(names))
    gradient[names.index(P.PULL.value)] = p * np.exp(a)
    gradient[names.index(P.ADHESION.value)] = np.expm1(a)
    finite = bool(np.isfinite(np.diag(solution.covariance)).all())
    error = math.sqrt(max(float(gradient @ solution.covariance @ gradient), 0.0)) if finite else float("inf")
    reach = error * float(student.ppf(0.975, max(solution.degrees, 1)))
    value = float(p * np.expm1(a))
    return Estimate(
        name="load_independent_friction_N",
        value=value,
        standard_error=error,
        interval=(value - reach, value + reach),
        identifiable=bool(error < POOR_SHARE * value),
        why="static stage: adhesion times (e^{mu theta} - 1)",
    )


def _constants(chosen: bool, parameter: StaticParameter) -> str:
    if chosen:
        return (
            "only two of adhesion, input bias and output bias can be told from friction loops; this one is held at the "
            "value given; read both cells with a slack tendon to tell"
        )
    what = "adhesion" if parameter is P.ADHESION else "a bias"
    return f"{what} does not lower the validation error; add strokes at low tension"


def _partner(names: Sequence[str], correlation: Array, name: str) -> str:
    """The value that this one is most correlated with, if nearly fully."""
    row = np.abs(correlation[list(names).index(name)]).copy()
    row[list(names).index(name)] = 0
    best = int(np.argmax(row)) if len(row) > 1 else 0
    return str(names[best]) if len(row) > 1 and row[best] > TWINS else ""


def _kept(name: str, value: float, own: float | None, why: str) -> Estimate:
    return Estimate(
        name=str(name), value=value, standard_error=None, interval=None, identifiable=False, why=why, scenario=own
    )


def dynamic_estimates(scenario: Scenario, fit: DynamicFit, now: ExcitationSummary, *, described: bool) -> Answer:
    """Estimates of the dynamic stage, which starts from the others' answers.

    Parameters
    ----------
    described : bool
        The law describes the device.
    """
    solution = fit.solution
    estimates: list[Estimate] = []
    for parameter in DynamicParameter:
        name = "soft_bristle_stiffness_N_per_m" if parameter is D.BRISTLE else str(parameter)
        source = D.MU_PULL if parameter is D.MU_RELEASE and fit.model.symmetric else parameter
        own = _scenario_value(scenario, name)
        if source not in solution.values:
            size = abs(fit.values[parameter])
            expected = fit.expected.get(parameter, float("inf"))
            why = reason(parameter, now, scenario.transmission, expected / size if size > 0 else None)
            if parameter is not D.STATIC_EXCESS:
                estimates.append(_kept(name, fit.values[parameter] if own is None else own, own, why))
            else:
                for static in ("mu_static", "mu_static_release"):
                    value = _scenario_value(scenario, static)
                    estimates.append(_kept(static, value or 0.0, value, f"{why}; its ratio to the dynamic one is kept"))
            continue
        value, error = solution.values[source], solution.standard_error(source)
        interval = solution.interval(source)
        size = relevant_size(source, value, fit.mean_N)
        told = described and bool(math.isfinite(error)) and (error < POOR_SHARE * size or source in BIASES)
        share = error / abs(value) if value else float("inf")
        why = "dynamic stage" if told else reason(parameter, now, scenario.transmission, share, fitted=True)
        if not described:
            why = NOT_DESCRIBED
        if parameter is D.STATIC_EXCESS:
            estimates += _static_coefficients(
                scenario, fit, value, error, interval, told=told, fitted=described, why=why
            )
            continue
        estimates.append(
            Estimate(
                name=name,
                value=value if described or own is None else own,
                standard_error=error,
                interval=_feasible(source, interval),
                identifiable=told,
                why=why,
                scenario=own,
                fitted=described,
            )
        )
    theta = scenario.transmission.path.total_angle_rad
    return (*_exponents(estimates, theta), *estimates), tuple(solution.values), solution.correlation()


def _exponents(estimates: Sequence[Estimate], theta: float) -> list[Estimate]:
    """Friction as ln(T_in/T_out) in gross sliding, mu theta: it needs no wrap angle."""
    return [
        replace(
            e,
            name=EXPONENTS[e.name],
            value=theta * e.value,
            standard_error=None if e.standard_error is None else theta * e.standard_error,
            interval=None if e.interval is None else (theta * e.interval[0], theta * e.interval[1]),
            scenario=None if e.scenario is None else theta * e.scenario,
        )
        for e in estimates
        if e.name in EXPONENTS
    ]


def _feasible(parameter: DynamicParameter, interval: tuple[float, float]) -> tuple[float, float]:
    """No interval of a positive value reaches below zero."""
    return interval if parameter in BIASES else (max(interval[0], 0.0), interval[1])


def _static_coefficients(
    scenario: Scenario,
    fit: DynamicFit,
    excess: float,
    error: float,
    interval: tuple[float, float],
    *,
    told: bool,
    fitted: bool,
    why: str,
) -> list[Estimate]:
    """mu_static of both directions from their common ratio to the dynamic coefficients."""
    found = []
    for name, mu in (("mu_static", fit.values[D.MU_PULL]), ("mu_static_release", fit.values[D.MU_RELEASE])):
        own = _scenario_value(scenario, name)
        found.append(
            Estimate(
                name=name,
                value=mu * (1 + excess) if fitted or own is None else own,
                standard_error=mu * error,
                interval=(mu * (1 + max(interval[0], 0.0)), mu * (1 + interval[1])),
                identifiable=told,
                why=why,
                scenario=own,
                fitted=fitted,
            )
        )
    return found
