"""The command line: one subcommand a verb.

Exit codes: 0 as expected, 1 an expectation failed, 2 bad input or a file that cannot be written, 3 a fault of holokin
itself, 130 stopped by Ctrl-C.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from ..errors import ArgumentError
from ..version import build
from .check import Columns, Degrees, Log, RobotName, TimeColumn, TipName, Topic, check
from .check_certificate import check_certificate
from .export import OneJob, exporting
from .outcome import Ending, finish, prepare_streams, show, show_rich
from .simulate import simulating
from .studio import studio
from .survey import surveying

if TYPE_CHECKING:
    from ..job import Job


class _EscapedError(Exception):
    """Carries, as its cause, an exception that typer would answer in its own way, out to `main`."""


class _Commands(TyperGroup):
    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Every command with the first paragraph of its help, whole."""
        found = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        rows = [(name, " ".join((one.help or "").split("\n\n")[0].split())) for name, one in found if one is not None]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def invoke(self, ctx: Any) -> Any:
        """Run the subcommand; what typer would answer in its own way goes out as `_EscapedError`."""
        sys.excepthook = _ending.printed  # here, since typer sets one of its own when it is called
        try:
            return super().invoke(ctx)
        except (KeyboardInterrupt, EOFError, OSError) as problem:
            raise _EscapedError from problem


_ending = Ending()
"""Of the command that runs: set by `main`."""

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
        from ..codegen import engine

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


@app.command()
def run(
    jobs: Annotated[
        list[str], typer.Argument(metavar="JOB...", help="Packaged jobs (`holokin jobs`), 'paper', or .toml files.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out"),
    animate: Annotated[bool, typer.Option("--animate", help="Make films of the two ways and of the cycles.")] = False,
) -> None:
    """Do jobs: a table each in the terminal, figures, trajectories and a report in OUT/<job>/.

    Exits 0 when every expectation of every job holds, 1 when one fails, 2 when a strategy cannot be run, after the
    others have been, and on bad input: of the command or of a job file before anything runs, else of the jobs that
    cannot be done or written, after the others have been; 3 where holokin itself failed at one.
    """
    from ..job import run_job
    from ..output.animate import animate as draw
    from ..output.job_report import write_report
    from ..output.job_table import print_result
    from ..output.result_folder import check_folder

    code = 0
    opened = _opened(jobs)
    for name, _, _ in opened:
        check_folder(out, name)
    for name, job, file in opened:
        with _ending.telling(name) as say:
            try:
                result = run_job(name, job, file, say)
                say("drawing")
                extra = (lambda folder, result=result, say=say: draw(result, folder, say)) if animate else None
                folder = write_report(result, out, build(), extra)
                show_rich(lambda console, result=result: print_result(result, console))
                show(f"  {result.seconds:.1f} s, report: {folder / 'report.html'}\n")
                code = max(code, result.exit_code)
            except Exception as problem:  # noqa: BLE001  whatever happens to one job, the others are done
                _ending.check()
                code = max(code, _ending.tell(problem, name if len(opened) > 1 else ""))
    raise typer.Exit(code)


def _opened(names: list[str]) -> list[tuple[str, Job, Path]]:
    """(short name, job, file) of each job, once. Raises: ArgumentError when two would write one folder."""
    from ..job import expand, open_job

    found: dict[str, tuple[str, Job, Path]] = {}
    for name, job, file in map(open_job, expand(names)):
        other = found.setdefault(name.casefold(), (name, job, file))[2]
        if other.absolute() != file.absolute():
            cure = f"{other} and {file} would write into one folder: rename one, or run them with an --out each"
            raise ArgumentError("the name of two jobs", name, cure)
    return list(found.values())


@app.command()
def jobs(
    kinds: Annotated[
        bool, typer.Option("--kinds", help="List the kinds of strategy that a job file may hold, and their keys.")
    ] = False,
) -> None:
    """List the packaged jobs, or what a job file may hold."""
    from ..job import KINDS, PAPER, keys_of, open_job, packaged_jobs

    if kinds:
        for kind, model in KINDS.items():
            needed, optional = keys_of(model)
            more = f"   may have {', '.join(optional)}" if optional else ""
            show(f"{kind:16} {'needs ' + ', '.join(needed) if needed else ''}{more}".rstrip())
        return
    for name in packaged_jobs():
        show(f"{name:22} {open_job(name)[1].title}")
    show(f"{'paper':22} {', '.join(PAPER)}")


@app.command()
def new(
    file: Annotated[Path, typer.Argument(help="The job file to write, ending in .toml.")],
    template: Annotated[
        str | None, typer.Option("--from", help="The packaged job to copy; by default panda-circle.")
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(help="Write a job for this robot instead: a catalogue name, .urdf, .xacro, .xml or .toml."),
    ] = None,
    tip: Annotated[str | None, typer.Option(help="With --robot: the link of a model that is the tool.")] = None,
    base: Annotated[str | None, typer.Option(help="With --robot: the link of a model that stands still.")] = None,
) -> None:
    """Write a job file of your own: a copy of a packaged one, or a small circle for a robot."""
    from ..job import new_job, new_job_for

    if robot is not None and template is not None:
        raise ArgumentError("--robot beside --from", template, "give one of them")
    for option, link in (("--tip", tip), ("--base", base)):
        if robot is None and link is not None:
            raise ArgumentError(f"{option} without --robot", link, "give the robot, too")
    if robot is not None:
        new_job_for(file, robot, tip, base)
    else:
        new_job(file, template or "panda-circle")
    show(f"wrote {file}; edit it, then: holokin run {file}")


@app.command()
def robots(
    model: Annotated[
        str | None,
        typer.Argument(help="A URDF, xacro or MJCF file: list its tips and the joints that lead there."),
    ] = None,
) -> None:
    """List the robots of the catalogue with joints and reach, or the chains of a model.

    The reach is the largest distance of the (first) tip from the base's origin within the joint limits, as computed.
    """
    from ..robot import catalogue, load, model_tips, reach

    if model is not None:
        for tip, joints in model_tips(model).items():
            show(f"{tip}: {len(joints)} moving joints{': ' if joints else ''}{', '.join(joints)}")
        return
    for name, source in catalogue().items():
        robot = load(name)
        show(f"{name:12} {robot.n:2} joints   reach {reach(robot):6.3f} m   {source}")


@app.command()
def audit(
    log: Log,
    robot: RobotName,
    tip: TipName = None,
    position: Annotated[
        bool, typer.Option("--position", help="The tool's orientation is free: look at its position alone.")
    ] = False,
    degrees: Degrees = None,
    topic: Topic = None,
    columns: Columns = None,
    time: TimeColumn = None,
    tolerance: Annotated[float, typer.Option(help="Joint distance in rad or m that counts as equal.")] = 1e-3,
    json: Annotated[Path | None, typer.Option("--json", help="Write the findings to this file.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="Write a figure to this file (.png, .svg, .pdf).")] = None,
) -> None:
    """Judge a log of joint motion: are the joints the same after each cycle of the tool?

    Exits 0 when they are in all that the log tests, 1 when they are not, 2 when the log does not decide, and on
    bad input.
    """
    from ..auditing import audit_recording
    from ..output.log_report import log_figure, print_log_audit, save_log_audit
    from ..output.plots import write_figure
    from ..recording import read_recording
    from ..robot import is_model, load

    arm = load(robot, tip=tip if is_model(robot) else None)
    found = audit_recording(
        read_recording(log, arm, degrees=degrees, topic=topic, columns=columns, time=time), arm, tip=tip,
        orientation=False if position else None, tolerance=tolerance,
    )  # fmt: skip
    if json is not None:
        save_log_audit(found, json)
    if plot is not None:
        write_figure(lambda: log_figure(found), plot)
    show_rich(lambda console: print_log_audit(found, console))
    raise typer.Exit(found.exit_code)


@app.command()
def advise(
    robot: Annotated[str, typer.Argument(help="Catalogue name, model (.urdf, .xacro, .xml) or .toml file.")],
    workspace: Annotated[
        str | None,
        typer.Option(help='Like "box X Y Z HX HY HZ tilt DEG spin DEG", or a .toml or .csv file; see docs/advise.md.'),
    ] = None,
    tip: Annotated[str | None, typer.Option(help="The link that is the tool; by default the palm of the arm.")] = None,
    base: Annotated[str | None, typer.Option(help="The link that stands still; by default the root.")] = None,
    position: Annotated[bool, typer.Option("--position", help="The tool's orientation is free.")] = False,
    start: Annotated[
        str | None, typer.Option(help="The posture to begin at, in rad and m, like '0 -0.8 0 -2.4 0 1.6 0.8'.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The job file to write, ending in .toml; with a picture of its name.")
    ] = None,
) -> None:
    """Find the law for a robot and its work: all that fit are compared on a workspace.

    Prints a table and why the best law is, and writes a job with it, by default advice-<robot>.toml, and a picture.
    Exits 0 when that is done, 2 on bad input.
    """
    from ..job.advice_job import advise_command
    from ..output.advice_report import advice_figure, print_advice
    from ..output.plots import write_figure

    with _ending.telling() as say:
        task = "position" if position else None
        found, write = advise_command(robot, workspace, tip, base, task, start, out, say, say.announce)
        show_rich(lambda console: print_advice(found, console))
        say("trying the job")
        job = write()
        picture = job.with_suffix(".png")
        say("drawing")
        write_figure(lambda: advice_figure(found), picture)
    show(f"wrote {job} and {picture} after {found.seconds:.0f} s; then: holokin run {job}")


@app.command()
def certify(
    job: OneJob,
    workspace: Annotated[
        bool, typer.Option("--workspace", help="Over the box of its [workspace], not along its path.")
    ] = False,
    budget: Annotated[int | None, typer.Option(help="Cells that may be examined for each strategy.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the certificates.")] = Path("out"),
) -> None:
    """Prove, for each strategy with leaves of a job, that the joints are one smooth function of the tool pose.

    Writes OUT/<job>-proof/<strategy>-certificate.json. Exits 0 when all of it is proven of every
    strategy with leaves, 1 when not, 2 on bad input.
    """
    from ..job import certify_job, open_one_job
    from ..output.proof_report import print_certificates, write_certificates
    from ..output.result_folder import check_folder

    name, opened, file = open_one_job(job)
    check_folder(out, f"{name}-proof")
    found = {}
    try:
        with _ending.telling(name) as say:
            for title, one in certify_job(opened, file, workspace=workspace, budget=budget, say=say):
                found[title] = one
    finally:  # after Ctrl-C those that are done
        files = write_certificates(f"{name}-proof", found, out, build()) if found else []
        for written in files:
            show(f"wrote {written}")
    show_rich(lambda console: print_certificates(opened.title, found, console))
    proven = [one for one in found.values() if not isinstance(one, str)]
    raise typer.Exit(0 if proven and all(one.whole for one in proven) else 1)


app.add_typer(exporting, name="export")
app.add_typer(surveying, name="survey")
app.command("simulate")(simulating(lambda name: _ending.telling(name)))
app.command()(check)
app.command()(studio)
app.command("check-certificate")(check_certificate)


def main() -> None:
    """Entry point: runs the command line and ends the process; every error becomes one sentence and an exit code."""
    global _ending
    arguments = sys.argv[1:]
    options = arguments[: arguments.index("--")] if "--" in arguments else arguments
    whole = "--traceback" in options
    if whole:  # at any place
        arguments.remove("--traceback")
    _ending = Ending(whole)
    prepare_streams()
    try:
        _ending.listen()
        try:
            app(args=arguments)
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
            _ending.check()
        except _EscapedError as escaped:
            code = _ending.tell(escaped.__cause__ or escaped)
    except BaseException as problem:  # noqa: BLE001
        code = _ending.tell(problem)
    code = finish(code)
    _ending.leave()
    sys.exit(code)


if __name__ == "__main__":
    main()
