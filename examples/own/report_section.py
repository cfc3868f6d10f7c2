"""A section of one's own in the report of a design."""

import tempfile
from dataclasses import replace
from pathlib import Path

import tendonff as tf
from tendonff.compensator.reporting.page import Section, Table, Text, write_report
from tendonff.compensator.studies.design.figures import design_figures
from tendonff.compensator.studies.design.report import design_report

scenario = tf.load_scenario("examples/finger.toml")
scenario = replace(scenario, reference=replace(scenario.reference, duration_s=0.5))
result = tf.design(scenario, compensators=["none", "capstan"])
rows = [(name, profile.force_N.max() - profile.force_N.min()) for name, profile in result.profiles.items()]
section = Section(
    title="Range of the force",
    blocks=(
        Text("The largest force less the smallest, which the amplifier has to cover."),
        Table(caption="Range of each profile", columns=("profile", "range [N]"), rows=rows),
    ),
)
report = design_report(result, design_figures(result))
with tempfile.TemporaryDirectory() as folder:
    page = Path(folder, "report.html")
    write_report(page, replace(report, sections=(*report.sections, section)))
    print(f"{page.stat().st_size} bytes, with the section: {'Range of the force' in page.read_text(encoding='utf-8')}")
