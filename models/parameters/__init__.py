"""Parts of a transmission: path, tendon, friction, drive and load, and their uncertainty."""

from tendonff.models.parameters.transmission import Actuator, Friction, Load, Path, Tendon, Transmission

__all__ = ["Actuator", "Friction", "Load", "Path", "Tendon", "Transmission"]
