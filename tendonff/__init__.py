"""Feedforward friction compensation for tendon and Bowden-cable drives.

The public names, each imported from where it is defined when it is first used, so that `import tendonff` costs nothing:
`import tendonff as tf`, then `tf.design(tf.load_scenario("finger.toml"))`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from tendonff._version import __version__

if TYPE_CHECKING:  # for editors and type checkers; `_HOMES` is the same for the interpreter
    from tendonff.compensator.compensators.base import Compensator, Problem
    from tendonff.compensator.compensators.plant import Plant, Response
    from tendonff.compensator.compensators.profile import Profile
    from tendonff.compensator.compensators.registry import COMPENSATORS
    from tendonff.compensator.door import (
        adapt,
        compare,
        design,
        export_c,
        export_fmu,
        identify,
        make_table,
        opti,
        suggest,
    )
    from tendonff.compensator.export.kinds import FmiVersion
    from tendonff.compensator.export.kinds import Kind as FmuKind
    from tendonff.compensator.files.reading import InputError
    from tendonff.compensator.identification.answer.result import Identification
    from tendonff.compensator.identification.measured.centreline.run import read_centreline
    from tendonff.compensator.mjcf.run import import_mjcf
    from tendonff.compensator.observe.estimate import Estimate, Observation, ObserverStatus
    from tendonff.compensator.observe.observer import Observer
    from tendonff.compensator.runtime.kinds import RuntimeKind, RuntimeStatus
    from tendonff.compensator.runtime.runtime import Runtime, RuntimeState
    from tendonff.compensator.scenario.sampled.sampling import Reference, sample_reference
    from tendonff.compensator.scenario.scenario import Scenario
    from tendonff.compensator.scenarios import load_scenario
    from tendonff.compensator.studies.adapt.study import AdaptationStudy
    from tendonff.compensator.studies.compare.result import Comparison
    from tendonff.compensator.studies.design.result import Design
    from tendonff.compensator.studies.design.sweep.plan import draw
    from tendonff.compensator.studies.experiment.result import ExperimentResult
    from tendonff.compensator.studies.experiment.run import experiment
    from tendonff.compensator.studies.tables.result import Tables
    from tendonff.compensator.studies.watch.output import Watch
    from tendonff.compensator.studies.watch.run import watch
    from tendonff.models.capstan import Branch, CapstanLaw
    from tendonff.models.capstan.two_ended import TwoEndedLaw
    from tendonff.models.errors import ParameterError, TendonffError
    from tendonff.models.fidelity import Level
    from tendonff.models.joint.parameters import Mechanism
    from tendonff.models.mechanism.equations import MechanismEquations, mechanism_equations
    from tendonff.models.mechanism.interop import as_iosystem, linear_system
    from tendonff.models.parameters import Actuator, Friction, Load, Path, Tendon, Transmission
    from tendonff.models.tendon.chain import Chain
    from tendonff.ocp.codegen.precision import Precision
    from tendonff.ocp.errors import CodeError, SolveError
    from tendonff.ocp.integrate.integrate import Integration, integrate
    from tendonff.ocp.integrate.method import Method
    from tendonff.ocp.opti.tendon import Formulation, OptiSolution
    from tendonff.ocp.optimal.track import track
    from tendonff.ocp.systems import invert, simulate, system_of
    from tendonff.ocp.tendon.batch import SimulationJob, simulate_batch
    from tendonff.ocp.tracking.limits import ForceLimits
    from tendonff.ocp.tracking.options import TrackOptions

__all__ = [
    "COMPENSATORS",
    "Actuator",
    "AdaptationStudy",
    "Branch",
    "CapstanLaw",
    "Chain",
    "CodeError",
    "Comparison",
    "Compensator",
    "Design",
    "Estimate",
    "ExperimentResult",
    "FmiVersion",
    "FmuKind",
    "ForceLimits",
    "Formulation",
    "Friction",
    "Identification",
    "InputError",
    "Integration",
    "Level",
    "Load",
    "Mechanism",
    "MechanismEquations",
    "Method",
    "Observation",
    "Observer",
    "ObserverStatus",
    "OptiSolution",
    "ParameterError",
    "Path",
    "Plant",
    "Precision",
    "Problem",
    "Profile",
    "Reference",
    "Response",
    "Runtime",
    "RuntimeKind",
    "RuntimeState",
    "RuntimeStatus",
    "Scenario",
    "SimulationJob",
    "SolveError",
    "Tables",
    "Tendon",
    "TendonffError",
    "TrackOptions",
    "Transmission",
    "TwoEndedLaw",
    "Watch",
    "__version__",
    "adapt",
    "as_iosystem",
    "compare",
    "design",
    "draw",
    "experiment",
    "export_c",
    "export_fmu",
    "identify",
    "import_mjcf",
    "integrate",
    "invert",
    "linear_system",
    "load_scenario",
    "make_table",
    "mechanism_equations",
    "opti",
    "read_centreline",
    "sample_reference",
    "simulate",
    "simulate_batch",
    "suggest",
    "system_of",
    "track",
    "watch",
]

_HOMES = {
    "compensator.door": (
        "opti",
        "adapt",
        "compare",
        "design",
        "export_c",
        "export_fmu",
        "identify",
        "make_table",
        "suggest",
    ),
    "compensator.studies.adapt.study": ("AdaptationStudy",),
    "compensator.studies.compare.result": ("Comparison",),
    "compensator.compensators.base": ("Compensator", "Problem"),
    "compensator.compensators.plant": ("Plant", "Response"),
    "compensator.compensators.profile": ("Profile",),
    "compensator.compensators.registry": ("COMPENSATORS",),
    "compensator.studies.design.result": ("Design",),
    "compensator.studies.design.sweep.plan": ("draw",),
    "compensator.studies.experiment.result": ("ExperimentResult",),
    "compensator.studies.experiment.run": ("experiment",),
    "compensator.export.kinds": ("FmiVersion", "FmuKind:Kind"),
    "compensator.files.reading": ("InputError",),
    "compensator.identification.measured.centreline.run": ("read_centreline",),
    "compensator.identification.answer.result": ("Identification",),
    "compensator.mjcf.run": ("import_mjcf",),
    "compensator.observe.estimate": ("Estimate", "Observation", "ObserverStatus"),
    "compensator.observe.observer": ("Observer",),
    "compensator.runtime.kinds": ("RuntimeKind", "RuntimeStatus"),
    "compensator.runtime.runtime": ("Runtime", "RuntimeState"),
    "compensator.scenario.sampled.sampling": ("Reference", "sample_reference"),
    "compensator.scenario.scenario": ("Scenario",),
    "compensator.scenarios": ("load_scenario",),
    "compensator.studies.tables.result": ("Tables",),
    "compensator.studies.watch.output": ("Watch",),
    "compensator.studies.watch.run": ("watch",),
    "models.capstan": ("Branch", "CapstanLaw"),
    "models.tendon.chain": ("Chain",),
    "models.errors": ("ParameterError", "TendonffError"),
    "models.fidelity": ("Level",),
    "models.mechanism.equations": ("MechanismEquations", "mechanism_equations"),
    "models.mechanism.interop": ("as_iosystem", "linear_system"),
    "models.joint.parameters": ("Mechanism",),
    "models.parameters": ("Actuator", "Friction", "Load", "Path", "Tendon", "Transmission"),
    "models.capstan.two_ended": ("TwoEndedLaw",),
    "ocp.tendon.batch": ("SimulationJob", "simulate_batch"),
    "ocp.codegen.precision": ("Precision",),
    "ocp.errors": ("CodeError", "SolveError"),
    "ocp.integrate.integrate": ("Integration", "integrate"),
    "ocp.integrate.method": ("Method",),
    "ocp.opti.tendon": ("Formulation", "OptiSolution"),
    "ocp.tracking.limits": ("ForceLimits",),
    "ocp.tracking.options": ("TrackOptions",),
    "ocp.optimal.track": ("track",),
    "ocp.systems": ("invert", "simulate", "system_of"),
}
_HOME_OF = {
    public: (f"tendonff.{module}", defined or public)
    for module, names in _HOMES.items()
    for public, _, defined in (name.partition(":") for name in names)
}


if not TYPE_CHECKING:  # hidden from type checkers, so that they refuse a name that does not exist

    def __getattr__(name: str) -> object:
        """Import a public name on its first use."""
        if name not in _HOME_OF:
            raise AttributeError(f"module 'tendonff' has no attribute {name!r}; public names: {', '.join(__all__)}")
        module, defined = _HOME_OF[name]
        value = getattr(import_module(module), defined)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """Public names and sub-packages."""
    return sorted({*__all__, *globals()})
