"""The documentation builds without a warning, holds every public name, and its examples run."""

import html
import json
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer
from selenium.webdriver.support.ui import WebDriverWait

import tendonff as tf
from tendonff.compensator.cli import app, run
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.codegen.compiler import find_compiler
from tests import bent_instrument
from tests.compensator.identification.motors.own_log import write as write_log
from tests.compensator.identification.synthetic import Faults, write_synthetic

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("mkdocstrings", reason="mkdocstrings is not installed")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "DISABLE_MKDOCS_2_WARNING": "true"}
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, env=environment)
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def test_every_public_name_is_documented_once(site):
    pages = [page.read_text(encoding="utf-8") for page in (site / "api").glob("*.html")]
    shown = [name for page in pages for name in re.findall(r'<h2 id="tendonff\.(\w+)"', page)]
    assert sorted(shown) == sorted(name for name in tf.__all__ if not name.startswith("_"))


def test_links_between_the_pages_lead_somewhere(site):
    ids = {page: set(re.findall(r'\bid="([^"]+)"', page.read_text(encoding="utf-8"))) for page in site.rglob("*.html")}
    broken = []
    for page in ids:
        if page.name == "404.html":  # its addresses start at the site's root
            continue
        for address in re.findall(
            r'<(?:a|img|script|link)\b[^>]*?(?:src|href)="([^"]+)"', page.read_text(encoding="utf-8")
        ):
            path, _, anchor = html.unescape(address).partition("#")
            if re.match(r"[a-z]+:", path):
                continue
            target = (page.parent / path).resolve() if path else page
            if not target.exists() or (anchor and target in ids and anchor not in ids[target]):
                broken.append(f"{page.relative_to(site)}: {address}")
    assert not broken


def test_the_pages_load_nothing_from_the_network(site):
    for page in site.rglob("*.html"):
        loaded = re.findall(r'<(?:script|img|link)[^>]*?(?:src|href)="([^"]+)"', page.read_text(encoding="utf-8"))
        assert not [address for address in loaded if address.startswith(("http:", "https:", "//"))]


def test_in_a_browser_from_disk_every_page_is_whole_and_nothing_complains(site, browser):
    browser.get_log("browser")
    size = {"width": 390, "height": 800, "deviceScaleFactor": 1, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    for page in sorted(set(site.rglob("*.html")) - {site / "404.html"}):  # its addresses start at the server
        browser.get(page.as_uri())
        formulas = page.read_text(encoding="utf-8").count('class="arithmatex"')
        drawn = "return document.querySelectorAll('.arithmatex mjx-container svg').length"
        WebDriverWait(browser, 20).until(lambda b, n=formulas, js=drawn: b.execute_script(js) >= n)
        assert browser.execute_script("return document.querySelectorAll('[data-mjx-error], mjx-merror').length") == 0
        broken = "return [...document.images].filter(i => !i.naturalWidth).map(i => i.src)"
        assert browser.execute_script(broken) == [], page
        assert browser.execute_script("return document.documentElement.scrollWidth") <= 390, page
        vanished = "return [...document.querySelectorAll('mjx-container > svg')].filter(s => s.clientWidth < 4).length"
        assert browser.execute_script(vanished) == 0, page
        assert browser.get_log("browser") == [], page
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_search_works_from_disk(site, browser):
    browser.get((site / "index.html").as_uri())
    browser.find_element("css selector", "input.md-search__input").click()
    WebDriverWait(browser, 20).until(lambda b: b.find_element("css selector", ".md-search-result__meta").text)
    browser.find_element("css selector", "input.md-search__input").send_keys("stress relaxation")
    found = WebDriverWait(browser, 20).until(lambda b: b.find_elements("css selector", ".md-search-result__link"))
    assert any("theory/chain.html" in link.get_attribute("href") for link in found)


def examples_of(page):
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


EXAMPLES = [
    pytest.param(code, id=f"{page.relative_to(ROOT)}-{k}")
    for page in PAGES
    for k, code in enumerate(examples_of(page), start=1)
]


@pytest.mark.compiler
@pytest.mark.parametrize("code", EXAMPLES)
def test_the_examples_of_the_documentation_run(code, tmp_path, monkeypatch):
    (tmp_path / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    (tmp_path / "example.py").write_text(code, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    runpy.run_path("example.py", run_name="__main__")


TUTORIAL = ROOT / "docs" / "tutorials" / "bowden.md"


@pytest.mark.slow
def test_the_commands_of_the_tutorial_lead_from_the_data_sheet_to_tested_c(tmp_path, run_commands_of):
    """The stand-in rig has mu = 0.13 where the scenario says 0.10; identification finds it."""
    if find_compiler() is None or shutil.which("make") is None:
        pytest.skip("no C compiler or no make")
    text = TUTORIAL.read_text(encoding="utf-8")
    scenario = re.search(r'```toml title="cable.toml"\n(.*?)^```', text, re.MULTILINE | re.DOTALL)[1]
    changes = re.search(r'```toml title="changes in rig.toml"\n(.*?)^```', text, re.MULTILINE | re.DOTALL)[1]
    rig = scenario
    for line in changes.splitlines():
        rig, count = re.subn(rf"^{line.split(' ')[0]} = .*$", line, rig, flags=re.MULTILINE)
        assert count == 1
    (tmp_path / "cable.toml").write_text(scenario, encoding="utf-8")
    (tmp_path / "rig.toml").write_text(rig, encoding="utf-8")
    said = run_commands_of(text)
    found = load_scenario(tmp_path / "fit" / "fitted.toml").transmission.friction
    assert found.mu_dynamic == pytest.approx(0.13, rel=0.01)
    assert "self test passed" in said


def commands_of(text):
    """Words of every command of a page, in a block or indented, in their order."""
    found = re.findall(r"^(?: {4})?(tendonff [^\n]*(?:(?<=\\)\n[^\n]*)*)", text, re.MULTILINE)
    return [shlex.split(line.replace("\\\n", " "), comments=True)[1:] for line in found]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_the_command_line_takes_every_command_of_the_pages(page):
    """Name, arguments, options and their values; nothing is run."""
    group = typer.main.get_command(app)
    for words in commands_of(page.read_text(encoding="utf-8")):
        group.commands[words[0]].make_context(words[0], words[1:])


def cable(folder, *, is_there=True):
    """A scenario, and a log of its rig."""
    assert run(["new", "mine.toml", "--for", "bowden"]) == 0
    transmission = load_scenario(folder / "mine.toml").transmission
    time = np.arange(0, 12, 0.002)
    level = 0.4 * transmission.actuator.force_max_N
    force = level * (1 + 0.8 * np.sin(2 * np.pi * 0.25 * time) * np.minimum(time, 1))
    write_synthetic(folder / "log.csv", transmission, time, force, Faults(), step_s=2e-3, masses=12)
    if not is_there:
        for written in folder.glob("mine.*"):  # `new` draws it too
            written.unlink()


def knuckle(folder, *logs):
    """Scenarios of a hand's joints, and logs of the first."""
    for name in ("knuckle", "middle"):
        assert run(["new", f"{name}.toml", "--for", "hand", "--joint", name]) == 0
    scenario = load_scenario(folder / "knuckle.toml")
    for log in logs:
        write_log(folder, scenario.mechanism, scenario, encoder=True).rename(folder / log)


def hand(folder):
    """The second joint of a hand, and both among its fingers; the first is written by the page."""
    fingers(folder)
    for written in folder.glob("knuckle.*"):
        written.unlink()


def logs_of_joints(folder):
    """Logs of a joint on several days, one of a finger along the suggested routine, two of an instrument's bends."""
    knuckle(folder, "monday.csv", "tuesday.csv", "log.csv")  # the last one keeps the name that it is written under
    assert run(["new", "finger.toml", "--for", "finger"]) == 0
    assert run(["identify", "finger.toml", "--suggest", "--out", "plan"]) == 0
    assert run(["simulate", "finger.toml", "--force", "plan/suggested_motors.csv", "--out", "finger.csv"]) == 0
    (folder / "instrument.toml").write_text(bent_instrument.TEXT, encoding="utf-8")
    for name, number in (("a", 0), ("b", 8)):
        bent_instrument.BentInstrument.drawn(1).log(folder, number)[0].rename(folder / f"{name}.csv")


def fingers(folder):
    """Joints of a hand."""
    knuckle(folder)
    (folder / "fingers").mkdir()
    for name in ("knuckle", "middle"):
        shutil.copy(folder / f"{name}.toml", folder / "fingers")


def tool(folder):
    """A grasper that something else than its mechanism loads: a capstan on torque and pre-tension, both ends sprung."""
    shutil.copy(ROOT / "examples" / "hand_joint.toml", folder / "tool.toml")
    time, draw = np.arange(0, 8, 0.01), np.random.default_rng(0)
    angle = 0.5 * (1 - np.cos(2 * np.pi * 0.3 * time))
    way = np.tanh(20 * np.sin(2 * np.pi * 0.3 * time))
    for name, load in (("low", 0.02), ("high", 0.14), ("unseen", 0.08)):
        torque = (load + 0.12) * np.exp(0.35 * way) - 0.12
        columns = {
            "input_torque_Nm": torque + 1e-3 * draw.standard_normal(len(time)),
            "input_angle_rad": angle,
            "output_torque_Nm": load + 1e-3 * draw.standard_normal(len(time)),
            "output_angle_rad": 0.9 * angle - 0.2 * torque + 2e-3 * draw.standard_normal(len(time)),
        }
        write_csv(folder / f"{name}.csv", {"time_s": time, **columns})


def models(folder):
    """The examples beside the page's files."""
    (folder / "examples").symlink_to(ROOT / "examples", target_is_directory=True)


MINUTES = pytest.mark.nightly
NEEDED = (
    pytest.param("README.md", lambda folder: cable(folder, is_there=False), marks=MINUTES),
    pytest.param("docs/identify.md", cable, marks=MINUTES),
    pytest.param("docs/tutorials/hand.md", hand, marks=MINUTES),
    pytest.param("docs/tutorials/fingers.md", lambda _: None, marks=MINUTES),
    pytest.param("docs/guide/identify_joint.md", logs_of_joints, marks=MINUTES),
    pytest.param("docs/guide/joints.md", fingers, marks=MINUTES),
    pytest.param("docs/guide/import.md", models, marks=MINUTES),
    pytest.param("docs/guide/observe.md", tool),
)
"""What the commands of a page take as given."""

BY_OTHER_TESTS = {f"docs/tutorials/{name}.md" for name in ("bowden", "finger", "identify")}


def test_the_commands_of_every_page_are_run_by_a_test():
    having = {p.relative_to(ROOT).as_posix() for p in PAGES if commands_of(p.read_text(encoding="utf-8"))}
    assert having == {param.values[0] for param in NEEDED} | BY_OTHER_TESTS


@pytest.mark.compiler
@pytest.mark.parametrize(("page", "prepare"), NEEDED)
def test_the_commands_of_a_page_run_with_its_files(page, prepare, tmp_path, monkeypatch, unpainted):
    monkeypatch.chdir(tmp_path)
    prepare(tmp_path)
    for command in commands_of((ROOT / page).read_text(encoding="utf-8")):
        if command[0] == "explore":  # serves until it is stopped; has tests of its own
            continue
        words = [file for word in command for file in (sorted(map(str, Path().glob(word))) if "*" in word else [word])]
        assert run(words) == 0, command


@pytest.fixture
def run_commands_of(tmp_path, monkeypatch, unpainted):
    """Runs the commands of a page in order, in an empty folder; what the last other program said."""
    monkeypatch.chdir(tmp_path)

    def call(text):
        said = ""
        for command in re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
            words = command.split()
            if words[0] == "tendonff":
                assert run(words[1:]) == 0, command
            else:
                done = subprocess.run(words, capture_output=True, text=True, check=False)
                said = done.stdout + done.stderr
                assert done.returncode == 0, command + said
        return said

    return call


@pytest.mark.compiler
@pytest.mark.nightly  # the first tutorial identifies too
def test_the_commands_of_the_identification_tutorial_find_the_friction(tmp_path, run_commands_of):
    run_commands_of((ROOT / "docs" / "tutorials" / "identify.md").read_text(encoding="utf-8"))
    found = load_scenario(tmp_path / "fit" / "fitted.toml").transmission.friction
    assert found.mu_dynamic == pytest.approx(0.2, rel=0.055)  # "to 5 %", says the page


@pytest.mark.nightly
def test_the_commands_of_the_moving_finger_end_in_tested_c_and_its_numbers_are_those_of_the_design(
    tmp_path, run_commands_of
):
    if find_compiler() is None or shutil.which("make") is None:
        pytest.skip("no C compiler or no make")
    text = (ROOT / "docs" / "tutorials" / "finger.md").read_text(encoding="utf-8")
    said = run_commands_of(text)
    assert "self test passed" in said
    found = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    expected = found["expectation"]["worst_percent_of_range"][found["expectation"]["recommended"]]
    assert f"({expected:.2g} % of range)" in " ".join(text.split())
    ignored = found["ignored_motion"]["rmse_percent_of_range"]
    assert f"design for the path at rest has {ignored:.1f} % on this finger" in " ".join(text.split())


def test_the_table_of_moving_paths_is_what_the_package_gives():
    """To the digits that the page prints."""
    page = (ROOT / "docs" / "theory" / "moving.md").read_text(encoding="utf-8")
    printed = dict(re.findall(r"^\| ([\w ]+) \| ([\d.]+) \|$", page, re.MULTILINE))
    measured = runpy.run_path(str(ROOT / "docs" / "figures" / "moving.py"))["errors_percent"]()
    assert {name: f"{value:.2g}" for name, value in measured.items()} == printed


def test_every_command_is_in_the_documentation():
    commands = {command.name or command.callback.__name__.replace("_", "-") for command in app.registered_commands}
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert not [name for name in commands if f"tendonff {name} " not in text]


@pytest.mark.compiler
def test_the_figure_of_the_readme_can_be_drawn_again(tmp_path, monkeypatch):
    script, target = ROOT / "docs" / "readme_figure.py", tmp_path / "finger.png"
    monkeypatch.setattr(sys, "argv", [str(script), str(target)])
    runpy.run_path(str(script), run_name="__main__")
    assert target.read_bytes().startswith(b"\x89PNG")
    assert (ROOT / "docs" / "finger.png").is_file()
