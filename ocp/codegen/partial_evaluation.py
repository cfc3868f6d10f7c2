"""Print laws with their parameters folded in: what a controller evaluates, and nothing else.

Where nothing is known, the law comes out whole: the host's code takes this road too. A law as `step.laws` states it
takes every parameter and the weight H of the scheme as arguments. On a controller these are known beforehand, so
everything that depends on them alone is evaluated here, in double precision: a number that is the same for every weight
H becomes a literal, one that differs becomes a field of a coefficient record with one value per weight. What remains
depends on the state only.

Folding keeps the order of operations, so that double code gives the bits that the unfolded law gives. Where `reorder`
allows it, constants are gathered and divisions by them become multiplications.

CasADi's own folding cannot stand in for it (`benchmarks/folding.py`): after `substitute`, 36 of 132 laws of examples
have other bits, by 3e-13 at most, and a third more is left to compute: CasADi takes both sides of a choice. With the
weight left open, `extract_parametric` leaves a few operations more still.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import casadi as ca

from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import OPERATORS, SELECT, Law, literal, operator
from tendonff.ocp.errors import CodeError

Values = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class _Node:
    """Value: a constant per weight, an argument, or an operation on earlier nodes."""

    op: int | None
    operands: tuple["_Node", ...] = ()
    constant: Values | None = None
    argument: str | None = None
    made: "_Made | str | None" = None  # of a constant: what it was computed from, or the known argument that it is

    def is_number(self, value: float) -> bool:
        """The same given number for every weight."""
        return self.constant is not None and all(c == value for c in self.constant)


_ONE = _Node(None, constant=(1.0,))
_Made = tuple[int, tuple[_Node, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class FoldedLaw:
    """A law with its parameters folded in, as a static C function."""

    prefix: str  # of its C identifier
    name: str  # C identifier without the prefix
    inputs: tuple[str, ...]  # arguments that remain, in the law's order
    outputs: tuple[str, ...]  # results, through pointers
    weighted: bool  # whether it reads the coefficient record
    code: str  # the whole definition


@dataclass(slots=True, kw_only=True)
class PartialEvaluator:
    """Folds the laws of one file and gathers the coefficients that differ between weights."""

    prefix: str  # prefix of every C name
    precision: Precision
    record: str = ""  # C type of the coefficient record; default: `<prefix>_weights`
    shared: bool = False  # the laws stand in a header
    parameters: Mapping[str, Values]  # value of each known argument for each weight H
    reorder: bool = False  # fewer operations at the price of other roundings
    # names, after the prefix, of functions to call for operations of a CasADi tape instead of those of the library
    functions: Mapping[int, str] = field(default_factory=dict)
    # lower bounds that the caller keeps, by name of the argument: maxima with what is not above them go
    floors: Mapping[str, float] = field(default_factory=dict)
    # arguments that are the same in many calls: with `reorder`, constants are gathered with them
    steady: Sequence[str] = ()
    coefficients: dict[str, Values] = field(default_factory=dict)
    # known arguments that follow from others, as a law gave them: see `follow`
    followed: dict[str, _Node] = field(default_factory=dict)
    _nodes: dict[str, _Node] = field(default_factory=dict)  # of the coefficients

    @property
    def weights_type(self) -> str:
        """C type of the coefficient record."""
        return self.record or f"{self.prefix}_weights"

    @property
    def weights(self) -> int:
        """Number of weights H."""
        return len(next(iter(self.parameters.values()), (0.0,)))

    def fold(self, law: Law, name: str | None = None, fixed: Mapping[str, float] | None = None) -> FoldedLaw:
        """C text of a law, under its own name or another; known values of `fixed` override `parameters`."""
        name = name or law.name
        known = dict(self.parameters) | {key: (value,) * self.weights for key, value in (fixed or {}).items()}
        results = _Tape(self.reorder, self.floors, self.steady).run(law, known, self.weights)
        return self._print(law, name, results)

    def parts(self, laws: Sequence[Law], whole: Sequence[str] = ()) -> list[FoldedLaw]:
        """C text of laws, in two parts of those with held arguments but for the names in `whole`."""
        parts: list[FoldedLaw] = []
        for law in laws:
            parts += self.split(law) if law.held and law.name not in whole else (self.fold(law),)
        return parts

    def split(self, law: Law) -> tuple[FoldedLaw, FoldedLaw]:
        """A law in two: `NAME_ready` takes what depends on the held arguments alone, the law itself its results."""
        tape = _Tape(self.reorder, self.floors, self.steady, law.held)
        results = tape.run(law, self.parameters, self.weights)
        early: dict[int, tuple[_Node, _Node]] = {}
        again: dict[int, _Node] = {}

        def late(node: _Node) -> _Node:
            if node.constant is not None:
                return node
            if id(node) not in again:
                if tape.is_held(node):
                    again[id(node)] = _Node(None, argument=f"ready_{len(early)}")
                    early[id(node)] = node, again[id(node)]
                else:
                    again[id(node)] = replace(node, operands=tuple(map(late, node.operands)))
            return again[id(node)]

        rest = [late(node) for node in results]
        names = [argument.argument or "" for _, argument in early.values()]
        outputs = {name: ca.SX(0) for name in names}
        before = replace(law, comment=f"{law.comment} What can be evaluated before.", outputs=outputs)
        free = tuple(symbol for symbol in law.inputs if symbol.name() not in law.held)
        after = replace(law, inputs=(*free, *map(ca.SX.sym, names)))
        return (
            self._print(before, f"{law.name}_ready", [node for node, _ in early.values()]),
            self._print(after, law.name, rest),
        )

    def evaluate(self, law: Law) -> tuple[Values, ...]:
        """Outputs of a law whose arguments are all known, one value per weight each."""
        return tuple(_constant_of(node, law.name) for node in _Tape(False).run(law, self.parameters, self.weights))

    def follow(self, argument: str, law: Law) -> None:
        """Know an argument as the one output of a law whose arguments are all known."""
        (node,) = _Tape(False).run(law, self.parameters, self.weights)
        self.parameters = {**self.parameters, argument: _constant_of(node, law.name)}
        self.followed[argument] = node

    def weigh(self, name: str = "weigh") -> FoldedLaw:
        """The coefficients as a function of what they depend on, so that a weight H may be known at run time only."""
        tape = _Tape(False)
        known: dict[int, _Node] = {}

        def again(node: _Node) -> _Node:
            if id(node) not in known:
                if node.constant is None or len(set(node.constant)) == 1 or node.made is None:
                    made = node
                elif isinstance(node.made, str):
                    of_law = self.followed.get(node.made)
                    made = tape.argument(node.made) if of_law is None else again(of_law)
                else:
                    made = tape.operation(node.made[0], tuple(map(again, node.made[1])))
                known[id(node)] = made
            return known[id(node)]

        law = Law(
            name=name,
            comment="What depends on the weight H [s] of the scheme.",
            inputs=tuple(ca.SX.sym(argument) for argument in self.parameters),
            outputs=dict.fromkeys(self.coefficients, ca.SX(0)),
        )
        return self._print(law, name, [again(self._nodes[output]) for output in self.coefficients])

    def _print(self, law: Law, name: str, results: Sequence[_Node]) -> FoldedLaw:
        real = self.precision.value
        constants = {"zero": literal(0.0, self.precision), "one": literal(1.0, self.precision)}
        suffix = "f" if self.precision is Precision.FLOAT else ""
        used: set[str] = set()
        lines: list[str] = []
        texts: dict[int, str] = {}
        weighted = False

        def text_of(node: _Node) -> str:
            nonlocal weighted
            if node.constant is not None:
                _require_finite(node.constant, law.name)
                if len(set(node.constant)) == 1:
                    text = literal(node.constant[0], self.precision)
                    return f"({text})" if text.startswith("-") else text
                weighted = True
                return f"w->{self._coefficient(name, node)}"
            if node.argument is not None:
                used.add(node.argument)
                return node.argument
            if id(node) not in texts:
                value = expression(node)
                if _is_condition(node):  # a value: 1 where it holds
                    value = f"({value}) ? {constants['one']} : {constants['zero']}"
                texts[id(node)] = f"t{len(texts)}"
                lines.append(f"    const {real} {texts[id(node)]} = {value};")
            return texts[id(node)]

        def condition_of(node: _Node) -> str:
            if _is_condition(node):
                return f"({expression(node)})"  # conditions stay where they are used
            return f"({text_of(node)} != {constants['zero']})"

        def expression(node: _Node) -> str:
            if node.op == SELECT:
                which, yes, no = node.operands
                return f"{condition_of(which)} ? {text_of(yes)} : {text_of(no)}"
            if (own := self.functions.get(node.op or 0)) is not None:
                return f"{self.prefix}_{own}({', '.join(map(text_of, node.operands))})"
            known = operator(node.op or 0, law.name)
            operands = [condition_of(o) if known.of_conditions else text_of(o) for o in node.operands]
            return known.text.format(*operands, f=suffix, **constants)

        outputs = tuple(law.outputs)
        for output, node in zip(outputs, results, strict=True):
            lines.append(f"    *{output} = {text_of(node)};")
        inputs = tuple(symbol.name() for symbol in law.inputs if symbol.name() in used)
        record = [f"const {self.weights_type} *w"] if weighted else []
        arguments = record + [f"{real} {n}" for n in inputs] + [f"{real} *{n}" for n in outputs]
        kind = "static inline void" if self.shared else "static void"
        head = f"/* {law.comment} */\n{kind} {self.prefix}_{name}(\n    {', '.join(arguments)})\n{{\n"
        code = head + "\n".join(lines) + "\n}\n"
        return FoldedLaw(prefix=self.prefix, name=name, inputs=inputs, outputs=outputs, weighted=weighted, code=code)

    def _coefficient(self, law: str, node: _Node) -> str:
        """Field of the coefficient record that holds these values."""
        values = _constant_of(node, law)
        for name, known in self.coefficients.items():
            if known == values:
                return name
        name = f"{law}_{1 + sum(n.startswith(f'{law}_') for n in self.coefficients)}"
        self.coefficients[name], self._nodes[name] = values, node
        return name


def _constant_of(node: _Node, law: str) -> Values:
    if node.constant is None:
        raise CodeError(f"{law}: an argument has no known value")
    return _require_finite(node.constant, law)


def _require_finite(values: Values, law: str) -> Values:
    """Refuse what no C literal spells: at run time it would be infinite or not a number as well."""
    if not all(map(math.isfinite, values)):
        raise CodeError(
            f"{law}: a number of these parameters is {values[0] if len(values) == 1 else values}: something is divided "
            "by zero, or overflows; check the parameters that are zero or very large"
        )
    return values


def _value_of(op: int, operands: Sequence[float]) -> float:
    """Value of an operation on numbers in C; where Python raises, as for 1/0, CasADi gives infinity or NaN like C."""
    try:
        return OPERATORS[op].evaluate(*operands)
    except (ArithmeticError, ValueError):
        return float(ca.SX.unary(op, *operands) if len(operands) == 1 else ca.SX.binary(op, *operands))


_SHORTHANDS = {ca.OP_SQ, ca.OP_TWICE, ca.OP_INV}


def _is_condition(node: _Node) -> bool:
    return node.op in OPERATORS and OPERATORS[node.op].condition


class _Tape:
    """Runs the instructions of a law on nodes and folds what is known, with the rules of `PartialEvaluator`."""

    def __init__(
        self,
        reorder: bool,
        floors: Mapping[str, float] | None = None,
        steady: Sequence[str] = (),
        held: Sequence[str] = (),
    ) -> None:
        self._reorder, self._floors, self._steady, self._held = reorder, floors or {}, steady, held
        self._table: dict[tuple[object, ...], _Node] = {}
        self._weights = 1

    def run(self, law: Law, known: Mapping[str, Values], weights: int) -> list[_Node]:
        """Nodes of the law's outputs."""
        self._weights = weights
        results_in = ca.densify(ca.vertcat(*law.outputs.values()))  # the tape numbers structural nonzeros
        tape = ca.Function(law.name, [ca.vertcat(*law.inputs)], [results_in], {"cse": True})
        names = [symbol.name() for symbol in law.inputs]
        register: dict[int, _Node] = {}
        results: dict[int, _Node] = {}
        for k in range(tape.n_instructions()):
            op, ins, outs = tape.instruction_id(k), tape.instruction_input(k), tape.instruction_output(k)
            if op == ca.OP_CONST:
                register[outs[0]] = _constant(tape.instruction_constant(k), weights)
            elif op == ca.OP_INPUT:
                name = names[ins[1]]
                if name in known:
                    register[outs[0]] = _Node(None, constant=tuple(known[name]), made=name)
                else:
                    register[outs[0]] = self.argument(name)
            elif op == ca.OP_OUTPUT:
                results[outs[1]] = register[ins[0]]
            else:
                count = 1 if op in _SHORTHANDS else operator(op, law.name).operands
                register[outs[0]] = self.operation(op, tuple(register[i] for i in ins[:count]))
        return [results[k] for k in range(len(law.outputs))]

    def argument(self, name: str) -> _Node:
        """The one node of an argument."""
        return self._shared(_Node(None, argument=name))

    def _shared(self, node: _Node) -> _Node:
        """The one node with this operation on these operands."""
        key = (node.op, node.argument, *(id(o) if o.constant is None else o.constant for o in node.operands))
        return self._table.setdefault(key, node)

    def operation(self, op: int, operands: tuple[_Node, ...]) -> _Node:
        """A node for an operation, folded where its operands allow it."""
        a = operands[0]
        if op == ca.OP_SQ:
            op, operands = ca.OP_MUL, (a, a)
        elif op == ca.OP_TWICE:
            op, operands = ca.OP_ADD, (a, a)
        elif op == ca.OP_INV:
            op, operands = ca.OP_DIV, (_ONE, a)
        if all(o.constant is not None for o in operands):
            columns = [o.constant for o in operands if o.constant is not None]
            count = max(len(column) for column in columns)
            rows = zip(*(column if len(column) == count else column * count for column in columns), strict=True)
            return _Node(None, constant=tuple(_value_of(op, row) for row in rows), made=(op, operands))
        if op == ca.OP_LT and self._is_below(*operands):
            return _constant(1.0, 1)
        if self._held and self._reorder and (early := self._held_apart(op, operands)) is not None:
            return early
        if (moved := self._into_choice(op, operands)) is not None:
            return moved
        if self._reorder and (gathered := self._gathered(op, operands)) is not None:
            return gathered
        return self._without_neutral(op, operands) or self._shared(_Node(op, operands))

    def _is_below(self, low: _Node, value: _Node) -> bool:
        """A constant is not above the lower bound of a value: then max(value, constant) is the value."""
        if value.op == SELECT:
            return all(self._is_below(low, branch) for branch in value.operands[1:])
        floor = self._floors.get(value.argument or "")
        return floor is not None and low.constant is not None and max(low.constant) <= floor

    def is_held(self, node: _Node) -> bool:
        """Depends on held arguments alone."""
        return node.constant is not None or (
            all(map(self.is_held, node.operands)) if node.argument is None else node.argument in self._held
        )

    def _is_held_choice(self, node: _Node) -> bool:
        """A choice between two values of held arguments by something else."""
        which, *values = node.operands if node.op == SELECT else (node,)
        return bool(values) and not self.is_held(which) and all(map(self.is_held, values))

    def _held_apart(self, op: int, operands: tuple[_Node, ...]) -> _Node | None:
        """Node that keeps apart what held arguments decide, but for a choice between two such values."""
        a, b = operands[0], operands[-1]
        if op in (ca.OP_FABS, ca.OP_SIGN) and not self.is_held(a):  # of zero: +1
            rising = self.operation(ca.OP_LE, (_constant(0.0, self._weights), a))
            way = self._shared(_Node(SELECT, (rising, _ONE, _Node(None, constant=(-1.0,)))))
            return way if op == ca.OP_SIGN else self.operation(ca.OP_MUL, (a, way))
        if op == ca.OP_DIV and not a.is_number(1) and (self.is_held(b) or self._is_held_choice(b)):
            return self.operation(ca.OP_MUL, (a, self.operation(ca.OP_DIV, (_ONE, b))))
        choices = {id(o.operands[0]): o.operands[0] for o in operands if self._is_held_choice(o)}
        parted = [o for o in operands if self._is_held_choice(o) or self.is_held(o)]
        if len(choices) == 1 and len(parted) == len(operands) and op != ca.OP_SUB:  # one more choice is dearer
            yes, no = (
                self.operation(op, tuple(o.operands[k] if self._is_held_choice(o) else o for o in operands))
                for k in (1, 2)
            )
            (which,) = choices.values()
            return yes if yes is no else self._shared(_Node(SELECT, (which, yes, no)))
        if op == ca.OP_MUL and len(parted) == 1:
            product, own = (a, b) if parted[0] is b else (b, a)
            for inner, rest in (product.operands, product.operands[::-1]) if product.op == ca.OP_MUL else ():
                whole = self.operation(ca.OP_MUL, (own, inner))
                if self.is_held(whole) or self._is_held_choice(whole):
                    return self.operation(ca.OP_MUL, (rest, whole))
        return None

    def _gathered(self, op: int, operands: tuple[_Node, ...]) -> _Node | None:
        """Division by a constant as multiplication, and K1 (K2 x) as (K1 K2) x."""
        a, b = operands[0], operands[-1]
        if op == ca.OP_DIV and (b.constant is not None or _is_choice(b)):
            return self.operation(ca.OP_MUL, (a, self.operation(ca.OP_DIV, (_ONE, b))))
        if op == ca.OP_NEG and a.op == ca.OP_MUL and any(o.constant is not None for o in a.operands):
            return self.operation(ca.OP_MUL, (a, _Node(None, constant=(-1.0,))))
        if op == ca.OP_MUL:
            for outer, product in ((a, b), (b, a)):
                if outer.constant is None or product.op != ca.OP_MUL:
                    continue
                for inner, rest in (product.operands, product.operands[::-1]):
                    if inner.constant is not None or self._is_steady(inner):
                        return self.operation(ca.OP_MUL, (rest, self.operation(ca.OP_MUL, (outer, inner))))
        return None

    def _is_steady(self, node: _Node) -> bool:
        """An argument that is the same in many calls, or a constant times one: several products may share it."""
        if node.op == ca.OP_MUL:
            one, other = node.operands
            return one.constant is not None and self._is_steady(other)
        return node.argument in self._steady

    def _without_neutral(self, op: int, operands: tuple[_Node, ...]) -> _Node | None:
        """X + 0, x - x, 1 x, 0 x, c ? x : x and their like: exact."""
        a, b = operands[0], operands[-1]
        if op == ca.OP_MUL:
            for this, other in ((a, b), (b, a)):
                if this.is_number(0):
                    return this
                if this.is_number(1):
                    return other
                if this.is_number(-1):
                    return self.operation(ca.OP_NEG, (other,))
        if op == ca.OP_ADD:
            if a.is_number(0) or b.is_number(0):
                return b if a.is_number(0) else a
            return self._selection(a, b) or self._selection(b, a)
        if op == ca.OP_SUB:
            if a is b:
                return _Node(None, constant=(0.0,))
            if b.is_number(0):
                return a
            if a.is_number(0):
                return self.operation(ca.OP_NEG, (b,))
        if op == ca.OP_DIV and b.is_number(1):
            return a
        if op == ca.OP_NEG and a.op == ca.OP_NEG:
            return a.operands[0]
        if op == ca.OP_IF_ELSE_ZERO:
            if a.constant is not None and len(set(map(bool, a.constant))) == 1:
                return b if a.constant[0] else _constant(0.0, len(a.constant))
            if b.is_number(0):
                return b
            zero = _constant(0.0, len(b.constant) if b.constant is not None else 1)
            return self._shared(_Node(SELECT, (a, b, zero)))
        return None

    def _into_choice(self, op: int, operands: tuple[_Node, ...]) -> _Node | None:
        """f(c ? K1 : K2, K3) as c ? f(K1, K3) : f(K2, K3), so that f is evaluated here and not on the controller."""
        choices = [o for o in operands if _is_choice(o)]
        if op not in OPERATORS or not choices or any(o.constant is None and o is not choices[0] for o in operands):
            return None
        yes, no = (self.operation(op, tuple(o.operands[k] if o is choices[0] else o for o in operands)) for k in (1, 2))
        if yes.constant == no.constant:
            return yes
        return self._shared(_Node(SELECT, (choices[0].operands[0], yes, no)))

    def _selection(self, first: _Node, second: _Node) -> _Node | None:
        """(c ? x : 0) + (!c ? y : 0), CasADi's if_else, as c ? x : y; x alone where both are the same."""
        if first.op != SELECT or second.op != SELECT:
            return None
        (c, x, x_else), (not_c, y, y_else) = first.operands, second.operands
        if not (x_else.is_number(0) and y_else.is_number(0) and not_c.op == ca.OP_NOT and not_c.operands[0] is c):
            return None
        if x is y or (x.constant is not None and x.constant == y.constant):
            return x
        return self._shared(_Node(SELECT, (c, x, y)))


def _constant(value: float, weights: int) -> _Node:
    return _Node(None, constant=(value,) * weights)


def _is_choice(node: _Node) -> bool:
    """A choice between two constants."""
    return node.op == SELECT and all(o.constant is not None for o in node.operands[1:])
