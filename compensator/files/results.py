"""Writers of results: a result knows its numbers, the study that makes it registers what writes its files."""

from collections.abc import Callable

_WRITERS: dict[type, Callable[..., None]] = {}


def register_writer(kind: type, writer: Callable[..., None]) -> None:
    """State what writes results of a kind: a function of the result, the folder and options by keyword."""
    _WRITERS[kind] = writer


def writer_of(kind: type) -> Callable[..., None]:
    """Return what writes results of a kind.

    Raises
    ------
    TypeError
        If the study that makes them was not imported, as where a result was unpickled.
    """
    if kind not in _WRITERS:
        raise TypeError(
            f"cannot write a {kind.__name__}: the function that makes one was not imported; "
            "import it from tendonff first"
        )
    return _WRITERS[kind]
