"""Which scenario files describe a driven joint; imports nothing that takes time."""

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path


def describes_joint(raw: Mapping[str, object]) -> bool:
    """Whether a scenario is one of a driven joint."""
    joints = raw.get("joints")
    driven = isinstance(joints, Mapping) and any(
        isinstance(table, Mapping) and table.get("kind") == "driven" for table in joints.values()
    )
    return driven or bool({"tendons", "drive", "base"} & set(raw))  # joints alone have a base


def is_joint_file(path: str | os.PathLike[str]) -> bool:
    """The same of a file; one that cannot be read is left to whoever reads it."""
    try:
        return describes_joint(tomllib.loads(Path(path).read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError):
        return False
