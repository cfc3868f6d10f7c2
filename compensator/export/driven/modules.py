"""The one list of modules beside the inverse in exports of driven joints, and their text."""

from collections.abc import Sequence

from tendonff.compensator.export.driven.module import ENDED, Content, Designed, Exports, Module
from tendonff.compensator.export.driven.module_checks import check_module
from tendonff.compensator.export.driven.profile import PROFILE
from tendonff.compensator.export.driven.table import TABLE
from tendonff.compensator.export.motors import JudgedJoint, rms_of
from tendonff.compensator.export.script import Script
from tendonff.compensator.export.text.fixed import core_file
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.codegen.templates import environment
from tendonff.ocp.joint.target import ConstantData

MODULES: tuple[Module, ...] = (PROFILE, TABLE)
"""A further module is one entry here: its record, and its fixed text `core/tff_NAME.c`, `core/tff_NAME_record.h`."""

_TEMPLATES = environment("tendonff.compensator.export", "templates/driven")


def modules_beside(
    designed: Sequence[Designed],
    judged: Sequence[JudgedJoint],
    *,
    prefix: str,
    script: Script,
    include: str,
    provenance: str,
) -> Exports:
    """Files of every module that all of these joints or fingers have.

    Parameters
    ----------
    designed : sequence of Designed
        In the order of their numbers in C.
    judged : sequence of JudgedJoint
        Errors of their inverse and of the ratio alone.
    prefix : str
    script : Script
        Takes their checks.
    include : str
        Header of their inverse.
    provenance : str
        Lines of the comment on top.
    """
    refused = {name: reason for each in designed for name, reason in each.task.without.items()}
    written, kept = dict[str, str](), list[Module]()
    errors, harmful = dict[str, str](), list[str]()
    for module in MODULES:
        if module.name in refused:
            continue
        data = ConstantData(f"{prefix}_{module.name}", script.precision)
        contents = [module.build(each, data) for each in designed]
        stated, reason = _stated(designed, contents, judged)
        if reason:
            refused[module.name] = reason
            harmful.append(module.name)
            continue
        errors |= {module.name: stated} if stated else {}
        kept.append(module)
        check_module(script, module, contents, prefix)
        written |= module_files(module, contents, data, prefix, include, provenance)
    return Exports(files=written, modules=tuple(kept), refused=refused, errors=errors, harmful=tuple(harmful))


def _stated(designed: Sequence[Designed], contents: Sequence[Content], every: Sequence[JudgedJoint]) -> tuple[str, str]:
    """RMS errors in words, and why one is of no use; empty where nothing is judged, or nothing speaks against it."""
    found = []
    for each, content, judged in zip(designed, contents, every, strict=True):
        if content.reference_rad is None:
            return "", ""
        error = rms_of(each.task, content.reference_rad)
        if error >= judged.plain_rms:
            plain = judged.text(judged.plain_rms)
            return "", f"the RMS error of {judged.name} is {judged.text(error)}, by the ratio alone {plain}"
        found.append(f"{judged.name} {judged.text(error)}")
    return ", ".join(found), ""


def module_files(
    module: Module, contents: Sequence[Content], data: ConstantData, prefix: str, include: str, provenance: str
) -> dict[str, str]:
    """Texts of a module by file name, of its contents and the constant data that they have filled."""
    precision = data.precision
    data.rows("record", "records", [content.record for content in contents])
    context = {
        "prefix": prefix,
        "guard": prefix.upper(),
        "module": module,
        "include": include,
        "provenance": provenance,
        "motors": max(content.command_rad.shape[1] for content in contents),
        "ended": ENDED,
        "number": len(contents),
        "num": lambda value: literal(float(value), precision),
    }
    top = f"/* Numbers of the {module.name}.\n *\n{provenance}\n */\n"
    head = f"{prefix}_{module.name}"
    return {
        f"{head}.h": _TEMPLATES.get_template("module.h.j2").render(context),
        f"{head}.c": core_file(f"{module.name}.c", prefix),
        f"{head}_data.h": f"{top}{core_file(f'{module.name}_record.h', prefix)}\n" + "\n".join(data.lines) + "\n",
    }
