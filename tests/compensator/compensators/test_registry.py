"""Compensators as objects: what each answers, that they agree everywhere, and what a further one takes."""

import json
import math
import subprocess
from dataclasses import replace

import jinja2
import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators import base, optimal
from tendonff.compensator.compensators.base import CModule, Compensator, Problem, answers_of
from tendonff.compensator.compensators.closed_form import Capstan
from tendonff.compensator.compensators.every import chosen
from tendonff.compensator.compensators.profile import Profile, ProfileStatus
from tendonff.compensator.compensators.registry import COMPENSATORS, compensator
from tendonff.compensator.export import c_project, modules
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.fmu import build_fmu
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.export.text import c_text
from tendonff.compensator.files.progress import Parts, silent
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.scenario import scenario_to_toml
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.compare.run import compare
from tendonff.compensator.studies.design.run import design
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.ocp.errors import SolveError
from tendonff.ocp.optimal import track as tracking
from tendonff.ocp.tendon import stability
from tendonff.ocp.tracking.options import TrackOptions
from tendonff.ocp.tracking.result import TrackStatus


class ConstantGain(Compensator):
    """The reference times e^{mu theta}: a compensator that only these tests know."""

    name = "gain"
    label = "constant gain"
    knows_the_level = False

    def profile(self, problem, *, progress=silent):
        friction, path = problem.transmission.friction, problem.transmission.path
        gain = math.exp(friction.mu_dynamic * path.total_angle_rad)
        return Profile(force_N=problem.limited(gain * problem.reference.tension_N))


ALL = (*COMPENSATORS, ConstantGain())


@pytest.fixture(scope="module")
def quick(examples):
    """The finger on three masses, one second, coarser, with a rate limit that binds."""
    scenario = load_scenario(examples / "finger_fast.toml")
    whole = scenario.transmission
    return replace(
        scenario,
        transmission=replace(whole, path=replace(whole.path, segments=3)),
        reference=replace(scenario.reference, duration_s=0.6, fade_in_s=0.1),
        run=replace(scenario.run, step_s=2e-3),
    )


@pytest.fixture(scope="module")
def reports():
    """What `designed` reported as its progress."""
    return []


@pytest.fixture(scope="module")
def designed(quick, reports):
    return design(quick, compensators=ALL, progress=lambda done, total: reports.append((done, total)))


def test_names_are_unique_and_ordered_as_shown():
    assert [c.name for c in COMPENSATORS] == [
        "none",
        "frictionless",
        "capstan",
        "smoothed",
        "inverse",
        "optimal",
        "table",
    ]
    assert len({(c.style.color, c.style.linestyle) for c in COMPENSATORS}) == len(COMPENSATORS)


def test_a_wrong_name_is_answered_with_the_right_one():
    assert compensator("inverse") in COMPENSATORS
    with pytest.raises(InputError, match='no compensator "invers", did you mean "inverse"'):
        compensator("invers")


@pytest.mark.parametrize("each", [c for c in COMPENSATORS if c.name != "none"], ids=str)
def test_every_profile_has_the_rows_of_the_reference_and_keeps_the_limits(quick, each):
    problem = Problem.of(quick)
    profile = each.profile(problem)
    assert profile.force_N.shape == problem.reference.tension_N.shape
    assert problem.limits.admits(profile.force_N, problem.reference.step_s, 1e-6)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (np.ones(3), "must give a tf.Profile, got ndarray"),
        (Profile(force_N=np.ones(3)), r"a value per row .* got \(3,\)"),
    ],
    ids=["array", "too short"],
)
def test_what_a_compensator_of_the_users_gives_wrongly_is_named(quick, monkeypatch, given, text):
    mine = ConstantGain()
    monkeypatch.setattr(ConstantGain, "profile", lambda *_, **__: given)
    with pytest.raises(SolveError, match=f"gain: failed: .*{text}"):
        answers_of(Problem.of(quick), [mine], Parts(silent, 1))


def test_the_inverse_knows_the_travel_of_the_actuator_where_no_limit_binds(quick):
    """Free of limits the force is the exact inverse, whose states hold the travel; a limit makes it unknown."""
    free = replace(
        quick.transmission, actuator=replace(quick.transmission.actuator, force_rate_max_N_per_s=1e6, force_max_N=1e4)
    )
    problem = Problem.of(replace(quick, transmission=free))
    profile = compensator("inverse").profile(problem)
    assert profile.travel_m is not None
    # Pulling stretches the tendon and the load's spring: the travel rises with the reference.
    assert np.corrcoef(profile.travel_m, problem.reference.tension_N)[0, 1] > 0.9
    assert compensator("inverse").profile(Problem.of(quick)).travel_m is None


@pytest.mark.compiler
def test_a_further_compensator_goes_through_design_with_force_error_and_picture(designed, tmp_path):
    reference, gain = designed.reference.tension_N, math.exp(0.2 * math.pi)
    actuator = designed.scenario.transmission.actuator
    assert designed.profiles["gain"].force_N.max() <= min(gain * reference.max(), actuator.force_max_N) * (1 + 1e-12)
    errors = {c.name: designed.on_level(c.name, designed.level).score.rmse for c in ALL}
    assert errors["optimal"] < errors["gain"]
    designed.write(tmp_path / "out")
    assert "force_gain_N" in (tmp_path / "out" / "profile.csv").read_text().splitlines()[0]
    assert '"gain"' in (tmp_path / "out" / "summary.json").read_text()
    assert "constant gain" in (tmp_path / "out" / "report.html").read_text()


def test_a_further_compensator_enters_the_matrix_of_compare(quick):
    result = compare(quick, compensators=(*COMPENSATORS[:5], ConstantGain()))
    assert {e.compensator for e in result.entries} == {"none", "frictionless", "capstan", "smoothed", "inverse", "gain"}
    # The gain is the pulling branch of the capstan law, so it is exact there and wrong while releasing.
    on_law = result.entry("gain", Level.ELASTIC, "capstan")
    assert on_law.rmse_percent_of_range > result.entry("capstan", Level.ELASTIC, "capstan").rmse_percent_of_range


class RenamedCapstan(Capstan):
    """A compensator with C of its own, which only these tests know."""

    name, label = "slack_free", "the capstan law by another name"
    c_module = CModule(name="slack_free", content=label, knows_joints=False)


class RenamingLoader(jinja2.BaseLoader):
    """The templates that are shipped, and those of the capstan law by another name."""

    def __init__(self, shipped):
        self.shipped = shipped

    def get_source(self, environment, template):
        text, *rest = self.shipped.get_source(environment, template.replace("slack_free", "capstan"))
        if "slack_free" in template:
            text = text.replace("capstan", "slack_free").replace("CAPSTAN", "SLACK_FREE")
        return text, *rest


@pytest.mark.compiler
def test_a_further_compensator_with_its_two_templates_is_exported_and_tests_itself(quick, monkeypatch, tmp_path):
    monkeypatch.setattr(modules, "COMPENSATORS", (*COMPENSATORS, RenamedCapstan()))
    monkeypatch.setattr(c_text._TEMPLATES, "loader", RenamingLoader(c_text._TEMPLATES.loader))
    export_project(quick, profile_N=compensator("inverse").profile(Problem.of(quick)).force_N).write(tmp_path)
    built = subprocess.run(["make", "test"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    assert "slack_free: golden vectors of other friction" in built.stdout
    assert json.loads((tmp_path / "design.json").read_text())["scores"]["slack_free"]["rmse_N"] > 0


def test_every_module_that_follows_a_reference_has_a_co_simulation_unit(quick):
    followers = {module.name for _, module in modules.exportable(quick.transmission, moving=False)} - {"profile"}
    assert followers <= {kind.value for kind in Kind}


@pytest.mark.compiler
def test_a_design_computes_the_inverse_once_with_and_once_without_friction_and_once_for_a_live_reference(
    quick, monkeypatch
):
    calls = []
    for module in (base, tracking, stability):
        right = module.invert

        def counted(*arguments, where=module.__name__, right=right, **options):
            calls.append(where)
            return right(*arguments, **options)

        monkeypatch.setattr(module, "invert", counted)
    design(quick)
    assert calls == 3 * [base.__name__]


def _parts(reports):
    return reports[0][1] / 100


def test_progress_of_a_design_goes_on_while_the_optimal_profile_is_sought(designed, reports):
    done = [step / total for step, total in reports]
    assert done == sorted(done)
    assert done[-1] == 1
    shares = {c.name: 1 if c.is_fast else 8 for c in ALL}  # the search counts as eight of the fast profiles
    before = sum(shares[c.name] for c in ALL[: ALL.index(compensator("optimal"))])
    first, last = before / _parts(reports), (before + shares["optimal"]) / _parts(reports)
    assert sum(first < share < last for share in done) >= 2


def test_options_of_the_search_reach_it(quick):
    """A tension that the tendon must keep, above what the plain search lets it fall to."""
    free = compensator("optimal").profile(Problem.of(quick)).tracking
    least = 1.02 * free.least_tension_N
    kept = compensator("optimal").profile(Problem.of(quick, options=TrackOptions(minimum_tension_N=least))).tracking
    assert free.least_tension_N < least <= kept.least_tension_N * (1 + 1e-6)


def test_options_of_the_search_are_those_of_the_scenario_file(quick, tmp_path):
    file = tmp_path / "s.toml"
    options = TrackOptions(minimum_tension_N=3.5, stiffer_weight=0.5)
    file.write_text(scenario_to_toml(replace(quick, optimal=options)), encoding="utf-8")
    assert "stiffer_weight = 0.5" in file.read_text(encoding="utf-8")
    assert Problem.of(load_scenario(file)).options == options


@pytest.fixture(scope="module")
def uncertain(quick):
    return replace(quick, robust=Uncertainty(mu=0.15, samples=3))


@pytest.mark.compiler
def test_the_exported_profile_is_that_of_the_design_also_under_uncertainty(quick, uncertain):
    of_design = design(uncertain, compensators=[compensator("none"), compensator("optimal")]).profiles["optimal"]
    assert np.array_equal(export_project(uncertain).profile_N, of_design.force_N)
    nominal = compensator("optimal").profile(Problem.of(quick)).force_N
    assert np.abs(of_design.force_N - nominal).max() > 0.01  # or the test could not tell the two apart


def fail(monkeypatch):
    """Let the search end without a profile that keeps the tension."""
    solve = optimal.solve

    def failing(*arguments, **options):
        return replace(solve(*arguments, **options), status=TrackStatus.INFEASIBLE, message="the tendon would go slack")

    monkeypatch.setattr(optimal, "solve", failing)


def test_a_profile_that_must_not_be_used_is_not_exported(quick, tmp_path, monkeypatch, capsys):
    fail(monkeypatch)
    scenario = tmp_path / "s.toml"
    scenario.write_text(scenario_to_toml(quick), encoding="utf-8")
    assert run(["export-c", str(scenario), "--out", str(tmp_path / "c")]) == 1
    assert "the tendon would go slack" in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_a_profile_that_must_not_be_used_says_so(quick, monkeypatch):
    fail(monkeypatch)
    profile = compensator("optimal").profile(Problem.of(quick))
    assert profile.status is ProfileStatus.FAILED
    with pytest.raises(SolveError, match="the tendon would go slack"):
        profile.require()


def test_a_unit_is_made_without_table_and_golden_vectors(quick, monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("a unit needs neither")

    monkeypatch.setattr(c_project, "table_of", refuse)
    monkeypatch.setattr(c_project, "golden_vectors", refuse)
    assert build_fmu(quick, Kind.INVERSE, FmiVersion.V2).content


@pytest.mark.parametrize("command", ["design", "compare", "experiment", "table", "export-c", "export-fmu"])
def test_a_folder_that_cannot_be_written_is_known_before_the_work(examples, tmp_path, monkeypatch, capsys, command):
    def work(*_, **__):
        raise AssertionError("the work began")

    works = ("design.run.design", "compare.run.compare", "experiment.run.experiment", "tables.force.ForceTables.made")
    for name in works:
        monkeypatch.setattr(f"tendonff.compensator.studies.{name}", work)
    for name in ("export.c_project.export_project", "export.fmu.build_fmu"):
        monkeypatch.setattr(f"tendonff.compensator.{name}", work)
    (tmp_path / "taken").write_text("a file")
    assert run([command, str(examples / "finger.toml"), "--out", str(tmp_path / "taken")]) == 2
    assert "is a file; name a folder" in capsys.readouterr().err


def test_a_compensator_needs_a_name_and_no_label(quick):
    class Nameless(Compensator):
        def profile(self, problem, *, progress=silent):
            return Profile(force_N=problem.reference.tension_N)

    with pytest.raises(ParameterError, match='Nameless has no name; write name = "mine" in the class'):
        design(quick, compensators=[Nameless()])
    named = type("Named", (Nameless,), {"name": "plain"})
    assert named.label == "plain"


def test_a_name_for_a_list_and_a_class_for_an_object_are_refused(quick):
    with pytest.raises(ParameterError, match=r'compensators must be a list, got "inverse"; write \["inverse"\]'):
        chosen(quick.kind, "inverse")
    with pytest.raises(ParameterError, match=r"Compensator is a class; give an instance, Compensator\(\)"):
        chosen(quick.kind, [Compensator])
