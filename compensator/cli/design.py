"""`tendonff design`: the main job."""

from tendonff.compensator.cli.options import OutFolderOption, ScenarioArgument
from tendonff.compensator.cli.progress import announce, progress, warn

EXIT_SOLVE = 1  # what was written is the best that was found


def design(scenario: ScenarioArgument, out: OutFolderOption) -> int:
    """Design the actuator's force profile for a wanted output tension, and prove what it delivers."""
    from tendonff.compensator.design.run import design as design_profile
    from tendonff.compensator.design.run import write_design
    from tendonff.compensator.design.scores import print_scores
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.scenario.scenario import load_scenario
    from tendonff.ocp.tracking.result import TrackStatus

    loaded = load_scenario(scenario)
    announce(loaded)
    with progress("designing") as advance:
        result = design_profile(loaded, advance=advance)
    with progress("writing"), atomic_directory(out) as folder:
        write_design(result, folder)
    for warning in result.warnings:
        warn(warning)
    print_scores(result, out)
    return EXIT_SOLVE if result.tracking.status in (TrackStatus.INFEASIBLE, TrackStatus.FAILED) else 0
