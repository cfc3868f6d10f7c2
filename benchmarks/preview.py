"""Gain from preview in the stream module where the force rate binds, compared with the optimal profile.

    python benchmarks/preview.py [PREVIEW_S ...]

The example is `finger_fast.toml` at its own rate limit. The stream module receives the reference of a 12 bit converter
and filters it, the optimal profile the reference itself.
"""

import sys

from optimise_others import EXAMPLES

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.stream import choose_stream, over_preview
from tendonff.compensator.scenario.settings import Stream
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.optimal.track import track

PREVIEWS_S = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5)


def main() -> None:
    scenario = load_scenario(EXAMPLES / "finger_fast.toml")
    problem = Problem.of(scenario)
    reference = problem.reference
    task = (problem.chain, reference.tension_N, reference.step_s, problem.limits)
    whole = track(*task)
    print(f"clipped inverse {whole.clipped_rms_error_N:.3f} N, all known {whole.rms_error_N:.3f} N")
    choice = choose_stream(problem, scenario.stream or Stream())
    assert choice is not None
    for preview in map(float, sys.argv[1:] or PREVIEWS_S):
        stream = over_preview(problem, choice.picked.design, [preview])
        reached = f"{stream[0].score.rmse:.3f} N" if stream else "no force"
        print(f"{preview:5.2f} s: stream {reached}", flush=True)


if __name__ == "__main__":
    main()
