"""`tendonff adapt`: feedforward that tunes itself, on rigs that differ from the scenario."""

from pathlib import Path

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    joint_looked_at,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn


def adapt(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("adapt"),
    pdf: PdfOption = False,
    yes: YesOption = False,
) -> None:
    """Try self-tuning on rigs that differ from the scenario.

    Feedforward and feedback alone stand beside it; of a driven joint the plain inverse.
    """
    from tendonff.compensator.joint.scenario.detect import is_joint_file

    if is_joint_file(scenario):
        _adapt_joint(scenario, out, pdf=pdf, yes=yes)
        return
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator.studies.adapt.run import adapt as study

        with progress("self-tuning") as advance:
            result = study(loaded, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    if result.certificate is not None:
        say(result.certificate.sentence())
    say(result.headline)


def _adapt_joint(scenario: Path, out: Path, *, pdf: bool, yes: bool) -> None:
    loaded = joint_looked_at(scenario, yes=yes)
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.studies.adapt.joint import adapt_joint

    with atomic_directory(out) as folder:
        with progress("self-tuning") as advance:
            result = adapt_joint(loaded, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    say(result.headline)
