"""`advise`: the law for a robot and its work, of all that fit, and why."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import ArrayLike
from ...motion.checks.keeping_clear import Clearances
from ...path.workspaces import Workspace
from ...proof.kept_apart import CLEARANCE, clearances_of
from ...robot import LinkShape, Robot
from ...strategies.tasks.task import Task, of_one_tool
from ..coverage.proposed_workspace import first_start, proposed_workspace
from ..coverage.starts import check_that_joints_move, task_of_kind
from ..coverage.tips import Chain, chain_to_tool
from .advice import Advice
from .advice_case import Case
from .reasons import reasons

ASKED = ("clear_of", "floor", "clearance", "self_collision", "ignore", "shapes_of")
"""What `certify` is asked of shapes, by name."""


@typed
def advise(
    robot: Robot | str | Path,
    workspace: Workspace | None = None,
    *,
    tip: str | None = None,
    base: str | None = None,
    task: Literal["pose", "axis", "position"] | Task | None = None,
    q0: ArrayLike | None = None,
    clear_of: Sequence[LinkShape] | None = None,
    floor: float | None = None,
    clearance: float = CLEARANCE,
    self_collision: bool = True,
    ignore: Sequence[tuple[str, str]] = (),
    shapes_of: Robot | None = None,
    levels: bool = False,
    say: Callable[[str], None] = lambda _text: None,
) -> Advice:
    """The laws that fit a robot, each on its best leaf, compared on a workspace, and a sentence on why the best is.

    Locked joints, differences of parallel joints, arm angles, the elbow's height, stationary costs, `radial` of the
    pseudo-inverse, and laws designed from the best of these: each from several postures at the workspace's centre.
    They are ranked by the share of the workspace that they reach within the joint limits, and with the clearance where
    one is asked for; of laws that cover alike those are first that keep well clear, by 0.01 m more than asked for; of
    these those that keep away from limits and singular postures; of these the one with the least joint speed. A law
    without a cusp near the workspace is preferred to one with, for up to a tenth more squared joint speed. All this is
    looked at pose by pose; `certify_by` of the advice is the call that proves it.

    Args:
        robot: a robot, a name of the catalogue, or a file.
        workspace: by default a box round the tool at the start, with moderate turns.
        tip: the link that is the tool; for a URDF by default the palm at the end of its longest arm. base: the link
            that stands still.
        task: "pose", "axis" (the tool may spin about its z axis) or "position", or a task of this robot; by default the
            pose, for arms of up to six joints the position.
        q0: the posture (n,) that the leaf is to go through; by default each law gets the best of several.
        clear_of: a pose is served only where no link is nearer than `clearance` to these obstacles (`hk.obstacle`), to
            the floor, or to another link; [] for the floor and the links alone. By default nothing is looked at. The
            pairs are those of `certify`; meshes are their convex hulls, and where these are nearer, themselves.
        floor, clearance, self_collision, ignore, shapes_of: as of `certify`.
        levels: which levels of the best law serve the workspace, as `level_range` finds them; it takes seconds.
        say: hears what is going on.

    Raises:
        ArgumentError: the robot is not redundant for the task; a workspace of one pose. OutOfReachError: no pose of
        the workspace is reached within the joint limits. JointLimitError: the start is beyond them. RobotFileError,
        UnknownNameError, ShapeError, NotFiniteError.
    """
    say("the robot")
    chain = chain_to_tool(robot, tip, base)
    if isinstance(task, Task):
        work = task
        if task.robot != chain.robot:
            raise ArgumentError("the task", task, "give a task of the same robot: load the robot first")
    else:
        work = task_of_kind(chain.robot, tip if isinstance(robot, Robot) else None, task)
    words = {"tip": not chain.chosen, "task": task, "q0": q0, "workspace": workspace}
    chosen = tuple(word for word, value in words.items() if value is None or value is False)
    asked = clear_of, floor, clearance, self_collision, ignore, shapes_of
    apart = clearances_of(chain.robot, *asked)
    proven: dict[str, Any] = {} if apart is None else dict(zip(ASKED, asked, strict=True))
    return advise_chain(chain, work, workspace, q0, chosen=chosen, apart=apart, proven=proven, levels=levels, say=say)


def advise_chain(
    chain: Chain, task: Task, workspace: Workspace | None, q0: ArrayLike | None, *, chosen: Sequence[str],
    apart: Clearances | None, proven: Mapping[str, Any], say: Callable[[str], None], levels: bool = False,
) -> Advice:  # fmt: skip
    """The advice for a chain and its task, as of `advise`.

    Args:
        chosen: what nobody gave. apart: how far shapes are from each other, None where nothing is asked of that;
            proven: the same as arguments of `certify`.
    """
    began = time.perf_counter()
    arm = chain.robot
    of_one_tool(task, "advice")
    check_that_joints_move(arm)
    start = None if q0 is None else arm.checked(q0, "the start posture")
    if start is not None:
        arm.check_limits(start)
    at = start
    if workspace is None:
        at = first_start(task) if start is None else start
        workspace = proposed_workspace(task, at)
    case = Case(task, workspace, start, apart, proven, say)
    laws = case.ranked()
    say("the reasons")
    part = case.part(laws) if not laws[0].served.all() else None
    found = case.checked[laws[0].name]
    range_, said = case.levels(laws[0]) if levels else (None, ())
    return Advice(
        chain, task, workspace, tuple(chosen), laws, case.floor_of(laws[0]), found,
        (*reasons(laws, found, part, case.excess(laws)), *case.of_cusps(laws[0]), *said),
        case.cusps[laws[0].name], part, time.perf_counter() - began, range_, proven,
    )  # fmt: skip
