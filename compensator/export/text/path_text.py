"""What the templates of exported C need to know of a path in sections, or of one that joints move."""

import numpy as np

from tendonff.models.chain import Chain
from tendonff.models.friction import equivalent_exponent
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.step.joints import Joints
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT
from tendonff.ocp.step.target_joints import contact_code


def path_context(chain: Chain, joints: Joints | None, prefix: str) -> dict[str, object]:
    """Names and numbers for the templates; no joints where all masses are alike and nothing moves."""
    moving = joints is not None and bool(joints.names)
    return {
        "joints": joints,
        "joint_parameter": f", const {prefix}_real joint_rad[]" if moving else "",
        "arguments": ", joint_rad" if moving else "",
        "carry": BDF2_CARRY,
        "weight": BDF2_WEIGHT,
        "rated": [] if joints is None else _rated(joints),
        "friction_shares": _friction_shares(chain),
    }


def path_bytes(chain: Chain, joints: Joints, prefix: str, precision: Precision, *, settable: bool) -> int:
    """Where the path stands, and friction of its bends, in the state of a module [bytes]."""
    size = 4 if precision is Precision.FLOAT else 8
    bends = len(joints.bends)
    path = padded(
        (2 * len(joints.names) + 3 * bends + (3 if size == 4 else 2) * len(joints.links) + 1) * size + 4, size
    )
    contact = contact_code(chain, joints, f"{prefix}_inverse", precision, settable=settable)
    return path + (bends * len(contact.own) + (2 if settable else 0)) * size


def _rated(joints: Joints) -> list[bool]:
    """Whether the speed of each joint matters: where it changes lengths, or moves the far end."""
    lengths = np.array([link.gained_m for link in joints.links if link.moves] + [joints.far_m], dtype=np.float64)
    return [bool(np.any(own)) for own in lengths.T]


def _friction_shares(chain: Chain) -> list[float]:
    """Share of each mass in what friction can hold along the path, at joint angle zero."""
    pull, _ = chain.friction.slip_coefficients
    exponent = equivalent_exponent(np.minimum(np.broadcast_to(np.asarray(pull, float), (chain.count,)), 1 - 1e-12))
    total = float(exponent.sum())
    return (exponent / total).tolist() if total > 0 else [1 / chain.count] * chain.count


def padded(size: int, alignment: int) -> int:
    """Size with the gap behind it [bytes]."""
    return -(-size // alignment) * alignment
