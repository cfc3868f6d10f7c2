"""`tendonff explore`: sliders for one scenario, in the browser."""

from typing import Annotated

import typer

from tendonff.compensator.cli.options import ScenarioArgument, YesOption, looked_at
from tendonff.compensator.cli.progress import say
from tendonff.compensator.files.text import InputError


def explore(
    scenario: ScenarioArgument,
    port: Annotated[
        int, typer.Option("--port", help="Port on this machine; 0 takes any that is free.", min=0, max=65535)
    ] = 5006,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")] = True,
    yes: YesOption = False,
) -> None:
    """Explore a scenario in the browser.

    Sliders change friction, angle, presliding stiffness, relaxation, rate limit, load and the pose of joints; for a
    driven joint friction, stiffness, tension, load and servo lag.
    """
    loaded = looked_at(scenario, yes=yes)
    try:
        from tendonff.compensator.studies.explore.page import make_server, page_url
    except ModuleNotFoundError as error:
        if error.name != "bokeh":
            raise
        raise InputError("explore needs Bokeh, which is not installed; install it by: pip install bokeh") from None
    from tendonff.compensator import door

    server = make_server(door.explore(loaded), port)
    server.start()
    say(f"{page_url(server)} (this machine only; Ctrl-C ends it)")
    if browser:
        import webbrowser

        server.io_loop.add_callback(webbrowser.open, page_url(server))
    try:
        server.io_loop.start()
    except KeyboardInterrupt:  # the way to end it
        pass
    finally:
        server.stop()
