"""Conditions of measured files: angles of joints at rest in a file, such as the bend of a sheath.

Friction and stiffness belong to the tendon and are alike in all files; the wrap angle is that of each file. A bend that
no file states stays unknown: tensions tell mu times the wrap angle, and neither of the two by itself.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from tendonff.compensator.files.text import InputError, suggestion
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.models.path import FURTHEST_RAD

STILL_RAD = 0.05
"""A joint whose angle has less range than this is at rest."""


def require_conditions(how: Measurement, joints: Sequence[str], files: Sequence[str], scenario: str) -> None:
    """Refuse conditions of joints that the paths do not follow, or of files that are not given."""
    for file, joint, angle in how.conditions_of_files:
        _require_rad(angle, joint, file or scenario)
        if joint not in joints:
            listed = f" ({', '.join(joints)})" if joints else ""
            raise InputError(
                f"{scenario}: a condition must name a joint that sections follow and no tendon drives{listed}, got "
                f'"{joint}"{suggestion(joint, joints)}'
            )
        if file and file not in files:
            listed = ", ".join(files)
            raise InputError(f'a condition must name a measured file ({listed}), got "{file}"{suggestion(file, files)}')


def still_rad(angle_rad: Array, joint: str, file: str) -> float:
    """Angle of a joint at rest in a file; InputError where it moves."""
    low, high = np.nanpercentile(angle_rad, [1, 99]) if np.isfinite(angle_rad).any() else (np.nan, np.nan)
    if not high - low <= STILL_RAD:
        raise InputError(
            f"{file}: {joint} moves by {high - low:.2g} rad; a condition holds for a whole file: cut the log where "
            f"{joint} is at rest, to {STILL_RAD:g} rad"
        )
    return _require_rad(float(np.nanmedian(angle_rad)), joint, file)


def _require_rad(angle_rad: float, joint: str, file: str) -> float:
    """Refuse an angle that no joint has [rad], and return the others."""
    if abs(angle_rad) > FURTHEST_RAD:
        raise InputError(
            f"{file}: {joint} must be within +-{FURTHEST_RAD:g} rad, got {angle_rad:g}; {angle_rad:g} deg are "
            f"{math.radians(angle_rad):.4g} rad"
        )
    return angle_rad


def condition_of(file: str, joints: Sequence[str], measured: Mapping[str, Array], how: Measurement) -> dict[str, float]:
    """Angles of joints that an option for a file, or for all, or else a column of it states [rad]."""
    given = how.conditions_of_files
    stated = {joint: angle for of in ("", file) for name, joint, angle in given if name == of}
    return stated | {j: still_rad(measured[j], j, file) for j in joints if j in measured and j not in stated}


def completed(
    stated: Mapping[str, Mapping[str, float]], usual: Mapping[str, float], scenario: str
) -> dict[str, dict[str, float]]:
    """Conditions by file, each with all joints: where no file states one, the scenario's.

    Parameters
    ----------
    stated : mapping of str to (mapping of str to float)
        By file and joint [rad].
    usual : mapping of str to float
        Angles in the scenario, NaN of a joint that moves there [rad].
    scenario : str
        Name of its file.

    Raises
    ------
    InputError
        If some files state a joint's angle and others do not, or the scenario has it move.
    """
    for joint, angle in usual.items():
        lacking = [file for file, own in stated.items() if joint not in own]
        if not lacking or (len(lacking) == len(stated) and np.isfinite(angle)):
            continue
        known = "other files state" if len(lacking) < len(stated) else f"moves in {scenario}"
        raise InputError(
            f"{lacking[0]}: the angle of {joint} is not known, which {known}; the tensions tell mu times the wrap "
            f"angle only: state it with --condition {lacking[0]}:{joint}=RAD, or log {joint}_rad"
        )
    return {file: {**usual, **own} for file, own in stated.items()}
