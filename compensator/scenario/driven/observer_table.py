"""Table [observer] of a driven joint: laws by which its angle and torque follow from angle and torque of the motor."""

from dataclasses import dataclass

from tendonff.models.capstan import CapstanLaw
from tendonff.models.errors import ParameterError, require
from tendonff.models.joint.quasi_static import LoopSensor, LoopTorque

_TORQUE = (
    "torque_pull_exponent",
    "torque_release_exponent",
    "torque_preload_N_m",
    "torque_spring_N_m_per_rad",
    "torque_offset_N_m",
    "torque_slid_rad",
    "torque_band_N_m",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverTable:
    """Laws of a loop that something else loads, as `identify` fits them.

    Parameters
    ----------
    angle_pull_exponent, angle_release_exponent : float
        mu theta of the memory that stretches the tendons, pulling and releasing [-], >= 0.
    angle_preload_N_m : float
        Pre-tension in it, as torque of the motor [N m], >= 0.
    angle_gain : float
        Angle of the joint over angle of the motor [-].
    angle_compliance_rad_per_N_m : float
        Angle of the joint by the motor's torque alone [rad/(N m)].
    angle_elongation_rad_per_N_m : float
        Angle of the joint by the mean torque along the path [rad/(N m)].
    angle_zero_rad : float
        Angle of the joint where angle and torque of the motor are 0 [rad].
    angle_band_rad : float
        Half-width of the 95 % interval of the angle [rad], >= 0.
    torque_pull_exponent, torque_release_exponent : float, optional
        mu theta from the motor to the joint, pulling and releasing [-], >= 0. All keys of the torque, or none.
    torque_preload_N_m : float, optional
        Pre-tension, as torque of the motor [N m], >= 0.
    torque_spring_N_m_per_rad : float, optional
        Spring of the drive [N m/rad].
    torque_offset_N_m : float, optional
        Torque at the joint where that of the motor is 0 in all other respects [N m].
    torque_slid_rad : float, optional
        Turn of the motor one way after which the loop slides [rad], > 0.
    torque_band_N_m : float, optional
        Half-width of the 95 % interval of the torque [N m], >= 0.
    """

    angle_pull_exponent: float
    angle_release_exponent: float
    angle_preload_N_m: float
    angle_gain: float
    angle_compliance_rad_per_N_m: float
    angle_elongation_rad_per_N_m: float
    angle_zero_rad: float
    angle_band_rad: float
    torque_pull_exponent: float | None = None
    torque_release_exponent: float | None = None
    torque_preload_N_m: float | None = None
    torque_spring_N_m_per_rad: float | None = None
    torque_offset_N_m: float | None = None
    torque_slid_rad: float | None = None
    torque_band_N_m: float | None = None

    def __post_init__(self) -> None:
        missing = [name for name in _TORQUE if getattr(self, name) is None]
        if missing and len(missing) < len(_TORQUE):
            raise ParameterError(f"{', '.join(missing)} is missing; give all keys torque_... or none")
        kinds = ("angle", "torque") if not missing else ("angle",)
        for name in (f"{kind}_{key}" for kind in kinds for key in ("pull_exponent", "release_exponent", "preload_N_m")):
            require(name, getattr(self, name), least=0, hint="use 0 for none")
        require("angle_band_rad", self.angle_band_rad, least=0, hint="use 0 for none")
        if not missing:
            require("torque_band_N_m", self.torque_band_N_m or 0.0, least=0, hint="use 0 for none")
            require(
                "torque_slid_rad", self.torque_slid_rad or 0.0, above=0, hint="0.02 of the motor's range suits most"
            )

    @property
    def angle(self) -> LoopSensor:
        """Law of the angle."""
        return LoopSensor(
            law=CapstanLaw(
                pull_exponent=self.angle_pull_exponent,
                release_exponent=self.angle_release_exponent,
                adhesion_N=self.angle_preload_N_m,
            ),
            gain=self.angle_gain,
            compliance=self.angle_compliance_rad_per_N_m,
            elongation=self.angle_elongation_rad_per_N_m,
            zero_rad=self.angle_zero_rad,
        )

    @property
    def torque(self) -> LoopTorque | None:
        """Law of the torque; None without its keys."""
        numbers = [getattr(self, name) for name in _TORQUE[:-1]]
        if any(value is None for value in numbers):
            return None
        pull, release, preload, spring, offset, slid = map(float, numbers)
        law = CapstanLaw(pull_exponent=pull, release_exponent=release, adhesion_N=preload)
        return LoopTorque(law=law, spring=spring, offset=offset, slid_rad=slid)

    @classmethod
    def of(
        cls, angle: LoopSensor, angle_band_rad: float, torque: LoopTorque | None, torque_band_N_m: float
    ) -> "ObserverTable":
        """Table of laws that were fitted."""
        more: dict[str, float] = {}
        if torque is not None:
            more = {
                "torque_pull_exponent": torque.law.pull_exponent,
                "torque_release_exponent": torque.law.release_exponent,
                "torque_preload_N_m": torque.law.adhesion_N,
                "torque_spring_N_m_per_rad": torque.spring,
                "torque_offset_N_m": torque.offset,
                "torque_slid_rad": torque.slid_rad,
                "torque_band_N_m": torque_band_N_m,
            }
        return cls(
            angle_pull_exponent=angle.law.pull_exponent,
            angle_release_exponent=angle.law.release_exponent,
            angle_preload_N_m=angle.law.adhesion_N,
            angle_gain=angle.gain,
            angle_compliance_rad_per_N_m=angle.compliance,
            angle_elongation_rad_per_N_m=angle.elongation,
            angle_zero_rad=angle.zero_rad,
            angle_band_rad=angle_band_rad,
            **more,
        )
