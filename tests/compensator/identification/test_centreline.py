"""Wrap angles from points, against curves whose angle is known in closed form."""

from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.identification.measured.centreline.run import centreline_of, read_centreline
from tendonff.compensator.scenarios import load_scenario


def helix(points: int) -> tuple[np.ndarray, float]:
    """One and a half turns of 20 mm radius and 50 mm pitch."""
    t, radius, rise = np.linspace(0, 3 * np.pi, points), 0.02, 0.05 / (2 * np.pi)
    curve = np.column_stack([radius * np.cos(t), radius * np.sin(t), rise * t])
    return curve, 3 * np.pi * radius / np.hypot(radius, rise)


def arcs(parts: tuple[tuple[float, float], ...], points: int) -> tuple[np.ndarray, float]:
    """Plane arcs one after the other, of given curvature [1/m] and length [m]."""
    ends = np.cumsum([0.0, *(length for _, length in parts)])
    s = np.linspace(0, ends[-1], points)
    place, heading, x = np.zeros((points, 3)), 0.0, np.zeros(2)
    for (curvature, length), begin, end in zip(parts, ends[:-1], ends[1:], strict=True):
        inside = (s >= begin) & (s <= end)
        for along, rows in ((s[inside] - begin, inside), (np.array([length]), None)):
            bent = heading + curvature * along
            if curvature == 0:
                step = along[:, None] * [np.cos(heading), np.sin(heading)]
            else:
                step = np.column_stack([np.sin(bent) - np.sin(heading), np.cos(heading) - np.cos(bent)]) / curvature
            if rows is not None:
                place[rows, :2] = x + step
        heading, x = heading + curvature * length, x + step[-1]
    return place, sum(abs(curvature) * length for curvature, length in parts)


CURVES = {
    "helix": helix(150),
    "arc": arcs(((20.0, 0.08),), 60),
    "arc, straight, arc": arcs(((30.0, 0.05), (0.0, 0.06), (40.0, 0.03)), 120),
    "straight, arc, straight": arcs(((0.0, 0.05), (40.0, 0.04), (0.0, 0.05)), 100),
    "to and fro": arcs(((25.0, 0.06), (-25.0, 0.06)), 120),
}


@pytest.mark.parametrize(
    ("noise_m", "width_rad"),
    [*(pytest.param(*each, marks=pytest.mark.nightly) for each in ((1e-6, 0.06), (1e-4, 0.4))), (1e-3, 1.5)],
)
def test_the_angle_is_within_its_stated_uncertainty(noise_m: float, width_rad: float) -> None:
    """95 % intervals: at least nine of ten hold, and they are of use."""
    rng, hits, widths = np.random.default_rng(4), [], []
    for points, angle in CURVES.values():
        for _ in range(8):
            found = centreline_of(points + rng.normal(0, noise_m, points.shape))
            hits.append(abs(found.angle_rad - angle) <= found.uncertainty_rad)
            widths.append(found.uncertainty_rad)
    assert np.mean(hits) >= 0.9
    assert np.median(widths) < width_rad


def test_turning_angles_of_the_points_themselves_are_far_too_large() -> None:
    points, angle = CURVES["arc"]
    points = points + np.random.default_rng(1).normal(0, 2e-4, points.shape)
    chords = np.diff(points, axis=0)
    chords /= np.linalg.norm(chords, axis=1)[:, None]
    turned = np.arccos(np.clip((chords[1:] * chords[:-1]).sum(axis=1), -1, 1)).sum()
    assert turned > 5 * angle
    assert centreline_of(points).angle_rad == pytest.approx(angle, rel=0.05)


@pytest.mark.parametrize("noise_m", [1e-4, 1e-3])
def test_what_noise_adds_to_a_straight_is_taken_off_or_stated(noise_m: float) -> None:
    straight = np.column_stack([np.linspace(0, 0.2, 120), np.zeros(120), np.zeros(120)])
    rng, angles = np.random.default_rng(9), []
    for _ in range(8):
        found = centreline_of(straight + rng.normal(0, noise_m, straight.shape))
        assert found.angle_rad < found.uncertainty_rad + 0.02
        angles.append(found.angle_rad)
        assert found.noise_m == pytest.approx(noise_m, rel=0.2)
    assert np.median(angles) < 150 * noise_m


def test_sections_are_where_the_arcs_are() -> None:
    points, angle = CURVES["arc, straight, arc"]
    found = centreline_of(points + np.random.default_rng(2).normal(0, 2e-5, points.shape))
    arcs_found = [each for each in found.stretches if each.angle_rad > 0.2]
    assert len(arcs_found) == 2
    assert [each.angle_rad for each in arcs_found] == pytest.approx([1.5, 1.2], abs=0.1)
    assert [each.length_m for each in arcs_found] == pytest.approx([0.05, 0.03], abs=0.006)
    assert sum(each.length_m for each in found.stretches) == pytest.approx(0.14, abs=0.0005)
    assert sum(each.angle_rad for each in found.stretches) == pytest.approx(found.angle_rad)
    assert found.angle_rad == pytest.approx(angle, abs=found.uncertainty_rad)


def write(path: Path, points: np.ndarray, header: str = "x_m,y_m,z_m") -> Path:
    path.write_text("\n".join([header, *(",".join(map(repr, map(float, row))) for row in points), ""]))
    return path


def test_the_command_prints_a_table_that_a_scenario_takes(
    tmp_path: Path, examples: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points, angle = CURVES["arc, straight, arc"]
    file = write(tmp_path / "points.csv", points[:, :2], "x_m,y_m")  # plane
    assert run(["path", str(file), "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert printed == (tmp_path / "out" / "sections.toml").read_text()
    assert {f.name for f in (tmp_path / "out").iterdir()} == {
        "sections.toml",
        "summary.json",
        "centreline.svg",
    }
    finger = (examples / "finger.toml").read_text()
    head, _, rest = finger.partition("[path]")
    pasted = tmp_path / "pasted.toml"
    pasted.write_text(head + printed + "\n[" + rest.partition("\n[")[2])
    assert load_scenario(pasted).transmission.path.total_angle_rad == pytest.approx(angle, abs=0.05)


def test_units_in_the_names_of_columns_are_read(tmp_path: Path) -> None:
    points, _ = CURVES["arc"]
    metres = read_centreline(write(tmp_path / "m.csv", points))
    for header, rows in (("x_mm,y_mm,z_mm", points), ("x [mm],y [mm]", points[:, :2])):
        found = read_centreline(write(tmp_path / "mm.csv", 1000 * rows, header))
        assert found.points_m == pytest.approx(metres.points_m)
        assert "in mm" in found.notes[0]


def test_noisy_points_in_order_are_taken(tmp_path: Path) -> None:
    """Noise turns back every second step, here from one point to the next by seven times their distance."""
    for points, _ in CURVES.values():
        noisy = points + np.random.default_rng(0).normal(0, 3e-3, points.shape)
        assert len(read_centreline(write(tmp_path / "noisy.csv", noisy)).points_m) == len(points)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (
            np.random.default_rng(0).permutation(helix(60)[0]),
            "the points jump to and fro, from one to the next by 43 %",
        ),
        (np.zeros((3, 3)), "needs at least 8 points, got 3"),
        (np.vstack([helix(20)[0][:10], helix(20)[0][9:]]), "row 12: the point is that of the row before"),
        (np.vstack([helix(20)[0], [[9.0, 0.0, 0.0]]]), "row 22: half of the path lies between this point and the one"),
    ],
)
def test_points_that_are_no_centreline_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rows: np.ndarray, message: str
) -> None:
    file = write(tmp_path / "points.csv", rows)
    assert run(["path", str(file), "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_millimetres_are_asked_about() -> None:
    points, _ = CURVES["arc"]
    assert any("millimetres" in note for note in centreline_of(1000 * points).warnings)
