"""Drawing of what a scenario describes: paths with their arcs, drums, and joints with the tendons that cross them.

Turning angles are to scale, so that a wrong one is seen; so are radii of drums and moment arms among one another.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.reporting.colours import GREY, INK
from tendonff.compensator.reporting.plots import CYCLE, LINE_STYLES, blank_figure, figure_style
from tendonff.models.joint.parameters import DrivenJoint, Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.parameters import Actuator, Load, Transmission
from tendonff.models.parameters.drive import Drive
from tendonff.models.path import Section, SectionKind, TabulatedSection

System = Transmission | Mechanism | Finger

_CAPTION = (
    "What the scenario describes. Turning angles are to scale; which way a section bends is not known, and "
    "lengths are only roughly to scale."
)
_PIN_CAPTION = " Circles on a path: joints that move the section."
_CHAIN_CAPTION = (
    " Below: drums and moment arms to one scale, with all joints at zero; a tendon above a joint turns it up."
)

_DRAWN = 0.6  # of the width of the page; beside it stands the legend
_PATH_IN, _PATHS_IN, _LINE_IN = 2.2, 1.2, 0.16  # least height of one path, of each of several, and of a line of text
_CHAIN_IN, _MOTOR_IN = 1.8, 0.55  # least height of a row of joints, and height of each motor
_LEAST_SHARE = 0.06  # of the whole length, that every section is drawn with
_COIL_SHIFT = 0.35  # of the radius, between full turns
_STUB_SHARE, _DRUM_SHARE = 0.1, 0.06  # of the size of a drawing: straight ends, and the radius of a drum
_LARGEST = 0.2  # of the distance of two joints: the largest radius or moment arm
_WRAPPED = 40  # letters of a line of a legend


@dataclass(frozen=True, slots=True, kw_only=True)
class _Route:
    """A path, and what is at its ends."""

    sections: tuple[Section, ...]
    start: str
    end: str
    title: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Chain:
    """Joints in a row, radii of drums by motor and tendon, and moment arms of each tendon about each joint [m]."""

    joints: tuple[DrivenJoint, ...]
    radii_m: Mapping[str, Mapping[str, float]]  # positive where the tendon is taken in at positive angles
    arms_m: Mapping[str, Sequence[float]]


def described_figure(system: System) -> Figure:
    """Drawing of a transmission, or of joints on tendons."""
    routes, chain = _described(system)
    heights = [max(_PATH_IN if len(routes) == 1 else _PATHS_IN, _height_in(route)) for route in routes]
    if chain is not None:
        heights.append(max(_CHAIN_IN, _MOTOR_IN * len(chain.radii_m)))
    figure = blank_figure(sum(heights))
    edges = np.cumsum([0.0, *heights]) / sum(heights)
    parts: list[_Route | _Chain] = [*routes] if chain is None else [*routes, chain]
    with figure_style():
        for k, drawn in enumerate(parts):
            panel = figure.add_axes((0.0, 1 - edges[k + 1], _DRAWN, edges[k + 1] - edges[k]))
            panel.set_axis_off()
            panel.set_aspect("equal", adjustable="datalim")
            panel.margins(0.15)
            if isinstance(drawn, _Route):
                _draw_route(panel, drawn)
            else:
                _draw_chain(panel, drawn)
            panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=2.5)
    return figure


def caption_of(system: System) -> str:
    """Caption of the drawing."""
    routes, chain = _described(system)
    pins = any(section.joints for route in routes for section in route.sections)
    return _CAPTION + _PIN_CAPTION * pins + _CHAIN_CAPTION * (chain is not None)


@singledispatch
def _described(system: System) -> tuple[list[_Route], _Chain | None]:
    raise TypeError(f"{type(system).__name__} has no drawing")


@_described.register
def _(system: Transmission) -> tuple[list[_Route], _Chain | None]:
    start, end = _actuator_text(system.actuator), _load_text(system.load)
    return [_Route(sections=system.path.parts, start=start, end=end)], None


@_described.register(Mechanism)
@_described.register(Finger)
def _(system: Mechanism | Finger) -> tuple[list[_Route], _Chain | None]:
    names = [tendon.name for tendon in system.tendons]
    arms = system.geometry().moment_arm_m(np.zeros((1, len(system.joints))))[0]
    alike: dict[tuple[Section, ...], list[str]] = {}
    for tendon in system.tendons:
        alike.setdefault(tendon.path.parts, []).append(tendon.name)
    routes = [_Route(sections=path, start="", end="", title=", ".join(those)) for path, those in alike.items()]
    return routes, _Chain(joints=system.joints, radii_m=system.drums_m, arms_m=dict(zip(names, arms, strict=True)))


def _actuator_text(actuator: Actuator) -> str:
    if actuator.motor is not None:
        gear = f", gear {actuator.motor.gear_ratio:.3g}" if actuator.motor.gear_ratio != 1 else ""
        return f"drum {_mm(actuator.motor.drum_radius_m)} mm{gear}"
    return "position drive" if actuator.drive is Drive.POSITION else f"actuator {actuator.largest_force_N:.4g} N"


def _load_text(load: Load) -> str:
    if load.joint is None or load.moment_arm_m is None:
        return f"load {load.stiffness_N_per_m:.4g} N/m"
    return f"joint {load.joint} {_mm(load.moment_arm_m)} mm"


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.3g}".replace("-", "\N{MINUS SIGN}")


def _section_text(section: Section) -> str:
    angle = section.angle_rad
    turned = f"{angle / math.tau:.3g} turns" if angle > math.tau else f"{math.degrees(angle):.3g} deg"
    found = f"{section.name}: {angle:.3g} rad = {turned}"
    if section.length_m is not None:
        found += f", {section.length_m:.3g} m"
    if section.kind is SectionKind.PULLEY:
        found += ", pulley"
    moved = []
    if section.angle_per_rad:
        moved.append(f"{section.angle_per_rad:+.3g} rad")
    if section.length_per_rad_m:
        moved.append(f"{1e3 * section.length_per_rad_m:+.3g} mm")
    if isinstance(section, TabulatedSection):
        found += f"; tables over {', '.join(section.joints)}"
    if moved:
        found += f"; per rad of {section.joint} {', '.join(moved)}"
    return fill(found.replace("-", "\N{MINUS SIGN}"), _WRAPPED)


def _height_in(route: _Route) -> float:
    """Height of the legend of a path."""
    return _LINE_IN * (4 + sum(1 + _section_text(section).count("\n") for section in route.sections))


def _drawn_lengths(sections: Sequence[Section]) -> FloatArray:
    """Lengths in proportion, none so small that it would not be seen; without lengths, angles with one radius."""
    known = [section.length_m for section in sections]
    lengths = np.array([s.angle_rad for s in sections] if None in known else known, dtype=np.float64)
    drawn: FloatArray = np.maximum(lengths, _LEAST_SHARE * lengths.sum() or 1.0)
    return drawn


def _arc(place: FloatArray, heading_rad: float, angle_rad: float, length: float) -> FloatArray:
    """Points of an arc, shape (n, 2), positive angles to the left."""
    share = np.linspace(0.0, 1.0, 2 + int(abs(angle_rad) / 0.05))
    if abs(angle_rad) < 1e-9:
        along = np.array([math.cos(heading_rad), math.sin(heading_rad)])
        straight: FloatArray = place + length * share[:, None] * along
        return straight
    at, radius = heading_rad + angle_rad * share, length / angle_rad
    points: FloatArray = place + radius * np.column_stack([np.sin(at) - np.sin(at[0]), np.cos(at[0]) - np.cos(at)])
    return points


def _pieces(angle_rad: float, length: float) -> Iterator[tuple[float, float]]:
    """Angles and lengths of arcs: full turns are shifted, so that they can be counted."""
    size = abs(angle_rad)
    for _ in range(int(size / math.tau)):
        yield math.copysign(math.tau, angle_rad), length * math.tau / size
        yield 0.0, _COIL_SHIFT * length / size
    rest = math.fmod(angle_rad, math.tau)
    yield rest, length * abs(rest) / size if size > math.tau else length


def _draw_route(panel: Axes, route: _Route) -> None:
    """The path from the drum to the far end, on the whole to the right: a section bends the way that leads there."""
    heading, place = math.fmod(route.sections[0].angle_rad, math.tau) / 2, np.zeros(2)
    start, lines, pins = heading, [], []
    for k, (section, length) in enumerate(zip(route.sections, _drawn_lengths(route.sections), strict=True)):
        ways = (-1.0, 1.0) if k else (-1.0,)
        way = min(ways, key=lambda way: abs(math.remainder(heading + way * section.angle_rad, math.tau)))
        outward = heading + way * section.angle_rad / 2 - way * math.pi / 2
        points = [place[None, :]]
        for angle, piece in _pieces(way * section.angle_rad, float(length)):
            points.append(_arc(points[-1][-1], heading, angle, piece))
            heading += angle
        line = np.concatenate(points)
        place = line[-1]
        lines.append(line)
        if section.joints:
            pins.append((", ".join(section.joints), line[len(line) // 2], outward))
    size = float(np.ptp(np.concatenate(lines), axis=0).max())
    first = _arc(np.zeros(2), start + math.pi, 0.0, _STUB_SHARE * size)
    last = _arc(place, heading, 0.0, _STUB_SHARE * size)
    middle = first[-1] + _DRUM_SHARE * size * np.array([math.sin(start), -math.cos(start)])
    panel.add_patch(Circle((middle[0], middle[1]), _DRUM_SHARE * size, facecolor="white", edgecolor=INK))
    panel.plot([], [], "o", markerfacecolor="white", markeredgecolor=INK, markersize=7, label=route.start or None)
    for stub in (first, last):
        panel.plot(*stub.T, color=INK)
    for k, (section, line) in enumerate(zip(route.sections, lines, strict=True)):
        style = LINE_STYLES[k // len(CYCLE) % len(LINE_STYLES)]
        panel.plot(*line.T, style, color=CYCLE[k % len(CYCLE)], linewidth=2.4, label=_section_text(section))
        panel.plot(*line[[0, -1]].T, ".", color=INK, markersize=4)
    for name, pin, outward in pins:
        panel.plot(*pin, "o", markerfacecolor="white", markeredgecolor=INK, markersize=6)
        shift = (11 * math.cos(outward), 11 * math.sin(outward))
        panel.annotate(name, pin, shift, textcoords="offset points", ha="center", va="center", fontsize=8)
    panel.plot(*last[-1], "s", color=INK, markersize=6, linestyle="", label=route.end or None)
    panel.set_title(route.title, x=0.02, y=0.86, loc="left", fontsize=8)


def _draw_chain(panel: Axes, chain: _Chain) -> None:
    """Joints in a row at angle zero; a tendon that turns a joint to positive angles lies above it."""
    radii = {name: radius for drums in chain.radii_m.values() for name, radius in drums.items()}
    scale = _LARGEST / max(abs(each) for each in (*radii.values(), *np.ravel(list(chain.arms_m.values()))))
    count = len(chain.joints)
    panel.update_datalim([(-_LARGEST - 0.12 * (count + 2), 0.0)])  # room for the names of motors
    panel.plot([0.55, count + 0.8], [0, 0], color="#D9D9D9", linewidth=6, solid_capstyle="round", zorder=0)
    for k, joint in enumerate(chain.joints, start=1):
        for size in {abs(float(arms[k - 1])) for arms in chain.arms_m.values()} - {0.0}:
            panel.add_patch(Circle((k, 0), scale * size, fill=False, edgecolor=GREY, linestyle=":", linewidth=0.8))
        panel.plot(k, 0, "o", markerfacecolor="white", markeredgecolor=INK, markersize=6)
        for stop in (joint.stop_low_rad, joint.stop_high_rad):
            if stop is not None:
                ray = 0.45 * np.array([math.cos(stop), math.sin(stop)])
                panel.plot([k, k + ray[0]], [0, ray[1]], "--", color=GREY, linewidth=0.8)
        panel.annotate(
            joint.name, (k, -_LARGEST), (0, -4), textcoords="offset points", ha="center", va="top", fontsize=8
        )
    for row, (motor, drums) in enumerate(chain.radii_m.items()):
        middle = 2.5 * _LARGEST * ((len(chain.radii_m) - 1) / 2 - row)
        for radius in drums.values():
            panel.add_patch(Circle((0, middle), scale * abs(radius), facecolor="white", edgecolor=INK))
        panel.annotate(
            motor, (-_LARGEST, middle), (-4, 0), textcoords="offset points", ha="right", va="center", fontsize=8
        )
        for name, radius in drums.items():
            _draw_tendon(panel, chain, name, middle + scale * radius, scale, radius)


def _draw_tendon(panel: Axes, chain: _Chain, name: str, start: float, scale: float, radius_m: float) -> None:
    """A tendon from its drum past the joints that it crosses."""
    k = list(chain.arms_m).index(name)
    crossed = [(x, float(arm)) for x, arm in enumerate(chain.arms_m[name], start=1) if arm]
    places = [(0.0, start)]
    for x, arm in crossed:
        places += [(x - 0.15, scale * arm), (x + 0.15, scale * arm)]
    places.append((places[-1][0] + 0.15, places[-1][1]))
    arms = ", ".join(f"{chain.joints[x - 1].name} {_mm(arm)}" for x, arm in crossed)
    label = fill(f"{name}: {arms} mm; drum {_mm(abs(radius_m))} mm", _WRAPPED)
    style, color = LINE_STYLES[k % len(LINE_STYLES)], CYCLE[k % len(CYCLE)]
    panel.plot(*np.array(places).T, style, color=color, label=label)
    panel.plot(*places[-1], "o", color=color, markersize=4)
