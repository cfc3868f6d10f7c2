"""What the search for the optimal profile counts beside the nominal system."""

from dataclasses import replace
from pathlib import Path

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.scenario.reference import SineReference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.parameters.uncertainty import OtherLaw, Uncertainty


def test_the_other_law_is_counted_and_its_worst_error_falls(examples: Path) -> None:
    """3 N of load-independent friction or none: in the middle both leave less than the worse one alone."""
    finger = load_scenario(examples / "finger.toml")
    law = OtherLaw(keys=("friction.adhesion_N", "friction.mu_dynamic"), values=(3.0, 0.19))
    wave = SineReference(
        initial_tension_N=30.0, amplitudes_N=(12.0,), frequencies_Hz=(1.0,), duration_s=1.2, fade_in_s=0.3
    )
    known = replace(finger, reference=wave, robust=Uncertainty(mu=0.02, samples=3, other_law=law))
    alone = replace(known, robust=replace(known.robust, other_law=None))
    profiles = {
        name: compensator("optimal").profile(Problem.of(each)) for name, each in (("both", known), ("one", alone))
    }
    found = {name: band.worst.rmse for name, band in Problem.of(known).expect(profiles).bands.items()}
    assert found["both"] < 0.8 * found["one"]
