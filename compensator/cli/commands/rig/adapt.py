"""`tendonff adapt`: feedforward that tunes itself, on rigs that differ from the scenario."""

from pathlib import Path
from typing import TYPE_CHECKING

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    of_one_joint,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn

if TYPE_CHECKING:
    from tendonff.compensator.studies.adapt.joint import JointAdaptationStudy
    from tendonff.compensator.studies.adapt.result import AdaptationStudy

_SEVERAL = (
    "adapt tunes one number from one motor; the joints of a finger share tendons, so that one torque tells of many"
)


def adapt(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("adapt"),
    pdf: PdfOption = False,
    yes: YesOption = False,
) -> None:
    """Try self-tuning on rigs that differ from the scenario.

    Feedforward and feedback alone stand beside it; of a driven joint the plain inverse.
    """
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator.scenario.scenario import Scenario

        result: AdaptationStudy | JointAdaptationStudy
        if isinstance(loaded, Scenario):
            from tendonff.compensator.studies.adapt.run import adapt as study

            with progress("self-tuning") as advance:
                result = study(loaded, progress=advance)
            said = () if result.certificate is None else (result.certificate.sentence(),)
        else:
            from tendonff.compensator.studies.adapt.joint import adapt_joint

            joint = of_one_joint(loaded, _SEVERAL)
            with progress("self-tuning") as advance:
                result = adapt_joint(joint, progress=advance)
            said = ()
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    say(*said, result.headline)
