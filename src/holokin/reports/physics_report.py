"""Strategies on physics: the table, the figures, the logs and what an audit says of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..auditing import LogAudit, LogVerdict, audit_recording
from ..base.files import write_text
from ..base.types import Matrix, number_or_none
from ..errors import HolokinError, brief
from ..motion import has_leaf
from ..physics_simulation import PhysicalRun
from ..robot import Robot, servo, to_mjcf
from ..robot_logs import read_recording
from .job_result import file_stems
from .job_table import number
from .palette import BAD, GOOD, WARNING
from .physics_figures import apart_figure, arms_figure, push_figure
from .plots import write_figure
from .result_folder import renewed, write_facts
from .words import joint_unit

FOLDER = "{}-physics"
"""The folder of a job's physical runs, beside that of `holokin run`."""


@dataclass(frozen=True, eq=False)
class Played:
    """A strategy of a job on physics: its run, the drift (cycles, n) that kinematics predicts, the audit of its log."""

    label: str
    run: PhysicalRun
    predicted: Matrix | None = None
    audit: LogAudit | None = None
    not_audited: str = ""

    @property
    def holds(self) -> bool:
        """Whether it ended, and repeats if it has leaves, which is what they are for."""
        if self.run.stopped:
            return False
        if not has_leaf(self.run.strategy):
            return True
        return self.audit is not None and self.audit.verdict is LogVerdict.REPEATS

    def summary(self) -> dict[str, Any]:
        """JSON-ready facts."""
        run = self.run
        return {
            "name": self.label, "servo": run.servo, "feedback": run.feedback, "stopped": run.stopped,
            "cycles": run.cycles, "duration": run.duration, "nominal_duration": run.nominal,
            "apart_each_cycle": run.apart.tolist(), "since_start": run.since_start.tolist(),
            "predicted": None if self.predicted is None else np.abs(self.predicted).max(axis=1).tolist(),
            "deflection": number_or_none(run.deflection),
            "tracking_m": run.tracking_error("m"), "remark": run.remark,
            "audit": None if self.audit is None else self.audit.summary(), "not_audited": self.not_audited,
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class PhysicsResult:
    """All strategies of a job on physics. masses: what stands in for the robot's own, empty if it has them."""

    name: str
    title: str
    robot: Robot
    played: tuple[Played, ...]
    masses: str
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def folder(self) -> str:
        """The name of its folder."""
        return FOLDER.format(self.name)

    @property
    def conditions(self) -> str:
        """What the strategies were run on, in a sentence."""
        run, had = self.played[0].run, self.settings
        weight = "additional torques carry the weight" if run.compensated else "the servos carry the weight"
        said = f"{run.servo} servos of {had['frequency']:g} Hz, {weight}, the strategy reads the {run.feedback} joints"
        said += f"; noise {had['noise']:g}" + (f"; a push of {np.linalg.norm(had['push']):.3g} N" if run.push else "")
        return f"{said}; masses: {self.masses or 'those of the robot'}"

    @property
    def exit_code(self) -> int:
        """0: every run ended, and the log of every strategy with leaves repeats; 1: one does not."""
        return 0 if all(one.holds for one in self.played) else 1


def write_physics(
    result: PhysicsResult, out: FilePath, version: str, say: Callable[[str], None] = lambda _text: None
) -> PhysicsResult:
    """Write `out/<job>-physics/`: logs, figures, the model, result.json; and return the result with the logs' audits.

    Raises:
        ArgumentError: the folder was not written by holokin. WriteError: the system refuses a file.
    """
    stems = file_stems({one.label: ("log",) for one in result.played})
    with renewed(out, result.folder) as work:
        audited = []
        for one in result.played:
            say(f"{one.label}: audit")
            log = work / f"{stems[one.label]}-log.csv"
            one.run.save(log)
            audited.append(_audited(one, log, result.robot))
        result = replace(result, played=tuple(audited))
        say("drawing")
        runs = {one.label: one.run for one in result.played}
        for kind in ("png", "svg"):
            predicted = {one.label: one.predicted for one in result.played}
            write_figure(lambda: apart_figure(runs, predicted), work / f"cycles.{kind}")
            if any(run.push for run in runs.values()):
                write_figure(lambda: push_figure(runs), work / f"push.{kind}")
        write_figure(lambda: arms_figure(runs), work / "arms.png")
        first = result.played[0].run
        drive = servo(result.robot, first.servo, first.command[0], frequency=result.settings["frequency"])
        write_text(work / "model.xml", to_mjcf(result.robot, servo=drive, density=result.settings["density"]))
        write_facts(work, _facts(result, version))
    return result


def _audited(one: Played, log: FilePath, robot: Robot) -> Played:
    task = one.run.strategy.task
    try:
        recording = read_recording(log, robot)
        whole = task.orientation is not None
        return replace(one, audit=audit_recording(recording, robot, tip=task.tip, orientation=whole))
    except HolokinError as problem:  # fewer than two cycles, for instance
        return replace(one, not_audited=str(problem).partition(": ")[2] or str(problem))


def _facts(result: PhysicsResult, version: str) -> dict[str, Any]:
    """What result.json says."""
    return {
        "job": result.name, "title": result.title, "robot": result.robot.name, "holokin": version,
        "masses": result.masses or "the robot's own", "physics": result.settings,
        "strategies": [one.summary() for one in result.played],
    }  # fmt: skip


def print_physics(result: PhysicsResult, console: Any) -> None:
    """Print the table, and below it what else is to be said."""
    from rich.table import Table
    from rich.text import Text

    unit = joint_unit(result.robot)
    table = Table(title=Text(f"{brief(result.title)}, on physics"), title_justify="left", title_style="bold")
    headings = (
        "strategy", "cycles", f"rests apart\n[{unit}]", f"by kinematics\n[{unit}]",
        f"push\ndeflects [{unit}]", "tracking\n[m]", "time", "audit of\nthe log",
    )  # fmt: skip
    for k, heading in enumerate(headings):
        table.add_column(Text(heading), justify="left" if k in (0, 7) else "right", no_wrap=k > 0)
    for one in result.played:
        run = one.run
        verdict = "-" if one.audit is None else one.audit.verdict.name.lower().replace("_", " ")
        color = GOOD if verdict == "repeats" else BAD if verdict == "differs" else WARNING
        table.add_row(
            Text(brief(one.label)), str(run.cycles),
            number(float(run.apart.max(initial=0.0))) if run.cycles else "-",
            "-" if one.predicted is None else number(float(np.abs(one.predicted).max())),
            number(run.deflection) if run.push else "-", number(run.tracking_error("m")),
            f"{run.duration:.0f} s", Text(verdict, style=color),
        )  # fmt: skip
    console.print(table)
    console.print(f"  {result.conditions}", markup=False, highlight=False)
    for one in result.played:
        for text in (
            one.run.remark,
            one.audit.sentence() if one.audit is not None else f"not audited: {one.not_audited}",
        ):
            if text:
                console.print(f"  {brief(one.label)}: {text}", markup=False, highlight=False)
