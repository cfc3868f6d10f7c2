"""Parts of a driven joint: the joint, its tendons, the drive, and the mechanism that they form."""

from tendonff.models.joint.parameters.drive import DriveKind, JointDrive
from tendonff.models.joint.parameters.joint import DrivenJoint
from tendonff.models.joint.parameters.mechanism import Mechanism
from tendonff.models.joint.parameters.tendon import Arm, JointTendon, LengthTable

__all__ = ["Arm", "DriveKind", "DrivenJoint", "JointDrive", "JointTendon", "LengthTable", "Mechanism"]
