"""Tensions measured between the ends tell where along the path the friction is."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.path import Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import simulate

pytestmark = pytest.mark.compiler

MU = ((0.3, 0.25), (0.12, 0.1), (0.22, 0.2))
ANGLES = (0.9, 1.3, 0.9)
MASSES = 31


@pytest.fixture(scope="module")
def nominal(examples):
    """A path of the same wrap angle whose friction nobody has divided."""
    found = load_scenario(examples / "finger.toml")
    path = replace(found.transmission.path, total_angle_rad=sum(ANGLES))
    return replace(found, transmission=replace(found.transmission, path=path))


@pytest.fixture(scope="module")
def log(nominal, tmp_path_factory):
    """Seven cells' worth of rig with four of them: ends, and where the sections meet."""
    parts = tuple(
        Section(
            name=f"s{k}",
            angle_rad=angle,
            mu_dynamic=pull,
            mu_static=pull,
            mu_dynamic_release=back,
            mu_static_release=back,
        )
        for k, (angle, (pull, back)) in enumerate(zip(ANGLES, MU, strict=True))
    )
    t = nominal.transmission
    friction = replace(t.friction, adhesion_N=0.0, soft_bristle_stiffness_N_per_m=3e5)
    truth = replace(t, path=replace(t.path, sections=parts, segments=MASSES), friction=friction)
    time = np.arange(0, 12, 4e-3)
    force = 45 + 28 * np.sin(2 * np.pi * 0.45 * time) * np.minimum(time / 2, 1) + 8 * np.sin(2 * np.pi * 1.3 * time)
    run_ = simulate(Chain.of(truth, Level.PRESLIDING, MASSES), force, 4e-3, initial_tension_N=45).require()
    # Pieces are equal within a section, so links between masses of unlike sections stand at the borders.
    angle = np.concatenate([[0], np.cumsum([a / n for a, n in zip(ANGLES, (9, 13, 9), strict=True) for _ in range(n)])])
    at = [int(np.argmin(np.abs(angle - border))) for border in (0.9, 2.2)]
    noise = np.random.default_rng(4).normal(0, 0.1, (len(time), 4))
    tension = run_.tension_N[:, [0, *at, MASSES]] + noise
    path = tmp_path_factory.mktemp("log") / "log.csv"
    names = ("input_tension_N", "cell_2_N", "cell_3_N", "output_tension_N")
    write_csv(path, {"time_s": time} | {name: tension[:, k] for k, name in enumerate(names)})
    return path


def test_friction_is_told_by_section(nominal, log, record_property):
    how = replace(nominal.measurement, tension_columns=("cell_3_N", "cell_2_N"), tension_angles_rad=(2.2, 0.9))
    found = identify(replace(nominal, measurement=how), [log], static_only=True)
    assert [(s.start, s.stop) for s in found.sections] == [
        ("input_tension_N", "cell_2_N"),
        ("cell_2_N", "cell_3_N"),
        ("cell_3_N", "output_tension_N"),
    ]
    for section, (pull, back) in zip(found.sections, MU, strict=True):
        assert section.mu == pytest.approx(pull, rel=0.05)
        assert section.mu_release == pytest.approx(back, rel=0.05)
    record_property("figure", f"friction by section, true {MU}: {[s.text for s in found.sections]}")
    spread = [s.mu for s in found.sections]
    assert max(spread) > 2 * min(spread)
    whole = sum(s.mu * (s.stop_rad - s.start_rad) for s in found.sections)
    assert whole == pytest.approx(found.estimate("mu_theta").value, rel=0.05)


@pytest.mark.usefixtures("unpainted")
def test_the_command_takes_any_number_of_cells(nominal, log, tmp_path, examples, capsys):
    scenario = tmp_path / "rig.toml"
    text = (examples / "finger.toml").read_text()
    scenario.write_text(text.replace("total_angle_rad = 3.141592653589793", f"total_angle_rad = {sum(ANGLES)}"))
    words = ["identify", str(scenario), "--data", str(log), "--static", "--out", str(tmp_path / "out")]
    words += ["--tension-column", "cell_2_N=0.9", "--tension-column", "cell_3_N=2.2"]
    assert run(words) == 0
    assert "cell_2_N to cell_3_N (0.9 to 2.2 rad): mu 0.1" in capsys.readouterr().err
    sections = json.loads((tmp_path / "out" / "fit.json").read_text())["sections"]
    assert [s["stop_rad"] for s in sections] == [0.9, 2.2, pytest.approx(sum(ANGLES))]
    assert "Friction by section" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.parametrize("cells", [["cell_2_N"], ["=1.0"], ["cell_2_N=x"]])
def test_a_cell_without_a_place_is_refused(examples, log, tmp_path, capsys, cells):
    words = ["identify", str(examples / "finger.toml"), "--data", str(log), "--out", str(tmp_path / "out")]
    assert run([*words, *(w for cell in cells for w in ("--tension-column", cell))]) == 2
    assert "--tension-column must be NAME=ANGLE_RAD" in capsys.readouterr().err


def test_a_cell_beyond_the_end_is_refused(nominal, log):
    how = replace(nominal.measurement, tension_columns=("cell_2_N",), tension_angles_rad=(9.0,))
    with pytest.raises(InputError, match="must be less than that of the whole path"):
        identify(replace(nominal, measurement=how), [log], static_only=True)


def test_a_gap_in_one_cell_leaves_out_its_strokes_and_pairs_the_others(nominal, log, tmp_path):
    """Other cells keep the strokes; none is compared with another one."""
    rows = [line.split(",") for line in log.read_text().splitlines()]
    for row in rows[1200:1700]:
        row[2] = ""
    gappy = tmp_path / "gappy.csv"
    gappy.write_text("\n".join(",".join(row) for row in rows) + "\n")
    how = replace(nominal.measurement, tension_columns=("cell_2_N", "cell_3_N"), tension_angles_rad=(0.9, 2.2))
    whole, some = (
        identify(replace(nominal, measurement=how), [file], static_only=True).sections for file in (log, gappy)
    )
    for one, other in zip(whole, some, strict=True):
        assert other.mu == pytest.approx(one.mu, rel=0.02)
        assert other.mu_release == pytest.approx(one.mu_release, rel=0.04)
