"""Scripts of `examples` that the manual shows run as they are."""

import re
import runpy
from pathlib import Path

import casadi as ca
import matplotlib as mpl
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
OWN = sorted((ROOT / "examples" / "own").glob("*.py"))
GALLERY = sorted((ROOT / "examples" / "gallery").glob("*.py"))
OPTI = sorted((ROOT / "examples" / "opti").glob("*.py"))
SHOWN = {
    found
    for page in (ROOT / "docs").rglob("*.md")
    for found in re.findall(r"<!-- code: (\S+) -->", page.read_text(encoding="utf-8"))
}
SLOW = {"log_format", "report_section", "export_package"}  # seconds of fits, verification and compilers


@pytest.mark.compiler
@pytest.mark.parametrize(
    "script",
    [pytest.param(path, marks=pytest.mark.nightly if path.stem in SLOW else ()) for path in (*OWN, *OPTI)],
    ids=lambda path: path.stem,
)
def test_a_script_that_the_manual_shows_runs(script, monkeypatch):
    monkeypatch.chdir(ROOT)
    with mpl.rc_context():
        runpy.run_path(str(script), run_name="__main__")


def test_the_model_of_acados_has_the_rates_of_the_equations(monkeypatch):
    """Well beyond the widths of its rounded switches, where they are (w/x)^2/2 off."""
    monkeypatch.chdir(ROOT)
    names = runpy.run_path(str(ROOT / "examples" / "opti" / "acados_model.py"))
    page, model = names["page"], names["model"]
    given = [page.state, page.inputs]
    found, exact = (ca.Function("rate", given, [each]) for each in (model.f_expl_expr, page.rate))
    rng = np.random.default_rng(0)
    for _ in range(20):
        at = rng.uniform(0.1, 1.0, page.state.numel()) * rng.choice([-1, 1], page.state.numel()), [30.0, 0.0]
        here = at[0], at[1][: page.inputs.numel()]
        wanted = np.asarray(exact(*here)).ravel()
        assert np.asarray(found(*here)).ravel() == pytest.approx(wanted, rel=1e-5, abs=1e-5 * np.abs(wanted).max())


@pytest.mark.compiler
@pytest.mark.nightly
@pytest.mark.parametrize("script", GALLERY, ids=lambda path: path.stem)
def test_a_script_of_the_gallery_draws_its_picture(script, monkeypatch):
    monkeypatch.chdir(ROOT)
    with mpl.rc_context():
        assert runpy.run_path(str(script))["figure"].axes


def test_every_picture_of_the_gallery_has_its_script_and_its_place():
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    names = [path.stem for path in GALLERY]
    assert sorted(path.stem for path in (ROOT / "docs" / "gallery").glob("*.png")) == names
    assert sorted(re.findall(r"\(gallery/(\w+)\.png\)", page)) == names
    assert sorted(re.findall(r"examples/gallery/(\w+)\.py", page)) == names


def test_every_script_is_shown_and_every_shown_one_is_run():
    run = {path.relative_to(ROOT).as_posix() for path in (*OWN, *OPTI)}
    assert {name for name in SHOWN if "/gallery/" not in name} == run


@pytest.mark.parametrize("script", OWN, ids=lambda path: path.stem)
def test_a_part_of_ones_own_takes_at_most_forty_lines(script):
    assert len(script.read_text(encoding="utf-8").splitlines()) <= 40
