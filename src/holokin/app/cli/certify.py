"""`holokin certify`: proves leaves of a job; `holokin check-certificate`: checks a proof."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ...base.errors import ArgumentError
from ...base.progress import progress
from ...version import build

if TYPE_CHECKING:
    from ...proof import WholeArm
from .outcome import (
    Base,
    MaybeRobot,
    RobotOrJob,
    Tip,
    TrustUnits,
    each_minute,
    ending,
    robot_of_option,
    show,
    show_rich,
)


def certify(
    job: RobotOrJob,
    workspace: Annotated[
        bool, typer.Option("--workspace", help="Over the box of its [workspace], not along its path.")
    ] = False,
    whole_arm: Annotated[
        bool, typer.Option("--whole-arm", help="For every start and level; of strategies that hold single joints.")
    ] = False,
    strategy: Annotated[
        str | None, typer.Option(help='With --whole-arm and a robot: the strategy, as "lock joint7".')
    ] = None,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
    part: Annotated[
        bool, typer.Option("--part", help="With --workspace: prove as much of the box as can be proven.")
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="With --workspace: go on with the cells of a run that was stopped.")
    ] = False,
    budget: Annotated[int | None, typer.Option(help="Cells that may be examined for each strategy.")] = None,
    check: Annotated[
        float, typer.Option(min=0.0, help="Seconds that the checker may take for each certificate; 0: it is not run.")
    ] = 60.0,
    sample: Annotated[
        float | None, typer.Option(help="Share of the cells that the checker verifies, as 0.01; by default all.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the certificates.")] = Path("out"),
) -> None:
    """Prove, for each strategy with leaves of a job, that the joints return with the tool, on its path or in a box.

    Of several paths each is proven by itself, from the posture at which `holokin run` begins it.

    With --whole-arm it is proven for all poses, starts and levels, where the arm and the held joint allow it: of a job,
    or of a robot and one --strategy.
    Writes OUT/<job>-proof/<strategy>-certificate.json, and beside it a page to print, <strategy>-certificate.html.
    With python-flint the checker verifies each certificate, and the page says so. With --workspace the cells that are
    done lie in OUT/<job>-proof-<strategy>.cells until the certificates are written: a run that was stopped, or killed,
    goes on from there with --resume. Exits 0 when all of it is proven of
    every strategy with leaves, 1 when not, or when the checker rejects a certificate, 2 on bad input.
    """
    from ...proof.recheck import Outcome, ask_checker
    from ...robot import catalogue, is_model
    from ..job import alone_says, certify_job, is_job, open_one_job
    from ..report.job_result import CellsFiles, check_folder
    from ..report.proof_report import print_certificates, write_certificates

    # The job, and where its files go.
    for option, given in (("--part", part), ("--resume", resume)):
        if given and not workspace:
            raise ArgumentError(option, given, "it is about the box of the workspace: say --workspace, too")
    if sample is not None and not 0 < sample <= 1:
        raise ArgumentError("--sample", sample, "give the share of the cells that is verified, as 0.01")
    for option, given in (("--workspace", workspace), ("--sample", sample), ("--budget", budget)):
        if whole_arm and given:
            raise ArgumentError(
                f"{option} beside --whole-arm", given, "leave it out: the proof has no cells and no box"
            )
    of_robot = whole_arm and not is_job(job)
    if not of_robot:
        if not is_job(job) and (is_model(job) or job in catalogue()):
            raise ArgumentError("a robot", job, "it is certified with --whole-arm; else give a job")
        alone_says(job, {"--strategy": strategy, "--tip": tip, "--base": base, "--trust-units": trust_units})
    if of_robot:
        name, title, prove = _of_robot(job, strategy, tip, base, trust_units)
        several = False
    else:
        name, opened, file = open_one_job(job)
        title, prove = opened.title, partial(certify_job, opened, file)
        several = bool(opened.paths) and not whole_arm
    check_folder(out, f"{name}-proof")
    cells = CellsFiles(out / f"{name}-proof", resume) if workspace else None
    more = {} if cells is None else {"cells_file": cells.of}
    certificates, words, stopped = {}, {}, True
    # The search for each proof, and the checker; what is done is written also after Ctrl-C.
    try:
        with ending().telling(name) as say_it:
            say = each_minute(say_it)
            asked = {
                "workspace": workspace,
                "whole_arm": whole_arm,
                "part": part,
                "budget": budget,
                "progress": say,
                **more,
            }
            for label, certificate in prove(**asked):
                certificates[label] = certificate
                if not isinstance(certificate, str):
                    say(f"{label}: the checker")
                    words[label] = ask_checker(certificate, check, sample)
        stopped = False
    except BaseException:
        if cells is not None and (count := cells.count):
            show(f"{count:,} cells are kept: the same command with --resume goes on with them")
        raise
    finally:
        if certificates:
            for written in write_certificates(f"{name}-proof", certificates, words, out, build(), stopped):
                show(f"wrote {written}")
    # The table and the exit code; of several paths each is asked for.
    if cells is not None:
        cells.remove()
    show_rich(lambda console: print_certificates(title, certificates, words, console))
    proven = [
        c.whole if not isinstance(c, str) else False for c in certificates.values() if several or not isinstance(c, str)
    ]
    rejected = any(word.outcome is Outcome.REJECTED for word in words.values())
    raise typer.Exit(0 if proven and all(proven) and not rejected else 1)


def _of_robot(
    name: str, strategy: str | None, tip: str | None, base: str | None, trust_units: bool
) -> tuple[str, str, Callable[..., list[tuple[str, WholeArm | str]]]]:
    """(name for files, title, what makes [(strategy, certificate or why there is none)]) of a robot and a strategy."""
    import numpy as np

    from ...analysis.coverage.tool_chain import chain_to_tool
    from ...base.errors import NoProofError
    from ...proof import certify as prove
    from ...strategies import moore_penrose
    from ...strategies.tasks import pose
    from ..job.strategy_tables import EXAMPLE, leaf_of_words
    from ..report.job_result import free_name

    chain = chain_to_tool(name, tip, base, trust_units)
    task, words = pose(chain.robot, tip=chain.tip), strategy or "no joint held"
    if strategy is None and task.n > task.m:
        raise ArgumentError("--strategy", None, EXAMPLE)
    # Of strategies that hold joints no start matters.
    law = moore_penrose(task) if strategy is None else leaf_of_words(strategy, task, np.zeros(task.n))

    def proofs(**_options: object) -> list[tuple[str, WholeArm | str]]:
        try:
            return [(words, prove(law))]
        except NoProofError as problem:
            return [(words, problem.cure)]

    return free_name(f"{chain.robot.name} {words}", "", ()), task.name, proofs


def check_certificate(
    file: Annotated[Path, typer.Argument(help="The .json file of a certificate.")],
    robot: MaybeRobot = None,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
    sample: Annotated[
        float | None, typer.Option(help="Verify this share of the cells alone, drawn at random: 0.01 for 1 %.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="With --sample: which cells are drawn; by default others each time.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.0, help="Time that it may take.")] = 3600.0,
) -> None:
    """Verify a certificate again, by a small checker that shares no code with what found it. Needs python-flint.

    Prints what was verified, by the checker's own numbers; the file's words are named as such. With --robot the rows of
    the task are written down anew from its model, and compared, and so are the limits.
    The certificate of a whole arm is about a model of exact numbers, whose distance to the robot is said.
    With --sample only some cells are verified, each with a neighbour that it is joined to: it says how many of all.
    Exits 0 when it holds, or when the sample shows no fault, 1 when it is rejected, 2 on bad input.
    """
    from ...proof.recheck import recheck

    # The robot to compare it with.
    model = None
    if robot is not None:
        model = robot_of_option(robot, tip, base, trust_units)
    elif tip is not None or base is not None:
        raise ArgumentError("--tip or --base", tip or base, "it is of a robot: give --robot, too")
    if seed is not None and sample is None:
        raise ArgumentError("--seed", seed, "it is of a sample: give --sample, too")
    # The check.
    with progress(f"checking {file.name}", 1000) as report:
        rejected, text = recheck(file, report, seconds, model, sample, seed)
    show(text)
    raise typer.Exit(1 if rejected else 0)
