"""The first look at a scenario: everything to ask about it, within a second and before heavy packages are loaded."""

import numpy as np

from tendonff.compensator.scenario.doubts import angle_doubt, out_of_reach, reference_doubts, scenario_doubts
from tendonff.compensator.scenario.joints import CsvJoint
from tendonff.compensator.scenario.reference import CsvReference
from tendonff.compensator.scenario.sampled.from_file import read_samples
from tendonff.compensator.scenario.sampled.joint_motion import read_angles
from tendonff.compensator.scenario.sampled.sampling import keep_taut, require_taut, sample_reference, work_ahead
from tendonff.compensator.scenario.scenario import Scenario


def first_look(scenario: Scenario, *, follows_reference: bool = True, strict: bool = False) -> tuple[str, ...]:
    """Doubts about a scenario and the files it names, before any work.

    Parameters
    ----------
    follows_reference : bool, optional
        The work follows the reference, so that it is looked at too.
    strict : bool, optional
        Refuse a reference out of the actuator's reach.

    Raises
    ------
    InputError
        If a file cannot be used, or the reference cannot be followed.
    """
    found = (*scenario_doubts(scenario), *_of_joint_files(scenario))
    if not follows_reference:
        return found
    spec, step = scenario.reference, scenario.run.step_s
    if isinstance(spec, CsvReference):
        more, duration = _of_file(scenario, spec, strict=strict)
    else:
        more, duration = sample_reference(scenario, strict=strict).warnings, spec.duration_s
    return tuple(dict.fromkeys((*found, *more, *work_ahead(duration, step))))


def _of_file(scenario: Scenario, spec: CsvReference, *, strict: bool) -> tuple[tuple[str, ...], float]:
    """Doubts about a reference from a file, by its own samples, and its length [s]."""
    samples = read_samples(spec, scenario.source.parent / spec.file, scenario.run.step_s)
    duration, file = float(samples.time_s[-1]), scenario.source.name
    if spec.wants_position:  # what tension that takes is for the work itself to find
        return samples.notes, duration
    tension, _, notes = keep_taut(samples.value, spec.least_tension_N)
    if spec.cutoff_Hz is None:
        require_taut(samples.time_s, tension, file)
    if strict and out_of_reach(scenario.transmission, 0.0, float(np.max(tension))):
        return sample_reference(scenario, strict=strict).warnings, duration  # a low-pass may take a peak away
    if spec.cutoff_Hz is not None:  # the filter comes with the work; a mean over half a period stands for it
        width = max(round(len(tension) / max(duration, 1e-9) / (2 * spec.cutoff_Hz)), 1)
        means = np.lib.stride_tricks.sliding_window_view(tension, min(width, len(tension))).mean(axis=1)
        doubts = reference_doubts(scenario.transmission, samples.time_s[: len(means)], means, file=file)
        return (
            *samples.notes,
            *(f"{text} (before the low-pass at {spec.cutoff_Hz:g} Hz)" for text in doubts),
        ), duration
    doubts = reference_doubts(scenario.transmission, samples.time_s, tension, file=file)
    return (*samples.notes, *notes, *doubts), duration


def _of_joint_files(scenario: Scenario) -> list[str]:
    """Doubts about joints whose motion is in a file."""
    found: list[str] = []
    for name, joint in scenario.joints.items():
        if isinstance(joint, CsvJoint):
            _, angle = read_angles(scenario.source.parent / joint.file, name)
            found += angle_doubt(f"{joint.file}: {name}", float(np.max(np.abs(angle))))
    return found
