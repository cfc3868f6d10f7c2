"""Table [measurement]: how measured files are to be read."""

from dataclasses import dataclass
from enum import StrEnum

from tendonff.models.errors import ParameterError, require, require_given


class Explain(StrEnum):
    """Tension to predict from the other one."""

    # chosen from the data: the output from the input's history, or the input from the output and the motion
    AUTO = "auto"
    OUTPUT = "output"  # from the input tension's history: one driven end, a load that moves only with the tendon
    INPUT = "input"  # from output tension and input position: the output tension is imposed by something else
    # position of the input end from its tension's history: nothing is measured at the far end
    POSITION = "position"


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """How measured files are to be read; the defaults are the file contract."""

    # names of columns; those of positions and force are optional ones, the force that of the actuator before its own
    # friction, read as actuator_force_N unless named
    time_column: str = "time_s"
    input_column: str = "input_tension_N"
    output_column: str = "output_tension_N"
    input_position_column: str = "input_position_m"
    output_position_column: str = "output_position_m"
    actuator_force_column: str | None = None
    # what a number in the file is multiplied by to give s, N or m (rad where the tensions are torques), not 0; 9.81 for
    # kg, -1 reverses a sign
    time_scale: float = 1.0
    input_scale: float = 1.0
    output_scale: float = 1.0
    input_position_scale: float = 1.0
    output_position_scale: float = 1.0
    actuator_force_scale: float | None = None
    columns: tuple[str, ...] | None = None  # names of the columns of a text file without a header
    # what turns other quantities into tensions and positions: a current into a torque [N m/A], a torque into a tension
    # and an angle into a position [m], and revolutions of the motor into those of the drum [-]
    torque_constant_N_m_per_A: float | None = None
    drum_radius_m: float | None = None
    gear_ratio: float | None = None
    # what is not known of the cells' gains, and of the tendon's values where the files do not tell them: half-widths of
    # their 95 % intervals as shares of the values; they widen the intervals of what is fitted
    gain_uncertainty: float = 0.0
    kept_uncertainty: float = 0.0
    # what the cells read without tension, after the scale [N]; subtracted. Default: found from slack samples
    input_offset_N: float | None = None
    output_offset_N: float | None = None
    tare_s: tuple[float, float] | None = None  # from and to [s]: the tendon is slack there, the cells are set to zero
    skip_s: float | None = None  # left out at the start of every file; default: until its start-up transient is over
    cutoff_Hz: float | None = None  # of the zero-phase low-pass that both channels go through; default: from the noise
    explain: Explain = Explain.AUTO
    # columns of tensions between the ends, scaled as the input, and the wrap angle from the actuator to each: friction
    # is told by section
    tension_columns: tuple[str, ...] | None = None
    tension_angles_rad: tuple[float, ...] | None = None
    # what the law of a driven output (explain = "input") has besides [friction], as `identify` writes it: stiffness of
    # what pulls on the input end beside the tendon and where it does not pull, and s of two strands whose bristles are
    # e^s times as stiff and as soft as soft_bristle_stiffness_N_per_m
    guide_stiffness_N_per_m: float | None = None
    guide_zero_m: float | None = None
    bristle_spread: float | None = None

    def __post_init__(self) -> None:
        require("time_scale", self.time_scale, above=0, hint="0.001 turns milliseconds into seconds")
        scales = ("input_scale", "output_scale", "input_position_scale", "output_position_scale")
        for name in (*scales, *(("actuator_force_scale",) if self.actuator_force_scale is not None else ())):
            require(name, getattr(self, name), hint="9.81 turns kg into N")
            if getattr(self, name) == 0:
                raise ParameterError(f"{name} must not be 0, which would erase the channel; leave it out for no factor")
        for name in ("input_offset_N", "output_offset_N"):
            require_given(name, getattr(self, name), hint="leave it out to have it found from slack samples")
        for name in ("guide_stiffness_N_per_m", "guide_zero_m", "bristle_spread"):
            require_given(name, getattr(self, name), hint="leave it out for none")
        for name in ("torque_constant_N_m_per_A", "drum_radius_m", "gear_ratio"):
            require_given(name, getattr(self, name), above=0, hint="leave it out where no column needs it")
        for name in ("gain_uncertainty", "kept_uncertainty"):
            require(name, getattr(self, name), least=0, hint="0.02 is +-2 %")
        self._check_cells()
        if self.tare_s is not None and not 0 <= self.tare_s[0] < self.tare_s[1]:
            raise ParameterError(
                f"tare_s must be from and to, 0 <= from < to, got {list(self.tare_s)}; give when the tendon is slack"
            )
        require_given("skip_s", self.skip_s, least=0, hint="use 0 to keep every row")
        require_given("cutoff_Hz", self.cutoff_Hz, above=0, hint="leave it out to have it found from the noise")

    def _check_cells(self) -> None:
        """Every cell between the ends has a place of its own."""
        columns, angles = self.tension_columns or (), self.tension_angles_rad or ()
        if len(columns) != len(angles) or len(set(angles)) < len(angles):
            raise ParameterError(
                f"tension_angles_rad must have an angle of its own for each of tension_columns, got {list(angles)} for "
                f"{list(columns)}"
            )
        for angle in angles:
            require("tension_angles_rad", angle, above=0, hint="the wrap angle from the actuator to the cell")
