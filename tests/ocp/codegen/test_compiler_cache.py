"""The cache of compiled libraries: what is torn is built anew, what is not the user's is not trusted."""

import os
import subprocess
import sys

import pytest

from tendonff.ocp.codegen import compiler
from tendonff.ocp.codegen.leftovers import remove_leftovers, temporary_name

pytestmark = pytest.mark.compiler
SOURCE = "int answer(void) { return 42; }\n"


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    compiler._works.cache_clear()
    yield tmp_path / "tendonff"
    compiler._works.cache_clear()


def libraries(folder):
    return sorted(p for p in folder.glob("*.so"))


def test_a_torn_library_is_built_anew(cache):
    """In another process for each: a library that is loaded stays what it was."""
    program = f"from tendonff.ocp.codegen.compiler import load_library; print(load_library({SOURCE!r}).answer())"

    def answer():
        return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout

    assert answer() == "42\n"
    made = libraries(cache)
    assert made
    for library in made:
        library.write_bytes(library.read_bytes()[:500])
    assert answer() == "42\n"
    for library in libraries(cache):
        library.write_bytes(b"")
        library.with_suffix(".sha256").unlink()
    assert answer() == "42\n"
    assert not list(cache.glob(".*partial"))


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o720])
def test_a_folder_that_others_may_write_to_is_not_used(cache, mode):
    cache.mkdir()
    cache.chmod(mode)
    assert compiler.load_library(SOURCE).answer() == 42
    assert not libraries(cache)
    cache.chmod(0o700)
    assert compiler.load_library(SOURCE).answer() == 42
    assert libraries(cache)


def test_a_folder_that_cannot_be_written_is_no_missing_compiler(cache, monkeypatch):
    monkeypatch.setattr(compiler, "_is_writable", lambda _: False)
    assert compiler.load_library(SOURCE).answer() == 42
    assert not libraries(cache)


def test_without_a_home_a_folder_of_the_process_serves(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(compiler.Path, "home", homeless)
    assert compiler.load_library(SOURCE).answer() == 42


def test_what_a_killed_process_left_is_removed_and_what_a_live_one_makes_stays(tmp_path):
    ended = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True, check=True
    )
    own = temporary_name("out")
    dead, within = (name.replace(f"-{os.getpid()}-", f"-{int(ended.stdout)}-") for name in (own, temporary_name(own)))
    other = dead.replace(".out.", ".else.")
    strange = ".out.0123456789ab.partial"
    for name in (own, dead, within, other, strange):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_text("x")
    remove_leftovers(tmp_path, "out")
    assert {p.name for p in tmp_path.iterdir()} == {own, other, strange}
    remove_leftovers(tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == {own, strange}
