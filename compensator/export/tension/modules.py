"""Modules of a tension as a self test calls them: inputs, functions and members of their states."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from tendonff.compensator.export.script import ModuleRecord, Port
from tendonff.models.tendon.chain import Chain

SHARED = {"reference": 0, "dt": 0, "force": 0, "samples": 0}


def _output(member: str = "output") -> tuple[Port, ...]:
    return (
        Port(name="force [N]", member=f"{member}.force"),
        Port(name="status", member=f"{member}.status", kind="u"),
        Port(name="seen", member=f"{member}.seen", kind="u"),
        Port(name="least force [N]", member=f"{member}.low"),
        Port(name="largest force [N]", member=f"{member}.high"),
        Port(name="largest change [N]", member=f"{member}.change"),
    )


_ENTRY = (
    Port(name="followed [N]", member="entry.last"),
    Port(name="samples left", member="entry.left"),
    Port(name="waiting [s]", member="entry.waiting"),
    Port(name="lost", member="entry.lost", kind="i"),
)


def friction_place(chain: Chain) -> int:
    """Of the first mass's friction among the states."""
    layout = chain.layout
    return layout.part(layout.friction_states[0]).start if layout.friction_states else 0


def record_helper(prefix: str, parameters: Sequence[str]) -> str:
    """Function of C that makes a record of parameters of inputs."""
    members = "".join(f"    test_record.{name} = in[{k}];\n" for k, name in enumerate(parameters))
    return (
        f"\nstatic {prefix}_parameters test_record;\n"
        f"static const {prefix}_parameters *test_parameters_of(const {prefix}_real *in)\n"
        f"{{\n{members}    return &test_record;\n}}\n"
    )


def called(
    name: str,
    prefix: str,
    parameters: int,
    joints: int,
    ports: Sequence[Port] = (),
    *,
    more: Mapping[str, int] = MappingProxyType({}),
    further: Mapping[str, str] = MappingProxyType({}),
    inputs: Mapping[str, int] = MappingProxyType({}),
) -> ModuleRecord:
    """A module that follows a reference.

    `more` are inputs that its steps take beside it, `further` calls of its own with their `inputs`.
    """
    call, joint = f"{prefix}_{name}", ", &{joint}" if joints else ""
    given = "".join(f", {{{each}}}" for each in more) + joint
    calls = {
        "init": f"{call}_init(self, {{reference}})",
        "init_at": f"{call}_init_at(self, {{reference}}, {{force}}{joint if name == 'adaptive' else ''})",
        "step": f"answer = (double){call}_step(self, {{reference}}{given})",
        "step_dt": f"answer = (double){call}_step_dt(self, {{dt}}, {{reference}}{given})",
        "missed": f"{call}_missed(self, (int32_t){{samples}})",
        "use": f"answer = (double){call}_use(self, test_parameters_of(&{{record}}))",
    }
    return ModuleRecord(
        name=name,
        type=call,
        inputs={**SHARED, "record": parameters, **({"joint": joints} if joints else {}), **more, **inputs},
        calls={**calls, **further},
        ports=(*_output(), *_ENTRY, *ports),
    )


def inverse(
    prefix: str,
    parameters: int,
    joints: int,
    chain: Chain,
    settable: Sequence[str],
    *,
    servo: bool,
) -> ModuleRecord:
    """The exact inverse; `settable` are members that follow from the parameters."""
    layout, count = chain.layout, chain.count
    friction_at, near, links = friction_place(chain), layout.part("q_a").start, layout.part("e").start
    stretched = " + ".join(f"(double)self->chain.x[{links + k}]" for k in range(count + 1))
    friction = " + ".join(f"(double)self->chain.x[{friction_at + k}]" for k in range(count))
    own = [
        *([Port(name="command [m]", member="command")] if servo else []),
        Port(name="states", member="chain.x", count=layout.size),
        Port(name="states before", member="chain.x_old", count=layout.size),
        Port(name="tension at the start [N]", member="start"),
        *(Port(name=member, member=member) for member in settable),
    ]
    further = {
        "set_mu": f"{prefix}_inverse_set_mu(self, {{mu}})",
        "mu": f"answer = (double){prefix}_inverse_mu(self)",
        "friction": f"answer = {friction}",
        "stretch": f"answer = ((double)self->chain.x[{near}] - (double)self->chain.x[{near + 1}]) - ({stretched})",
    }
    return called("inverse", prefix, parameters, joints, own, further=further, inputs={"mu": 0})


def stream(prefix: str, parameters: int, joints: int, servo: bool) -> ModuleRecord:
    """The inverse behind a filter."""
    own = [
        *([Port(name="command [m]", member="inverse.command")] if servo else []),
        Port(name="load-independent friction [N]", member="inverse.adhesion"),
        Port(name="least reference [N]", member="low"),
        Port(name="largest reference [N]", member="high"),
    ]
    return called("stream", prefix, parameters, joints, own)


def adaptive(
    prefix: str, parameters: int, joints: int, chain: Chain, tuned: int, mu: float, mu_index: int, *, other: bool
) -> ModuleRecord:
    """The inverse that tunes itself; with `other` friction of both directions."""
    first = friction_place(chain)
    sums = {
        name: " + ".join(f"(double)self->tuner.{member}[{first + k}]" for k in range(chain.count))
        for name, member in (("friction", "x"), ("friction of the inverse", "inverse_x"))
    }
    keep = f"{{{{ {prefix}_adaptive_memory memory; "
    fill = "".join(f"memory.factor[{k}] = {{{'factor' if k == 0 else 'second_factor'}}}; " for k in range(tuned))
    further = {
        "mu": f"answer = (double){prefix}_adaptive_mu(self)",
        "mu ratio": f"answer = (double){prefix}_adaptive_mu(self) / {mu!r}",
        **({"mu_release": f"answer = (double){prefix}_adaptive_mu_release(self)"} if other else {}),
        "restore": f"{keep}{fill}{prefix}_adaptive_restore(self, &memory); }}}}",
        "save": f"{keep}{prefix}_adaptive_save(self, &memory); answer = (double)memory.factor[0]; }}}}",
        **{name: f"answer = {text}" for name, text in sums.items()},
    }
    tuner = {
        "prediction": "y", "factor": "f[0]", "safe factor": "safe_f[0]", "safe factor of mu": f"safe_f[{mu_index}]",
        "factor of the inverse": "inverse_f[0]",
        "error": "error", "stale": "stale", "level": "level", "correction": "correction", "drift": "drift",
        "model": "x[0]", "force of the model [N]": "force",
    }  # fmt: skip
    own = [Port(name=name, member=f"tuner.{member}") for name, member in tuner.items()]
    own += [Port(name=name, member=f"tuner.{name}", kind="n") for name in ("open", "limited")]
    own.append(Port(name="blind", member="blind", kind="i"))
    return called(
        "adaptive", prefix, parameters, joints, own, more={"measured": 0}, further=further,
        inputs={"factor": 0, "second_factor": 0},
    )  # fmt: skip


def plant(prefix: str, joints: int) -> ModuleRecord:
    """The chain itself."""
    call = f"{prefix}_plant"
    return ModuleRecord(
        name="plant",
        type=call,
        inputs={"tension": 0, "given": 0, **({"joint": joints} if joints else {})},
        calls={
            "init": f"{call}_init(self, {{tension}})",
            "step": f"answer = (double){call}_step(self, {{given}}{', &{joint}' if joints else ''})",
            "actuator_position": f"answer = (double){call}_actuator_position(self)",
            "load_position": f"answer = (double){call}_load_position(self)",
        },
        ports=(
            Port(name="tension [N]", member="tension"),
            Port(name="status", member="status", kind="u"),
            Port(name="seen", member="seen", kind="u"),
            Port(name="evaluations", member="evaluations", kind="i"),
            Port(name="states", member="chain.x"),
        ),
    )


def observer(prefix: str, joints: int, count: int, friction_at: int, plays: bool) -> ModuleRecord:
    """The observer of the output tension."""
    call, joint = f"{prefix}_observer", ", &{joint}" if joints else ""
    friction = " + ".join(f"(double)self->chain.x[{friction_at + k}]" for k in range(count))
    of_chain = (
        ()
        if plays
        else (Port(name="states", member="chain.x"), Port(name="evaluations", member="evaluations", kind="i"))
    )
    return ModuleRecord(
        name="observer",
        type=call,
        inputs={"input": 0, "position": 0, "dt": 0, "samples": 0, "output": 0, **({"joint": joints} if joints else {})},
        calls={
            "init": f"{call}_init(self, {{input}})",
            "init_at": f"{call}_init_at(self, {{output}}, {{input}})",
            "step": f"answer = (double){call}_step(self, {{input}}, {{position}}{joint})",
            "step_dt": f"answer = (double){call}_step_dt(self, {{dt}}, {{input}}, {{position}}{joint})",
            "missed": f"{call}_missed(self, (int32_t){{samples}})",
            "friction": "answer = 0.0" if plays else f"answer = {friction}",
        },
        ports=(
            Port(name="tension [N]", member="output.tension"),
            Port(name="lower bound [N]", member="output.low"),
            Port(name="upper bound [N]", member="output.high"),
            Port(name="status", member="output.status", kind="u"),
            Port(name="seen", member="output.seen", kind="u"),
            *_ENTRY,
            Port(name="lower memory [N]", member="low_memory"),
            Port(name="upper memory [N]", member="high_memory"),
            *of_chain,
        ),
    )


def bounds(prefix: str) -> ModuleRecord:
    """The certified interval."""
    return ModuleRecord(
        name="bounds",
        type=f"{prefix}_bounds",
        inputs={"given": 0},
        calls={"init": f"{prefix}_bounds_init(self, {{given}})", "step": f"{prefix}_bounds_step(self, {{given}})"},
        ports=(
            Port(name="lower bound [N]", member="low"),
            Port(name="upper bound [N]", member="high"),
            Port(name="status", member="status", kind="u"),
        ),
    )


def profile(prefix: str) -> ModuleRecord:
    """The profile."""
    return ModuleRecord(
        name="profile",
        type=f"{prefix}_profile",
        inputs={"index": 0},
        calls={
            "init": f"{prefix}_profile_init(self)",
            "step": f"answer = (double){prefix}_profile_step(self)",
            "at": f"answer = (double){prefix}_profile_at((uint32_t){{index}})",
            "last": f"answer = (double){prefix}_profile_at(UINT32_C(4294967295))",
        },
        ports=_output(),
    )


def limiter(prefix: str, parameters: int) -> ModuleRecord:
    """Limits of force and rate, which all modules share."""
    return ModuleRecord(
        name="limits",
        type=f"{prefix}_output",
        inputs={"force": 0, "record": parameters},
        calls={
            "init": f"{prefix}_output_init(self, {{force}})",
            "set": f"answer = (double){prefix}_output_set(self, {{force}})",
            "hold": f"answer = (double){prefix}_output_hold(self, {prefix.upper()}_INPUT_HELD)",
            "use": f"answer = (double){prefix}_output_use(self, test_parameters_of(&{{record}}))",
        },
        ports=tuple(Port(name=p.name, member=p.member.removeprefix("output.")) if p.kind == "r" else
                    Port(name=p.name, member=p.member.removeprefix("output."), kind="u") for p in _output()),
    )  # fmt: skip


def record(prefix: str, names: Sequence[str]) -> ModuleRecord:
    """The record of parameters."""
    call = f"{prefix}_parameters"
    return ModuleRecord(
        name="parameters",
        type=call,
        inputs={"first": 0, "second": 0, "third": 0},
        calls={
            "init": f"{call}_init(self)",
            "are_good": f"answer = (double){call}_are_good(self)",
            "set_mu": f"answer = (double){call}_set_mu(self, {{first}}, {{second}})",
            "set_adhesion": f"answer = (double){call}_set_adhesion(self, {{first}})",
            "set_limits": f"answer = (double){call}_set_limits(self, {{first}}, {{second}}, {{third}})",
            "set_references": f"answer = (double){call}_set_references(self, {{first}}, {{second}})",
        },
        ports=tuple(Port(name=name, member=name) for name in names),
    )


def constants(prefix: str, names: Sequence[str], arrays: Sequence[str] = ()) -> ModuleRecord:
    """Constants of the headers, and arrays of data by place."""
    guard = prefix.upper()
    read = {name: f"answer = (double){guard}_{name}" for name in names}
    read |= {name: f"answer = (double){prefix}_{name}[(uint32_t){{index}}]" for name in arrays}
    return ModuleRecord(name="data", type=f"{prefix}_real", inputs={"index": 0}, calls=read, ports=())
