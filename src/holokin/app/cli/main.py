"""The command line: one subcommand a verb.

Exit codes: 0 as expected, 1 an expectation failed, 2 bad input or a file that cannot be written, 3 a fault of holokin
itself, 130 stopped by Ctrl-C, 143 by SIGTERM.
"""

from __future__ import annotations

import sys
from functools import cache
from typing import Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_command

from ...version import build
from .advise import advise
from .audit import audit
from .cell import cell
from .certify import certify, check_certificate
from .check import check
from .export import exporting
from .jobs import jobs
from .new import new
from .outcome import Ending, ending, finish, prepare_streams, set_ending, show
from .retarget import retarget
from .robots import robots
from .run import run
from .sheets import sheets
from .studio import studio
from .survey import surveying


class _EscapedError(Exception):
    """Carries, as its cause, an exception that typer would answer in its own way, out to `main`."""


class _Commands(TyperGroup):
    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Every command with the first paragraph of its help, whole."""
        commands = {name: self.get_command(ctx, name) for name in self.list_commands(ctx)}
        rows = [
            (name, " ".join((command.help or "").split("\n\n")[0].split()))
            for name, command in commands.items()
            if command is not None
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def invoke(self, ctx: Any) -> Any:
        """Run the subcommand; what typer would answer in its own way goes out as `_EscapedError`."""
        try:
            return super().invoke(ctx)
        except (KeyboardInterrupt, EOFError, OSError) as problem:
            raise _EscapedError from problem


app = typer.Typer(
    name="holokin",
    cls=_Commands,
    help="Makes redundant robots repeatable, and measures how repeatable any control law is.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # else what stands in brackets is lost
)


def _version(wanted: bool) -> None:
    if wanted:
        from ...symbolic.native import engine

        show(f"holokin {build()}, {engine()}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_version, is_eager=True, help="Say the version, and what runs: native code or not."
        ),
    ] = False,
    _whole: Annotated[
        bool, typer.Option("--traceback", help="Of an error show where it arose, too; with any subcommand.")
    ] = False,
) -> None:
    """Makes redundant robots repeatable, and measures how repeatable any control law is."""


for _command in (cell, run, jobs, new, robots, audit, retarget, advise, sheets, certify):
    app.command()(_command)
app.add_typer(exporting, name="export")
app.add_typer(surveying, name="survey")
for _command in (check, studio, check_certificate):
    app.command()(_command)

_whole_command = cache(lambda: get_command(app))
"""What runs the subcommands; reading their options takes longer than a short one, so once in a process."""


def main() -> None:
    """Entry point: runs the command line and ends the process; every error becomes one sentence and an exit code."""
    arguments = sys.argv[1:]
    options = arguments[: arguments.index("--")] if "--" in arguments else arguments
    whole = "--traceback" in options
    if whole:  # at any place
        arguments.remove("--traceback")
    set_ending(Ending(whole))
    prepare_streams()
    try:
        ending().listen()
        try:
            _whole_command()(args=arguments)
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
            ending().check()
        except _EscapedError as escaped:
            code = ending().tell(escaped.__cause__ or escaped)
    except BaseException as problem:  # noqa: BLE001
        code = ending().tell(problem)
    code = finish(code)
    ending().leave()
    sys.exit(code)


if __name__ == "__main__":
    main()
