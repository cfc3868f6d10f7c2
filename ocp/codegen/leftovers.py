"""Names of temporary files that say which process made them, and the removal of what a killed one left behind."""

import hashlib
import os
import platform
import re
import shutil
import uuid
from pathlib import Path

_MARK = re.compile(r"\.(?P<host>[0-9a-f]{8})-(?P<process>\d+)-[0-9a-f]{12}\.partial$")


def temporary_name(stem: str) -> str:
    """A new name for something that is not complete yet; within what is not complete either, of the same stem."""
    if within := _MARK.search(stem):
        stem = stem[1 : within.start()]
    return f".{stem[:80]}.{_host()}-{os.getpid()}-{uuid.uuid4().hex[:12]}.partial"


def remove_leftovers(folder: Path, stem: str = "") -> None:
    """Remove what processes of this machine that no longer run left incomplete: all of it, or that of one name."""
    try:
        names = [entry.name for entry in os.scandir(folder) if entry.name.endswith(".partial")]
    except OSError:
        return
    for name in names:
        found = _MARK.search(name)
        if found is None or found["host"] != _host() or _runs(int(found["process"])):
            continue
        if stem and not name.startswith(f".{stem[:80]}."):
            continue
        left = folder / name
        if left.is_dir() and not left.is_symlink():
            shutil.rmtree(left, ignore_errors=True)
        else:
            left.unlink(missing_ok=True)


def _host() -> str:
    return hashlib.sha256(platform.node().encode()).hexdigest()[:8]


def _runs(process: int) -> bool:
    """Whether a process exists; assumed where that is unknown (not on POSIX)."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
