"""Mechanisms of any bodies, tendons and drives: their parts, and their equations on one page."""

from tendonff.models.mechanism.equations import MechanismEquations, equations_of, mechanism_equations
from tendonff.models.mechanism.loads import Damper, DryFriction, Gravity, LoadLaw, Spring, Stops
from tendonff.models.mechanism.mechanism import CutMechanism, CutTendon, Mechanism
from tendonff.models.mechanism.parts import Arm, Attachment, Body, Drive, Force, Lead, Servo, Table, Tendon, Unit
from tendonff.models.mechanism.start import rest_state

__all__ = [
    "Arm",
    "Attachment",
    "Body",
    "CutMechanism",
    "CutTendon",
    "Damper",
    "Drive",
    "DryFriction",
    "Force",
    "Gravity",
    "Lead",
    "LoadLaw",
    "Mechanism",
    "MechanismEquations",
    "Servo",
    "Spring",
    "Stops",
    "Table",
    "Tendon",
    "Unit",
    "equations_of",
    "mechanism_equations",
    "rest_state",
]
