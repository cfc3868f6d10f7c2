"""Scripts of a shipped self test: calls of exported modules and what they must answer, as constant data for C.

The program that carries them out is the fixed text `core/tff_self_test.c`. A module is a record of its inputs, of its
functions, and of the members of its state that can be looked at, its ports; all that is compared goes by their names.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.export.text.fixed import core_file
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.codegen.templates import environment

SLOTS = 3
"""Instances of a module that a check can have."""
MEAN_OF = 8
"""Rows of a mean that is compared instead of each difference."""
ANSWER = "answer"
"""Port of every module: what its last call returned."""
EVERY_BIT = 0xFFFFFFFF
_COLUMN = 8  # numbers from which on it is written what they are

_TEMPLATES = environment("tendonff.compensator.export", "templates/library")


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """Member of a module's state.

    Attributes
    ----------
    name : str
        With its unit where it has one, "force [N]".
    member : str
        In C.
    count : int
        Numbers.
    kind : str
        "r" real, "i" int32_t, "u" uint32_t, "n" int, "d" double.
    """

    name: str
    member: str
    count: int = 1
    kind: str = "r"


@dataclass(frozen=True, slots=True, kw_only=True)
class ModuleRecord:
    """Functions and values of a module that a self test reaches.

    Attributes
    ----------
    name : str
    type : str
        Of its state, in C.
    inputs : dict of str to int
        Arguments of its functions by name: 0 for a number, else how many an array has.
    calls : dict of str to str
        Statements of C by the name of the call: `self` is the state, `{name}` an input, `answer` what is returned.
    ports : tuple of Port
    """

    name: str
    type: str
    inputs: Mapping[str, int]
    calls: Mapping[str, str]
    ports: tuple[Port, ...]

    def place(self, given: str) -> int:
        """Of the first number of an input among all."""
        names = list(self.inputs)
        return sum(max(1, self.inputs[name]) for name in names[: names.index(given)])

    @property
    def statements(self) -> list[str]:
        """The calls in C."""
        given = {name: f"in[{self.place(name)}]" for name in self.inputs}
        return [text.format(**given) for text in self.calls.values()]


@dataclass(frozen=True, slots=True)
class _Line:
    act: str
    slot: int = 0
    port: int = 0
    look: str = "VALUE"
    other: int = 0
    versus: int = 0
    next: int = 0
    a: int = 0
    b: int = 0

    def text(self) -> str:
        numbers = ", ".join(map(str, (self.other, self.versus, self.next)))
        return f"{{ TEST_{self.act}, {self.slot}, {self.port}, TEST_{self.look}, {numbers}, {self.a}u, {self.b}u }}"


@dataclass(frozen=True, slots=True)
class Ramp:
    """An input that grows by the same from row to row."""

    first: float
    slope: float


EACH = Ramp(0.0, 1.0)
"""Number of the row."""


@dataclass(slots=True, kw_only=True)
class Check:
    """Lines that are carried out in each row; see `Script.check`."""

    script: "Script"
    module: ModuleRecord
    name: str
    rows: int
    lines: list[_Line] = field(default_factory=list)
    given: dict[int, _Line] = field(default_factory=dict)
    title: str = ""  # name, or that of the check whose rows go on

    def __post_init__(self) -> None:
        self.title = self.title or self.name

    def then(self, rows: int = 1) -> "Check":
        """Further rows of the same check, with lines of their own."""
        following = self.script.check(self.module, "", rows)
        following.title = self.title
        following.given |= self.given
        return following

    def give(self, **inputs: ArrayLike | Ramp) -> "Check":
        """Give inputs: a number or an array for all rows or a ramp; else one for each row, the first axis."""
        for name, values in inputs.items():
            place, count = self.module.place(name), max(1, self.module.inputs[name])
            first, slope = (values.first, values.slope) if isinstance(values, Ramp) else (values, 0.0)
            a, step = self._column(first, self.module.inputs[name], f"{self.title}: {name}")
            line = _Line("GIVE", port=place, other=count, next=step, a=a, b=self._column(slope)[0])
            if self.given.get(place) != line:
                self.lines.append(line)
            self.given.pop(place, None)
            if step == 0 and slope == 0:
                self.given[place] = line  # what all rows are given need not be given again
        return self

    def call(self, name: str, slot: int = 0, /, **inputs: ArrayLike | Ramp) -> "Check":
        """Call a function, with inputs beside those that were given before."""
        self.give(**inputs)
        self.lines.append(_Line("CALL", slot, list(self.module.calls).index(name)))
        return self

    def write(self, port: str, values: ArrayLike, slot: int = 0) -> "Check":
        """Set the first number of a member of the state."""
        a, step = self._column(values)
        self.lines.append(_Line("WRITE", slot, self._port(port), next=step, a=a))
        return self

    def copy(self, slot: int, other: int) -> "Check":
        """Make a slot the same as another one."""
        self.lines.append(_Line("COPY", slot, other=other))
        return self

    def fill(self, slot: int, byte: int) -> "Check":
        """Fill the state with bytes."""
        self.lines.append(_Line("FILL", slot, other=byte))
        return self

    def near(
        self, port: str, values: ArrayLike, tolerance: float | None = None, slot: int = 0, *, mean: bool = False
    ) -> "Check":
        """Compare an output with numbers, NaN where a row is not compared; by default but for their rounding."""
        table = np.asarray(values, dtype=np.float64)
        most = self.script.rounding(table) if tolerance is None else tolerance
        return self._compare("MEAN" if mean else "NEAR", slot, port, table, most)

    def held(self, port: str, tolerance: float = 0.0, slot: int = 0) -> "Check":
        """Expect an output as it was before the call."""
        return self._compare("NEAR", slot, port, 0.0, tolerance, look="CHANGE")

    def moved(self, port: str, most: float, slot: int = 0) -> "Check":
        """Expect a change from before the call, either way, of at most so much."""
        return self._compare("WITHIN", slot, port, -most, most, look="CHANGE")

    def within(self, port: str, low: float, high: float, slot: int = 0) -> "Check":
        """Expect an output between two numbers."""
        return self._compare("WITHIN", slot, port, low, high)

    def same(
        self, port: str, tolerance: float = 0.0, *, slot: int = 0, other: int = 1, versus: str | None = None
    ) -> "Check":
        """Expect an output to be another slot's, by default of the same port."""
        versus_at = self._port(versus or port)
        return self._compare("NEAR", slot, port, 0.0, tolerance, look="APART", other=other, versus=versus_at)

    def apart(self, port: str, values: ArrayLike, tolerance: float, *, slot: int = 0, other: int = 1) -> "Check":
        """Expect an output to differ from another slot's by so much."""
        return self._compare("NEAR", slot, port, values, tolerance, look="APART", other=other, versus=self._port(port))

    def apart_within(
        self, port: str, low: float, high: float, *, other: int = 1, slot: int = 0, versus: str = ""
    ) -> "Check":
        """Expect the difference from another slot's output, or from another port, between two numbers."""
        versus_at = self._port(versus or port)
        return self._compare("WITHIN", slot, port, low, high, look="APART", other=other, versus=versus_at)

    def bits(self, port: str, *, some: int = 0, none: int = 0, exactly: int | None = None, slot: int = 0) -> "Check":
        """Expect bits: these set and those clear, or exactly these."""
        mask, word = (EVERY_BIT, exactly) if exactly is not None else (some | none, some)
        self.lines.append(_Line("BITS", slot, self._port(port), a=mask, b=word))
        return self

    def when(
        self,
        port: str,
        low: float,
        high: float,
        then: Callable[["Check"], object],
        *,
        moved: bool = False,
        slot: int = 0,
    ) -> "Check":
        """Carry out further lines only where all numbers of an output, or their changes, are in a range."""
        at = len(self.lines)
        self._compare("WHEN", slot, port, low, high, look="CHANGE" if moved else "VALUE")
        return self._then(at, then)

    def when_bits(self, port: str, some: int, then: Callable[["Check"], object], slot: int = 0) -> "Check":
        """Carry out further lines only where bits are set."""
        self.lines.append(_Line("WHEN_BITS", slot, self._port(port), a=some, b=some))
        return self._then(len(self.lines) - 1, then)

    def checksum(self, expected: int, slot: int = 0) -> "Check":
        """Expect the checksum of what the calls of all rows returned."""
        self.lines.append(_Line("SUM", slot, a=expected))
        return self

    def _then(self, at: int, then: Callable[["Check"], object]) -> "Check":
        then(self)
        self.lines[at] = replace(self.lines[at], other=len(self.lines) - at - 1)
        self.given.clear()
        return self

    def _compare(
        self, act: str, slot: int, port: str, a: ArrayLike, b: float, *, look: str = "VALUE", other: int = 0,
        versus: int = 0,
    ) -> "Check":  # fmt: skip
        place = self._port(port)
        count = self.module.ports[place - 1].count if place else 1
        every = np.full(count, a) if np.ndim(a) == 0 and count > 1 else a
        first, step = self._column(every, 0 if count == 1 else count, f"{self.title}: {port}")
        second = self._column(b)[0]
        self.lines.append(_Line(act, slot, place, look, other, versus, step, first, second))
        return self

    def _port(self, name: str) -> int:
        if name == ANSWER:
            return 0
        return 1 + [port.name.split(" [")[0] for port in self.module.ports].index(name)

    def _column(self, values: ArrayLike, count: int = 0, what: str = "") -> tuple[int, int]:
        """Place of the first number, and how far it is from row to row: 0 where all rows have the same.

        Each row has `count` numbers, 0 for one that is no array; `what` they are is written beside them.
        """
        table = np.asarray(values, dtype=np.float64)
        single = table.ndim == (1 if count else 0)
        if not single and len(table) != self.rows:
            raise ValueError(f'"{self.title}": {len(table)} rows of numbers for {self.rows} of the check')
        return self.script.place(table.ravel(), f"{self.module.name}, {what}"), 0 if single else max(1, count)


@dataclass(slots=True, kw_only=True)
class Script:
    """All checks of a self test, in order, and their numbers."""

    precision: Precision
    prefix: str
    checks: list[Check] = field(default_factory=list)
    numbers: bytearray = field(default_factory=bytearray)
    parts: list[tuple[int, str]] = field(default_factory=list)  # how many numbers, and what they are

    def check(self, module: ModuleRecord, name: str, rows: int = 1) -> Check:
        """A further check; its name is a claim."""
        self.checks.append(made := Check(script=self, module=module, name=name, rows=rows))
        return made

    @property
    def real(self) -> type[np.floating]:
        """Type of all numbers."""
        return np.float32 if self.precision is Precision.FLOAT else np.float64

    @property
    def one_rounding(self) -> float:
        """Relative difference that the type of numbers leaves after some operations."""
        return 1e-6 if self.precision is Precision.FLOAT else 1e-12

    def rounding(self, values: ArrayLike) -> float:
        """Difference by rounding of numbers of this size."""
        sizes = np.abs(np.asarray(values, dtype=np.float64))
        finite = sizes[np.isfinite(sizes)]
        return self.one_rounding * (1.0 + float(finite.max(initial=0.0)))

    def place(self, values: FloatArray, what: str) -> int:
        """Place of numbers in a row; those that are there already are not stored again."""
        with np.errstate(over="ignore"):
            part = np.where(np.isnan(values), math.nan, np.clip(values, -1e300, 1e300))
            # as C reads its literals: bounds in the headers are written with as many digits
            part = np.array([float(literal(v, self.precision).rstrip("f")) for v in part.tolist()]).astype(self.real)
        part[np.isinf(values)] = values[np.isinf(values)]
        wanted, size = part.tobytes(), part.itemsize
        at = self.numbers.find(wanted)
        while at >= 0 and at % size:
            at = self.numbers.find(wanted, at + 1)
        if at < 0:
            at = len(self.numbers)
            self.numbers += wanted
            self.parts.append((len(part), what))
        return at // size

    def text(self, headers: Sequence[str], provenance: str, *, helpers: str = "", drive: str = "") -> dict[str, str]:
        """The self test by file name: the fixed program, and the data with adapters of the modules.

        `helpers` are functions of C that calls use, `drive` is a function `drive` that calls the modules at random.
        """
        prefix, modules = self.prefix, list[ModuleRecord]()
        for check in self.checks:
            if check.module not in modules:
                modules.append(check.module)
        firsts = np.cumsum([0, *(len(check.lines) for check in self.checks)])
        data = _TEMPLATES.get_template("self_test_data.h.j2").render(
            prefix=prefix,
            provenance=provenance,
            headers=headers,
            record=core_file("self_test_record.h", prefix),
            modules=modules,
            inputs=max(sum(max(1, n) for n in module.inputs.values()) for module in modules),
            checks=[
                (check, modules.index(check.module), int(first))
                for check, first in zip(self.checks, firsts[:-1], strict=True)
            ],
            numbers=self._numbers(),
            slots=SLOTS,
            mean_of=MEAN_OF,
            helpers=helpers,
            drive=drive,
        )
        top = f"/* Self test.\n *\n{provenance}\n */\n"
        return {"self_test.c": top + core_file("self_test.c", prefix), "self_test_data.h": data}

    def _numbers(self) -> list[tuple[str, str]]:
        """Numbers in their order, and what they are where it is a column of them."""
        found = np.frombuffer(bytes(self.numbers), dtype=self.real).astype(np.float64).tolist()
        items = iter([_number(value, self.precision, self.prefix) for value in found])
        texts, single = list[tuple[str, str]](), list[str]()
        for count, what in self.parts:
            part = list(itertools.islice(items, count))
            if count < _COLUMN:
                single += part
                continue
            texts += [("further numbers", _wrapped(single))] if single else []
            texts.append((what, _wrapped(part)))
            single = []
        return texts + ([("further numbers", _wrapped(single))] if single else [])


def _number(value: float, precision: Precision, prefix: str) -> str:
    if math.isfinite(value):
        return literal(value, precision)
    return f"({prefix}_real)NAN" if math.isnan(value) else f"{'-' if value < 0 else ''}({prefix}_real)INFINITY"


def _wrapped(items: Sequence[str]) -> str:
    return ",\n".join("    " + ", ".join(items[k : k + 6]) for k in range(0, len(items), 6))
