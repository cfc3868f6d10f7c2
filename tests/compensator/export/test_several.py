"""Several tensions in one C project."""

import shutil
import subprocess
from dataclasses import replace

import pytest

import tendonff as tf


@pytest.fixture(scope="module")
def quick(examples):
    scenario = tf.load_scenario(examples / "finger.toml")
    path = replace(scenario.transmission.path, segments=2)
    return replace(
        scenario,
        transmission=replace(scenario.transmission, path=path),
        reference=replace(scenario.reference, duration_s=0.2),
        run=replace(scenario.run, level=tf.Level.ELASTIC, step_s=0.005),
        optimal=replace(scenario.optimal, stiffer_weight=0.0),
    )


def test_two_tensions_of_one_project_link_into_one_program(quick, tmp_path):
    every = [replace(quick, source=tmp_path / f"{name}.toml") for name in ("thumb", "ring finger")]
    exported = tf.export_c(every[0], further=every[1:], force_export=True)
    exported.write(tmp_path / "c")
    assert "FOLDERS = thumb ring_finger" in (tmp_path / "c" / "Makefile").read_text("utf-8")
    sources = [*(tmp_path / "c").glob("*/tff_*_inverse.c"), *(tmp_path / "c").glob("*/tff_*_plant.c")]
    sources += [*(tmp_path / "c").glob("*/tff_*_limits.c"), *(tmp_path / "c").glob("*/tff_*_parameters.c")]
    assert len(sources) == 8
    if shutil.which("cc"):
        subprocess.run(["cc", "-O0", "-shared", "-fPIC", "-o", tmp_path / "x.so", *sources, "-lm"], check=True)


def test_two_tensions_of_one_name_are_refused(quick, tmp_path):
    with pytest.raises(tf.InputError, match="files of one name; rename one"):
        tf.export_c(quick, further=(replace(quick, source=tmp_path / "finger.toml"),))
