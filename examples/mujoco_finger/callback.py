"""Common part of the plants that MuJoCo calls for its passive forces."""

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Any, Self

import mujoco


class PassiveForces(ABC):
    """A plant in MuJoCo's callback for passive forces: `with` installs it, and takes it off again."""

    @abstractmethod
    def follow(self, data: Any) -> None:
        """Step to the time and the joint angles of MuJoCo."""

    @abstractmethod
    def add(self, model: Any, data: Any) -> None:
        """Add the forces found there to `data.qfrc_passive`."""

    def __call__(self, model: Any, data: Any) -> None:
        """MuJoCo's callback."""
        self.follow(data)
        self.add(model, data)

    def __enter__(self) -> Self:
        mujoco.set_mjcb_passive(self)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        mujoco.set_mjcb_passive(None)
