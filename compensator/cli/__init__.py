"""The command line `tendonff`: one module per command, all listed here.

Exit codes: 0 success; 1 a solve failed, with its diagnosis; 2 bad input, with one message; 130 interrupted.
"""

import gc
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, cast

import typer

from tendonff._version import __version__
from tendonff.compensator.cli.commands.decide.compare import compare
from tendonff.compensator.cli.commands.decide.design import design
from tendonff.compensator.cli.commands.decide.explore import explore
from tendonff.compensator.cli.commands.decide.sweep import sweep
from tendonff.compensator.cli.commands.deploy.export_c import export_c
from tendonff.compensator.cli.commands.deploy.export_fmu import export_fmu
from tendonff.compensator.cli.commands.deploy.table import table
from tendonff.compensator.cli.commands.model.example import example
from tendonff.compensator.cli.commands.model.experiment import experiment
from tendonff.compensator.cli.commands.model.import_ import import_
from tendonff.compensator.cli.commands.model.new import new
from tendonff.compensator.cli.commands.model.path import path
from tendonff.compensator.cli.commands.model.simulate import simulate
from tendonff.compensator.cli.commands.rig.adapt import adapt
from tendonff.compensator.cli.commands.rig.identify import identify
from tendonff.compensator.cli.commands.rig.watch import watch
from tendonff.compensator.cli.progress import forget_warnings, leave, say
from tendonff.compensator.files import interrupts
from tendonff.models.errors import TendonffError

EXIT_SOLVE, EXIT_INPUT, EXIT_INTERRUPTED = 1, 2, 130

# Base of typer's complaints about arguments. Newer typers bring their own copy of click, so that it cannot be imported
# under one name; `BadParameter` is public in all of them.
_USAGE_ERRORS = cast(
    tuple[type[typer.BadParameter], ...],
    tuple(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException"),
)


class _Grouped(typer.core.TyperGroup):
    """The commands in the order of the work, under a heading for each part of it."""

    def format_commands(self, _ctx: Any, formatter: Any) -> None:
        """List the commands group by group."""
        width = formatter.width - 6 - max(map(len, self.commands))
        for title, commands in _GROUPS.items():
            names = [_name(command) for command in commands]
            with formatter.section(title):
                formatter.write_dl([(name, self.commands[name].get_short_help_str(width)) for name in names])


app = typer.Typer(
    name="tendonff",
    cls=_Grouped,
    help="Feedforward friction compensation for tendon and Bowden-cable drives: compute the actuator force that "
    "produces a desired output tension, and export it to your controller.",
    rich_markup_mode=None,  # plain text: panels wrap file names, and messages are to be grepped
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"tendonff {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Show the version.", callback=_show_version, is_eager=True)
    ] = False,
) -> None:
    pass


_GROUPS: Mapping[str, Mapping[Callable[..., object], str]] = {
    "Model": {
        new: "mine.toml --for bowden",
        example: "finger",
        import_: "hand.xml --out hand.toml",
        path: "centreline.csv",
        simulate: "mine.toml --force force.csv --out run.csv",
        experiment: "mine.toml",
    },
    "Decide": {
        design: "mine.toml",
        compare: "mine.toml",
        sweep: "mine.toml --samples 200",
        explore: "mine.toml",
    },
    "Rig": {
        identify: "mine.toml --data log.csv",
        adapt: "mine.toml",
        watch: "fitted.toml --data monday.csv --data tuesday.csv",
    },
    "Deploy": {
        table: "mine.toml",
        export_c: "mine.toml",
        export_fmu: "mine.toml",
    },
}
"""Commands by the part of the work that they belong to, each with the arguments of an example."""


def _name(command: Callable[..., object]) -> str:
    return command.__name__.rstrip("_").replace("_", "-")  # import_ is `import`, a keyword of Python


for _commands in _GROUPS.values():
    for _command, _example in _commands.items():
        app.command(_name(_command), epilog=f"Example: tendonff {_name(_command)} {_example}")(_command)


def _example_after(error: Exception) -> str:
    """The command's example behind a complaint about an argument that no option introduces."""
    command = getattr(getattr(error, "ctx", None), "command", None)
    if type(error).__name__ != "UsageError" or command is None or not command.epilog:
        return ""
    return f"; for instance: {command.epilog.partition(': ')[2]}"


def run(arguments: Sequence[str]) -> int:
    """Run one command and turn what goes wrong into a message and an exit code."""
    command = typer.main.get_command(app)
    forget_warnings()
    if not arguments:
        command.main(["--help"], prog_name="tendonff", standalone_mode=False)
        return EXIT_INPUT
    try:
        result = command.main(list(arguments), prog_name="tendonff", standalone_mode=False)
    except _USAGE_ERRORS as error:
        say(f"error: {error.format_message().replace('Value error, ', '')}{_example_after(error)}")
        return EXIT_INPUT
    except (KeyboardInterrupt, typer.Abort, interrupts.Interrupted) as ended:
        say(f"interrupted; {ended if isinstance(ended, interrupts.Interrupted) else 'nothing was written'}")
        return EXIT_INTERRUPTED
    except TendonffError as error:
        say(f"error: {error}")
        return EXIT_SOLVE if isinstance(error, RuntimeError) else EXIT_INPUT
    except BrokenPipeError:
        return EXIT_SOLVE
    except OSError as error:
        name = f"{error.filename}: " if error.filename else ""
        say(f"error: {name}{error.strerror or error}; nothing was written")
        return EXIT_SOLVE
    except MemoryError:
        say(
            "error: not enough memory; use a larger step_s, fewer segments or samples, or a shorter file; "
            "nothing was written"
        )
        return EXIT_SOLVE
    if result == EXIT_INTERRUPTED:  # some versions of typer catch Ctrl-C and return the code instead
        say("interrupted; nothing was written")
    return result if isinstance(result, int) else 0


def main() -> None:
    """Entry point of the program."""
    interrupts.install()
    gc.set_threshold(50_000, 20, 100)  # importing and drawing make many objects that stay
    try:
        code = run(sys.argv[1:])
    except Exception:  # what is interrupted while a compiled module is loaded may fail in any way
        if not interrupts.stopped():
            raise
        say("interrupted; nothing was written")
        code = EXIT_INTERRUPTED
    interrupts.ended()
    leave(EXIT_INTERRUPTED if interrupts.stopped() else code)
