"""Templates are translated once for all processes."""

import errno

import jinja2
import pytest

from tendonff.ocp.codegen import templates


@pytest.fixture
def translated(monkeypatch, tmp_path):
    """Names of the templates that are translated, one entry each time."""
    found = []
    compile_ = jinja2.Environment.compile

    def counted(self, source, name=None, *args, **kwargs):
        found.append(name)
        return compile_(self, source, name, *args, **kwargs)

    monkeypatch.setattr(jinja2.Environment, "compile", counted)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return found


def text():
    return templates.environment("tendonff.ocp.step").get_template("finish.c.j2")


def test_a_template_is_translated_once_and_anew_where_what_is_kept_is_torn(translated, tmp_path):
    text()
    text()
    assert translated == ["finish.c.j2"]
    (kept,) = (tmp_path / "tendonff").glob("*.template")
    whole = kept.read_bytes()
    for length in (0, 30, 60, len(whole) - 5):
        translated.clear()
        kept.write_bytes(whole[:length])
        text()
        assert translated == ["finish.c.j2"], length
        assert kept.read_bytes() == whole


def test_a_folder_that_cannot_be_written_costs_time_alone(translated, monkeypatch):
    def full():
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(templates, "cache_folder", full)
    text()
    text()
    assert translated == ["finish.c.j2"] * 2
