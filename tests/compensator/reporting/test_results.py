"""What every result shows: a short repr, a view for notebooks, its main table, its figures."""

import csv
import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import tendonff as tf
import tendonff.compensator
from tendonff.compensator.reporting.results import Views


@pytest.fixture(scope="module")
def designs(examples):
    """A tension and a joint, designed."""
    fast = [each for each in tf.COMPENSATORS if each.is_fast]
    return (
        tf.design(tf.load_scenario(examples / "finger_fast.toml"), compensators=fast),
        tf.design(tf.load_scenario(examples / "hand_joint.toml")),
    )


@pytest.mark.compiler
def test_the_repr_of_a_result_is_its_name_and_its_headline(designs):
    for result in designs:
        assert repr(result) == f"<{type(result).__name__} of {result.scenario.name!r}: {result.headline}>"
        assert len(repr(result)) < 800
        assert repr(result.expectation).startswith("<Expectation: up to ")
        assert len(repr(result.expectation)) < 400


@pytest.mark.compiler
def test_the_frame_of_a_design_is_its_profile_file(designs, tmp_path):
    for k, result in enumerate(designs):
        result.write(tmp_path / str(k))
        with (tmp_path / str(k) / "profile.csv").open() as file:
            head, first, *_ = csv.reader(file)
        frame = result.to_frame()
        assert list(frame.columns) == head
        assert frame.iloc[0].tolist() == [float(value) for value in first]


@pytest.mark.compiler
def test_a_figure_is_plotted_by_the_name_of_its_file(designs):
    result = designs[0]
    assert isinstance(result.plot("force"), Figure)
    assert result.plot().axes[0].get_ylabel() == result.plot("expectation").axes[0].get_ylabel()
    with pytest.raises(tf.ParameterError, match=r"name must be one of expectation, .*, got 'forces'"):
        result.plot("forces")


@pytest.mark.compiler
def test_a_notebook_shows_headline_and_first_figure(designs):
    for result in designs:
        page = result._repr_html_()
        assert "RMS" in page
        assert page.count("<img") == 1


def test_scenarios_simulations_and_exports_have_a_repr_of_a_line(examples):
    for name in ("finger", "hand_joint", "three_joint_finger"):
        assert len(repr(tf.load_scenario(examples / f"{name}.toml"))) < 130
    scenario = tf.load_scenario(examples / "finger.toml")
    system = tf.system_of(scenario.transmission, tf.Level.ELASTIC)
    simulated = tf.simulate(system, np.full(50, 10.0), 1e-3)
    assert repr(simulated) == "<Simulation done: 50 rows to 0.049 s>"


def test_a_choice_that_there_is_not_is_refused_with_those_there_are(examples):
    system = tf.system_of(tf.load_scenario(examples / "finger.toml").transmission, tf.Level.ELASTIC)
    with pytest.raises(tf.ParameterError, match=r'Method must be one of "bdf2", .*"collocation", got "euler"'):
        tf.simulate(system, np.full(50, 10.0), 1e-3, method="euler")
    with pytest.raises(tf.ParameterError, match='Level must be one of "elastic"'):
        tf.Level("rigid")


def test_every_result_names_a_module_that_shows_it():
    """All classes of the package, so that none fails at the first `.write` or `.plot`."""
    for path in Path(tendonff.compensator.__file__).parent.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if re.search(r"\((Result|ShownDesign|Tables|AdaptationStudy)\):", text) and not re.search(
            r"class (ShownDesign|Tables|AdaptationStudy)\b", text
        ):
            [name] = re.findall(r'shown_by: ClassVar\[str\] = "(.*)"', text)
            assert isinstance(import_module(f"tendonff.compensator.{name}").VIEWS, Views)
