"""`holokin cell`: from a robot and a file of paths to verdict, rule, checks, certificate and program."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ...base.errors import HolokinError, UnknownNameError
from ...version import build
from .outcome import Base, RobotOrJob, Tip, TrustUnits, ending, print_as, show

if TYPE_CHECKING:
    from ...analysis.design import Advice
    from ..job import Job
    from ..job.cell_answer import Outcomes
    from ..job.cell_job import CellJob

NAME, PROGRAM = "cell", "program"
"""Of the job, and so of the folders of its results; of the folder of the program."""


class Lengths(StrEnum):
    """Units of lengths in files of paths."""

    M, MM, IN = "m", "mm", "in"


def cell(
    robot: RobotOrJob,
    paths: Annotated[
        Path, typer.Argument(metavar="PATHS", help="What a CAM system writes: a table, APT, CLS, G-code, DXF or SVG.")
    ],
    scene: Annotated[
        Path | None,
        typer.Option(help="What stands there: an .srdf, or a .toml with [checks], [frames], [robot], ... of a job."),
    ] = None,
    at: Annotated[
        str | None, typer.Option(help='Where the part stands: "X Y Z" [m], or "X Y Z ROLL PITCH YAW" [m, degrees].')
    ] = None,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
    speed: Annotated[float | None, typer.Option(help="Of the tool [m/s], in place of that of the file.")] = None,
    units: Annotated[Lengths | None, typer.Option(help="Of lengths, where the file states none.")] = None,
    columns: Annotated[
        str | None, typer.Option(help='Of a table without a header, as "x_mm, y_mm, z_mm, i, j, k".')
    ] = None,
    language: Annotated[
        str | None, typer.Option(help="Of the program, as in `holokin export`; by default by the name of the arm.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The folder to write; by default out/PATHS-cell.")] = None,
) -> None:
    """From a robot and a CAM file to verdict, rule, checks, certificate and robot program, all in one folder.

    Writes the job OUT/cell.toml, which is yours from then on, and what `holokin advise`, `run`, `certify` and `export`
    make of it. Prints the answer in six sentences, and the commands that make each of the files again.

    Exits 0 when the arm goes along all paths, clear and proven, and the program is written; 1 when some of that is
    missing; 2 on bad input.
    """
    from ...export import LANGUAGES, language_of
    from ..job import open_one_job
    from ..job.cell_answer import clearance, next_step, verdict, what_was_read
    from ..job.cell_job import write_cell
    from ..report.job_result import check_folder

    # What is asked.
    if language is not None and language not in LANGUAGES:
        raise UnknownNameError("language of programs", language, tuple(LANGUAGES))
    folder = Path("out", f"{paths.stem}-{NAME}") if out is None else out
    for name in (NAME, f"{NAME}-proof"):
        check_folder(folder, name)
    file, given = folder / f"{NAME}.toml", None if columns is None else [word.strip() for word in columns.split(",")]
    made: list[Path] = []
    try:
        with ending().telling(paths.name) as say:
            # The job and its rule, what it does, the proof and the program.
            say("the job")
            draft = write_cell(
                robot, paths, folder, scene=scene, tip=tip, base=base, trust_units=trust_units, at=at, speed=speed,
                units=None if units is None else units.value, columns=given,
            )  # fmt: skip
            made.append(draft.file)
            advice = None if draft.ruled else _ruled(draft, file, say)
            made += [] if draft.ruled else [file]
            opened = open_one_job(str(file))
            outcomes, report = _done(opened, folder, say)
            made.append(report)
            proven, proof = _proven(opened, folder, say)
            made.append(folder / f"{NAME}-proof")
            say("the program")
            known = language_of(robot, draft.robot.name)
            language = language or known or "ros"
            exported, program = _exported(opened, folder, language, known is None, outcomes, draft)
    except BaseException:
        if made:
            show(f"made until then: {', '.join(map(str, made))}")
        raise
    # The answer in the units of the job, and how each file is made again.
    print_as(*opened[1:])
    by = opened[1].printed_units
    show(verdict(draft, advice, outcomes))
    show(what_was_read(draft, by))
    show(clearance(outcomes, by))
    show(proof)
    show(program)
    show(next_step(draft, file, outcomes, exported, proven, by))
    show(f"\nAll of it is in {folder}; {file} is yours from now on. Its files are made again by:")
    words = [] if draft.ruled else [["advise", str(draft.file), "--any-start", "--out", str(file)]]
    words += [["run", str(file), "--out", str(folder)], ["certify", str(file), "--out", str(folder)]]
    words += [["export", language, str(file), "--out", str(folder / PROGRAM)]]
    for command in words:
        show(f"  holokin {shlex.join(command)}")
    raise typer.Exit(0 if exported and proven and outcomes.clear and not outcomes.left else 1)


def _ruled(draft: CellJob, file: Path, say: Callable[[str], None]) -> Advice:
    """The job with the rule that is advised, and the picture of the advice, as `holokin advise` writes them."""
    from ..job.advice_job import advise_command, question
    from ..report.advice_report import advice_figure
    from ..report.plots import write_figure

    asked = question(str(draft.file), any_start=True)
    advice, write = advise_command(str(draft.file), asked, file, say, say)
    say("trying the job")
    write()
    write_figure(lambda: advice_figure(advice, asked.shown), file.with_suffix(".png"))
    return advice


def _done(opened: tuple[str, Job, Path], folder: Path, say: Callable[[str], None]) -> tuple[Outcomes, Path]:
    """What the job does, and its report, as `holokin run` writes it."""
    from ..job import run_job, run_paths
    from ..job.cell_answer import Outcomes
    from ..report.job_report import write_report
    from ..report.paths_report import write_paths_report

    if opened[1].paths:
        several = run_paths(*opened, say)
        return Outcomes.of(several), write_paths_report(several, folder, build())
    one = run_job(*opened, say)
    say("drawing")
    return Outcomes.of(one), write_report(one, folder, build())


def _proven(opened: tuple[str, Job, Path], folder: Path, say: Callable[[str], None]) -> tuple[bool, str]:
    """Whether the job's motion is proven, in words; with the certificates, as `holokin certify` writes them."""
    from ...proof.recheck import ask_checker
    from ..job import certify_job
    from ..job.cell_answer import proof
    from ..report.proof_report import write_certificates

    certificates, words = {}, {}
    try:
        for label, certificate in certify_job(*opened[1:], progress=say):
            certificates[label] = certificate
            if not isinstance(certificate, str):
                say("the checker")
                words[label] = ask_checker(certificate)
    except HolokinError as problem:
        return False, f"Not proven: {problem}."
    write_certificates(f"{opened[0]}-proof", certificates, words, folder, build(), False)
    return proof(certificates, words)


def _exported(
    opened: tuple[str, Job, Path], folder: Path, language: str, guessed: bool, outcomes: Outcomes, draft: CellJob
) -> tuple[bool, str]:
    """Whether the program is written, in words, as by `holokin export`."""
    from ...export import LANGUAGES
    from ..job import program_of_job, program_of_paths
    from ..job.cell_answer import program_words

    controller = LANGUAGES[language].controller
    if outcomes.timed is None or not outcomes.clear:
        why = "the motion does not come to its end" if outcomes.timed is None else "the motion is not clear"
        return False, f"No program for {controller}: {why}."
    try:
        if opened[1].paths:
            program, plan = program_of_paths(*opened, language)
            timed = plan.timed
        else:
            program, timed, _ = program_of_job(*opened, language)
    except HolokinError as problem:
        return False, f"No program for {controller}: {problem}."
    files = program.save(folder / PROGRAM)
    timed.save(folder / PROGRAM / "joints.csv", opened[1].printed_units)
    return True, program_words(language, guessed, files[0], program, outcomes, draft.task, opened[1].printed_units)
