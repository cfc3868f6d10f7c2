"""Estimates in the words of the scenario file; why a value is not identifiable, and what would identify it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from tendonff.compensator.identification.answer.estimate import EXPONENTS, Estimate, is_known
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.dynamic import DynamicFit
from tendonff.compensator.identification.fitting.static import CONSTANTS, StaticFit
from tendonff.compensator.identification.fitting.tendon import longest_hold_s
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.cleaning import Record, mean_pose
from tendonff.compensator.identification.measured.gains import Gains
from tendonff.compensator.identification.parameters import BIASES, BY_TENSIONS, CELL_GAINS, TENDON, Parameter
from tendonff.compensator.scenario.measurement import Explain
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import ExponentLine, exponent_lines
from tendonff.ocp.fits.static import StaticParameter, in_gross_sliding

P, D = StaticParameter, Parameter

LOAD_TERMS = (P.PULL, P.RELEASE, P.ADHESION)
BY_STATIC = {p.tensions.static: p for p in BY_TENSIONS if p.tensions.static is not None}
"""Names of these values in the static laws."""


NOT_FITTED = "not fitted: --static"

OF_SECTION = (
    "bearing_exponent",
    "mu_dynamic",
    "mu_static",
    "mu_dynamic_release",
    "mu_static_release",
)
SECTION_KEPT = "a section's own value is not fitted"

NOT_DESCRIBED = "no law explains these files, so its parameters mean nothing here"

Answer = tuple[tuple[Estimate, ...], tuple[str, ...], Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitationSummary:
    """Measured quantities."""

    positions: bool  # both ends' positions
    hold_s: float  # longest hold of the input tension
    speed_m_per_s: float  # usual top speed of the near end; 0 if not measured
    load_swing: float  # range of the output tension over its mean; of the input's where the output was not measured
    proximal: bool  # nothing was measured at the far end
    joint_rad: Mapping[str, float]  # mean angles of the joints


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rig:
    """Scenario values for comparison, and messages on the estimates."""

    scenario: Scenario
    now: ExcitationSummary
    described: bool
    static_only: bool

    @property
    def lines(self) -> tuple[ExponentLine, ExponentLine]:
        """Mu theta over the common coefficient, at the joints' mean angles, when pulling and when releasing."""
        return exponent_lines(self.scenario.transmission, self.now.joint_rad)

    @property
    def pose(self) -> str:
        """Where the path's exponent counts; empty for a path that no joint moves."""
        shown = ", ".join(f"{name} at {angle:.3g} rad" for name, angle in self.now.joint_rad.items())
        return f"of the whole path with {shown} (mean)" if shown else ""

    def of_sections(self) -> list[Estimate]:
        """Values of single sections, which no fit changes."""
        return [
            Estimate(name=f"{section.name}: {name}", value=value, why=SECTION_KEPT, scenario=value)
            for section in self.scenario.transmission.path.sections
            for name in OF_SECTION
            if (value := getattr(section, name)) is not None
        ]

    def own(self, name: str) -> float | None:
        """The scenario's value; None where it has none of this name."""
        t = self.scenario.transmission
        friction = t.friction
        if name in ("mu_static", "mu_static_release"):
            return friction.mu_static if name == "mu_static" else friction.release_static
        table, _, key = Parameter(name).spec.key.partition(".") if name in BY_TENSIONS else ("", "", "")
        if not key:
            return None
        value = friction.release_dynamic if name == D.MU_RELEASE else getattr(getattr(t, table), key)
        return float(value or 0.0)

    def reason(self, name: Parameter, relative_error: float | None = None, *, fitted: bool = False) -> str:
        """Why a value is not identifiable, with the way out.

        `relative_error` is the standard error that it has or would have; a value that is `fitted` is part of the law
        and doubtful, another does not reduce the validation error.
        """
        now, transmission = self.now, self.scenario.transmission
        tau = transmission.tendon.relaxation_time_s
        doubt = ""
        if relative_error is not None and np.isfinite(relative_error):
            size = f"{100 * relative_error:.3g}" if relative_error < 10 else "above 1000"
            doubt = f"standard error {size} %; "
        if unmeasured := self._unmeasured(name, doubt):
            return unmeasured
        if name in (D.RELAXATION_TIME, D.RELAXING) and now.hold_s < 3 * tau:
            return (
                f"no hold longer than {now.hold_s:.2g} s: {name} is not identifiable; "
                f"add a hold of 3 tau, {3 * tau:.3g} s with the scenario's tau"
            )
        if name in (D.STATIC_EXCESS, D.STRIBECK_VELOCITY):
            omega = transmission.friction.stribeck_velocity_m_per_s
            speed = f" (the near end moved at up to {now.speed_m_per_s:.2g} m/s)" if now.speed_m_per_s else ""
            useless = "adding a Stribeck term does not significantly reduce the validation error"
            return (
                f"{doubt.removesuffix('; ') if fitted else useless}{speed}; "
                f"add strokes at speeds from {0.2 * omega:.2g} to {5 * omega:.2g} m/s, around the Stribeck velocity"
            )
        if name.tensions.signed:
            return name.tensions.advice
        if name.tensions.may_vanish and not fitted:
            doubt += f"adding {name.spec.effect} does not significantly reduce the validation error; "
        if name.tensions.advice:
            return doubt + name.tensions.advice
        if now.load_swing < 0.3:
            return f"{doubt}the output tension varies too little; repeat at several loads"
        return f"{doubt}repeat with full strokes in both directions at several loads"

    def _unmeasured(self, name: Parameter, doubt: str) -> str:
        """Sensor that would identify a value; empty where it is not for want of one."""
        if self.now.proximal and (name is D.STIFFNESS or name.tensions.signed):
            return f"{doubt}nothing was measured at the far end; measure the output tension to tell {name}"
        if name in TENDON and not self.now.positions and not self.now.proximal:
            return (
                f"no positions of both ends were measured: {name} is not identifiable (tensions alone do not show "
                "elongation); measure both positions"
            )
        return ""

    def kept(self, name: str, value: float, why: str) -> Estimate:
        """A value that was not fitted, as the fitted scenario has it."""
        own = self.own(name)
        return Estimate(name=str(name), value=value if self.described or own is None else own, why=why, scenario=own)

    def fitted(
        self, name: str, value: float, error: float, interval: tuple[float, float], *, identifiable: bool, why: str
    ) -> Estimate:
        """A value that was fitted; the scenario's own where no law describes the device."""
        own = self.own(name)
        if not self.described and own is not None:  # an interval of the fit would belong to another value
            return Estimate(name=name, value=own, why=NOT_DESCRIBED, scenario=own)
        seen = error < TUNED.insensitive_share * max(abs(value), abs(own or 0.0), 1.0)
        return Estimate(
            name=name,
            value=value,
            standard_error=error if seen else None,
            interval=interval if seen else None,
            identifiable=bool(identifiable and self.described and seen),
            why=why if self.described else NOT_DESCRIBED,
            scenario=own,
            fitted=self.described,
        )


def estimates_of(
    scenario: Scenario, law: DynamicFit | StaticFit, now: ExcitationSummary, *, described: bool, static_only: bool
) -> Answer:
    """Estimates of the law that won, names of its free values, their correlation; `described`: it fits the device."""
    rig = _Rig(scenario=scenario, now=now, described=described, static_only=static_only)
    found = _dynamic(rig, law) if isinstance(law, DynamicFit) else _static(rig, law)
    every = (*_exponents(rig, found), *found, *rig.of_sections())
    return every, tuple(law.solution.values), law.solution.correlation()


def _static(rig: _Rig, fit: StaticFit) -> list[Estimate]:
    solution, branches = fit.solution, (P.PULL, P.RELEASE)
    sliding = dict(zip(branches, in_gross_sliding(fit.values), strict=True))
    lines = dict(zip(branches, rig.lines, strict=True))
    angles = {k: line.angle_rad for k, line in lines.items()}
    per_own = {k: v / fit.values[k] / angles[k] if fit.values[k] > 0 else 1 / angles[k] for k, v in sliding.items()}
    estimates: list[Estimate] = []
    for parameter in P:
        of = BY_STATIC.get(parameter)
        name, factor = str(of or parameter), per_own.get(parameter, 1.0)
        source = P.PULL if parameter is P.RELEASE and not fit.model.asymmetric else parameter
        own = rig.own(name)
        if source not in solution.values:
            if parameter in CONSTANTS:
                why = _why_no_constant(fit.model.constants, parameter)
                estimates.append(rig.kept(name, fit.values[parameter], why))
            elif own is not None:
                not_tried = rig.static_only and fit.explain is Explain.OUTPUT
                estimates.append(rig.kept(name, own, NOT_FITTED if not_tried else rig.reason(D.BRISTLE)))
            continue
        value, error = solution.values[source], solution.standard_error(source)
        low, high = solution.interval(source)
        partner = _partner(solution.correlation(), list(solution.values), source)
        # Friction that grows with load and friction that does not look the same here.
        alike = parameter in LOAD_TERMS and partner in LOAD_TERMS
        if parameter in (P.INPUT_BIAS, P.OUTPUT_BIAS):
            sure = fit.stands_out(parameter)
        else:
            sure = is_known(error, abs(value)) or parameter.spec.signed
        identifiable = not alike and sure
        if alike:
            why = f"it goes with {partner}, these files tell only their combination; repeat at several loads"
        elif identifiable and math.isfinite(error):
            why = "static stage" + (f"; mu theta = {sliding[parameter]:.4g}" if parameter in sliding else "")
        else:
            share = error / abs(value) if value else float("inf")
            twin = f" It goes with {partner}: the files tell only their combination." if partner else ""
            why = rig.reason(of or D.INPUT_BIAS, share, fitted=True) + "." + twin
        least = lines[parameter].held / angles[parameter] if parameter in lines else 0.0
        interval = (factor * low - least, factor * high - least)
        estimates.append(
            rig.fitted(
                name, float(factor * value) - least, factor * error, interval, identifiable=identifiable, why=why
            )
        )
    if rig.described and P.ADHESION in solution.values:
        estimates.append(_without_load(rig, fit))
    for name in (D.STIFFNESS, D.RELAXING, D.RELAXATION_TIME, D.STRIBECK_VELOCITY, D.VISCOUS, D.DAMPING):
        why = NOT_FITTED if rig.static_only else rig.reason(name)
        if not rig.static_only and fit.explain is Explain.INPUT and name not in (D.STRIBECK_VELOCITY, D.VISCOUS):
            why = f"the output tension is imposed: what would tell {name} needs a load that only follows"
        estimates.append(rig.kept(name, rig.own(name) or 0.0, why if rig.described else NOT_DESCRIBED))
    return estimates


def _without_load(rig: _Rig, fit: StaticFit) -> Estimate:
    """Friction at zero output tension, p (e^{mu theta} - 1), which is better identified than its two factors."""
    solution, names = fit.solution, list(fit.solution.values)
    a, p = solution.values[P.PULL], solution.values[P.ADHESION]
    gradient = np.zeros(len(names))
    gradient[names.index(P.PULL)] = p * np.exp(a)
    gradient[names.index(P.ADHESION)] = np.expm1(a)
    finite = bool(np.isfinite(np.diag(solution.covariance)).all())
    error = math.sqrt(max(float(gradient @ solution.covariance @ gradient), 0.0)) if finite else float("inf")
    reach = error * float(student.ppf(0.975, max(solution.degrees, 1)))
    value = float(p * np.expm1(a))
    found = rig.fitted(
        "load_independent_friction_N",
        value,
        error,
        (value - reach, value + reach),
        identifiable=is_known(error, value),
        why="static stage: adhesion_N times (e^{mu theta} - 1)",
    )
    return replace(found, fitted=False)


def _why_no_constant(chosen: bool, parameter: StaticParameter) -> str:
    if chosen:
        return (
            "only two of load-independent friction and the offsets of both cells can be identified from friction "
            "loops; this one is held at the value given; read both cells with a slack tendon to identify it"
        )
    what = "load-independent friction" if parameter is P.ADHESION else "an offset"
    return f"{what} does not significantly reduce the validation error; add strokes at low tension"


def _partner(correlation: Array, names: list[str], name: str) -> str:
    """The value that this one is most correlated with, if nearly fully; empty where there is none."""
    row = np.abs(correlation[names.index(name)])
    row[names.index(name)] = 0
    best = int(np.argmax(row))
    return names[best] if row[best] > TUNED.twins else ""


def _dynamic(rig: _Rig, fit: DynamicFit) -> list[Estimate]:
    """Estimates of the dynamic stage, which starts from the others' answers."""
    solution = fit.solution
    estimates: list[Estimate] = []
    for parameter in (p for p in BY_TENSIONS if p not in CELL_GAINS):
        source = D.MU if parameter is D.MU_RELEASE and fit.model.symmetric else parameter
        statics = {"mu_static": fit.values[D.MU], "mu_static_release": fit.values[D.MU_RELEASE]}
        if parameter is D.LOAD_EXPONENT and source not in solution.values and not fit.values[parameter]:
            continue  # tried only where adhesion was found
        if source not in solution.values:
            size = abs(fit.values[parameter])
            expected = fit.expected.get(parameter, float("inf"))
            why = rig.reason(parameter, expected / size if size > 0 else None)
            if parameter in fit.bounded:
                bound = f"lower bound: everything above explains these files as well; {parameter.tensions.advice}"
                why = bound if rig.described else NOT_DESCRIBED
            if parameter is not D.STATIC_EXCESS:
                estimates.append(rig.kept(parameter, fit.values[parameter], why))
            else:
                why, ratio = f"its ratio to the dynamic one is kept; {why}", 1 + fit.values[parameter]
                estimates += [rig.kept(static, ratio * mu, why) for static, mu in statics.items()]
            continue
        value, error = solution.values[source], solution.standard_error(source)
        low, high = solution.interval(source)
        if source not in BIASES:
            low = max(low, 0.0)  # no interval of a positive value reaches below zero
        identifiable = math.isfinite(error) and (
            is_known(error, source.tensions.size_of(value, fit.mean_N)) or source in BIASES
        )
        share = error / abs(value) if value else float("inf")
        why = "dynamic stage" if identifiable else rig.reason(parameter, share, fitted=True)
        if parameter is not D.STATIC_EXCESS:
            estimates.append(rig.fitted(parameter, value, error, (low, high), identifiable=identifiable, why=why))
            continue
        for static, mu in statics.items():  # both from their common ratio to the dynamic coefficients
            interval = (mu * (1 + low), mu * (1 + high))
            estimates.append(
                rig.fitted(static, mu * (1 + value), mu * error, interval, identifiable=identifiable, why=why)
            )
    return estimates


def of_gains(gains: Gains) -> list[Estimate]:
    """Gains of the cells that were found, by the time that identifies them."""
    by = {D.INPUT_GAIN: (gains.input, "uniform_s"), D.OUTPUT_GAIN: (gains.output, "known_output_s")}
    deviations = np.sqrt(np.diag(gains.covariance))
    found = []
    for (name, (value, key)), deviation in zip(by.items(), (gains.ratio_deviation, deviations[1]), strict=True):
        if key in gains.found:
            error = value * float(deviation)
            reach = error * float(student.ppf(0.975, 4))
            of_what = "relative to the output cell, " if name is D.INPUT_GAIN else ""
            found.append(
                Estimate(
                    name=str(name),
                    value=value,
                    standard_error=error,
                    interval=(value - reach, value + reach),
                    identifiable=True,
                    why=f"{of_what}where [measurement] states {key}",
                    scenario=1.0,
                    fitted=True,
                )
            )
    return found


def _exponents(rig: _Rig, estimates: Sequence[Estimate]) -> list[Estimate]:
    """Friction as ln(T_in/T_out) in gross sliding, mu theta: without sections it needs no wrap angle."""
    lines = dict(zip(EXPONENTS, rig.lines, strict=True))
    return [
        replace(
            e,
            name=EXPONENTS[e.name],
            value=line.exponent(e.value),
            standard_error=None if e.standard_error is None else line.angle_rad * e.standard_error,
            interval=None if e.interval is None else (line.exponent(e.interval[0]), line.exponent(e.interval[1])),
            scenario=None if e.scenario is None else line.exponent(e.scenario),
            note=rig.pose,
        )
        for e in estimates
        if (line := lines.get(e.name)) is not None
    ]


def summarise_excitation(records: Sequence[Record]) -> ExcitationSummary:
    """Measured quantities of these records."""
    speeds = [
        float(np.percentile(np.abs(np.gradient(p.input_m, r.step_s)), 95))
        for r in records
        for p in r.pieces
        if p.input_m is not None
    ]
    proximal = not all(r.has_output for r in records)
    output = np.concatenate([r.joined("input_N" if proximal else "output_N") for r in records])
    return ExcitationSummary(
        positions=all(r.has_positions for r in records),
        hold_s=longest_hold_s(records),
        speed_m_per_s=max(speeds, default=0.0),
        load_swing=float(np.ptp(output) / max(abs(output.mean()), 1e-12)),
        proximal=proximal,
        joint_rad=mean_pose(records),
    )
