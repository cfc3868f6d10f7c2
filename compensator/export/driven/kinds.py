"""Units for co-simulation that driven joints do not have, and why."""

from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.task import MotorTask
from tendonff.compensator.export.driven.table import TABLE
from tendonff.compensator.export.kinds import Kind
from tendonff.models.joint.parameters import DriveKind

_CAPSTAN = "the capstan law gives the ratio of two tensions, and the angle of a motor needs their stretch too"
_OF_PAIR = "the motor of a loop tells where its joint is; the motors of a pair set the tensions too"
_OF_FINGER = {
    Kind.PLANT: "the exported C of a finger leads its joints; tendonff simulate moves them by the motors",
    Kind.OBSERVER: "the motors of a finger do not tell the far ends of its tendons apart",
    Kind.ADAPTIVE: "the joints of a finger share tendons, so that one torque tells of many",
}


def why_none(kind: Kind, task: MotorTask) -> str:
    """Physical reason why a joint or finger has no unit of a kind; empty where it has one."""
    if kind is Kind.CAPSTAN:
        return _CAPSTAN
    if kind is Kind.TABLE:
        return TABLE.refusal(task)
    if not isinstance(task, JointTask):
        return _OF_FINGER.get(kind, "")
    of_motor = kind in (Kind.PLANT, Kind.OBSERVER)
    return _OF_PAIR if of_motor and task.mechanism.drive.kind is not DriveKind.LOOP else ""
