"""`tendonff compare`: which model fidelity the task needs."""

from tendonff.compensator.cli.options import OutFolderOption, PdfOption, ScenarioArgument, opened
from tendonff.compensator.cli.progress import progress, say, warn


def compare(scenario: ScenarioArgument, out: OutFolderOption, pdf: PdfOption = False) -> None:
    """Compare model levels and compensators.

    Every compensator is designed on each level, and simulated on each and on the capstan law.
    """
    with opened(scenario, out) as (loaded, folder):
        from tendonff.compensator.compare.run import compare as compare_levels

        with progress("comparing") as advance:
            result = compare_levels(loaded, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    say(result.recommendation, result.headline)
