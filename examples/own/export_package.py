"""A package of one's own around the exported C: a build file for Meson beside it."""

import tempfile
from pathlib import Path

import tendonff as tf

MESON = """project('{name}', 'c', default_options: ['c_std=c99', 'warning_level=3'])
tendon = static_library('{name}', {sources})
tendon_dep = declare_dependency(link_with: tendon, include_directories: include_directories('.'))
"""

scenario = tf.load_scenario("examples/finger.toml")

with tempfile.TemporaryDirectory() as folder:
    exported = tf.export_c(scenario, prefix="finger", precision=tf.Precision.FLOAT)
    exported.write(Path(folder, "c"))
    sources = sorted(file.name for file in Path(folder, "c").glob("finger_*.c"))
    Path(folder, "c", "meson.build").write_text(MESON.format(name="finger", sources=sources), encoding="utf-8")
    print(f"{len(sources)} sources: {', '.join(sources)}")
