"""Shared by all tests."""

import os

# Each worker of a run in parallel has one processor: threads of the linear algebra would only wait for each other. The
# library reads this when numpy is imported; commands that tests start inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# What exported folders are compiled with by their Makefile: most tests wait for the compiler, not for its code.
os.environ.setdefault("CFLAGS", "-O0")

import functools
import gc
import importlib.util
import io
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType

import matplotlib as mpl
import pytest
from hypothesis import HealthCheck, settings
from shared_outputs import Output, output_of
from without_figures import without_figures

from tendonff.models.parameters import (
    Actuator,
    Friction,
    Load,
    Tendon,
    Transmission,
)
from tendonff.models.parameters import Path as TendonPath
from tendonff.ocp.codegen import compiler

ROOT = Path(__file__).resolve().parents[1]

_SHARED = re.compile(r'scope="(module|session)"')

mpl.use("Agg")
gc.set_threshold(50_000, 20, 100)  # as in the program: importing and drawing make many objects that stay

# Here too: a third of the time to compile, and the same numbers to the bit (`tests/ocp/step/test_engines.py`). Loops as
# shipped, for long chains take half as long again without.
_SHIPPED = compiler._FLAGS
compiler._FLAGS = ("-O1", "-ftree-vectorize", *(flag for flag in _SHIPPED if flag != "-O3"))

# A failure prints what reproduces it; no deadline, for machines differ in speed; the same examples on every run, so
# that a red build is a change of the code.
settings.register_profile(
    "tendonff", print_blob=True, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("fresh", settings.get_profile("tendonff"), derandomize=False, database=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "tendonff"))


@pytest.fixture(scope="session")
def examples() -> Path:
    """Folder of the example scenarios."""
    return ROOT / "examples"


@pytest.fixture(scope="session")
def shipped_flags() -> tuple[str, ...]:
    """What the library compiles with; the tests optimise less."""
    return _SHIPPED


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """Folder of the measured data, which is not part of the repository; skips where it is absent."""
    folder = Path(os.environ.get("TENDONFF_DATA") or ROOT.parent / "shared" / "data")
    if not (folder / "band_capstan").is_dir():
        pytest.skip("measured data not found; set TENDONFF_DATA to its folder")
    return folder


@pytest.fixture(scope="session")
def independent_rig() -> ModuleType:
    """The module `independent_rig.py`: a rig that shares no code with the packages."""
    spec = importlib.util.spec_from_file_location("independent_rig", ROOT / "tests" / "independent_rig.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def output(tmp_path_factory: pytest.TempPathFactory, examples: Path) -> Callable[..., Output]:
    """Files and messages of a command on an example: `output("design", "finger")`; made once in a session."""
    base = tmp_path_factory.getbasetemp()
    shared = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "outputs"
    shared.mkdir(exist_ok=True)
    return functools.partial(output_of, shared, examples)


@pytest.fixture
def stand_in_ziglang(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package ziglang that compiles for this system whatever it is asked for; the file with its calls."""
    cc = shutil.which("cc")
    if cc is None:
        pytest.skip("cc is not installed")
    package, calls = tmp_path / "packages" / "ziglang", tmp_path / "calls.txt"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text(
        f"""
import os, subprocess, sys
given = sys.argv[1:]
with open({str(calls)!r}, "a") as calls:
    print(*given, file=calls)
if given == ["cc", *given[1:]] and "--version" not in given:
    target = given.index("-target") if "-target" in given else len(given)
    rest = [word for word in given[1:target] + given[target + 2 :] if word != "-mcpu=baseline"]
    os.environ["PATH"] = {os.environ["PATH"]!r}
    sys.exit(subprocess.run([{cc!r}, *rest, "-O0"]).returncode)
print("clang version 0")
"""
    )
    monkeypatch.syspath_prepend(str(package.parent))
    monkeypatch.setenv("PYTHONPATH", str(package.parent), prepend=os.pathsep)
    return calls


@pytest.fixture
def unpainted() -> Iterator[None]:
    """No figure is painted."""
    with without_figures():
        yield


@pytest.fixture(scope="session")
def generic() -> Transmission:
    """A transmission in which every term of the model acts, and no two values that could be mixed up are equal."""
    return Transmission(
        path=TendonPath(total_angle_rad=3.1, segments=6, radius_m=0.03),
        tendon=Tendon(
            mass_kg=0.002,
            stiffness_N_per_m=2e4,
            relaxing_stiffness_N_per_m=6e3,
            relaxation_time_s=0.4,
            damping_N_s_per_m=2.0,
        ),
        friction=Friction(
            mu_dynamic=0.2,
            mu_static=0.23,
            stribeck_velocity_m_per_s=0.005,
            viscous_N_s_per_m=1.0,
            bristle_stiffness_N_per_m=1e6,
            soft_bristle_stiffness_N_per_m=2e4,
            mu_dynamic_release=0.15,
            mu_static_release=0.18,
            adhesion_N=0.5,
        ),
        actuator=Actuator(
            mass_kg=0.15,
            damping_N_s_per_m=5.0,
            force_min_N=0.0,
            force_max_N=200.0,
            force_rate_max_N_per_s=1e5,
        ),
        load=Load(mass_kg=0.02, stiffness_N_per_m=3000.0, damping_N_s_per_m=2.0),
    )


@pytest.fixture(scope="session")
def browser():
    """Chromium without a screen and without a network; skips where it is not installed."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("chromium and chromedriver (Debian: chromium, chromium-driver) are not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for flag in ("--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"):
        options.add_argument(flag)
    options.add_argument("--window-size=1280,900")
    # No name resolves but this machine's own: a page that asked the network would fail to load it, and be seen.
    options.add_argument("--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE localhost")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with webdriver.Chrome(options=options, service=webdriver.ChromeService(driver)) as opened:
        opened.set_page_load_timeout(60)
        yield opened


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let the golden set be written anew, or be compared with that of another commit."""
    add = parser.getgroup("golden set").addoption
    add("--golden-update", action="store_true", help="store what the commands write now in tests/golden/stored")
    add("--golden-folder", metavar="FOLDER", help="store there, or compare with what is stored there")
    add(
        "--golden-exact",
        metavar="BASE",
        help="compare with what commit BASE writes on this machine: numbers to 1e-12, texts to the byte",
    )
    add("--golden-full", action="store_true", help="store in full, compare exactly (what --golden-exact does in BASE)")
    parser.addoption(
        "--every-combination",
        action="store_true",
        help="run also what the marks `each_value` and `nightly` leave out of the ordinary run",
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave combinations to the nightly run: of `each_value`, all but so many that every value is met once."""
    whole = ("every_combination", "golden_update", "golden_folder")
    if any(config.getoption(name) for name in whole) or any("::" in argument for argument in config.args):
        return
    left = {item for item in items if item.get_closest_marker("nightly")}
    functions: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item not in left and item.get_closest_marker("each_value"):
            functions.setdefault(item.nodeid.split("[", maxsplit=1)[0], []).append(item)
    for combinations in functions.values():
        left.update(set(combinations) - set(_meeting_each_value(combinations)))
    config.hook.pytest_deselected(items=[item for item in items if item in left])
    items[:] = [item for item in items if item not in left]


def _meeting_each_value(combinations: Sequence[pytest.Item]) -> list[pytest.Item]:
    """So many of the combinations that every value of every parameter is among them; always the same ones."""
    values = {
        item: {(name, id(value)) for name, value in item.callspec.params.items()}  # type: ignore[attr-defined]
        for item in combinations
    }
    missing, chosen = set().union(*values.values()), []
    while missing:
        best = max(combinations, key=lambda item: len(values[item] & missing))
        chosen.append(best)
        missing -= values[best]
    return chosen


def pytest_configure(config: pytest.Config) -> None:
    """Record the golden set of the commit to compare with, once, before workers start."""
    base = config.getoption("golden_exact")
    if base is None or hasattr(config, "workerinput"):
        return
    temporary = Path(tempfile.mkdtemp(prefix="golden-"))
    config.add_cleanup(lambda: shutil.rmtree(temporary, ignore_errors=True))
    config.option.golden_folder, config.option.golden_full = str(temporary / "stored"), True
    _record(base, temporary, config.invocation_params.args)


def _record(base: str, temporary: Path, arguments: Sequence[str | os.PathLike[str]]) -> None:
    """Let another commit write its golden set into a temporary folder, by today's tests and the same selection."""
    checkout, there = temporary / "checkout", temporary / "stored"
    archive = subprocess.run(["git", "archive", "--format=tar", base], cwd=ROOT, capture_output=True, check=False)
    if archive.returncode:
        raise pytest.UsageError(f"--golden-exact {base}: {archive.stderr.decode().strip()}")
    with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as files:
        files.extractall(checkout, filter="tar")
    for name in ("conftest.py", "shared_outputs.py", "without_figures.py"):
        shutil.copy(ROOT / "tests" / name, checkout / "tests")
    shutil.copytree(
        ROOT / "tests" / "golden", checkout / "tests" / "golden", dirs_exist_ok=True, ignore=lambda *_: ["stored"]
    )
    kept = [str(argument) for argument in arguments]
    place = next(i for i, argument in enumerate(kept) if argument.startswith("--golden-exact"))
    del kept[place : place + (1 if "=" in kept[place] else 2)]
    command = [sys.executable, "-m", "pytest", *kept, "--golden-update", "--golden-full", f"--golden-folder={there}"]
    data = os.environ.get("TENDONFF_DATA") or str(ROOT.parent / "shared" / "data")
    run = subprocess.run(
        [*command, "--override-ini=pythonpath=. tests tests/golden"],
        cwd=checkout,
        env={**os.environ, "TENDONFF_DATA": data},
        capture_output=True,
        text=True,
        check=False,
    )
    if run.returncode:
        raise pytest.UsageError(f"--golden-exact {base}: its commands failed\n{run.stdout[-4000:]}{run.stderr[-1000:]}")


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """Tests that share what a fixture of their file or folder made stay on one worker, so that it is made once."""
    from xdist.scheduler import LoadScopeScheduling

    class ByFixture(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = config.rootpath / nodeid.split("::", maxsplit=1)[0]
            for shared in (file.parent / "conftest.py", file):
                if shared != Path(__file__) and shared.is_file() and _SHARED.search(shared.read_text("utf-8")):
                    return str(shared)
            return nodeid

    return ByFixture(config, log)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what compares with compiled C where there is no compiler."""
    if item.get_closest_marker("compiler") and compiler.find_compiler() is None:
        pytest.skip("no C compiler found (looked for CC, cc, gcc, clang and the package ziglang)")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print what tests measured (`record_property("figure", text)`), from every worker."""
    reports = [r for r in terminalreporter.stats.get("passed", []) if getattr(r, "when", "") == "call"]
    figures = sorted({str(text) for r in reports for name, text in r.user_properties if name == "figure"})
    if figures:
        terminalreporter.section("measured figures")
        for figure in figures:
            terminalreporter.line(figure)
