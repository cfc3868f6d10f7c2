"""The commands of a design, to be sent sample by sample."""

import numpy as np

from tendonff.compensator.export.driven.module import ENDED, Content, Designed, Module
from tendonff.ocp.joint.target import ConstantData


def _content(designed: Designed, data: ConstantData) -> Content:
    task = designed.task
    command = task.commanded(designed.motor_rad)
    if task.is_periodic:
        command = command[:-1]  # its last row is the first of the next period
    record = [f"{len(command)}u", str(designed.motors), str(int(task.is_periodic)), data.array(command.ravel())]
    end = command[:2] if task.is_periodic else command[[-1, -1]]
    played = np.vstack([command[:1], command, end])
    status = np.zeros(len(played), dtype=np.int64)
    status[1 + len(command) :] = 0 if task.is_periodic else ENDED
    return Content(record=record, given=np.empty((len(played), 0)), command_rad=played, status=status)


PROFILE = Module(
    name="profile",
    content="commands of the design, sent sample by sample",
    about=(
        "Play and lag of the drive are taken back with the whole reference known. After the last sample the command",
        "stays, with the status ENDED; of a cycle comes its first one again, in the steady state: lead the motors to",
        "the first command before.",
    ),
    state=("uint32_t index; /* of the sample that the next step plays */",),
    build=_content,
)
