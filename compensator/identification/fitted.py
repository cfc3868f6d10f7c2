"""The scenario that goes on: every value of the law that was fitted, and what simulating it again leaves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tendonff.compensator.identification.fitting.dynamic import DynamicFit, chain_errors
from tendonff.compensator.identification.fitting.model_selection import StaticSelection
from tendonff.compensator.identification.fitting.static import (
    FileError,
    StaticFit,
    errors_of,
    fit_static,
    middle_of,
    pooled_percent,
)
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.compensator.scenario.measurement import Explain
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.chain import ChainModel, DynamicParameter
from tendonff.ocp.fits.static import StaticParameter

P, D = StaticParameter, DynamicParameter

REPLAY_STEP_S = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A scenario with fitted values.

    Parameters
    ----------
    scenario : Scenario
    offsets_N : tuple of 2 floats
        What the input and the output cell read at zero, beyond what was taken off when the files were read.
    static : StaticFit or None
        The static law that it holds.
    """

    scenario: Scenario
    offsets_N: tuple[float, float] = (0.0, 0.0)
    static: StaticFit | None = None


def scenario_of_chain(scenario: Scenario, fit: DynamicFit, records: Sequence[Record]) -> Fitted:
    """The scenario with all values of a fitted chain: they were fitted together and belong together.

    Parameters
    ----------
    scenario : Scenario
    fit : DynamicFit
    records : sequence of Record
        What it was fitted to.
    """
    t, number = scenario.transmission, fit.model.whole(fit.values).value
    friction = replace(
        t.friction,
        mu_dynamic=number("mu_dynamic_pull"),
        mu_static=number("mu_static_pull"),
        mu_dynamic_release=number("mu_dynamic_release"),
        mu_static_release=number("mu_static_release"),
        stribeck_velocity_m_per_s=number("stribeck_velocity_m_per_s"),
        viscous_N_s_per_m=number("viscous_N_s_per_m"),
        soft_bristle_stiffness_N_per_m=number("bristle_stiffness_N_per_m"),
        adhesion_N=number("adhesion_N"),
    )
    tendon = replace(
        t.tendon,
        stiffness_N_per_m=number("stiffness_N_per_m"),
        relaxing_stiffness_N_per_m=number("relaxing_stiffness_N_per_m"),
        relaxation_time_s=number("relaxation_time_s"),
        damping_N_s_per_m=number("damping_N_s_per_m"),
    )
    changed = replace(scenario, transmission=replace(t, friction=friction, tendon=tendon))
    return _fitted(changed, fit.model.level, (fit.values[D.INPUT_BIAS], fit.values[D.OUTPUT_BIAS]), records)


def scenario_of_static(
    scenario: Scenario, stage: StaticSelection, records: Sequence[Record], *, static_only: bool
) -> Fitted:
    """The scenario with all values of a fitted static law, at the fidelity level that replays the files best.

    What a scenario has no key for is left out, and the rest fitted again without it.

    Parameters
    ----------
    scenario : Scenario
    stage : StaticSelection
    records : sequence of Record
        What it was fitted to.
    static_only : bool
        No simulation: the scenario's own level stays.
    """
    t, fit = scenario.transmission, stage.fit
    if fit.model.guide or fit.model.spread:
        fit = fit_static(records, replace(fit.model, guide=False, spread=False), fit.explain, start=fit)
    theta, f = t.path.total_angle_rad, t.friction
    pull, release = (max(fit.values[k], 0.0) / theta for k in (P.PULL, P.RELEASE))
    ratio = f.mu_static / f.mu_dynamic if f.mu_dynamic > 0 else 1.0
    friction = replace(
        f,
        mu_dynamic=pull,
        mu_static=ratio * pull,
        mu_dynamic_release=release,
        mu_static_release=ratio * release,
        adhesion_N=max(fit.values[P.ADHESION], 0.0),
    )
    if fit.model.presliding:
        friction = replace(friction, soft_bristle_stiffness_N_per_m=fit.values[P.BRISTLE])
    changed = replace(scenario, transmission=replace(t, friction=friction))
    offsets = (fit.values[P.INPUT_BIAS], fit.values[P.OUTPUT_BIAS])
    own = scenario.run.level
    driven = static_only or fit.explain is Explain.INPUT or any(r.signed for r in records)
    levels = [Level.PRESLIDING] if fit.model.presliding else [own] if driven else [own, Level.VISCOELASTIC]
    tried = [replace(_fitted(changed, level, offsets, records), static=fit) for level in dict.fromkeys(levels)]
    if len(tried) == 1:
        return tried[0]
    return min(tried, key=lambda found: pooled_percent(replay(found, fit.explain, records), records, fit.explain))


def with_coulomb(scenario: Scenario, coulomb_N: float) -> Scenario:
    """The scenario with another dry friction of the drive [N]."""
    t = scenario.transmission
    return replace(scenario, transmission=replace(t, actuator=replace(t.actuator, coulomb_N=coulomb_N)))


def _fitted(scenario: Scenario, level: Level, offsets_N: tuple[float, float], records: Sequence[Record]) -> Fitted:
    """The scenario with its level; what the cells read at zero becomes part of how files are read."""
    how = scenario.measurement
    if any(offsets_N) and not any(r.zeroed for r in records):
        before = (how.input_offset_N or 0.0, how.output_offset_N or 0.0)
        how = replace(how, input_offset_N=before[0] + offsets_N[0], output_offset_N=before[1] + offsets_N[1])
    run = replace(scenario.run, level=level)
    return Fitted(
        scenario=replace(scenario, name=f"{scenario.name}, fitted", run=run, measurement=how), offsets_N=offsets_N
    )


def replay(
    fitted: Fitted, explain: Explain, records: Sequence[Record], *, static_only: bool = False
) -> tuple[FileError, ...]:
    """Errors of a fitted scenario, simulated again over the files with its own number of masses.

    Parameters
    ----------
    fitted : Fitted
    explain : Explain
    records : sequence of Record
    static_only : bool, optional
        By the static law, without the chain.
    """
    driven = static_only or explain is Explain.INPUT or any(r.signed for r in records)
    if fitted.static is not None and driven:
        return errors_of(fitted.static, records, middle_of(records))
    scenario = fitted.scenario
    model = ChainModel(
        transmission=scenario.transmission,
        level=scenario.run.level,
        count=scenario.transmission.path.segments,
        longest_step_s=REPLAY_STEP_S,
    )
    values = {**model.values(), D.INPUT_BIAS: fitted.offsets_N[0], D.OUTPUT_BIAS: fitted.offsets_N[1]}
    try:
        return chain_errors(model, values, records, Explain.OUTPUT if explain is Explain.INPUT else explain)
    except SolveError:
        return tuple(FileError(name=r.name, rms=float("inf"), span=1.0) for r in records)
