"""Data passed through the stages of a tendon's identification: the request, the records, and the results so far."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.fitting.delay import Delay
from tendonff.compensator.identification.fitting.dynamic import CoarseFit, DynamicFit
from tendonff.compensator.identification.fitting.model_selection import StaticSelection
from tendonff.compensator.identification.identify import Request
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.compensator.identification.measured.gains import EXACT_GAINS, Gains
from tendonff.compensator.identification.measured.reading import RawMeasurement
from tendonff.compensator.identification.pace import UNHURRIED, Pace, SlowFitError
from tendonff.compensator.scenario.measurement import Explain
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.errors import ParameterError
from tendonff.ocp.errors import SolveError

FAILURES = (SolveError, ParameterError, np.linalg.LinAlgError)
"""Errors that end a law or a stage, but never the identification."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """An identification on its way.

    Parameters
    ----------
    asked : Request
    scenario : Scenario
        The question as the files put it: gains of the cells found, bearings free.
    raw : tuple of RawMeasurement
        The files to fit as they were read.
    records, judges : sequence of Record
        The same, cleaned; a delay of the output is taken out of them once it is found.
    pace : Pace
        Of the work; names its parts to the user.
    gains : Gains
        Of the cells; the records are without them.
    explain : Explain
        Channel that the laws explain.
    coarse : CoarseFit, optional
        The chain's first fit; None where it was not tried, or failed.
    delay : Delay, optional
        Of the output behind the input.
    stage : StaticSelection, optional
        The static laws; None where nothing was measured at the far end.
    chain : DynamicFit, optional
        The chain; None where it was not tried, or failed.
    warnings : tuple of str
        Messages beside the estimates.
    """

    asked: Request[Scenario]
    scenario: Scenario
    raw: tuple[RawMeasurement, ...]
    records: Sequence[Record]
    judges: Sequence[Record]
    pace: Pace = UNHURRIED
    gains: Gains = EXACT_GAINS
    explain: Explain = Explain.OUTPUT
    coarse: CoarseFit | None = None
    delay: Delay | None = None
    stage: StaticSelection | None = None
    chain: DynamicFit | None = None
    warnings: tuple[str, ...] = ()

    def noted(self, *texts: str) -> "Study":
        """The study with more to tell the user; empty texts are none."""
        return replace(self, warnings=(*self.warnings, *filter(None, texts)))


Stage = Callable[[Study], Study]


def attempted(stage: Stage, study: Study) -> Study:
    """The study after a stage, or as it was with a line on why the stage found nothing."""
    name = stage.__name__.replace("_", " ")
    study.pace.begin(name)
    try:
        return stage(study)
    except SlowFitError as error:  # of all stages together
        return study if any(str(error) in text for text in study.warnings) else study.noted(f"{name}: {error}")
    except FAILURES as error:
        return study.noted(f"{name}: no answer ({error}); the other laws are not affected")
