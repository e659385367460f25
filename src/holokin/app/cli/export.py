"""`holokin export`: a strategy as C, and the motion of a job as a robot program."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ...base.errors import ArgumentError
from .outcome import Base, OneJob, RobotOrJob, Tip, TrustUnits, ending, show

if TYPE_CHECKING:
    from ..job import Job

# --- `holokin export web`: a page on which anyone drags a loop and sees two strategies follow it.


def export_web(
    name: RobotOrJob,
    out: Annotated[Path | None, typer.Option(help="The HTML file to write; by default out/NAME-web.html.")] = None,
    strategy: Annotated[
        str | None, typer.Option(help="The strategy beside the pseudo-inverse; by default the first with leaves.")
    ] = None,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
    cusps: Annotated[
        bool, typer.Option("--cusps", help="Look for a loop after which the joints are elsewhere, and offer it.")
    ] = False,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Write it also where a strategy does not get round, or [checks] fail.")
    ] = False,
) -> None:
    """Write a page in one file: anyone drags a loop in a browser, without an installation, and sees which joints drift.

    The pseudo-inverse (or the job's first strategy without leaves) is at the left, the strategy at the right. Both are
    computed by the browser. Needs the extra "native" for its compiler, which takes about a minute at its first call.

    Exits 0 when the page is written, 1 where a strategy does not get round the path once or fails the job's [checks],
    but with --anyway, 2 on bad input.
    """
    from ...base.errors import HolokinError
    from ..job import is_job, open_one_job
    from ..studio import open_session
    from ..studio.standalone_page import page_plan

    # What is written, and whether it gets round and passes the checks.
    plan = page_plan(open_session(name, tip=tip, base=base, trust_units=trust_units), strategy)
    stopped = [f"{label}: {problem}" for label, problem in plan.rounds.items() if isinstance(problem, HolokinError)]
    checked = plan.checked(open_one_job(name)[1]) if is_job(name) else None
    for line in [*stopped, *(checked.table().splitlines() if checked is not None else [])]:
        show(line)
    if (stopped or (checked is not None and not checked.passed)) and not anyway:
        show("nothing was written: cure it, or give --anyway")
        raise typer.Exit(1)
    # The page.
    loops = plan.cusp_loops() if cusps else []
    if cusps and not loops:
        show("no loop round a cusp was found, which is no proof that there is none")
    file = plan.page(loops).save(out or Path("out", f"{Path(name).stem}-web.html"))
    show(f"wrote {file}: {' and '.join(plan.strategies)}, {file.stat().st_size / 1000:.0f} kB")


Folder = Annotated[Path | None, typer.Option(help="The folder to write; by default one in out/, named like the job.")]
StrategyName = Annotated[
    str | None,
    typer.Option(help="The strategy's name in the job; by default the advised one, else the first with leaves."),
]
Orientation = Annotated[
    str | None, typer.Option(help="One of the job's representations of orientation; by default its first.")
]
Prefix = Annotated[str | None, typer.Option(help="Prefix of the C names; by default that of robot and strategy.")]


def _opened(name: str, kind: str, out: Path | None) -> tuple[tuple[str, Job, Path], Path]:
    """(a job, the folder of what is exported of it). Raises: as `open_one_job`; ArgumentError: not holokin's folder."""
    from ..job import open_one_job

    opened = open_one_job(name)
    return opened, Path("out", f"{opened[0]}-{kind}") if out is None else out


def _strategy(opened: tuple[str, Job, Path], label: str | None) -> str:
    """The strategy that is exported; one that was chosen here is said. Raises: as `default_strategy`."""
    from ..job import default_strategy

    if label is not None:
        return label
    label, why = default_strategy(*opened[1:])
    if why:
        show(why)
    return label


exporting = typer.Typer(help="Write a strategy for a controller.", no_args_is_help=True, rich_markup_mode=None)


@exporting.command("c")
def export_c(
    job: OneJob,
    out: Folder = None,
    strategy: StrategyName = None,
    orientation: Orientation = None,
    dt: Annotated[float, typer.Option(help="Step of the control loop in seconds, a default the C may change.")] = 1e-3,
    name: Prefix = None,
    check: Annotated[bool, typer.Option("--check", help="Build and run the self-test with the compiler here.")] = False,
) -> None:
    """Write a strategy as C99: library, headers of C and C++, self-test with its vectors, README.md.

    Exits 0 when all is written (and, with --check, the self-test passes), 2 else.
    """
    from ...export import check as build_and_run
    from ...export import export_c as write_c
    from ..job import exported_strategy

    opened, out = _opened(job, "c", out)
    law, given = exported_strategy(*opened, _strategy(opened, strategy), orientation=orientation, prefix=name)
    written = write_c(law, out, dt=dt, **given)
    for file in written.files:
        show(f"wrote {out / file}")
    if check:
        show("\n".join(build_and_run(written)))


@exporting.command("moveit")
def export_moveit(
    job: OneJob,
    out: Folder = None,
    strategy: StrategyName = None,
    orientation: Orientation = None,
    name: Prefix = None,
    package: Annotated[
        str | None, typer.Option(help="Name of the package; by default the C name and _moveit_plugin.")
    ] = None,
    group: Annotated[str, typer.Option(help="The planning group, for config/kinematics.yaml.")] = "arm",
) -> None:
    """Write a strategy as a kinematics plugin for MoveIt 2: a package of ROS 2 with the C, its tests and a README.md.

    Exits 0 when all is written, 2 else.
    """
    from ...export import export_moveit as write_package
    from ..job import exported_strategy

    opened, out = _opened(job, "moveit", out)
    law, given = exported_strategy(*opened, _strategy(opened, strategy), orientation=orientation, prefix=name)
    written = write_package(law, out, package=package, group=group, **given)
    for file in written.files:
        show(f"wrote {out / file}")
    show(f"in kinematics.yaml: kinematics_solver: {written.plugin}")


@exporting.command("ros2-control")
def export_ros2_control(
    job: OneJob,
    out: Folder = None,
    strategy: StrategyName = None,
    orientation: Orientation = None,
    name: Prefix = None,
    package: Annotated[
        str | None, typer.Option(help="Name of the package; by default the C name and _controller.")
    ] = None,
) -> None:
    """Write a strategy as a controller for ros2_control: a package of ROS 2 with the C, its tests and a README.md.

    Exits 0 when all is written, 2 else.
    """
    from ...export import export_ros2_control as write_package
    from ..job import exported_strategy

    opened, out = _opened(job, "ros2-control", out)
    law, given = exported_strategy(*opened, _strategy(opened, strategy), orientation=orientation, prefix=name)
    written = write_package(law, out, package=package, **given)
    for file in written.files:
        show(f"wrote {out / file}")
    show(f"in controller.yaml: type: {written.plugin}")


def _export_motion(language: str) -> Callable[..., None]:
    """The command that writes a job's motion in a language."""

    def command(
        job: OneJob,
        out: Folder = None,
        strategy: StrategyName = None,
        sheets: Annotated[
            bool, typer.Option("--sheets", help="The path over the job's [sheets], in place of a strategy.")
        ] = False,
        name: Annotated[str | None, typer.Option(help="The program's name; by default robot and strategy.")] = None,
        acceleration: Annotated[float | None, typer.Option(help="Of all joints [rad/s^2, m/s^2].")] = None,
        jerk: Annotated[float | None, typer.Option(help="Of all joints [rad/s^3, m/s^3]; by default no limit.")] = None,
        profile: Annotated[str | None, typer.Option(help="time-optimal, trapezoidal or quintic.")] = None,
        speed: Annotated[
            str | None, typer.Option(help="The most of the path's own speed, by default 1; `fastest` for any.")
        ] = None,
        dt: Annotated[float | None, typer.Option(help="The controller's step in seconds.")] = None,
        anyway: Annotated[bool, typer.Option("--anyway", help="Write it also where the job's [checks] fail.")] = False,
    ) -> None:
        from ..job import program_of_job, program_of_paths, program_of_sheets

        # The job, with its limits as they are given.
        most: float | str | None = speed
        with suppress(ValueError, TypeError):  # "fastest" is judged by [timing]
            most = float(speed)  # type: ignore[arg-type]
        given = {"acceleration": acceleration, "jerk": jerk, "profile": profile, "speed": most, "dt": dt}
        changes = {key: value for key, value in given.items() if value is not None}
        if sheets and strategy is not None:
            raise ArgumentError("--strategy", strategy, "--sheets takes the place of a strategy: leave one out")
        opened, out = _opened(job, language, out)
        units = opened[1].printed_units
        if opened[1].timing is None and acceleration is profile is None:
            changes["profile"] = "quintic"
            show("no acceleration is given: a quintic profile, within the speeds of the joints alone")
            show("the tool's speed then changes all along the path; with --acceleration 5 [rad/s^2] it can be steady")
        strategy = None if sheets else _strategy(opened, strategy)
        # The program, and what the checks say of its motion.
        code = 0
        if opened[1].paths:
            with ending().telling() as say:
                program, plan = program_of_paths(*opened, language, strategy, short=name, changes=changes, progress=say)
            timed, checked, code = plan.timed, None, int(bool(plan.left_out))
        elif sheets:
            with ending().telling() as say:
                program, timed, checked = program_of_sheets(
                    *opened, language, short=name, changes=changes, progress=say
                )
        else:
            program, timed, checked = program_of_job(*opened, language, strategy, short=name, changes=changes)
        if checked is not None:
            show(checked.table())
            if not (checked.passed or anyway):
                show("nothing was written: the motion fails the job's [checks]; cure it, or give --anyway")
                raise typer.Exit(1)
        # The files, and how near the program is to the motion.
        files = [*program.save(out), out / "joints.csv"]
        timed.save(files[-1], units)
        for file in files:
            show(f"wrote {file}")
        unit, factor = units.together(timed.joint_units)
        if program.tool is None:
            far = f"{factor * program.deviation:.2g} {unit}"
            show(f"{program.targets} targets, even motion between them within {far}")
        else:
            show("\n".join([f"{program.targets} targets", *program.tool.sentences(unit, factor)]))
        show("\n".join([*program.notes, timed.table(units)]))
        if code:
            raise typer.Exit(code)

    return command


exporting.command("web")(export_web)

_MORE = """With it joints.csv: every sample. Limits are those of the job's [timing], or given here.

Where the job has [checks] and the motion fails them, nothing is written and the exit code is 1, but with --anyway."""

_ABOUT = {
    "ros": "ROS 2: a trajectory_msgs/JointTrajectory, as YAML.",
    "rapid": "ABB RAPID: a module of MoveAbsJ, MoveL and MoveC.",
    "krl": "KUKA KRL: a .src of SPTP, LIN and CIRC, and its .dat.",
    "urscript": "Universal Robots URScript: servoj at 2 or 8 ms, else movej, movel and movec.",
    "inform": "Yaskawa INFORM: a .JBI of MOVJ and MOVL, in pulses.",
    "val3": "Staubli VAL3: a .pgx of movej, movel and movec.",
    "sunrise": "KUKA Sunrise: a .java of SplineJP motions of an iiwa.",
    "xarm": "UFACTORY: a .py of joint moves for the maker's SDK.",
    "franka": "Franka: a .csv of the joints every millisecond, and a .py that sends them.",
    "kinova": "Kinova Gen3: a .csv of the joints every millisecond, and a .py that sends it.",
    "gcode": "G-code: a .ngc of G1; the joints are the axes.",
    "ls": "FANUC TP: an .LS of J, L and C.",
}
"""Each of the languages (`holokin.export.LANGUAGES`, whose writers take long to load) in one line of help."""

for _name, _about in _ABOUT.items():
    exporting.command(_name, help=f"{_about}\n\n{_MORE}")(_export_motion(_name))
