"""`tendonff compare`: how much model the task needs."""

from tendonff.compensator.cli.options import OutFolderOption, ScenarioArgument
from tendonff.compensator.cli.progress import announce, progress, say, warn


def compare(scenario: ScenarioArgument, out: OutFolderOption) -> None:
    """Compare the fidelity levels: every compensator designed on each, played on each and on the capstan law."""
    from tendonff.compensator.compare.report import write_comparison
    from tendonff.compensator.compare.run import compare as compare_levels
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.scenario.scenario import load_scenario

    loaded = load_scenario(scenario)
    announce(loaded)
    with atomic_directory(out) as folder:  # entered first: a folder that cannot be written is known before the work
        with progress("comparing") as advance:
            result = compare_levels(loaded, advance=advance)
        write_comparison(result, folder)
    for warning in result.warnings:
        warn(warning)
    say(result.recommendation)
