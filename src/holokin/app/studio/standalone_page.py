"""A page to play with: laws of one robot in one HTML file, which a browser computes itself, without Python.

The file has the laws as WebAssembly, from the C that `hk.follow` runs, and draws by WebGL. It needs no network.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.curvature import CuspWitness
from ...base.arguments import typed
from ...base.errors import ArgumentError, OpenPathError, PathError
from ...base.files import write_text
from ...base.types import ArrayLike, Matrix, Value, Vector
from ...motion import follow
from ...motion.follow_path import by_leaf
from ...motion.ik.plan import check_start, make_plan
from ...path import Path, circle
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.task import Task, of_one_tool
from ..report.palette import law_colors
from .drawn_arm import DrawnArm
from .page_text import digest, page_text
from .wasm_law import begin_of, law_code, packed, wasm_of

STEPS = 240
"""Steps of a round: `hk.follow` with as many samples gives the same joints."""

ROUNDS = 8
"""Rounds that are shown at first."""

MOST_LAWS = 3
"""Laws beside each other: more are too narrow."""

LOOKED = 24
"""Postures of a round by which a view is chosen."""

SMALL = 0.15
"""Diameter of the first circle over the size of the arm, where there is no path."""


@dataclass(frozen=True, eq=False)
class PageLoop(Value):
    """A closed path that a page offers: its name, the path, the posture (n,) at which all laws begin, what to see.

    rounds: how often it is gone; 0 for as often as the page's reader wants.
    """

    name: str
    path: Path
    q0: Vector
    text: str = ""
    rounds: int = 0


@dataclass(frozen=True, eq=False)
class WebPage(Value):
    """A page as the text of one HTML file."""

    html: str

    @typed
    def save(self, file: str | FilePath) -> FilePath:
        """Write the page to a file, whole or not at all. Raises: WriteError."""
        write_text(file, self.html)
        return FilePath(file)


@typed
def web_page(
    laws: Mapping[str, Strategy], q0: ArrayLike, path: Path | None = None, *, title: str = "", text: str = "",
    loops: Sequence[PageLoop] = (),
) -> WebPage:  # fmt: skip
    """A page on which a loop of the tool is dragged, and laws of one robot follow it beside each other.

    The numbers are those of `hk.follow` with 240 samples a round. The page has a circle and a figure eight, which begin
    at the tool pose of q0, beside the path.

    Args:
        laws: name -> strategy, one to three of one robot and task; the first is at the left.
        q0: the posture (n,) at which all begin, or one for each law (laws, n), of one tool pose.
        path: a closed path from there, whose size and plane the circle has at first.
        title: heads the page. text: what there is to see, beside what the page says of drift.
        loops: more closed paths, with postures of their own.

    Raises:
        MissingExtraError: zig is not installed. ExportError: a law cannot be compiled. OpenPathError. StartError: a
            path begins elsewhere. ArgumentError: too many laws, or of several robots, tasks or tips. ShapeError,
            NotFiniteError, JointLimitError, SingularityError: of a start.
    """
    strategies = _checked(laws)
    task = strategies[0].task
    starts = _starts(strategies, q0)
    loop = path if path is not None else _first_circle(task, starts[0])
    arm = DrawnArm.of(task, _postures(strategies, loop, starts))
    offered = [_loop(PageLoop("", loop, starts[0]), strategies, starts, arm)]
    if path is not None and not _is_circle(path):
        offered.append(_loop(PageLoop("The planned path", path, starts[0]), strategies, starts, arm))
    for more in loops:
        one = task.robot.checked(more.q0, f"the start posture of {more.name!r}")
        offered.append(_loop(more, strategies, [one] * len(strategies), arm))
    plane = 2 if task.robot.planar else _plane(loop)
    data = {
        "joints": [{"name": joint.name, "unit": joint.unit} for joint in task.robot.coordinates],
        "steps": STEPS, "rounds": ROUNDS, "planar": task.robot.planar, "plane": plane, "size": _size(loop, plane),
        "pieces": arm.pieces, "loops": offered,
        "laws": _modules(laws, arm, max(2, *(len(one["counts"]) for one in offered))),
    }  # fmt: skip
    return WebPage(page_text(title or f"{task.robot.name}: drag the loop", text, data))


def cusp_loop(witness: CuspWitness, rule: str = "the rule") -> PageLoop:
    """The loop of a cusp for a page, which says how far the joints end from where they began."""
    turn = np.degrees(witness.turn)
    said = (
        f"This loop is {100 * witness.length:.1f} cm long, and the tool turns by {turn:.0f} degrees on it. "
        f"It goes round a cusp of {rule}. The joints end {witness.apart:.2f} rad from where they began, "
        "though no posture on it is singular and the rule is kept all the way. "
        "A rule is repeatable within a region of tool poses. No such region contains this loop."
    )
    return PageLoop("A loop round a cusp", witness.path, witness.first, said, rounds=1)


def _checked(laws: Mapping[str, Strategy]) -> list[Strategy]:
    """The laws. Raises: ArgumentError."""
    found = list(laws.values())
    if not 1 <= len(found) <= MOST_LAWS:
        raise ArgumentError("the number of laws on a page", len(found), f"give one to {MOST_LAWS}")
    for one, other in pairwise(found):
        same = one.task.robot == other.task.robot and (one.task.m, one.task.tip) == (other.task.m, other.task.tip)
        if not same:
            raise ArgumentError("the laws of a page", list(laws), "give those of one robot and one task")
    for one in found:
        of_one_tool(one.task, "a page")
    if not found[0].task.spatial:
        raise ArgumentError("the task", found[0].task.name, "a page leads a tool in space: take a position or a pose")
    return found


def _starts(laws: Sequence[Strategy], q0: ArrayLike) -> list[Vector]:
    """The posture at which each law begins. Raises: ShapeError, NotFiniteError."""
    robot = laws[0].task.robot
    many = np.ndim(q0) == 2
    given = list(np.asarray(q0)) if many else [q0] * len(laws)
    if len(given) != len(laws):
        raise ArgumentError("the number of start postures", len(given), f"give one, or {len(laws)}")
    return [robot.checked(q, "the start posture") for q in given]


def _modules(laws: Mapping[str, Strategy], arm: DrawnArm, segments: int) -> list[dict[str, Any]]:
    """Each law for the page: name, colour, module."""
    colors, found = law_colors([isinstance(law, HolonomicStrategy) for law in laws.values()]), []
    for (name, law), color in zip(laws.items(), colors, strict=True):
        code = law_code(law, arm, segments)
        its = {"name": name, "leaf": by_leaf(law) is not None, "color": color}
        found.append(its | {"code": digest(code), "module": packed(wasm_of(code, name))})
    return found


def _loop(loop: PageLoop, laws: Sequence[Strategy], starts: Sequence[Vector], arm: DrawnArm) -> dict[str, Any]:
    """A loop for the page: its table, as `hk.follow` has it, what each law begins with, and from where it is seen."""
    task, path = laws[0].task, loop.path
    if not path.closed:
        raise OpenPathError("a page", path.gap)
    plan = make_plan(task, path, STEPS, task.place(starts[0])[1])
    p, R = plan.first
    for law, q in zip(laws, starts, strict=True):
        task.robot.check_limits(q)
        law(q)
        check_start(task, q, p, R)
    return {
        "name": loop.name, "text": loop.text, "rounds": loop.rounds, "first": [*p.tolist(), *R.ravel().tolist()],
        "table": packed(path.table(plan.start_rotation).astype("<f8").tobytes()), "counts": plan.counts.tolist(),
        "begin": [begin_of(law, q, p, R) for law, q in zip(laws, starts, strict=True)],
        "view": arm.view(_postures(laws, path, starts), path),
    }  # fmt: skip


def _postures(laws: Sequence[Strategy], path: Path, starts: Sequence[Vector]) -> Matrix:
    """Some postures (k, n) of the first rounds, by which a view is chosen; of a law that stops those before."""
    found = [starts[0]]
    for law, q in zip(laws, starts, strict=True):
        try:
            found += list(follow(law, path, q, samples=LOOKED).q)
        except PathError as problem:
            found += [] if problem.trajectory is None else list(problem.trajectory.q)
    return np.array(found)


def _is_circle(path: Path) -> bool:
    """Whether it is what the page draws itself: one turn about an axis of the base."""
    (first, *others), normal = path.segments, path.area
    even = np.count_nonzero(np.abs(normal) > 1e-9 * np.abs(normal).max()) == 1
    return not others and not first.along.any() and not first.turning.any() and even and bool(normal.max() > 0)


def _first_circle(task: Task, q0: Vector) -> Path:
    """A level circle that lies towards the base."""
    start = task.place(q0)[0][:3]
    inward = -np.sign(start[0]) or -1.0
    return circle(start, start + [inward * SMALL / 2 * DrawnArm.of(task, q0[None]).size(q0), 0.0, 0.0])


def _size(path: Path, plane: int) -> list[float]:
    """From the start of a path to its farthest point, in a plane (3,)."""
    points = path.at(np.linspace(0, path.duration, 361)).position - path.start
    points[:, plane] = 0.0
    return points[np.argmax(np.linalg.norm(points, axis=1))].tolist()


def _plane(path: Path) -> int:
    """The axis, 0 to 2, about which a path winds most."""
    area: Matrix = np.abs(path.area)
    return int(area.argmax()) if area.max() > 0 else 2
