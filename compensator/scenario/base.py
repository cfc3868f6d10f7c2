"""Base that several scenarios share."""

from collections.abc import Mapping
from pathlib import Path

from tendonff.compensator.files.reading import InputError, read_text
from tendonff.compensator.files.text import require_named
from tendonff.compensator.scenario.tables import show
from tendonff.compensator.scenario.toml import toml_of

_MERGED = ("path", "tendon", "friction", "actuator", "load", "drive", "run", "robust", "measurement")
_WITHIN = "motor"  # a table of [actuator], merged like it


def with_base(raw: dict[str, object], source: Path, inputs: list[Path]) -> dict[str, object]:
    """A scenario with what it leaves to its base, a file that several scenarios share and that may have a base itself.

    Keys of `_MERGED` tables are taken one by one, other tables and those of another kind as a whole; files that the
    base names are relative to the folder of `source`.
    """
    return _with_base(raw, source, inputs, (source.resolve(),))


def _with_base(raw: dict[str, object], source: Path, inputs: list[Path], above: tuple[Path, ...]) -> dict[str, object]:
    if "base" not in raw:
        return raw
    if not isinstance(name := raw["base"], str):
        raise InputError(f"{source.name}: base must be the name of a file, got {show(name)}")
    path = source.parent / name
    if path.resolve() in above:
        raise InputError(f"{source.name}: base = {show(name)} leads back to {path.name}; take one of them out")
    require_named(path, f"{source.name}: base")
    inputs.append(path)
    base = _with_base(toml_of(read_text(path), path.name), path, inputs, (*above, path.resolve()))
    own = {key: value for key, value in raw.items() if key != "base"}
    for key in _MERGED:
        if isinstance(shared := base.get(key), Mapping) and isinstance(given := own.get(key), Mapping):
            own[key] = _merged(shared, given)
    return {**base, **own}


def _merged(shared: Mapping[str, object], given: Mapping[str, object]) -> dict[str, object]:
    if given.get("kind", kind := shared.get("kind")) != kind:
        return dict(given)
    found = {**shared, **given}
    if isinstance(below := shared.get(_WITHIN), Mapping) and isinstance(own := given.get(_WITHIN), Mapping):
        found[_WITHIN] = {**below, **own}
    return found
