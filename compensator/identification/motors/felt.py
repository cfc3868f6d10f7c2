"""Torques as several motors feel them: columns of torque, of current, or of tension cells at the drums."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from tendonff.compensator.files.formats.table import Table
from tendonff.compensator.files.quantities import FORCE_UNITS
from tendonff.compensator.files.reading import nearest_column
from tendonff.compensator.files.text import InputError
from tendonff.compensator.identification.motors.columns import Channel, Column, find, motor_current, motor_torque
from tendonff.models.joint.parameters.finger import Motor


def _torque_of(motor: Motor) -> Channel:
    return motor_torque((f"motor_torque_{motor.name}_N_m",), (motor.name,))


def _current_of(motor: Motor) -> Channel:
    return motor_current((f"motor_current_{motor.name}_A",), (motor.name,))


def _cell_of(tendon: str) -> Channel:
    return Channel(usual=(f"tension_{tendon}_at_drum_N",), stems={f"tension_{tendon}_at_drum": ""}, units=FORCE_UNITS)


def felt_channels(motors: Sequence[Motor]) -> list[Channel]:
    """Channels of torque, current and tensions at the drums of all motors."""
    cells = [_cell_of(tendon) for motor in motors for tendon in motor.winds]
    return [*map(_torque_of, motors), *map(_current_of, motors), *cells]


def felt_columns(
    table: Table, motors: Sequence[Motor], file: Path, named: Mapping[str, str]
) -> tuple[list[list[Column]], bool]:
    """Columns of each motor whose sum is its torque in N m, and whether they are those of cells.

    Where a motor has neither torque nor current, cells at all drums take their place.
    """
    drums = [list(zip(motor.winds, motor.winding_m, strict=True)) for motor in motors]
    cells = [[(find(table, _cell_of(tendon), file, named), winding) for tendon, winding in own] for own in drums]
    pulled = [[replace(c, factor=c.factor * w) for c, w in own if c is not None] for own in cells]
    whole = all(len(own) == len(motor.winds) for own, motor in zip(pulled, motors, strict=True))
    plain = [*map(_torque_of, motors), *map(_current_of, motors)]
    if whole and not any(find(table, each, file, named) for each in plain):
        return pulled, True
    return [[_torque(table, motor, file, named)] for motor in motors], False


def _torque(table: Table, motor: Motor, file: Path, named: Mapping[str, str]) -> Column:
    torque, current = _torque_of(motor), _current_of(motor)
    if (found := find(table, torque, file, named)) is not None:
        return found
    constant = motor.drive.torque_constant_N_m_per_A
    if (found := find(table, current, file, named)) is not None and constant is not None:
        return replace(found, factor=constant * found.factor)
    if found is not None:
        raise InputError(
            f"{file.name}: {found.name} needs the torque constant: torque_constant_N_m_per_A in [[motors]] "
            f'"{motor.name}"'
        )
    name = torque.usual[0]
    raise InputError(
        f'{file.name}: column "{name}" is missing{nearest_column(name, tuple(table.columns))}; log the torque of each '
        f"motor, its current as {current.usual[0]}, or tensions at the drums as {_cell_of(motor.winds[0]).usual[0]}"
    )
