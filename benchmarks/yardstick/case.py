"""A case: what its JSON file says, sampled on its rows."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FOLDER = Path(__file__).parent / "cases"


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of the path.

    Attributes
    ----------
    angle_rad : float
        Wrap angle where its joint is at zero.
    length_m : float
    mu, mu_release : float
        Coulomb friction pulling and releasing.
    joint : bool
        Whether the joint of the case bends it.
    angle_per_rad, length_per_rad_m : float
        Wrap angle and length that it gains with the joint.
    bearing : dict or None
        A pulley instead of a guide: `mu`, `radius_ratio` (shaft over pulley), `wrap_rad`.
    arm_m : float
        Moment arm of the tension behind it about the joint there.
    """

    angle_rad: float
    length_m: float
    mu: float = 0.0
    mu_release: float | None = None
    joint: bool = False
    angle_per_rad: float = 0.0
    length_per_rad_m: float = 0.0
    bearing: dict[str, float] | None = None
    arm_m: float = 0.0

    @property
    def exponents(self) -> tuple[float, float]:
        """Logarithm of the tension ratio across it while it slips, pulling and releasing."""
        if self.bearing is not None:  # (T1 - T2) = kappa (T1 + T2)
            kappa = self.bearing["mu"] * self.bearing["radius_ratio"] * np.sin(self.bearing["wrap_rad"] / 2)
            return (float(np.log((1 + kappa) / (1 - kappa))),) * 2
        release = self.mu if self.mu_release is None else self.mu_release
        return self.mu * self.angle_rad, release * self.angle_rad


@dataclass(frozen=True, kw_only=True)
class Phase:
    """A stretch of time in which each end keeps its role."""

    time_s: Array
    ends: dict[str, dict[str, Any]]  # "near" and "far": {"tension_N" or "travel_m": waypoints}, or {} for a passive end


@dataclass(frozen=True, kw_only=True)
class Case:
    """Case.

    Attributes
    ----------
    key, name, physics, source : str
        File, title, the physics it tests, where its answer comes from.
    kind : str
        "tendon", "loop" or "slider".
    tolerance_percent : float
        Largest error that passes.
    raw : dict
        Everything in the file.
    path : tuple of Section
    phases : tuple of Phase
    recorded : dict
        Tensions that a simulator gave the ends instead, by end: the answer is then the one to these.
    """

    key: str
    name: str
    physics: str
    source: str
    kind: str
    tolerance_percent: float
    raw: dict[str, Any]
    path: tuple[Section, ...] = ()
    phases: tuple[Phase, ...] = ()
    recorded: dict[str, Array] = field(default_factory=dict)

    @classmethod
    def read(cls, file: Path) -> "Case":
        """Read a file."""
        raw = json.loads(file.read_text(encoding="utf-8"))
        phases = tuple(
            Phase(time_s=np.array(p["time_s"], float), ends={end: p.get(end, {}) for end in ("near", "far")})
            for p in raw.get("phases", ())
        )
        return cls(
            key=file.stem,
            path=tuple(Section(**section) for section in raw.get("path", ())),
            phases=phases,
            raw=raw,
            **{name: raw[name] for name in ("name", "physics", "source", "kind", "tolerance_percent")},
        )

    @property
    def time_s(self) -> Array:
        """Times of the rows."""
        last = self.raw["duration_s"] if "duration_s" in self.raw else self.phases[-1].time_s[-1]
        return np.arange(round(last / self.raw["row_s"]) + 1) * float(self.raw["row_s"])

    def drive(self, end: str, quantity: str) -> Array:
        """Given quantity of an end on each row; NaN where there is none."""
        t, begin = self.time_s, -1.0
        found = np.full(len(t), np.nan)
        for phase in self.phases:
            rows = (t > begin + 1e-9) & (t <= phase.time_s[-1] + 1e-9)
            if quantity in phase.ends[end]:
                found[rows] = np.interp(t[rows], phase.time_s, phase.ends[end][quantity])
                if quantity == "tension_N" and end in self.recorded:
                    found[rows] = self.recorded[end][rows]
            begin = phase.time_s[-1]
        return found

    def course(self, name: str) -> Array:
        """Waypoints elsewhere in the file, such as those of a joint or a motor."""
        way = self.raw[name]
        return np.interp(self.time_s, way["time_s"], way["values"])

    @property
    def judged(self) -> NDArray[np.bool_]:
        """Rows that count."""
        windows = self.raw.get("judge_s", [[0.0, self.time_s[-1]]])
        inside = [(self.time_s >= a - 1e-9) & (self.time_s <= b + 1e-9) for a, b in windows]
        found: NDArray[np.bool_] = np.any(inside, axis=0)
        return found


def all_cases() -> list[Case]:
    """The fifteen, in the order of their files."""
    return [Case.read(file) for file in sorted(FOLDER.glob("*.json"))]


def error_percent(case: Case, found: dict[str, Array], answer: dict[str, Array]) -> float:
    """RMS difference over the range of the answer, in per cent: the worst of the outputs of the case."""
    errors = []
    for name in case.raw["outputs"]:
        rows = slice(None) if case.kind == "slider" else case.judged
        wanted, got = answer[name][rows], np.asarray(found[name], float)[rows]
        worst = np.sqrt(np.mean((got - wanted) ** 2, axis=0)) / np.maximum(np.ptp(answer[name], axis=0), 1e-12)
        errors.append(100 * float(np.max(worst)))
    return max(errors)
