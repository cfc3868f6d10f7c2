"""`tendonff adapt`: feedforward that tunes itself, on rigs that differ from the scenario."""

from pathlib import Path

from tendonff.compensator.cli.options import OutFolderOption, PdfOption, ScenarioArgument, opened
from tendonff.compensator.cli.progress import progress, say, warn


def adapt(scenario: ScenarioArgument, out: OutFolderOption = Path("adapt"), pdf: PdfOption = False) -> None:
    """Try self-tuning on rigs that differ from the scenario.

    Feedforward and feedback alone stand beside it.
    """
    with opened(scenario, out) as (loaded, folder):
        from tendonff.compensator.adapt.run import adapt as study

        with progress("self-tuning") as advance:
            result = study(loaded, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    if result.certificate is not None:
        say(result.certificate.sentence())
    say(result.headline)
