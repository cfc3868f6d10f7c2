"""The next step: what removes the largest part of the expected error, and the controller only where nothing does."""

from collections.abc import Sequence

from tendonff.compensator.compensators.expectation import Contribution, Expectation
from tendonff.compensator.scenario.doubts import is_nothing, largest_tension, needed_force
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.numbers import FACTORS
from tendonff.models.parameters.uncertainty import Spread

_MEASURED = 0.05  # relative half-width that a fit leaves: a narrower interval is not narrowed by another
_SMALL_PERCENT = 1.0  # of range: an error below needs no further measurement
_PAYS = 0.2  # of the worst error, that a number alone must add for its measurement to pay
_RIG = ("friction", "tendon", "path")  # tables whose numbers a log of the tendon tells


def next_step(found: Expectation, file: str, then: str, *, change: str = "") -> str:
    """The next step after the expected error of a scenario file, quoted for a shell.

    Parameters
    ----------
    then : str
        Command where no single measurement pays.
    change : str, optional
        What to change where limits cause most of the error; where the reference is out of reach, that comes first.
    """
    if change := found.change or change:
        return change
    if found.best.hangs_on_the_law and found.best.worst.rmse_percent_of_range >= _SMALL_PERCENT:
        return _suggest(file)
    worth = next((each for each in found.contributions if _pays(found, each)), None)
    if worth is None:
        return then
    if not found.doubt.system.motors_tell:
        return f"measure {worth.key}, tendon by tendon, and state what is left of it in [robust] of {file}"
    return _measurement(worth.key, file)


def within_reach(transmission: Transmission, peak_N: float) -> str:
    """The change with which the actuator reaches a peak of the reference; empty where it does."""
    most = largest_tension(transmission)
    if peak_N <= most:
        return ""
    actuator = transmission.actuator
    needed = needed_force(transmission, peak_N)
    raised = f"raise {actuator.largest_force_name} from {actuator.largest_force_N:g} to {needed:.4g}"
    if is_nothing(most, peak_N):
        return f"{raised}, or bend the path less: nothing arrives through the friction"
    return f"lower the reference to at most {most:.4g} N, or {raised}"


def limited_by(found: Expectation, reasons: Sequence[str]) -> str:
    """The change to make where limits of the drive cause most of the error, as the search for a profile states them."""
    best = found.best
    dominates = best.nominal.rmse > 0.5 * best.worst.rmse and best.nominal.rmse_percent_of_range > _SMALL_PERCENT
    return f"a larger limit: {reasons[0]}" if dominates and reasons else ""


def _pays(found: Expectation, contribution: Contribution) -> bool:
    """Whether to know the number better would remove a good part of an error that is not small."""
    best = found.best
    if best.worst.rmse_percent_of_range < _SMALL_PERCENT and not found.doubt.is_assumed:
        return False
    spread = next(each for each in found.doubt.spreads if each.name == contribution.key)
    added = contribution.rmse - best.nominal.rmse
    return (found.doubt.is_assumed or _half_width(spread) > _MEASURED) and added > _PAYS * best.worst.rmse


def _half_width(spread: Spread) -> float:
    """Half of an interval over the size of its middle [-]."""
    if spread.half_width is not None:
        return spread.half_width
    low, high = spread.low or 0.0, spread.high or 0.0
    return (high - low) / max(abs(high + low), 1e-300)


def _suggest(file: str) -> str:
    """Command that writes an excitation."""
    return f"tendonff identify {file} --suggest --out excite"


def _measurement(key: str, file: str) -> str:
    """The way to measure the number of a key; several keys that vary together are of one kind."""
    suggest = _suggest(file)
    *tables, name = key.split(",", maxsplit=1)[0].split(".")
    if name in FACTORS or name == "pretension_N" or any(table in _RIG for table in tables):
        return suggest
    if name == "coulomb_N":
        return f"{suggest}, and log actuator_force_N beside the tension: it tells the friction of the drive"
    if name == "coulomb_N_m":
        return f"{suggest}, and log motor_torque_N_m or motor_current_A: it tells the friction of the drive"
    if name in ("servo_time_s", "delay_s"):
        return f"{suggest}, run suggested_drive.csv on the drive alone, log command and answer: they tell {key}"
    way = _WAYS.get((tables[0] if tables else "", name), "")
    return f"measure {key}{way}, and state what remains unknown in [robust.spread]"


_WAYS = {
    ("actuator", "damping_N_s_per_m"): " (let the motor run down without the tendon)",
    ("load", "stiffness_N_per_m"): " (pull at the load with two known forces and read its position)",
    ("load", "mass_kg"): " (weigh what moves with the tendon's end)",
}
