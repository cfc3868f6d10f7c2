"""What a transmission is made of: path, tendon, friction, drive and load, and how well they are known."""

from tendonff.models.parameters.transmission import Actuator, Friction, Load, Path, Tendon, Transmission

__all__ = ["Actuator", "Friction", "Load", "Path", "Tendon", "Transmission"]
