"""The inverse of fingers in C for a controller: laws printed from the models, numbers in constant records.

The core, fixed text, is the one that the host compiles. What all tendons share is folded into the laws; what differs
stands in a record for each tendon.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonff.models.layout import fields_of
from tendonff.models.mechanism import Tendon
from tendonff.models.path_table import MOST_AXES
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError
from tendonff.ocp.joint.laws import JOINT_NUMBERS, joint_torque, link_back, path_mass_back, representative
from tendonff.ocp.joint.target import ConstantData, shared_numbers
from tendonff.ocp.mechanism.compiled import MS, effect_parts, home_of, table_parts
from tendonff.ocp.mechanism.problem import Array, MechanismProblem
from tendonff.ocp.step.folding import scheme_rows
from tendonff.ocp.step.laws import ElementLaws, twins_of
from tendonff.ocp.step.render import Core, StepCode
from tendonff.ocp.step.target import require_linear

_SINGLE = {"tolerance": 2e-6, "nudge_rad": 1e-5, "moves": 15, "evaluations": 30}
_DOUBLE = {"evaluations": 60}
"""Bounds of a step by precision: two or three evaluations are usual, up to a dozen where many masses turn at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanismCode:
    """Parts of C files about fingers.

    Attributes
    ----------
    laws : str
        Types, laws, loops over elements and sizes, to stand before the core.
    data : ConstantData
        Constant records, to which more may be added: of each finger N `PREFIX_bodies_N`, `PREFIX_tendons_N`, and
        those in `names`.
    names : tuple of dict of str to str
        Names of a finger's other arrays in C: winding, partner, shares, closure, compliance, pretension, scale and
        motor_of.
    masses, states : int
        Of the largest tendon: masses, and numbers of its state.
    work : str
        Numbers that the largest tendon keeps in its work area, as C.
    core : Core
    """

    laws: str
    data: ConstantData
    names: tuple[dict[str, str], ...]
    masses: int
    states: int
    work: str
    core: Core


def mechanism_code(
    problems: Sequence[MechanismProblem],
    pretension_N: Sequence[Array],
    step_s: float,
    prefix: str,
    precision: Precision,
) -> MechanismCode:
    """Print the inverse of fingers.

    Parameters
    ----------
    problems : sequence of MechanismProblem
        One for each finger; all their bodies but the motors are driven.
    pretension_N : sequence of ndarray, shape (tendons,)
        Tension of each tendon when its loop was tensioned; of a tendon alone on its drum any number.
    step_s : float
        Sample time of all [s].
    prefix : str
        Of every C name.
    precision : Precision

    Raises
    ------
    CodeError
        If tendons cannot share their code.
    """
    sets = [problem.chains() for problem in problems]
    chains = [chain for each in sets for chain in each]
    if len({(chain.layout.link_states, chain.layout.friction_states) for chain in chains}) > 1:
        raise CodeError("tendons with one and with two relaxation times cannot share their code; give all of them two")
    model = representative(tuple(chains))
    elements = ElementLaws.of(model, folded=True)
    laws = (
        *(elements.link_gain(), elements.link_start(), elements.link_states()),
        *(link_back(elements), path_mass_back(elements), elements.contact(twins_of(model))),
    )
    weights = scheme_rows(step_s)
    known = {name: (value,) * len(weights) for name, value in shared_numbers(chains).items()}
    known["H"] = tuple(weight for weight, _ in weights)
    single = precision is Precision.FLOAT
    folder = PartialEvaluator(prefix=prefix, precision=precision, parameters=known, reorder=single)
    folded = {law.name: law for law in folder.parts(laws)}
    bodies = [fields_of(law, "joint_") for problem in problems for law in problem.laws()[: problem.known]]
    same = {name: (float(bodies[0][name]),) for name in JOINT_NUMBERS if len({each[name] for each in bodies}) == 1}
    balance = PartialEvaluator(prefix=prefix, precision=precision, parameters=same).fold(joint_torque())
    folded[balance.name] = balance
    taken = [name for name in model.numbers() if any(name in law.inputs for law in folded.values())]
    record = tuple(name for name in taken if name.startswith("link_") or name == "piece_adhesion_N")
    of_bodies = tuple(name for name in JOINT_NUMBERS if name in balance.inputs) or JOINT_NUMBERS[:1]
    core = Core(
        bodies=max(problem.known for problem in problems),
        tendons=max(map(len, sets)),
        **(_SINGLE if single else _DOUBLE),
    )
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
        joint_numbers=of_bodies,
        core=core,
        lean=True,
        record=(*record, *folder.coefficients),
        weigh=folder.weigh(),
    )
    parts = [code.render("joint_target.h.j2"), *(law.code for law in folded.values()), folder.weigh().code]
    names = ("reweigh.c.j2", "moving.c.j2", "links.c.j2", "finish.c.j2", "bodies_laws.c.j2")
    parts += [code.render(name) for name in names]
    data = ConstantData(prefix, precision)
    rows = [(w, carry, {k: v[j] for k, v in folder.coefficients.items()}) for j, (w, carry) in enumerate(weights)]
    found = []
    for k, (problem, own, tensioned) in enumerate(zip(problems, sets, pretension_N, strict=True)):
        pairs = zip(problem.mechanism.tendons, own, strict=True)
        tendons = [
            _tendon(data, f"{k + 1}_{t + 1}", problem, tendon, chain, rows, record)
            for t, (tendon, chain) in enumerate(pairs)
        ]
        numbers = [fields_of(law, "joint_") for law in problem.laws()[: problem.known]]
        data.rows("body", f"bodies_{k + 1}", [[data.number(float(n[name])) for name in of_bodies] for n in numbers])
        data.rows("tendon", f"tendons_{k + 1}", tendons)
        found.append(_arrays(data, problem, tensioned))
    masses = max(chain.count for chain in chains)
    layout = next(chain.layout for chain in chains if chain.count == masses)
    return MechanismCode(
        laws="\n".join(parts),
        data=data,
        names=tuple(found),
        masses=masses,
        states=layout.size,
        work=" + ".join(re.sub(r"\bn\b", str(masses), f"({size})") for _, size in code.work()),
        core=core,
    )


def _tendon(
    data: ConstantData,
    label: str,
    problem: MechanismProblem,
    tendon: Tendon,
    chain: Chain,
    weights: Sequence[tuple[float, float, dict[str, float]]],
    record: Sequence[str],
) -> list[str]:
    path, numbers = chain.elements.path, chain.numbers()
    ends = np.searchsorted(path.section_of, path.section_of, side="right")
    stretch, own = chain.link.rest(1.0)
    if any(state != stretch for state in own):
        raise CodeError("a link whose own states rest elsewhere than its elongation cannot be exported yet")
    require_linear(chain)
    common = [data.number(float(stretch)), data.array(np.concatenate(list(chain.of_masses().values())))]
    common += [data.array(ends, integers=True), data.number(path.total_angle_rad)]
    common += [data.number(float(numbers[name])) for name in record]
    rows = [
        [
            str(chain.count),
            data.number(w),
            data.number(carry),
            *common,
            *(data.number(v) for v in coefficients.values()),
        ]
        for w, carry, coefficients in weights
    ]
    effects = []
    for name in problem.names[: problem.known]:
        part = effect_parts(tendon, chain, name)
        effects.append(
            [
                *(data.number(0.0), data.array(() if part.per is None else part.per)),
                *(data.array(() if part.knots is None else part.knots), data.array(part.cubics)),
                *map(str, (part.pieces, *part.masses, *part.links)),
            ]
        )
    chain_rows = data.rows("weights", f"weights_{label}", rows)
    records = data.rows("effect", f"effects_{label}", effects)
    tables = [
        [
            *(data.array(part.values.ravel()), data.array(part.share)),
            *("{" + ", ".join(map(data.number, _padded(each))) + "}" for each in (part.low, part.step)),
            data.number(part.per_m),
            *("{" + ", ".join(map(str, _padded(each))) + "}" for each in (part.bodies, part.nodes)),
            *map(str, (len(part.nodes), part.first, len(part.share))),
        ]
        for part in table_parts(chain, problem.names)
    ]
    named = data.rows("path_table", f"tables_{label}", tables) if tables else "NULL"
    home = data.array(home_of(chain))
    return [chain_rows, home, records, data.number(0.0), "NULL", "NULL", "NULL", named, str(len(tables))]


def _padded(values: Sequence[Any]) -> list[Any]:
    return [*values, *[0] * (MOST_AXES - len(values))]


def _arrays(data: ConstantData, problem: MechanismProblem, pretension_N: Array) -> dict[str, str]:
    compliance = [1 / tendon.tendon.stiffness_N_per_m for tendon in problem.mechanism.tendons]
    return {
        "winding": data.array(problem.winding_m),
        "partner": data.array(problem.partner, integers=True),
        "shares": data.array(map(int, problem.alone), integers=True),
        "closure": data.array(np.zeros(len(compliance))),
        "compliance": data.array(compliance),
        "pretension": data.array(pretension_N),
        "scale": data.array(problem.scale_m()[: problem.known]),
        "motor_of": data.array(problem.motor_of, integers=True),
    }


def price(problem: MechanismProblem, step_s: float) -> float:
    """Price on a change of tensions in a step [1/N]."""
    return problem.sharing.change_weight * MS / step_s
