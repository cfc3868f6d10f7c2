"""Table [measurement]: how measured files are to be read."""

import math
from dataclasses import dataclass
from enum import StrEnum

from tendonff.models.errors import ParameterError, require, require_given


class Explain(StrEnum):
    """Tension to predict from the other one."""

    # chosen from the data: the output from the input's history, or the input from the output and the motion
    AUTO = "auto"
    OUTPUT = "output"  # from the input tension's history: one driven end, a load that moves only with the tendon
    INPUT = "input"  # from output tension and input position: the output tension is imposed by something else
    # position of the near end from its tension's history: nothing is measured at the far end
    POSITION = "position"


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """Format of measured files; the defaults are the file contract.

    Attributes
    ----------
    time_column, input_column, output_column : str
        Columns of the time, and of the tension at the near and at the far end.
    input_position_column, output_position_column : str
        Columns of the positions of both ends; read where they are there.
    actuator_force_column : str or None
        Column of the actuator's force before its own friction; default: `actuator_force_N`, where it is there.
    time_scale, input_scale, output_scale, input_position_scale, output_position_scale : float
        Factor that makes a number of the file one in s, N or m (rad where the tensions are torques), not 0: 9.81 for
        kg, -1 reverses a sign.
    actuator_force_scale : float or None
        Factor that makes the actuator's force one in N; default: that of the input.
    columns : tuple of str or None
        Names of the columns of a text file without a header.
    torque_constant_N_m_per_A : float or None
        Factor that turns a current into a torque [N m/A], > 0.
    drum_radius_m : float or None
        Factor that turns a torque into a tension and an angle into a position [m], > 0.
    gear_ratio : float or None
        Revolutions of the motor for one of the drum [-], > 0.
    gain_uncertainty : float or None
        Half-width of the 95 % interval of each tension cell's gain as a share of it [-], >= 0; it widens the intervals
        of what is fitted.
    input_gain, output_gain : float or None
        Reading of the cell over the tension, > 0, by which the readings are divided; default: 1, or found by
        `uniform_s` and `known_output_s`, and written by `identify`.
    uniform_s : tuple of float or None
        Beginning and end of a time in which the tension is the same along the whole path, as before the first stroke
        of a tendon that was tensioned without sliding [s]: the input cell's gain relative to the output cell's is
        found there. The zeros of both cells must be known (`tare_s`, the offsets, or slack samples).
    known_output_s : tuple of float or None
        Beginning and end of a time in which the output tension is `known_output_N` [s]: the output cell's gain is
        found there.
    known_output_N : float or None
        Output tension in `known_output_s` [N], as of a weight, > 0.
    kept_uncertainty : float or None
        The same for the tendon's values where the files do not tell them and the scenario's are kept [-], >= 0;
        default: 0.5.
    input_offset_N, output_offset_N : float or None
        Reading of the cell without tension, after the scale [N], which is subtracted; default: found from slack
        samples.
    tare_s : tuple of float or None
        Beginning and end of a time in which the tendon is slack [s]: the cells are set to zero there.
    skip_s : float or None
        Time that is left out at the start of every file [s]; default: until its start-up transient is over.
    cutoff_Hz : float or None
        Cut-off of the zero-phase low-pass that both channels go through [Hz]; default: found from the noise.
    explain : Explain
        Channel that the model predicts; by default the data decide.
    tension_columns : tuple of str or None
        Columns of tensions between the ends, scaled as the input: friction is identified by section.
    tension_angles_rad : tuple of float or None
        Wrap angle from the actuator to each of these columns [rad].
    channels : tuple of str or None
        "CHANNEL=COLUMN", columns by the channels' usual names: "motor_flexor_rad=motorPosition[2]".
    conditions : tuple of str or None
        "FILE:JOINT=RAD", or "JOINT=RAD" for all files: angles of joints at rest in a measured file, such as
        the bend of a sheath; default: as the scenario says, or by a column JOINT_rad.
    guide_stiffness_N_per_m, guide_zero_m : float or None
        Of a driven output (explain = "input"), as `identify` writes them: stiffness of what pulls on the near end
        beside the tendon [N/m], and position at which it does not pull [m].
    bristle_spread : float or None
        The same: s of two strands whose bristles are e^s times as stiff and as soft as
        soft_bristle_stiffness_N_per_m [-].
    """

    time_column: str = "time_s"
    input_column: str = "input_tension_N"
    output_column: str = "output_tension_N"
    input_position_column: str = "input_position_m"
    output_position_column: str = "output_position_m"
    actuator_force_column: str | None = None
    time_scale: float = 1.0
    input_scale: float = 1.0
    output_scale: float = 1.0
    input_position_scale: float = 1.0
    output_position_scale: float = 1.0
    actuator_force_scale: float | None = None
    columns: tuple[str, ...] | None = None
    torque_constant_N_m_per_A: float | None = None
    drum_radius_m: float | None = None
    gear_ratio: float | None = None
    gain_uncertainty: float | None = None
    input_gain: float | None = None
    output_gain: float | None = None
    uniform_s: tuple[float, float] | None = None
    known_output_s: tuple[float, float] | None = None
    known_output_N: float | None = None
    kept_uncertainty: float | None = None
    input_offset_N: float | None = None
    output_offset_N: float | None = None
    tare_s: tuple[float, float] | None = None
    skip_s: float | None = None
    cutoff_Hz: float | None = None
    explain: Explain = Explain.AUTO
    tension_columns: tuple[str, ...] | None = None
    tension_angles_rad: tuple[float, ...] | None = None
    channels: tuple[str, ...] | None = None
    conditions: tuple[str, ...] | None = None
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
            require_given(name, getattr(self, name), least=0, hint="0.02 is +-2 %")
            if (getattr(self, name) or 0.0) >= 1:
                raise ParameterError(f"{name} must be < 1, got {getattr(self, name):g}; 0.02 is +-2 %")
        self._check_cells()
        times = {
            "tare_s": "the tendon is slack",
            "uniform_s": "the tension is the same along the path",
            "known_output_s": "the output tension is known_output_N",
        }
        for name, what in times.items():
            if (time_s := getattr(self, name)) is not None and not 0 <= time_s[0] < time_s[1]:
                raise ParameterError(
                    f"{name} must be from and to, 0 <= from < to, got {list(time_s)}; give when {what}"
                )
        for name in ("input_gain", "output_gain", "known_output_N"):
            require_given(name, getattr(self, name), above=0, hint="leave it out where it is not known")
        if (self.known_output_s is None) != (self.known_output_N is None):
            raise ParameterError("known_output_s and known_output_N go together; give both or none of them")
        require_given("skip_s", self.skip_s, least=0, hint="use 0 to keep every row")
        require_given("cutoff_Hz", self.cutoff_Hz, above=0, hint="leave it out to have it found from the noise")

    @property
    def named_columns(self) -> dict[str, str]:
        """`channels` as a mapping."""
        return {channel: name for channel, _, name in (text.partition("=") for text in self.channels or ())}

    @property
    def conditions_of_files(self) -> list[tuple[str, str, float]]:
        """`conditions` as file, empty for all of them, joint, and angle [rad]; NaN for no number."""
        found = []
        for text in self.conditions or ():
            place, _, number = text.rpartition("=")
            file, _, joint = place.rpartition(":")
            try:
                found.append((file.strip(), joint.strip(), float(number)))
            except ValueError:
                found.append((file.strip(), joint.strip(), math.nan))
        return found

    def _check_cells(self) -> None:
        """Every cell between the ends has a place of its own, every channel a column, every condition an angle."""
        stated = zip(self.conditions or (), self.conditions_of_files, strict=True)
        if wrong := next((text for text, (_, j, rad) in stated if not (j and math.isfinite(rad))), None):
            raise ParameterError(f'conditions must be FILE:JOINT=RAD, got "{wrong}"; "bent.csv:bend=1.2"')
        if wrong := next((text for text in self.channels or () if not all(text.partition("="))), None):
            raise ParameterError(f'channels must be CHANNEL=COLUMN, got "{wrong}"; "motor_flexor_rad=position[2]"')
        columns, angles = self.tension_columns or (), self.tension_angles_rad or ()
        if len(columns) != len(angles) or len(set(angles)) < len(angles):
            raise ParameterError(
                f"tension_angles_rad must have an angle of its own for each of tension_columns, got {list(angles)} for "
                f"{list(columns)}"
            )
        for angle in angles:
            require("tension_angles_rad", angle, above=0, hint="the wrap angle from the actuator to the cell")
