"""`tendonff design`: the main job."""

from tendonff.compensator.cli.options import OutFolderOption, ScenarioArgument
from tendonff.compensator.cli.progress import progress, warn

EXIT_SOLVE = 1  # what was written is the best that was found


def design(scenario: ScenarioArgument, out: OutFolderOption) -> int:
    """Design the actuator's force profile for a wanted output tension, and prove what it delivers."""
    from tendonff.compensator.design.run import design as design_profile
    from tendonff.compensator.design.scores import print_scores
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.scenario.scenario import load_scenario

    loaded = load_scenario(scenario)
    with atomic_directory(out) as folder:  # entered first: a folder that cannot be written is known before the work
        with progress("designing") as advance:
            result = design_profile(loaded, progress=advance)
        with progress("writing"):
            result.write(folder)
    for warning in result.warnings:
        warn(warning)
    print_scores(result, out)
    return 0 if result.is_usable else EXIT_SOLVE
