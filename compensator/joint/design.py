"""Design of a joint's motor angle: three compensators, each verified on a finer mechanism behind the drive."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.joint.output import JointDesign
from tendonff.compensator.joint.reference import JointQuantity
from tendonff.compensator.joint.result import Contribution, JointProfile
from tendonff.compensator.joint.scenario import JointScenario, SampledJoint, sample_joint
from tendonff.models.errors import ParameterError
from tendonff.models.joint.closed_form import DataSheet, GrossSliding, data_sheet, sweep_pretension
from tendonff.models.joint.parameters import DriveKind, JointDrive, Mechanism
from tendonff.models.joint.quasi_static import static_motor_rad
from tendonff.ocp.errors import SolveError
from tendonff.ocp.joint.invert import JointInversion, JointStatus, invert_joint, steady_joint_inverse
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.simulate import JointSimulation, simulate_joint
from tendonff.ocp.joint.start import joint_problem

VERIFYING_MASSES = 40
REFINEMENT = 10
"""The verifying mechanism has more masses and smaller steps than the design."""

ASSUMED_SPREAD = 0.2
"""Relative half-width of what is unknown where [robust] says nothing: friction, stiffness and pre-tension."""

LEAST_DAMPING_RATIO, LEAST_COMMANDS = 0.02, 20.0
"""A joint that damps its resonance less is shaken by commands that come less often than so many times a period [-]."""

_SETTLING_CYCLES = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class JointPlant:
    """A mechanism behind its drive that commands are judged on.

    Attributes
    ----------
    mechanism : Mechanism
    scenario : JointScenario
    sampled : SampledJoint
    masses : int or None
        Masses of each tendon; None for the paths' own.
    refinement : int
        Steps in one of the design.
    """

    mechanism: Mechanism
    scenario: JointScenario
    sampled: SampledJoint
    masses: int | None = None
    refinement: int = 1

    def respond(self, command_rad: FloatArray) -> JointSimulation:
        """Response to commands of the motors, shape (rows, motors), rows as those of the reference.

        Of a reference that repeats, its last cycle after some. SolveError where the simulation fails.
        """
        sampled, step, fine = self.sampled, self.scenario.run.step_s, self.refinement
        wish = self.scenario.reference
        repeats = 1 + _SETTLING_CYCLES if wish.periodic else 1
        time = sampled.time_s
        span = float(time[-1])
        motor = driven(self.mechanism.drive, command_rad, step)
        rows = (len(time) - 1) * fine
        inner = np.arange(rows * repeats + 1) * (step / fine)
        within = np.mod(inner, span) if repeats > 1 else inner
        columns = [np.interp(within, time, column) for column in motor.T]
        if repeats > 1:  # from rest: the motor starts where it stands
            columns = [column * np.minimum(inner / (0.1 * span), 1.0) + 0 * column for column in columns]
        contact = np.interp(within, time, sampled.contact_N_m)
        led = np.interp(within, time, sampled.angle_rad) if wish.quantity is JointQuantity.TORQUE else None
        problem = joint_problem(self.mechanism, self.scenario.run.level, sampled.motion, segments=self.masses)
        run = simulate_joint(
            problem,
            np.column_stack(columns),
            step / fine,
            contact_N_m=contact if led is None else contact[0],
            led_rad=led,
        ).require()
        keep = slice(rows * (repeats - 1), None, fine)
        return replace(
            run,
            time_s=time,
            motor_rad=run.motor_rad[keep],
            motor_torque_N_m=run.motor_torque_N_m[keep],
            angle_rad=run.angle_rad[keep],
            torque_N_m=run.torque_N_m[keep],
            tension_N=run.tension_N[keep],
            drum_N=run.drum_N[keep],
            lowest_N=run.lowest_N[keep],
        )

    def reached(self, run: JointSimulation) -> FloatArray:
        """Quantity of the reference in a run, shape (rows,)."""
        if self.scenario.reference.quantity is JointQuantity.ANGLE:
            return run.angle_rad
        return run.torque_N_m - joint_load(self.mechanism, self.sampled, self.scenario.run.step_s)


def driven(drive: JointDrive, command_rad: FloatArray, step_s: float) -> FloatArray:
    """Angles of the drums at the commanded shaft, shape (rows, motors), for commands.

    These are sampled, rounded, delayed by the servo's lag, and taken through the play of the gear.
    """
    command = np.asarray(command_rad, dtype=np.float64)
    time = np.arange(len(command)) * step_s
    if drive.command_interval_s is not None and drive.command_interval_s > step_s:
        at = np.arange(0.0, time[-1] + drive.command_interval_s, drive.command_interval_s)
        told = np.column_stack([rounded(np.interp(at, time, c), drive.resolution_rad) for c in command.T])
        command = np.column_stack([np.interp(time, at, c) for c in told.T])
    else:
        command = rounded(command, drive.resolution_rad)
    if drive.servo_time_s == 0:
        return played(command, drive.play_rad)
    keep = math.exp(-step_s / drive.servo_time_s)
    # First order, exact for commands that go straight between rows.
    lag = drive.servo_time_s
    reached = np.empty_like(command)
    reached[0] = now = command[0]
    for row in range(1, len(command)):
        slope = (command[row] - command[row - 1]) / step_s
        now = command[row] - slope * lag + (now - command[row - 1] + slope * lag) * keep
        reached[row] = now
    return played(reached, drive.play_rad)


def played(motor_rad: FloatArray, play_rad: float) -> FloatArray:
    """Angles of drums that stand until their motors, in the middle at first, have crossed the play (play operator)."""
    if play_rad == 0:
        return motor_rad
    drum = np.empty_like(motor_rad)
    now = drum[0] = motor_rad[0]
    for row, motor in enumerate(motor_rad):
        now = drum[row] = np.clip(now, motor - play_rad / 2, motor + play_rad / 2)
    return drum


def crossed(drum_rad: FloatArray, drive: JointDrive) -> FloatArray:
    """Angles of motors that have crossed the play wherever their drums turn back."""
    if drive.play_rad == 0:
        return drum_rad
    motor = np.empty_like(drum_rad)
    furthest, side = drum_rad[0].copy(), np.zeros(drum_rad.shape[1])
    for row, drum in enumerate(drum_rad):
        turned = np.abs(drum - furthest) > drive.turning_rad
        ahead = (drum - furthest) * side > 0
        side = np.where(turned & ~ahead, np.sign(drum - furthest), side)
        furthest = np.where(ahead | turned, drum, furthest)
        motor[row] = drum + side * drive.play_rad / 2
    return motor


def known_by_ratio(drive: JointDrive) -> JointDrive:
    """A drive without what a controller that knows the ratio alone does not know either."""
    return replace(drive, servo_time_s=0.0, backlash_rad=0.0)


def rounded(values: FloatArray, resolution: float) -> FloatArray:
    """Values in steps of the resolution, where there is one."""
    return values if resolution == 0 else np.round(values / resolution) * resolution


def commanded(drive: JointDrive, motor_rad: FloatArray, step_s: float, *, live: bool = False) -> FloatArray:
    """Commands whose answer is the wanted angle: play and lag of the servo taken back, the speed within its limit.

    Live, the rate of a motor is known from the samples so far alone, as on a controller.
    """
    command = crossed(motor_rad, drive)
    if drive.servo_time_s > 0:
        rate = _rate_so_far(motor_rad, step_s) if live else np.gradient(motor_rad, step_s, axis=0)
        command = command + drive.servo_time_s * rate
    if drive.speed_max_rad_per_s is None:
        return command
    most, limited = drive.speed_max_rad_per_s * step_s, command.copy()
    for row in range(1, len(command)):
        limited[row] = limited[row - 1] + np.clip(command[row] - limited[row - 1], -most, most)
    return limited


def _rate_so_far(values: FloatArray, step_s: float) -> FloatArray:
    """Rates at the ends of steps that start at rest, of second order [1/s]."""
    change = np.diff(values, axis=0, prepend=values[:1])
    before = np.roll(change, 1, axis=0)
    before[0] = 0.0
    rate: FloatArray = (1.5 * change - 0.5 * before) / step_s
    return rate


def joint_load(mechanism: Mechanism, sampled: SampledJoint, step_s: float) -> FloatArray:
    """Torque that the joint itself takes while it moves as it does, its dry friction included [N m]."""
    joint, angle = mechanism.joint, sampled.angle_rad
    speed = np.gradient(angle, step_s)
    moving = joint.inertia_kg_m2 * np.gradient(speed, step_s) + joint.damping_N_m_s_per_rad * speed
    return moving + joint.coulomb_N_m * np.sign(speed) + joint.static_torque_N_m(angle)


def design_joint(scenario: JointScenario, *, strict: bool = True, progress: Progress = silent) -> JointDesign:
    """Design and verify the motor angles of a joint.

    Parameters
    ----------
    scenario : JointScenario
    strict : bool, optional
        Refuse a reference for which a tendon of a pair would have to push.
    progress : callable, optional

    Raises
    ------
    InputError
        If the reference has no meaning, or cannot be followed.
    SolveError
        If the inverse or a simulation fails.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_joint_scenario("examples/hand_joint.toml")
    >>> result = tf.design_joint(scenario)  # doctest: +SKIP
    >>> print(result.headline)  # doctest: +SKIP
    """
    sampled, mechanism, step = sample_joint(scenario), scenario.mechanism, scenario.run.step_s
    drive = mechanism.drive
    done, total = 0, 10
    try:
        problem = joint_problem(mechanism, scenario.run.level, sampled.motion)
        inversion, notes = inverse_of(scenario, sampled, problem)
    except ParameterError as error:
        raise InputError(f"{scenario.source.name}: {error}") from None
    if inversion.status is JointStatus.FAILED:
        raise SolveError(inversion.message)
    if inversion.status is JointStatus.WOULD_PUSH and strict and drive.kind is DriveKind.PAIR:
        raise InputError(f"{scenario.source.name}: {inversion.message}")
    motors = {
        "linear": linear_motor_rad(scenario, sampled),
        "static": _static(scenario, sampled),
        "inverse": inversion.motor_rad,
    }
    plant = JointPlant(
        mechanism=mechanism,
        scenario=scenario,
        sampled=sampled,
        masses=verifying_masses(mechanism),
        refinement=REFINEMENT,
    )
    profiles, commands = {}, {}
    for name, motor in motors.items():
        command = commanded(drive if name != "linear" else known_by_ratio(drive), motor, step)
        commands[name] = command
        run = plant.respond(command)
        reached, kept = plant.reached(run), slice(sampled.lead, None)
        profiles[name] = JointProfile(
            name=name,
            motor_rad=command[kept],
            reached=reached[kept],
            tension_N=run.tension_N[kept],
            torque_N_m=run.motor_torque_N_m[kept],
            error=(reached - sampled.wanted)[kept],
        )
        progress(done := done + 1, total)
    contributions = _contributions(scenario, sampled, commands["inverse"], lambda k: progress(done + k, total))
    sheet, sheets, warned = _data_sheet(scenario, sampled, inversion)
    warnings = [*notes, *warned, *_drive_warnings(drive, inversion, step), *_ringing(mechanism, sampled)]
    if inversion.status is not JointStatus.EXACT:
        warnings.insert(0, inversion.message)
    progress(total, total)
    return JointDesign(
        scenario=scenario,
        sampled=sampled,
        profiles=profiles,
        inversion=_after(inversion, sampled.lead),
        homing_rad=commands["inverse"][: sampled.lead],
        sheet=sheet,
        sheets=sheets,
        contributions=contributions,
        masses=plant.masses or 0,
        refinement=REFINEMENT,
        warnings=tuple(warnings),
    )


def _after(found: JointInversion, lead: int) -> JointInversion:
    """An inversion without the rows of the homing stroke."""
    rows = slice(lead, None)
    return replace(
        found,
        time_s=found.time_s[rows] - found.time_s[lead],
        motor_rad=found.motor_rad[rows],
        motor_torque_N_m=found.motor_torque_N_m[rows],
        tension_N=found.tension_N[rows],
        drum_N=found.drum_N[rows],
        slack_m=found.slack_m[rows],
        lowest_N=found.lowest_N[rows],
    )


def verifying_masses(mechanism: Mechanism) -> int:
    """Masses of each tendon of the mechanism that commands are judged on."""
    return max(VERIFYING_MASSES, *(2 * tendon.path.segments for tendon in mechanism.tendons))


def inverse_of(
    scenario: JointScenario, sampled: SampledJoint, problem: JointProblem
) -> tuple[JointInversion, tuple[str, ...]]:
    """The exact inverse, of a cycle in its steady state, and what the user should know."""
    step = scenario.run.step_s
    if not scenario.reference.periodic:
        return invert_joint(problem, sampled.angle_rad, step, contact_N_m=sampled.contact_N_m), ()
    found, cycles, steady = steady_joint_inverse(problem, sampled.angle_rad, step, contact_N_m=sampled.contact_N_m)
    if steady:
        return found, ()
    return found, (f"after {cycles} cycles the motor angle still changes; the profile is that of the last one",)


def linear_motor_rad(scenario: JointScenario, sampled: SampledJoint) -> FloatArray:
    """The ratio alone: what the path leaves to the drum; with a wanted torque, what springs without friction take."""
    mechanism, joint = scenario.mechanism, scenario.mechanism.joint.name
    if scenario.reference.quantity is JointQuantity.TORQUE:
        still = np.zeros(len(sampled.time_s))
        load = joint_load(mechanism, sampled, scenario.run.step_s) + sampled.contact_N_m
        return static_motor_rad(mechanism, sampled.angle_rad, load, sampled.others(joint), still)
    travel = [
        t.path_travel_m(sampled.angle_rad, sampled.others(joint))
        - t.path_travel_m(sampled.angle_rad, sampled.others(joint))[0]
        for t in mechanism.tendons
    ]
    motor = mechanism.motor_rad(np.column_stack(travel), float(sampled.angle_rad[0]))
    return motor.mean(axis=1, keepdims=True) if mechanism.drive.kind is DriveKind.LOOP else motor


def _static(scenario: JointScenario, sampled: SampledJoint) -> FloatArray:
    """The quasi-static law: what slides, held by spring, gravity, dry friction and what the joint touches."""
    mechanism = scenario.mechanism
    joint = mechanism.joint
    speed = np.gradient(sampled.angle_rad, scenario.run.step_s)
    held = joint.static_torque_N_m(sampled.angle_rad) + joint.coulomb_N_m * np.sign(speed) + sampled.contact_N_m
    return static_motor_rad(mechanism, sampled.angle_rad, held, sampled.others(joint.name))


def _contributions(
    scenario: JointScenario, sampled: SampledJoint, command: FloatArray, advance: Callable[[int], None]
) -> tuple[Contribution, ...]:
    """Error of the exact inverse with one parameter off, each end on the scenario's own masses."""
    robust, found = scenario.robust, []
    spreads = {
        "friction.mu_dynamic": ASSUMED_SPREAD if robust.is_certain else robust.mu,
        "tendon.stiffness_N_per_m": ASSUMED_SPREAD if robust.is_certain else robust.stiffness,
    }
    if scenario.mechanism.drive.kind is DriveKind.LOOP:
        spreads["drive.pretension_N"] = ASSUMED_SPREAD
    for k, (key, spread) in enumerate(spreads.items()):
        if spread == 0:
            continue
        errors = []
        for factor in (1 - spread, 1 + spread):
            plant = JointPlant(mechanism=_changed(scenario.mechanism, key, factor), scenario=scenario, sampled=sampled)
            errors.append((plant.reached(plant.respond(command)) - sampled.wanted)[sampled.lead :])
        found.append(Contribution(key=key, spread=spread, rms=max(float(np.sqrt(np.mean(e**2))) for e in errors)))
        advance(2 * (k + 1))
    return tuple(sorted(found, key=lambda each: -each.rms))


def _changed(mechanism: Mechanism, key: str, factor: float) -> Mechanism:
    """The mechanism with one number times a factor; release coefficients go with those of pulling."""
    if key == "drive.pretension_N":
        drive = mechanism.drive
        return replace(mechanism, drive=replace(drive, pretension_N=(drive.pretension_N or 0.0) * factor))
    tendons = []
    for tendon in mechanism.tendons:
        if key == "tendon.stiffness_N_per_m":
            tendons.append(replace(tendon, tendon=tendon.tendon.scaled(factor)))
            continue
        names = ("mu_dynamic", "mu_static", "mu_dynamic_release", "mu_static_release")
        given = {name: getattr(tendon.friction, name) for name in names}
        scaled = {name: value * factor for name, value in given.items() if value is not None}
        sections = tuple(
            replace(s, **{n: v * factor for n in names if (v := getattr(s, n)) is not None})
            for s in tendon.path.sections
        )
        tendons.append(
            replace(
                tendon,
                friction=replace(tendon.friction, **scaled),
                path=replace(tendon.path, sections=sections),
            )
        )
    return replace(mechanism, tendons=tuple(tendons))


def _data_sheet(
    scenario: JointScenario, sampled: SampledJoint, inversion: JointInversion
) -> tuple[DataSheet | None, tuple[tuple[float, DataSheet], ...], list[str]]:
    """Closed forms of a loop, the same over pre-tensions, and what they warn of."""
    mechanism = scenario.mechanism
    if mechanism.drive.kind is not DriveKind.LOOP:
        return None, (), []
    others = {name: float(q[0]) for name, q in sampled.others(mechanism.joint.name).items()}
    law = GrossSliding.of(mechanism, float(sampled.angle_rad[0]), others)
    load = joint_load(mechanism, sampled, scenario.run.step_s) + sampled.contact_N_m
    largest = float(np.abs(load).max())
    sheet = data_sheet(law, largest)
    tension = mechanism.drive.pretension_N or 0.0
    most = max(2 * tension, 2 * sheet.recommended_pretension_N, 1e-3)
    grid = np.linspace(0.1, 1.0, 10) * most
    warned = []
    home = mechanism.drive.homing_rad
    if 0 < home < 4 * sheet.lost_motion_rad:
        warned.append(
            f"homing_rad = {home:g} hardly slides the tendons through; {5 * sheet.lost_motion_rad:.2g} rad leaves a "
            "margin"
        )
    if tension < sheet.least_pretension_N and inversion.status is JointStatus.EXACT:
        warned.append(
            f"pretension_N = {tension:g} is below {sheet.least_pretension_N:.3g} N, at which the largest torque makes "
            f"a tendon slack in steady sliding; {sheet.recommended_pretension_N:.3g} N leaves a margin"
        )
    elif sheet.recommended_pretension_N > 0 and tension > 3 * sheet.recommended_pretension_N:
        warned.append(
            f"pretension_N = {tension:g} is more than the torque asks for; {sheet.recommended_pretension_N:.3g} N "
            "would make lost motion and friction of the drive that much smaller"
        )
    return sheet, tuple(zip(grid.tolist(), sweep_pretension(law, largest, grid), strict=True)), warned


def _ringing(mechanism: Mechanism, sampled: SampledJoint) -> list[str]:
    """Effect of stepped commands on a joint that hardly damps its own resonance between the tendons."""
    interval, joint = mechanism.drive.command_interval_s, mechanism.joint
    if interval is None:
        return []
    arms = mechanism.arms_at(float(sampled.angle_rad[0]))
    parts = [(t.tendon.stiffness_N_per_m, t.tendon.damping_N_s_per_m) for t in mechanism.tendons]
    stiffness = joint.stiffness_N_m_per_rad + math.fsum(k * arm**2 for (k, _), arm in zip(parts, arms, strict=True))
    damping = joint.damping_N_m_s_per_rad + math.fsum(c * arm**2 for (_, c), arm in zip(parts, arms, strict=True))
    ratio = damping / (2 * math.sqrt(stiffness * joint.inertia_kg_m2))
    frequency = math.sqrt(stiffness / joint.inertia_kg_m2) / (2 * math.pi)
    if ratio > LEAST_DAMPING_RATIO or 1 / interval > LEAST_COMMANDS * frequency:
        return []
    text = (
        f"the joint rings at {frequency:.3g} Hz with {100 * ratio:.2g} % of critical damping: commands every "
        f"{interval:g} s shake it, and what friction stores leaks away while it stands; more commands a second or more "
        "damping help"
    )
    return [text]


def _drive_warnings(drive: JointDrive, inversion: JointInversion, step_s: float) -> list[str]:
    found = []
    speed = np.abs(np.diff(inversion.motor_rad, axis=0)) / step_s
    if drive.speed_max_rad_per_s is not None and speed.max() > drive.speed_max_rad_per_s:
        row = int(speed.max(axis=1).argmax())
        share = 100 * float((speed > drive.speed_max_rad_per_s).any(axis=1).mean())
        found.append(
            f"the motor would have to turn at {speed.max():.3g} rad/s at t = {row * step_s:g} s, speed_max_rad_per_s "
            f"is {drive.speed_max_rad_per_s:g}; the commands keep to it in {share:.2g} % of the samples"
        )
    torque = np.abs(inversion.motor_torque_N_m)
    if drive.torque_max_N_m is not None and torque.max() > drive.torque_max_N_m:
        row = int(torque.max(axis=1).argmax())
        found.append(
            f"the motor would have to give {torque.max():.3g} N m at t = {row * step_s:g} s, torque_max_N_m is "
            f"{drive.torque_max_N_m:g}; lower pretension_N, a slower reference or a larger gear_ratio help"
        )
    return found
