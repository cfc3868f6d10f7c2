"""The one reader of scenario files: the tension of one tendon, one driven joint, or several."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tendonff.compensator.files.reading import read_text
from tendonff.compensator.scenario.base import with_base
from tendonff.compensator.scenario.scenario import Scenario, parse_scenario
from tendonff.compensator.scenario.toml import toml_of

if TYPE_CHECKING:  # each takes a fifth of a second to import, for its own files alone
    from tendonff.compensator.scenario.driven.finger import FingerScenario
    from tendonff.compensator.scenario.driven.joint import JointScenario


def load_scenario(path: str | os.PathLike[str]) -> "Scenario | JointScenario | FingerScenario":
    """Read a scenario file, whatever it describes.

    Returns
    -------
    Scenario
        Of the tension of one tendon; of a driven joint a JointScenario, of several a FingerScenario.

    Raises
    ------
    InputError
        In one message: file, table, key, value and the way out.

    Examples
    --------
    >>> import tendonff as tf
    >>> tf.load_scenario("examples/finger.toml").transmission.friction.mu_dynamic
    0.2
    >>> tf.load_scenario("examples/hand_joint.toml").mechanism.joint.name
    'knuckle'
    """
    path = Path(path)
    return parse_any(read_text(path), path)


def parse_any(text: str, source: str | os.PathLike[str]) -> "Scenario | JointScenario | FingerScenario":
    """Read a scenario from its text; files that it names are relative to the source's folder."""
    source = Path(source)
    driven = _driven(with_base(toml_of(text, source.name), source, []))
    if driven == 0:
        return parse_scenario(text, source)
    if driven == 1:
        from tendonff.compensator.scenario.driven.joint import parse_joint_scenario

        return parse_joint_scenario(text, source)
    from tendonff.compensator.scenario.driven.finger import parse_finger_scenario

    return parse_finger_scenario(text, source)


def _driven(raw: Mapping[str, Any]) -> int:
    """0 for the tension of one tendon, 1 for a driven joint, 2 for several or for motors that wind several tendons."""
    joints = raw.get("joints")
    tables = joints.values() if isinstance(joints, Mapping) else ()
    driven = sum(isinstance(table, Mapping) and table.get("kind") == "driven" for table in tables)
    if driven > 1 or "motors" in raw:
        return 2
    return 1 if driven or {"tendons", "drive", "base"} & set(raw) else 0
