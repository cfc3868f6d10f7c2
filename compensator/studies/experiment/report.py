"""The report of the two-motor test: what the three models show, in one page."""

import math
from collections.abc import Mapping
from statistics import mean

from matplotlib.figure import Figure

from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.reporting.page import (
    FileNote,
    Picture,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
    provenance_of,
)
from tendonff.compensator.scenario.experiment import MotorMode
from tendonff.compensator.studies.experiment import numbers
from tendonff.compensator.studies.experiment.result import ExperimentResult, MeasuredTensions
from tendonff.models.fidelity import Level

_CAPTIONS = {
    "experiment_tensions": "Seven tensions along the path; the states are shaded and named.",
    "experiment_distribution": "Tension over time (across) and angle (up) on the machine's level; dark is high.",
    "experiment_details": "Holds and reversals on the three models: relaxation, and how smooth the transient is.",
    "experiment_hysteresis": "Tension at each motor over the elongation of the tendon.",
}
_NOTE = (
    "Both ends of the tendon are pulled, held and released in turn; every model receives the schedule that the level "
    "of [run] gives. The shares below are of the largest minus the smallest tension of the test."
)


def experiment_report(result: ExperimentResult, figures: dict[str, Figure]) -> Report:
    """The page of an experiment."""
    pictures = pictures_of(figures, _CAPTIONS)
    held = Table(
        caption="Holds: change of tension at the held end, and travel of its motor",
        columns=("level", "state", "change [N]", "change [% of range]", "travel [mm]"),
        rows=tuple(
            (level.value, state, value.change_N, value.change_percent_of_range, 1e3 * value.travel_m)
            for level, run in result.runs.items()
            for state, value in numbers.relaxation(run).items()
        ),
        least=1e-3,
    )
    transients = Table(
        caption="Reversals: width of the transient (5 to 50 % of the change) and largest slope of the output",
        columns=("level", "state", "width [s]", "slope [N/s]"),
        rows=tuple(
            (level.value, done.state.name, value.width_s, value.max_slope_N_per_s)
            for level, run in result.runs.items()
            for done in numbers.reversals(run)
            if (value := numbers.transient(run, done)) is not None
        ),
    )
    models = {**{level.value: run for level, run in result.runs.items()}, "quasi-static elastic": result.quasi_static}
    law = Table(
        caption="Difference from the capstan law with two ends, given the two end tensions [% of range]",
        columns=("model", "RMS", "largest"),
        rows=tuple(
            (name, off.rms_percent_of_range, off.max_percent_of_range)
            for name, run in models.items()
            for off in (numbers.law_deviation(run),)
        ),
    )
    finer = numbers.refinement(result.runs[result.lead], result.fine)
    step = max(map(numbers.largest_switch, result.runs.values()))
    return Report(
        title=f"Two-motor test: {result.scenario.name}",
        summary=_summary(result),
        warnings=numbers.warnings_of(result),
        sections=(
            Section(
                title="Seven tensions",
                blocks=(
                    Text(_NOTE),
                    *_present(pictures, "experiment_tensions"),
                    *((_measured(result, result.measured),) if result.measured is not None else ()),
                    _states(result),
                ),
            ),
            Section(
                title="How the models differ", blocks=(*_present(pictures, "experiment_details"), held, transients)
            ),
            Section(title="Along the path", blocks=(*_present(pictures, "experiment_distribution"), law)),
            Section(title="Hysteresis of the tendon", blocks=_present(pictures, "experiment_hysteresis")),
            Section(
                title="Numerical accuracy",
                blocks=(
                    Text(
                        f"Switching a motor changes a tension by at most {step:.2g} % of the range. "
                        f"{finer.segments} and {finer.fine_segments} masses differ by "
                        f"{finer.rms_percent_of_range:.2g} % of the range RMS."
                    ),
                    Table(
                        caption="What each number of this page and of summary.json means",
                        columns=("number", "meaning"),
                        rows=tuple(numbers.MEANINGS.items()),
                    ),
                ),
            ),
        ),
        provenance=provenance_of(
            result.scenario, "experiment", "" if result.measured is None else f"--measured {result.measured.name}"
        ),
        files=(
            *(FileNote(name=f"experiment_{level}.csv", content="states, tensions, motors") for level in result.runs),
            FileNote(name="summary.json", content="every number of this page for other programs"),
        ),
    )


def _measured(result: ExperimentResult, measured: MeasuredTensions) -> Table:
    """RMS difference of each sensor from each model."""
    by_level = {level: numbers.deviations(run, measured) for level, run in result.runs.items()}
    return Table(
        caption=f"{measured.name}, dashed in the figure: RMS difference from the models [% of range]",
        columns=("tension", *(str(level) for level in by_level)),
        rows=tuple(
            (f"f_{each[0].sensor}", *(d.measured_rms_percent_of_range for d in each))
            for each in zip(*by_level.values(), strict=True)
        ),
    )


def _present(pictures: dict[str, Picture], name: str) -> tuple[Picture, ...]:
    """A picture, unless the states left nothing to draw in it."""
    return (pictures[name],) if name in pictures else ()


def _states(result: ExperimentResult) -> Table:
    lead = result.runs[result.lead]
    return Table(
        caption="States; A acts, A_h holds its position, A_f its force, L loads",
        columns=("state", "purpose", "motor 1", "motor 2", "from [s]", "to [s]"),
        rows=tuple(
            (
                done.state.name,
                done.state.purpose,
                str(done.state.modes[0]),
                str(done.state.modes[1]),
                float(lead.time_s[done.first_row]),
                float(lead.time_s[done.last_row]),
            )
            for done in lead.passes
        ),
    )


def _summary(result: ExperimentResult) -> str:
    lead = result.runs[result.lead]
    sentences = [_closest(result, result.measured)] if result.measured is not None else []
    held = {level: numbers.relaxation(run).values() for level, run in result.runs.items()}
    modes = {done.state.modes[motor] for done, motor in numbers.holds(lead)}
    if MotorMode.HOLD in modes or not modes:
        largest = {
            level: max((abs(v.change_percent_of_range) for v in some), default=0.0) for level, some in held.items()
        }
        sentences.append(f"While a motor holds its position, its tension changes by {_each(largest, '% of range')}.")
    if MotorMode.HOLD_FORCE in modes:
        farthest = {level: max(abs(v.travel_m) for v in some) for level, some in held.items()}
        creep = {level: 1e3 * value for level, value in farthest.items()}
        sentences.append(f"While a motor holds its force, creep moves it by {_each(creep, 'mm')}.")
    widths = {
        level: [value.width_s for done in numbers.reversals(run) if (value := numbers.transient(run, done)) is not None]
        for level, run in result.runs.items()
    }
    if all(widths.values()):
        longest = {level: 1e3 * max(some) for level, some in widths.items()}
        sentences.append(f"After a reversal the output changes over {_each(longest, 'ms')}.")
    if len(sentences) > (result.measured is not None):
        sentences.append("The level whose numbers your rig shows is the one to design with.")
    return " ".join(sentences)


def _each(values: Mapping[Level, float], unit: str) -> str:
    """A quantity on each level, in words."""
    first, *others = [f"{two_digits(value)} {{}}({level})" for level, value in values.items()]
    return ", ".join((first.format(f"{unit} "), *(other.format("") for other in others)))


def _closest(result: ExperimentResult, measured: MeasuredTensions) -> str:
    """Which level the measured tensions agree with best, by the mean square over the sensors."""
    errors = {
        level: math.sqrt(mean(each.measured_rms_percent_of_range**2 for each in numbers.deviations(run, measured)))
        for level, run in result.runs.items()
    }
    best = min(errors, key=lambda level: errors[level])
    return f"{measured.name} agrees best with the {best} level: RMS difference {_each(errors, '% of range')}."
