"""`holokin survey`: runs a survey, writes its report, repeats a case of it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from ...base.files import writing
from ...base.progress import progress
from .outcome import each_minute, show, show_rich

if TYPE_CHECKING:
    from ..survey import Progress

RUN = "run"


class _RunsFiles(TyperGroup):
    """`holokin survey FILE` is `holokin survey run FILE`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """With `run` put before what is no subcommand."""
        first = next((word for word in args if not word.startswith("-")), None)
        if first is not None and first not in self.commands:
            args = [RUN, *args]
        return super().parse_args(ctx, args)


_ABOUT = "Run a survey: many robots, starts, loops and strategies. `holokin survey FILE` runs one."
surveying = typer.Typer(cls=_RunsFiles, no_args_is_help=True, rich_markup_mode=None, help=_ABOUT)

Results = Annotated[Path, typer.Argument(metavar="RESULTS", help="The .sqlite file of a survey.")]


@surveying.command(RUN)
def run_one(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A survey (.toml).")],
    out: Annotated[Path | None, typer.Option(help="The results file; by default out/<survey>.sqlite.")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; by default one a processor.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the results that are there.")] = False,
    again: Annotated[bool, typer.Option("--again", help="Go on, and do again the cases that were faults.")] = False,
) -> None:
    """Run the cases of a survey: each row is kept as it comes, and --resume goes on where a run was stopped.

    Exits 0 when every case has a row, 2 on bad input.
    """
    from ..survey import Store, read_survey, run_survey

    # The survey and its results file.
    survey = read_survey(file)
    out = out or Path("out") / f"{file.stem}.sqlite"
    with writing(out.parent):
        out.parent.mkdir(parents=True, exist_ok=True)
    # The run.
    asked = {"workers": workers, "resume": resume, "again": again}
    known: Progress | None = None
    try:
        with progress(survey.title, 1.0, words=True) as report:

            def advance(state: Progress) -> None:
                nonlocal known
                known = state
                say(str(state))

            say = each_minute(lambda text: report(0.0 if known is None else known.share, text))
            done = run_survey(survey, file.parent, out, **asked, progress=advance)
    except KeyboardInterrupt:
        if known is not None:
            show(f"{known.done:,} of {known.total:,} cases are in {out}: go on with --resume")
        raise
    # What became of the cases, and what to do next.
    resumed = f", {done.resumed:,} of them before" if done.resumed else ""
    resumed += f", {done.again:,} faults done again" if done.again else ""
    with Store.opened(out, None) as store:
        reason, count, faults = store.most_frequent_fault()
    show(f"{done.done:,} cases{resumed}, {faults:,} faults, {done.seconds:.1f} s: {out}")
    if done.fewer:
        show(done.fewer)
    if done.stale:
        why = "it had more cases, or the file of a robot or a strategy was another one; a report counts them, too"
        show(f"{done.stale:,} more rows are of cases that the survey no longer has: {why} (--out begins a new file)")
    if faults:
        show(f"{count:,} of {faults:,} faults: {reason}\nwhen that is cured: holokin survey {file} --again")
    show(f"then: holokin survey report {out}")


@surveying.command("report")
def report_one(
    results: Results,
    out: Annotated[Path | None, typer.Option(help="The page; by default beside the results, as .html.")] = None,
) -> None:
    """Write a page of a survey's results: how often each strategy drifts, meets a limit, and the worst cases."""
    from ..survey import Findings, Store, write_survey_report

    with Store.opened(results, None) as store:
        survey, folder, findings = store.content(), store.folder(), Findings.of(store.rows())
    page = out or results.with_suffix(".html")
    write_survey_report(survey, folder, findings, page)
    show_rich(findings.section().rich)
    show(f"wrote {page}")


@surveying.command("case")
def case_one(
    results: Results, case: Annotated[str, typer.Argument(metavar="ID", help="The id of a case, or its number.")]
) -> None:
    """Print the job file that repeats a case; of a control law one of the pseudo-inverse on its loop."""
    from ..survey import Store, repeated
    from ..survey.store import case_of

    with Store.opened(results, None) as store:
        cases, chosen = case_of(store, case)
    job, why = repeated(cases, chosen)
    show(job)
    if why:
        print(why.replace("RESULTS", repr(str(results))), file=sys.stderr)
