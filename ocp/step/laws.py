"""The laws of one element under an implicit step, as functions that every solver shares.

A scheme is written as x = base + H dx/dt at the end of the step; implicit Euler has base = old x, H = h. Then a link
is affine in the rate of its elongation, a friction law gives its states for a known velocity and normal force, and what
is left to solve is one equation per mass in its velocity, coupled to its two neighbours only.

Arguments are named after what they are: states with "_base" for what the scheme adds the rates to, parameters as in
`Chain.numbers`, those of either end with "end_" in front.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import casadi as ca
import numpy as np

from tendonff.models.layout import fields_of
from tendonff.models.tendon.assembly import End, Piece, end_force, near_tension, normal_force, path_force, tension_sum
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import FrictionLaw, from_far_side
from tendonff.models.tendon.link import LinkLaw, tendon_force
from tendonff.ocp.codegen.printer import Law

R = TypeVar("R")

PLAIN_END = End(mass_kg=0, damping_N_s_per_m=0, stiffness_N_per_m=0)
"""An end without states of its own; its numbers do not matter."""


def symbols(names: str) -> tuple[ca.SX, ...]:
    """CasADi scalars with names that blanks separate."""
    return tuple(ca.SX.sym(name) for name in names.split())


def symbolic(record: R, prefix: str, aliases: dict[str, str] | None = None) -> R:
    """The record with a CasADi scalar in the place of each number, named after its field or that of its alias."""
    known = {f.name: ca.SX.sym(prefix + f.name) for f in fields(record)}  # type: ignore[arg-type]
    return replace(record, **(known | {name: known[other] for name, other in (aliases or {}).items()}))  # type: ignore[type-var]


def way_of(name: str) -> str:
    """Direction that a coefficient of friction is for, "pull" or "release"; empty for other fields of the law."""
    way = name.rpartition("_")[2]
    return way if name.startswith("mu_") and way in ("pull", "release") else ""


def twins_of(chain: Chain, *, ways_differ: bool = False) -> dict[str, str]:
    """Coefficients of friction that equal an earlier one on every mass, wherever the joints stand, and the first such.

    Those of the two directions count as different where they may be set apart.
    """
    first, found = dict[tuple[str, bytes], str](), dict[str, str]()
    for name, value in fields_of(chain.elements.contact).items():
        if way_of(name):
            kind = (way_of(name) if ways_differ else "", (np.asarray(value) + 0.0).tobytes())  # 0.0 and -0.0 are alike
            found[name] = first.setdefault(kind, name)
    return {name: other for name, other in found.items() if name != other}


def _based(names: Sequence[str]) -> tuple[ca.SX, ...]:
    return tuple(ca.SX.sym(f"{name}_base") for name in names)


def _zero_of(expression: ca.SX, unknown: ca.SX) -> ca.SX:
    """Root of an expression that is affine in `unknown`."""
    return -ca.substitute(expression, unknown, ca.SX(0)) / ca.jacobian(expression, unknown)


@dataclass(frozen=True, slots=True)
class ElementLaws:
    """The laws of a chain's elements in symbols."""

    link: LinkLaw
    friction: FrictionLaw  # records of symbols
    # link_symbols, friction_symbols: those symbols; also what no expression uses, so that all variants of a law take
    # the same arguments
    link_symbols: tuple[ca.SX, ...]
    friction_symbols: tuple[ca.SX, ...]
    near: End  # kind of the near end

    @classmethod
    def of(cls, chain: Chain, *, folded: bool = False) -> "ElementLaws":
        """Laws for a chain; folded, without what its numbers make superfluous (`FrictionLaw.aliases`)."""
        friction, link = symbolic(chain.friction, "friction_"), symbolic(chain.link, "link_")
        every = tuple(fields_of(friction).values()), tuple(fields_of(link).values())
        if folded:
            known = fields_of(friction)
            same = {name: known[other] for name, other in chain.friction.aliases().items()}
            friction = replace(friction, **same)  # type: ignore[type-var]
        return cls(link, friction, every[1], every[0], chain.near)

    def link_gain(self) -> Law:
        """Slope of a link's unclipped force over the rate of elongation: one number per weight and length."""
        rate, *_, ratio, step = known = self._link_known()
        return Law(
            name="link_gain",
            comment="Slope of a link's force over its rate of elongation in an implicit step [N s/m], eqs. (6), (7).",
            inputs=(ratio, step, *self.link_symbols),
            outputs={"gain": ca.jacobian(self._link(known)[0], rate)},
        )

    def _link_known(self) -> tuple[ca.SX, ...]:
        return (*symbols("rate e_base"), *_based(self.link.states), *symbols("ratio H"))

    def _link(self, known: tuple[ca.SX, ...]) -> tuple[ca.SX, ca.SX, tuple[ca.SX, ...]]:
        """Unclipped force, elongation and own states at the end of a step."""
        rate, e_base, *base, ratio, step = known
        e, link = e_base + step * rate, self.link.shortened(ratio)
        states = link.implicit(e, tuple(base), step)
        return link.unclipped_force(e, rate, states) + link.explicit_force(e_base), e, states

    def link_start(self) -> Law:
        """A link's unclipped force at zero rate of elongation: one number per link and step."""
        known = self._link_known()
        return Law(
            name="link_start",
            comment="A link's force at zero rate of elongation, before slack [N], eqs. (6), (7).",
            inputs=(*known[1:], *self.link_symbols),
            outputs={"start": self._link((ca.SX(0), *known[1:]))[0]},
        )

    def link_force(self) -> Law:
        """Tension of a link from its affine form, and its slope: a tendon cannot push."""
        rate, start, gain = symbols("rate start gain")
        force = tendon_force(start + gain * rate)
        return Law(
            name="link_force",
            comment="Tension of a link [N] and its slope over the rate of elongation [N s/m]; a tendon cannot push.",
            inputs=(rate, start, gain),
            outputs={"force": force, "slope": ca.jacobian(force, rate)},
        )

    def link_rate(self) -> Law:
        """Rate of elongation of a taut link that carries a given force."""
        rate, start, gain, force = symbols("rate start gain force")
        return Law(
            name="link_rate",
            comment="Rate of elongation [m/s] of a taut link that carries a given force.",
            inputs=(force, start, gain),
            outputs={"rate": _zero_of(start + gain * rate - force, rate)},
        )

    def link_states(self) -> Law:
        """Elongation and own states of a link at the end of the step."""
        known = self._link_known()
        _, e, states = self._link(known)
        return Law(
            name="link_states",
            comment="Elongation of a link and its own states at the end of the step.",
            inputs=(*known, *self.link_symbols),
            outputs={"e": e, **dict(zip(self.link.states, states, strict=True))},
        )

    def link_tangent(self, *, of_length: bool = False) -> Law:
        """Slopes of a link's unclipped force (`u_by_X`) and states (`STATE_by_X`); `of_length`: over its ratio too."""
        known = self._link_known()
        force, _, states = self._link(known)
        fixed = ("H",) if of_length else ("H", "ratio")
        over = [s for s in (*known, *self.link_symbols) if s.name() not in fixed]
        outputs = {f"u_by_{s.name()}": ca.jacobian(force, s) for s in over}
        for name, state in zip(self.link.states, states, strict=True):
            outputs |= {f"{name}_by_{s.name()}": ca.jacobian(state, s) for s in over}
        return Law(
            name="link_tangent",
            comment="Slopes of a link's force before slack and of its own states.",
            inputs=(*known, *self.link_symbols),
            outputs=outputs,
        )

    def _path_mass(self) -> tuple[tuple[ca.SX, ...], ca.SX, tuple[ca.SX, ...]]:
        """Arguments, balance and states of one mass on the path."""
        v, v_base, f_near, f_far, step = symbols("v v_base f_near f_far H")
        base, piece = _based(self.friction.states), symbolic(Piece(mass_kg=0, adhesion_N=0), "piece_")
        f_n = normal_force(f_near, f_far, piece.adhesion_N)
        states = self.friction.implicit(v, base, step, f_n)
        f_f = self.friction.state_force(states) + self.friction.viscous_force(v)
        residual = piece.mass_kg / step * (v - v_base) - path_force(f_near, f_far, f_f)
        inputs = (v, f_near, f_far, v_base, *base, step, piece.mass_kg, piece.adhesion_N, *self.friction_symbols)
        return inputs, residual, states

    def path_mass(self) -> Law:
        """Balance of a mass on the path [N] and its slopes: zero where the mass's velocity solves the step."""
        inputs, residual, states = self._path_mass()
        v, f_near, f_far = inputs[:3]
        return Law(
            name="path_mass",
            comment="Balance of a mass on the path [N], its slopes, and the states of its friction, eqs. (4), (5).",
            inputs=inputs,
            outputs={
                "residual": residual,
                "by_v": ca.jacobian(residual, v),
                "by_near": ca.jacobian(residual, f_near),
                "by_far": ca.jacobian(residual, f_far),
                **dict(zip(self.friction.states, states, strict=True)),
            },
        )

    def path_balance(self) -> Law:
        """Balance of a mass on the path [N] without its slopes."""
        inputs, residual, states = self._path_mass()
        return Law(
            name="path_balance",
            comment="Balance of a mass on the path [N] and the states of its friction, eqs. (4), (5).",
            inputs=inputs,
            outputs={"residual": residual, **dict(zip(self.friction.states, states, strict=True))},
        )

    def path_mass_tangent(self) -> Law:
        """Every slope of a path mass's balance (`r_by_X`) and of its states (`STATE_by_X`)."""
        inputs, residual, states = self._path_mass()
        outputs: dict[str, ca.SX] = {}
        for symbol in (s for s in inputs if s.name() != "H"):
            outputs[f"r_by_{symbol.name()}"] = ca.jacobian(residual, symbol)
            for name, state in zip(self.friction.states, states, strict=True):
                outputs[f"{name}_by_{symbol.name()}"] = ca.jacobian(state, symbol)
        return Law(
            name="path_mass_tangent",
            comment="Slopes of a path mass's balance and of its states over states and parameters.",
            inputs=inputs,
            outputs=outputs,
        )

    def path_mass_inverse(self, *, drop: bool = False) -> Law:
        """Tension on the actuator's side of a mass whose motion and load side are known.

        With `drop`, what the mass adds to the tension instead, f_i = f_{i+1} + drop, for arithmetic with few digits and
        without the slack.
        """
        v, f_far, v_base, step = symbols("v f_far v_base H")
        base, piece = _based(self.friction.states), symbolic(Piece(mass_kg=0, adhesion_N=0), "piece_")
        inertia, viscous = piece.mass_kg / step * (v - v_base), self.friction.viscous_force(v)
        without_states = near_tension(f_far, viscous, inertia)
        states = from_far_side(self.friction, v, base, step, tension_sum(f_far, without_states, piece.adhesion_N))
        state_force = self.friction.state_force(states)
        found = (
            {"drop": state_force + viscous + inertia}
            if drop
            else {"f_near": tendon_force(without_states + state_force)}
        )
        return Law(
            name="path_mass_drop" if drop else "path_mass_inverse",
            comment=f"{'Friction and inertia' if drop else 'Near tension'} of a mass [N], and its states.",
            inputs=(v, f_far, v_base, *base, step, piece.mass_kg, piece.adhesion_N, *self.friction_symbols),
            outputs={**found, **dict(zip(self.friction.states, states, strict=True))},
        )

    def contact(self, twins: Mapping[str, str]) -> Law:
        """The friction's parameters on a piece with a given wrap angle; one evaluation serves a field and its twins."""
        whole = symbolic(self.friction, "contact_", dict(twins))
        angle, share, length = symbols("angle_rad angle_share length_share")
        outputs = fields_of(whole.on_piece(angle, share, length), "friction_")
        return Law(
            name="contact",
            comment="Parameters of friction on a piece, eqs. (8), (9), from the whole's and a wrap angle [rad].",
            inputs=(angle, share, length, *(s for name, s in fields_of(whole).items() if name not in twins)),
            outputs=outputs,
        )

    def contact_tangent(self, twins: Mapping[str, str]) -> Law:
        """Slopes of the parameters on a piece (`PARAMETER_by_X`) over its wrap angle and those of the whole."""
        law = self.contact(twins)
        return replace(
            law,
            name="contact_tangent",
            comment="Slopes of parameters of friction on a piece over its wrap angle and those of the whole.",
            outputs={f"{n}_by_{s.name()}": ca.jacobian(e, s) for n, e in law.outputs.items() for s in law.inputs},
        )

    def simulation(self) -> tuple[Law, ...]:
        """The laws that a time step needs."""
        path = (self.path_mass(), self.path_balance())
        ends = tuple(end_mass(end) for end in self.ends)
        return (self.link_gain(), self.link_start(), self.link_force(), self.link_states(), *path, *ends)

    def inverse(self) -> tuple[Law, ...]:
        """The laws that the exact inverse needs beside `link_gain`, `link_start` and `link_states`."""
        return (far_velocity(), near_force(self.near), self.link_rate(), self.path_mass_inverse())

    def tangent(self) -> tuple[Law, ...]:
        """The laws that forward sensitivities need beside those of a time step."""
        return (self.link_tangent(), self.path_mass_tangent(), *(end_mass_tangent(end) for end in self.ends))

    @property
    def ends(self) -> tuple[End, ...]:
        """Kinds of ends: one where both are alike."""
        return (PLAIN_END, self.near) if self.near.states else (PLAIN_END,)


def _end_mass(kind: End) -> tuple[dict[str, ca.SX], ca.SX, dict[str, ca.SX]]:
    """Arguments by name, balance of an end mass [N] and own states; `pull`: +1 where tension pulls to the positive."""
    v, f, v_base, q_base, step, pull, f_c, x_c = inputs = symbols("v f v_base q_base H pull f_c x_c")
    end, base = symbolic(kind, "end_"), _based(kind.states)
    own = end.implicit(v, base, step, f)
    residual = end.mass_kg / step * (v - v_base) - end_force(v, q_base + step * v, f, pull, f_c, x_c, end, own)
    known = {s.name(): s for s in (*inputs, *base, *fields_of(end).values())}
    return known, residual, dict(zip(kind.states, own, strict=True))


def _name(law: str, kind: End) -> str:
    """Only the near end has states: a law of its own there, which is called before the one for both."""
    return f"{law}_near" if kind.states else law


def end_mass(kind: End = PLAIN_END) -> Law:
    """Balance of an end mass [N], its slopes, and the end's own states."""
    known, residual, own = _end_mass(kind)
    return Law(
        name=_name("end_mass", kind),
        comment="Balance of an end mass [N] and its slopes over velocity and tension; pull: -1 near, +1 far end.",
        inputs=tuple(known.values()),
        outputs={
            "residual": residual,
            "by_v": ca.jacobian(residual, known["v"]),
            "by_f": ca.jacobian(residual, known["f"]),
            **own,
        },
    )


def end_mass_tangent(kind: End = PLAIN_END) -> Law:
    """Slopes of an end mass's balance over bases, motor inputs and parameters, and those of its own states."""
    known, residual, own = _end_mass(kind)
    kept = {name: s for name, s in known.items() if name not in ("H", "pull")}
    outputs = {f"by_{name}": ca.jacobian(residual, s) for name, s in kept.items() if name != "v"}
    over = {name: s for name, s in kept.items() if name == "v" or name.startswith("end_") or name[:-5] in kind.states}
    if any(ca.depends_on(value, known["f"]) for value in own.values()):
        over["f"] = known["f"]
    for state, value in own.items():
        outputs |= {f"{state}_by_{name}": ca.jacobian(value, s) for name, s in over.items()}
    return Law(
        name=_name("end_mass_tangent", kind),
        comment="Slopes of an end mass's balance.",
        inputs=tuple(known.values()),
        outputs=outputs,
    )


def far_velocity() -> Law:
    """Velocity of the load that a given output tension causes."""
    known, residual, _ = _end_mass(PLAIN_END)
    return Law(
        name="far_velocity",
        comment="Velocity of an end mass [m/s] for a given tension.",
        inputs=tuple(s for name, s in known.items() if name != "v"),
        outputs={"v": _zero_of(residual, known["v"])},
    )


def near_force(kind: End = PLAIN_END) -> Law:
    """Motor force that gives an end mass a given velocity against a given tension, and the end's own states."""
    known, residual, own = _end_mass(kind)
    return Law(
        name="near_force",
        comment="Motor force [N] that gives an end mass its velocity.",
        inputs=tuple(s for name, s in known.items() if name != "f_c"),
        outputs={"f_c": _zero_of(residual, known["f_c"]), **own},
    )
