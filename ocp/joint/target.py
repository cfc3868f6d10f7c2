"""The inverse of joints between tendons in C for a controller: one copy of the code, and a record for each joint.

What all tendons share is folded into the laws; what differs stands in constant records. States are kept relative to
what the tension alone would stretch, and positions follow from lengths as they are, so that rounding adds up nowhere.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.models.joint.balance import Followed
from tendonff.models.layout import fields_of
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.errors import CodeError
from tendonff.ocp.joint.compiled import per_radian
from tendonff.ocp.joint.laws import JOINT_NUMBERS, joint_torque, link_back, path_mass_back, representative
from tendonff.ocp.joint.protocol import Array, JointProblem
from tendonff.ocp.step.folding import scheme_rows
from tendonff.ocp.step.laws import ElementLaws, twins_of
from tendonff.ocp.step.render import Roots, StepCode
from tendonff.ocp.step.target import require_linear

MOVES = {Precision.DOUBLE: 60, Precision.FLOAT: 30}
"""Most moves of one search for a tension in exported code: where friction kinks, it halves a bracket."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointCode:
    """Parts of a C file about joints between tendons.

    Attributes
    ----------
    core : str
        Types and functions of the inverse.
    data : str
        Constant records: `PREFIX_hinges`, a row for each joint, `PREFIX_tendons`, two for each, and what they point to.
    masses : int
        Most masses of any tendon.
    others : tuple of tuple of str
        For each joint and tendon the array of what other joints do to its path, "NULL" for nothing; empty without any.
    """

    core: str
    data: str
    masses: int
    others: tuple[tuple[str, ...], ...]


def joint_code(
    problems: Sequence[JointProblem], step_s: float, prefix: str, precision: Precision, others: Sequence[str] = ()
) -> JointCode:
    """Print the inverse of joints.

    Parameters
    ----------
    problems : sequence of JointProblem
        One for each joint.
    step_s : float
        Sample time of all [s].
    prefix : str
        Of every C name.
    precision : Precision
    others : sequence of str, optional
        Joints beside the driven ones whose angles are known at run time, as `other_joints` finds them.
    """
    chains = [chain for problem in problems for chain in problem.chains]
    if len({chain.layout.link_states for chain in chains}) > 1:
        raise CodeError("tendons with one and with two relaxation times cannot share their code; give all of them two")
    model = representative(tuple(chains))
    elements = ElementLaws.of(model, folded=True)
    laws = (
        elements.link_gain(),
        elements.link_start(),
        elements.link_states(),
        link_back(elements),
        path_mass_back(elements),
        elements.contact(twins_of(model)),
    )
    weights = scheme_rows(step_s)
    known = {name: (value,) * len(weights) for name, value in shared_numbers(chains).items()}
    known["H"] = tuple(weight for weight, _ in weights)
    folder = PartialEvaluator(
        prefix=prefix, precision=precision, parameters=known, reorder=precision is Precision.FLOAT
    )
    folded = {law.name: folder.fold(law) for law in laws}
    hinges = [fields_of(problem.law, "joint_") for problem in problems]
    same = {name: (float(hinges[0][name]),) for name in JOINT_NUMBERS if len({h[name] for h in hinges}) == 1}
    balance = PartialEvaluator(prefix=prefix, precision=precision, parameters=same).fold(joint_torque())
    folded[balance.name] = balance
    taken = [name for name in model.numbers() if any(name in law.inputs for law in folded.values())]
    record = tuple(name for name in taken if name.startswith("link_") or name == "piece_adhesion_N")
    of_hinges = tuple(name for name in JOINT_NUMBERS if name in balance.inputs) or JOINT_NUMBERS[:1]
    code = StepCode(
        prefix=prefix,
        precision=precision,
        layout=model.layout,
        laws=folded,
        count="c->count",
        size="n",
        numbers={name: f"c->{name}" for name in model.numbers()},
        host=True,
        moving=True,
        of_masses=tuple(model.of_masses()),
        joint_numbers=of_hinges,
        roots=_roots(precision),
        record=(*record, *folder.coefficients),
        weigh=folder.weigh(),
    )
    parts = [code.render("joint_target.h.j2"), *(law.code for law in folded.values()), folder.weigh().code]
    parts += [code.render(name) for name in ("reweigh.c.j2", "moving.c.j2", "links.c.j2", "finish.c.j2", "sides.c.j2")]
    data = ConstantData(prefix, precision)
    rows = [
        (weight, carry, {k: v[j] for k, v in folder.coefficients.items()}) for j, (weight, carry) in enumerate(weights)
    ]
    tendons = [text for k, problem in enumerate(problems) for text in _tendons(data, k, problem, rows, record)]
    data.rows("hinge", "hinges", [[data.number(float(h[name])) for name in of_hinges] for h in hinges])
    data.rows("tendon", "tendons", tendons)
    moved = (
        tuple(tuple(map(data.array, _by_others(problem, others))) for problem in problems)
        if others
        else ((),) * len(problems)
    )
    return JointCode(
        core="\n".join(parts),
        data="\n".join(data.lines),
        masses=max(chain.count for chain in chains),
        others=moved,
    )


def _plain(chain: Chain, joint: str) -> int:
    """0 where the path follows the joint, 1 where it follows others, 2 where it is at rest."""
    if Followed.of(chain, joint).any:
        return 0
    return 1 if any(Followed.of(chain, s.joint).any for s in chain.elements.path.sections if s.joint) else 2


def other_joints(problems: Sequence[JointProblem]) -> tuple[str, ...]:
    """Names of the joints, beside the driven ones, that sections of any path follow."""
    found: dict[str, None] = {}
    for problem in problems:
        own = problem.mechanism.joint.name
        for chain in problem.chains:
            for section in chain.elements.path.sections:
                if section.joint not in (None, own) and (section.angle_per_rad or section.length_per_rad_m):
                    found[str(section.joint)] = None
    return tuple(found)


def _roots(precision: Precision) -> Roots:
    single = precision is Precision.FLOAT
    return Roots(moves=MOVES[precision], tolerance=2e-6 if single else 1e-10, loose_N=2e-4 if single else 1e-6)


def shared_numbers(chains: Sequence[Chain]) -> dict[str, float]:
    """Numbers that are the same for every link and mass of all chains, wherever the joints stand."""
    bends = any(section.angle_per_rad for chain in chains for section in chain.elements.path.sections)
    found = {}
    for name in chains[0].numbers():
        if name.startswith(("near_", "far_")) or (bends and name.startswith("friction_")):
            continue
        values = np.concatenate([np.ravel(_every(chain, name)) for chain in chains])
        if np.all(values == values[0]):
            found[name] = float(values[0])
    return found


def _every(chain: Chain, name: str) -> Array:
    e = chain.elements
    records = {"piece": e.piece, "friction": e.friction, "link": e.link}
    where, _, field = name.partition("_")
    return np.asarray(getattr(records[where], field), dtype=np.float64)


class ConstantData:
    """Constant arrays in C; equal ones are written once."""

    def __init__(self, prefix: str, precision: Precision) -> None:
        self.prefix, self.precision = prefix, precision
        self.lines: list[str] = []
        self._known: dict[str, str] = {}

    def number(self, value: float) -> str:
        """Text of a number."""
        return literal(value, self.precision)

    def array(self, values: Iterable[float], *, integers: bool = False) -> str:
        """Name of an array with these values; a null pointer for none."""
        texts = [str(int(v)) if integers else self.number(float(v)) for v in values]
        if not texts:
            return "NULL"
        kind = "int" if integers else self.precision.value
        text = f"{kind}:{', '.join(texts)}"
        if text not in self._known:
            name = self._known[text] = f"{self.prefix}_{'which' if integers else 'data'}_{len(self._known) + 1}"
            lines = [", ".join(texts[k : k + 6]) for k in range(0, len(texts), 6)]
            body = ",\n    ".join(lines)
            self.lines.append(f"static const {kind} {name}[{len(texts)}] = {{\n    {body}\n}};")
        return self._known[text]

    def rows(self, kind: str, name: str, rows: Sequence[Sequence[str]]) -> str:
        """Name of an array of records."""
        body = ",\n".join("    { " + ", ".join(row) + " }" for row in rows)
        whole = f"{self.prefix}_{name}"
        self.lines.append(f"static const {self.prefix}_{kind} {whole}[{len(rows)}] = {{\n{body}\n}};")
        return whole


def _tendons(
    data: ConstantData,
    number: int,
    problem: JointProblem,
    weights: Sequence[tuple[float, float, dict[str, float]]],
    record: Sequence[str],
) -> list[list[str]]:
    """Records of a joint's tendons, two rows; the second of a joint with one tendon is never read."""
    texts = []
    joint = problem.mechanism.joint.name
    for k, (chain, tendon) in enumerate(zip(problem.chains, problem.mechanism.tendons, strict=True)):
        path, lengths = chain.elements.path, tendon.arm.lengths
        numbers = chain.numbers()
        of_masses = data.array(np.concatenate(list(chain.of_masses().values())))
        ends = np.searchsorted(path.section_of, path.section_of, side="right")
        stretch, own = chain.link.rest(1.0)
        if any(state != stretch for state in own):
            raise CodeError("a link whose own states rest elsewhere than its elongation cannot be exported yet")
        require_linear(chain)
        common = [data.number(float(stretch)), of_masses, data.array(ends, integers=True)]
        rows = [
            [
                *(str(chain.count), data.number(weight), data.number(carry), *common),
                data.number(path.total_angle_rad),
                *(data.number(float(numbers[name])) for name in record),
                *(data.number(value) for value in coefficients.values()),
            ]
            for weight, carry, coefficients in weights
        ]
        chain_rows = data.rows("weights", f"weights_{number + 1}_{k + 1}", rows)
        still = path.at_zero
        place = np.concatenate([still.angle_rad[0], 1 / still.ratio[0], np.zeros(chain.count + 2)])
        per_rad = per_radian(chain, joint, tendon.arm.moment_arm_m or 0.0)
        texts.append(
            [
                *(chain_rows, data.array(place), data.array(per_rad)),
                data.array(() if lengths is None else lengths.angle_rad),
                data.array(() if lengths is None else lengths.travel_pieces.ravel()),
                str(0 if lengths is None else len(lengths.angle_rad) - 1),
                str(_plain(chain, joint)),
                data.number(problem.windings_m[k]),
                *(data.number(0.0), "NULL", "NULL", "NULL"),
            ]
        )
    return texts if len(texts) > 1 else texts * 2


def _by_others(problem: JointProblem, names: Sequence[str]) -> list[Array]:
    """Change of the place of each tendon's path per radian of other joints, one after the other; empty for none."""
    found = []
    for chain in problem.chains:
        rows = np.concatenate([per_radian(chain, name, 0.0) for name in names])
        found.append(rows if rows.any() else np.empty(0))
    return found
