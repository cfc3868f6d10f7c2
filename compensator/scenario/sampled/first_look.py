"""The first look at a scenario: everything to ask about it, within a second and before heavy packages are loaded."""

import numpy as np

from tendonff.compensator.scenario.doubts import (
    UnitDoubt,
    angle_doubt,
    length_doubts,
    out_of_reach,
    reach_notes,
    reference_doubts,
    scenario_doubts,
    scenario_notes,
    settle,
    unaccepted,
)
from tendonff.compensator.scenario.joints import CsvJoint
from tendonff.compensator.scenario.reference import CsvReference
from tendonff.compensator.scenario.sampled.from_file import read_samples
from tendonff.compensator.scenario.sampled.joint_motion import read_angles
from tendonff.compensator.scenario.sampled.sampling import keep_taut, require_taut, sample_reference
from tendonff.compensator.scenario.scenario import Scenario


def first_look(
    scenario: Scenario, *, follows_reference: bool = True, strict: bool = False, accept: bool = False
) -> tuple[str, ...]:
    """Warnings about a scenario and the files it names, before any work.

    Parameters
    ----------
    follows_reference : bool, optional
        The work follows the reference, so that it is looked at too.
    strict : bool, optional
        Refuse a reference out of the actuator's reach.
    accept : bool, optional
        Warn of values that look like another unit, instead of refusing them.

    Raises
    ------
    InputError
        If a file cannot be used, the reference cannot be followed, or a value looks like another unit.
    """
    file, rig, spec = scenario.source.name, scenario.transmission, scenario.reference
    found = settle((*scenario_doubts(scenario), *_of_joint_files(scenario)), file=file, accept=accept)
    found += scenario_notes(rig)
    if not follows_reference:
        return found
    if isinstance(spec, CsvReference):
        doubts, notes = _of_file(scenario, spec, strict=strict)
    else:
        found += settle(length_doubts(spec, spec.duration_s, scenario.run), file=file, accept=accept)
        reference = sample_reference(scenario, strict=strict)
        doubts, notes = reference_doubts(rig, reference.tension_N, scenario.run), reference.warnings
    return tuple(dict.fromkeys((*found, *settle(doubts, file=file, accept=accept), *notes)))


def _of_file(scenario: Scenario, spec: CsvReference, *, strict: bool) -> tuple[tuple[UnitDoubt, ...], tuple[str, ...]]:
    """Doubts and notes about a reference from a file, by its own samples."""
    samples = read_samples(spec, scenario.source.parent / spec.file, scenario.run.step_s)
    duration, file, rig = float(samples.time_s[-1]), scenario.source.name, scenario.transmission
    doubts = length_doubts(spec, duration, scenario.run)
    if spec.wants_position:  # what tension that takes is for the work itself to find
        return doubts, samples.notes
    tension, _, notes = keep_taut(samples.value, spec.least_tension_N)
    if spec.cutoff_Hz is None:
        require_taut(samples.time_s, tension, file)
    if strict and out_of_reach(rig, 0.0, float(np.max(tension))):
        return doubts, sample_reference(scenario, strict=strict).warnings  # a low-pass may take a peak away
    if spec.cutoff_Hz is not None:  # the filter comes with the work; a mean over half a period stands for it
        width = max(round(len(tension) / max(duration, 1e-9) / (2 * spec.cutoff_Hz)), 1)
        means = np.lib.stride_tricks.sliding_window_view(tension, min(width, len(tension))).mean(axis=1)
        reach = reach_notes(rig, samples.time_s[: len(means)], means, file)
        reach = tuple(f"{text} (before the low-pass at {spec.cutoff_Hz:g} Hz)" for text in reach)
        return (*doubts, *reference_doubts(rig, means, scenario.run)), (*samples.notes, *reach)
    reach = reach_notes(rig, samples.time_s, tension, file)
    return (*doubts, *reference_doubts(rig, tension, scenario.run)), (*samples.notes, *notes, *reach)


def _of_joint_files(scenario: Scenario) -> tuple[UnitDoubt, ...]:
    """Doubts about joints whose motion is in a file."""
    found: list[UnitDoubt] = []
    for name, joint in scenario.joints.items():
        if isinstance(joint, CsvJoint):
            _, angle = read_angles(scenario.source.parent / joint.file, name)
            found += angle_doubt(f"joints.{name}", float(np.max(np.abs(angle))), f"{joint.file}: {name}")
    return unaccepted(found, scenario.run)
