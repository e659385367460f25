"""[laws.NAME] of a survey: the strategies of a job, control laws of text books and libraries, and your own.

A new kind is one more class here: `kind` and its keys, and `build`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from pydantic import Field

from ...analysis.coverage import locked_joints
from ...base.errors import ArgumentError
from ...base.types import Vector
from ...motion.control import (
    ControlLaw,
    PostureTask,
    as_control_law,
    closed_loop,
    damped,
    gradient_projection,
    repetitive_motion,
)
from ...motion.control.feedback_laws import GAIN
from ...motion.control.libraries import LIBRARIES
from ...strategies import Strategy, constraints
from ...strategies.tasks.task import Task
from ..job.strategy_tables import KINDS, Fitted, Lock, Radial, StrategyTable
from ..job.table_values import Few, Length, Positive, Table
from .objects import given
from .user_functions import imported

Gain = Annotated[float, Field(ge=0, le=1e6)]


class LawTable(Table):
    """A control law: it is run by `simulate`, with steps as long as those of the strategies."""

    def build(self, task: Task, q0: Vector, name: str) -> ControlLaw:
        """The control law of a task, from a start posture (n,). Raises: HolokinError."""
        raise NotImplementedError


class BestLock(LawTable):
    """The joints that determine the self-motion best at the start posture stay where they are, as of `lock`."""

    kind: Literal["best-lock"]


class ClosedLoop(LawTable):
    """A strategy of the survey with feedback of the tool's error."""

    kind: Literal["closed-loop"]
    of: str
    gain: Gain = GAIN


class Damped(LawTable):
    """Damped least squares."""

    kind: Literal["damped"]
    damping: Positive = 0.05
    gain: Gain = GAIN

    def build(self, task: Task, q0: Vector, name: str) -> ControlLaw:
        """As `damped`."""
        return damped(task, self.damping, self.gain, name=name)


class GradientProjection(LawTable):
    """Gradient projection on the start posture, or on a cost."""

    kind: Literal["gradient-projection"]
    cost: Literal["start", "centring", "manipulability"] = "start"
    weight: Gain = 1.0
    gain: Gain = GAIN

    def build(self, task: Task, q0: Vector, name: str) -> ControlLaw:
        """As `gradient_projection`; of the start posture as `repetitive_motion`, which is the same."""
        if self.cost == "start":
            return repetitive_motion(task, self.weight, self.gain, name=name)
        cost = constraints.centring_cost() if self.cost == "centring" else constraints.manipulability_cost()
        return gradient_projection(task, cost, self.weight, self.gain, name=name)


if TYPE_CHECKING:
    LibraryName = str
else:
    LibraryName = Literal[tuple(LIBRARIES)]


class Library(LawTable):
    """A library's inverse kinematics: a frame task on the robot's first tip, with a posture task if it costs.

    Without `preferred` that prefers the start.
    """

    kind: LibraryName
    posture_cost: Gain = 1e-3
    posture_gain: Gain = 1.0
    preferred: Annotated[list[Length], Few] | None = None

    def build(self, task: Task, q0: Vector, name: str) -> ControlLaw:
        """As `pink_law`, `mink_law` or `placo_law`. Raises: ArgumentError: a task that is no whole pose."""
        if task.orientation != "twist" or task.m != (3 if task.robot.planar else 6):
            cure = f"{', '.join(LIBRARIES)} follow whole poses here: use kind = 'pose'"
            raise ArgumentError("the task", task.name, cure)
        preferred = None if self.preferred is None else tuple(self.preferred)
        posture = PostureTask(self.posture_cost, self.posture_gain, preferred)
        return LIBRARIES[self.kind].law(task.robot, posture, name=name)


class Own(LawTable):
    """Your own: "module:function", which takes (task, start posture) and returns a strategy or a control law.

    The module is looked for beside the survey file first.
    """

    kind: Literal["import"]
    function: Annotated[str, Field(pattern=r"^[\w.]+:\w+$")]


class Given(LawTable):
    """One that `hk.survey` was given: a function of the task, or of the task and the start posture."""

    kind: Literal["given"]
    key: str

    def build(self, task: Task, q0: Vector, name: str) -> Any:
        """What the function returns."""
        function = given(self.key)
        return _as_law(function(task, q0) if _takes_start(function) else function(task))


def _takes_start(function: Callable[..., Any]) -> bool:
    """Whether a user's function is of the task and the start posture, and not of the task alone."""
    parameters = inspect.signature(function).parameters.values()
    places = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return sum(p.kind in places and p.default is p.empty for p in parameters) > 1


def _as_law(made: Any) -> Strategy | ControlLaw:
    """What a user's function returned, as it can be run."""
    return made if isinstance(made, Strategy) else as_control_law(made)


OWN_KINDS = (BestLock, ClosedLoop, Damped, GradientProjection, Library, Own, Given)
OF_A_JOB = tuple(model for kind, model in KINDS.items() if model is not Fitted)

if TYPE_CHECKING:
    AnyLaw = StrategyTable | LawTable
else:
    AnyLaw = Annotated[Union[(*OF_A_JOB, *OWN_KINDS)], Field(discriminator="kind")]


def resolved(laws: Mapping[str, AnyLaw], name: str, task: Task, q0: Vector) -> dict[str, AnyLaw]:
    """A law, and what it is of, with what a start posture chooses chosen: two starts may share what is built."""
    table = laws[name]
    found = resolved(laws, table.of, task, q0) if isinstance(table, ClosedLoop) else {}
    if isinstance(table, BestLock):
        joints: list[str | int] = [task.robot.joint_names[i] for i in locked_joints(task, q0)]
        table = Lock(kind="lock", joints=joints)
    return found | {name: table}


def of_the_start(laws: Mapping[str, AnyLaw]) -> bool:
    """Whether what is built depends on the start posture, and not on the task alone."""
    return any(
        isinstance(law, (Radial, Own)) or (isinstance(law, Given) and _takes_start(given(law.key)))
        for law in laws.values()
    )


def built(laws: Mapping[str, AnyLaw], name: str, task: Task, q0: Vector, folder: FilePath) -> Strategy | ControlLaw:
    """The law of a name; modules are looked for in the survey file's folder first. Raises: HolokinError."""
    table = laws[name]
    if isinstance(table, Own):
        return _as_law(imported(table.function, folder)(task, q0))
    if isinstance(table, ClosedLoop):
        of = built(laws, table.of, task, q0, folder)
        if not isinstance(of, Strategy):
            raise ArgumentError("of", table.of, "it is a control law already: name a strategy")
        return closed_loop(of, table.gain, name=name)
    return table.build(task, q0, name)
