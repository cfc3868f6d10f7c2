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
    from tendonff.compensator.export.c_project import export_project as export_c
    from tendonff.compensator.export.fmu import build_fmu as export_fmu
    from tendonff.compensator.export.kinds import FmiVersion
    from tendonff.compensator.export.kinds import Kind as FmuKind
    from tendonff.compensator.files.reading import InputError
    from tendonff.compensator.finger.scenario import FingerScenario
    from tendonff.compensator.identification.answer.result import Identification
    from tendonff.compensator.identification.joint.result import JointIdentification
    from tendonff.compensator.identification.joint.routine import suggest_routine
    from tendonff.compensator.identification.joint.run import identify_joint
    from tendonff.compensator.identification.measured.centreline.run import read_centreline
    from tendonff.compensator.identification.run import identify
    from tendonff.compensator.identification.suggest import suggest
    from tendonff.compensator.joint.design.result import JointDesign
    from tendonff.compensator.joint.design.run import design_joint
    from tendonff.compensator.joint.export.fmu import build_joint_fmu as export_joint_fmu
    from tendonff.compensator.joint.export.project import ExportedJoints
    from tendonff.compensator.joint.export.project import export_joints as export_joint_c
    from tendonff.compensator.joint.scenario.scenario import JointScenario, load_joint_scenario
    from tendonff.compensator.observe.estimate import Estimate, Observation, ObserverStatus
    from tendonff.compensator.observe.observer import Observer
    from tendonff.compensator.runtime.kinds import RuntimeKind, RuntimeStatus
    from tendonff.compensator.runtime.runtime import Runtime, RuntimeState
    from tendonff.compensator.scenario.sampled.sampling import Reference, sample_reference
    from tendonff.compensator.scenario.scenario import Scenario
    from tendonff.compensator.scenarios import load_scenario
    from tendonff.compensator.studies.adapt.joint import JointAdaptationStudy, adapt_joint
    from tendonff.compensator.studies.adapt.result import AdaptationStudy
    from tendonff.compensator.studies.adapt.run import adapt
    from tendonff.compensator.studies.compare.joint import JointComparison, compare_joint
    from tendonff.compensator.studies.compare.result import Comparison
    from tendonff.compensator.studies.compare.run import compare
    from tendonff.compensator.studies.design.result import Design
    from tendonff.compensator.studies.design.run import design
    from tendonff.compensator.studies.experiment.result import ExperimentResult
    from tendonff.compensator.studies.experiment.run import experiment
    from tendonff.compensator.studies.opti.run import opti
    from tendonff.compensator.studies.tables.result import Tables
    from tendonff.compensator.studies.tables.run import make_tables as make_table
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
    from tendonff.ocp.joint.invert import invert_joint
    from tendonff.ocp.joint.simulate import simulate_joint
    from tendonff.ocp.joint.start import joint_problem
    from tendonff.ocp.opti.joint import JointFormulation
    from tendonff.ocp.opti.tendon import Formulation, OptiSolution
    from tendonff.ocp.tendon.batch import SimulationJob, simulate_batch
    from tendonff.ocp.tendon.inverse import invert
    from tendonff.ocp.tendon.simulate import simulate
    from tendonff.ocp.tracking.limits import ForceLimits
    from tendonff.ocp.tracking.options import TrackOptions
    from tendonff.ocp.tracking.track import track

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
    "ExportedJoints",
    "FingerScenario",
    "FmiVersion",
    "FmuKind",
    "ForceLimits",
    "Formulation",
    "Friction",
    "Identification",
    "InputError",
    "Integration",
    "JointAdaptationStudy",
    "JointComparison",
    "JointDesign",
    "JointFormulation",
    "JointIdentification",
    "JointScenario",
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
    "adapt_joint",
    "as_iosystem",
    "compare",
    "compare_joint",
    "design",
    "design_joint",
    "experiment",
    "export_c",
    "export_fmu",
    "export_joint_c",
    "export_joint_fmu",
    "identify",
    "identify_joint",
    "integrate",
    "invert",
    "invert_joint",
    "joint_problem",
    "linear_system",
    "load_joint_scenario",
    "load_scenario",
    "make_table",
    "mechanism_equations",
    "opti",
    "read_centreline",
    "sample_reference",
    "simulate",
    "simulate_batch",
    "simulate_joint",
    "suggest",
    "suggest_routine",
    "track",
    "watch",
]

_HOMES = {
    "compensator.studies.adapt.joint": ("JointAdaptationStudy", "adapt_joint"),
    "compensator.studies.adapt.result": ("AdaptationStudy",),
    "compensator.studies.adapt.run": ("adapt",),
    "compensator.studies.compare.result": ("Comparison",),
    "compensator.studies.compare.run": ("compare",),
    "compensator.compensators.base": ("Compensator", "Problem"),
    "compensator.compensators.plant": ("Plant", "Response"),
    "compensator.compensators.profile": ("Profile",),
    "compensator.compensators.registry": ("COMPENSATORS",),
    "compensator.studies.design.result": ("Design",),
    "compensator.studies.design.run": ("design",),
    "compensator.studies.experiment.result": ("ExperimentResult",),
    "compensator.studies.experiment.run": ("experiment",),
    "compensator.export.c_project": ("export_c:export_project",),
    "compensator.export.fmu": ("export_fmu:build_fmu",),
    "compensator.export.kinds": ("FmiVersion", "FmuKind:Kind"),
    "compensator.files.reading": ("InputError",),
    "compensator.identification.joint.result": ("JointIdentification",),
    "compensator.identification.joint.routine": ("suggest_routine",),
    "compensator.identification.joint.run": ("identify_joint",),
    "compensator.identification.measured.centreline.run": ("read_centreline",),
    "compensator.finger.scenario": ("FingerScenario",),
    "compensator.identification.answer.result": ("Identification",),
    "compensator.identification.run": ("identify",),
    "compensator.identification.suggest": ("suggest",),
    "compensator.studies.compare.joint": ("JointComparison", "compare_joint"),
    "compensator.joint.design.run": ("design_joint",),
    "compensator.joint.export.fmu": ("export_joint_fmu:build_joint_fmu",),
    "compensator.joint.export.project": ("ExportedJoints", "export_joint_c:export_joints"),
    "compensator.joint.design.result": ("JointDesign",),
    "compensator.joint.scenario.scenario": ("JointScenario", "load_joint_scenario"),
    "compensator.observe.estimate": ("Estimate", "Observation", "ObserverStatus"),
    "compensator.observe.observer": ("Observer",),
    "compensator.runtime.kinds": ("RuntimeKind", "RuntimeStatus"),
    "compensator.runtime.runtime": ("Runtime", "RuntimeState"),
    "compensator.scenario.sampled.sampling": ("Reference", "sample_reference"),
    "compensator.scenario.scenario": ("Scenario",),
    "compensator.scenarios": ("load_scenario",),
    "compensator.studies.opti.run": ("opti",),
    "compensator.studies.tables.result": ("Tables",),
    "compensator.studies.tables.run": ("make_table:make_tables",),
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
    "ocp.tendon.inverse": ("invert",),
    "ocp.integrate.integrate": ("Integration", "integrate"),
    "ocp.integrate.method": ("Method",),
    "ocp.joint.invert": ("invert_joint",),
    "ocp.joint.simulate": ("simulate_joint",),
    "ocp.joint.start": ("joint_problem",),
    "ocp.opti.joint": ("JointFormulation",),
    "ocp.opti.tendon": ("Formulation", "OptiSolution"),
    "ocp.tendon.simulate": ("simulate",),
    "ocp.tracking.limits": ("ForceLimits",),
    "ocp.tracking.options": ("TrackOptions",),
    "ocp.tracking.track": ("track",),
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
