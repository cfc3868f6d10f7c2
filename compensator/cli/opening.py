"""What every command does first: read the scenario and open the folder for the results."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tendonff.compensator.cli.progress import say
from tendonff.compensator.files.writing import atomic_directory
from tendonff.compensator.scenario.sampled.sampling import sample_reference, work_ahead
from tendonff.compensator.scenario.scenario import Scenario, load_scenario


@contextmanager
def opened(
    scenario: Path, out: Path, *, follows_reference: bool = True, strict: bool = True
) -> Iterator[tuple[Scenario, Path]]:
    """Scenario and result folder, before a command imports what it computes with, which takes a second.

    A scenario that is not valid, a reference that is infeasible and a folder that cannot be written are refused at
    once; the folder appears when the block ends without an error. The length of a long run is said before it starts.

    Parameters
    ----------
    follows_reference : bool, optional
        Whether the command uses the scenario's reference.
    strict : bool, optional
        Refuse a reference out of reach.

    Raises
    ------
    InputError
        One message for the user.
    """
    loaded = load_scenario(scenario)
    if follows_reference and loaded.reference_file() is None:  # pandas reads files; the command itself checks those
        sample_reference(loaded, strict=strict)
    with atomic_directory(out) as folder:
        if follows_reference and (note := work_ahead(loaded)) is not None:
            say(note)
        yield loaded, folder
