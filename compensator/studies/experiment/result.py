"""Result of a two-motor test."""

import os
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.reporting.results import Result
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.studies.experiment.machine import StatePass
from tendonff.compensator.studies.experiment.rig import Plan
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission

SECTIONS = 7
"""Places along the path at which tensions are reported: 0, theta/6 ... theta."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentRun:
    """The test on one model, rows at 0, h, 2 h ...

    Attributes
    ----------
    level : Level
        Fidelity level of the model.
    transmission : Transmission
        What it ran on.
    passes : tuple of StatePass
        States and their rows; a state starts with the row in which the one before it ended.
    time_s : numpy.ndarray
        Shape (n,).
    link_tension_N : numpy.ndarray
        Shape (n, N + 1); f_1 .. f_{N+1} of the chain.
    position_m, force_N : numpy.ndarray
        Shape (n, 2); of motors 1 and 2; forces are each motor's pull on its end of the tendon.
    velocity_m_per_s : numpy.ndarray
        Shape (n, N + 2); v_a, v_1 .. v_N, v_l.
    """

    level: Level
    transmission: Transmission
    passes: tuple[StatePass, ...]
    time_s: FloatArray
    link_tension_N: FloatArray
    position_m: FloatArray
    force_N: FloatArray
    velocity_m_per_s: FloatArray

    @property
    def tension_N(self) -> FloatArray:
        """Tensions at the seven sections of the path, shape (n, 7) [N].

        Link i of N masses is at the angle i theta/N; between links ln T is taken as linear, which it is in slip.
        """
        links = self.link_tension_N.shape[1]
        if links == SECTIONS:
            return self.link_tension_N
        places = np.linspace(0, links - 1, SECTIONS)
        left = np.minimum(places.astype(int), max(links - 2, 0))
        share = places - left
        log = np.log(np.maximum(self.link_tension_N, 1e-12))
        return np.asarray(np.exp((1 - share) * log[:, left] + share * log[:, left + 1]))

    @property
    def elongation_m(self) -> FloatArray:
        """Elongation of the tendon since the start, q_a - q_l, shape (n,) [m]."""
        length = self.position_m[:, 0] - self.position_m[:, 1]
        return np.asarray(length - length[0])

    @property
    def range_N(self) -> float:
        """Largest minus smallest tension of the run [N]: what percentages refer to."""
        return float(np.ptp(self.link_tension_N))

    def state_names(self) -> list[str]:
        """Name of the state in each row; a row in which one state ends and the next begins counts to the first."""
        names = [self.passes[0].state.name]
        for done in self.passes:
            names += [done.state.name] * (done.last_row - done.first_row)
        return names


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredTensions:
    """Tensions measured on a rig during the same test.

    Attributes
    ----------
    name : str
        Of the file.
    time_s : numpy.ndarray
        Shape (n,); from the start of the test.
    tension_N : dict of int to numpy.ndarray
        Shape (n,); by place among the seven sections, from 0.
    """

    name: str
    time_s: FloatArray
    tension_N: dict[int, FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ExperimentResult(Result):
    """The two-motor test on all three levels.

    Attributes
    ----------
    scenario : Scenario
        The scenario it was made for.
    plan : Plan
        The test: rig, states and commands.
    lead : Level
        On which the machine ran.
    runs : dict of Level to ExperimentRun
        All three levels, on the path's own number of masses.
    fine : ExperimentRun
        The leading level with more masses.
    quasi_static : ExperimentRun
        The elastic level with a stiffer bristle, no viscous friction, no Stribeck effect: nearest to the capstan law.
    quasi_static_factor : float
        By how much its bristle is stiffer.
    measured : MeasuredTensions or None
        Measured tensions beside it, where a file was given.
    """

    shown_by: ClassVar[str] = "studies.experiment.output"

    scenario: Scenario
    plan: Plan
    lead: Level
    runs: dict[Level, ExperimentRun]
    fine: ExperimentRun
    quasi_static: ExperimentRun
    quasi_static_factor: float
    measured: MeasuredTensions | None = None

    @property
    def headline(self) -> str:
        """The test that was run."""
        states = ", ".join(done.state.name for done in self.runs[self.lead].passes)
        return f"two-motor test through the states {states}, by the machine on the {self.lead} level"

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `experiment_<level>.csv`, `summary.json`, figures and `report.html`, all or nothing; makes
        the folder.
        """
        self._views.write(self, folder, pdf=pdf)
