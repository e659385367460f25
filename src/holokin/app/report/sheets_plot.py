"""Pictures of a map of sheets: which sheet serves which pose, and where the joints change."""

from __future__ import annotations

from textwrap import fill
from typing import Any

import numpy as np

from ...analysis.coverage.proposed_workspace import reached
from ...analysis.coverage.slices import Plane, grid_planes, neighbouring_cells
from ...analysis.sheets import PoseRest, Sheets
from ...base.types import Array, Indices
from ...motion.ik.quiet_answers import leads_to
from ...path.workspaces import PoseRange
from .coverage_plots import CUT, frame_cloud, plane_map, views
from .palette import BLACK, INK, ORANGE, PURPLE, SKY, VERMILLION, YELLOW
from .words import on_figure

SHEETS = ("#1f7a6b", SKY, ORANGE, "#3b4ba0", YELLOW, VERMILLION, PURPLE)
"""Colours of the sheets, the first one's first; of more they come again."""

NONE = "#d5dae1"
"""Colour of cells that no sheet serves."""

REST = {
    PoseRest.NOT_COVERED: (BLACK, "reached, by no sheet"), PoseRest.BLOCKED: ("#4b5563", "too near to something"),
    PoseRest.LIMITS: ("#8a93a0", "beyond joint limits"), PoseRest.OUT_OF_REACH: ("#c5ccd6", "out of reach"),
}  # fmt: skip
"""Colour and short name of what becomes of a pose without a sheet."""

MAPPED = (
    "The sheets of the workspace: the planes through its centre, the tool in its middle orientation, and all poses "
    "that were sampled. Each has the colour of the sheet that serves it. Shares are of the poses that the arm reaches, "
    "unless it says `of all`."
)
"""What a figure of sheets shows."""

STEPS = 41
"""Cells along the longest side."""


def sheets_figure(found: Sheets, steps: int = STEPS) -> Any:
    """Maps of the planes through the workspace's centre, in its middle orientation, and the cloud of all poses.

    Lines are where the joints jump from a cell to the next: there the arm changes its posture.

    Args:
        steps: cells along the longest side of a map, at least 2.
    """
    p = found.poses[:, :3, 3]
    planes = list(grid_planes(found.workspace, steps)) if isinstance(found.workspace, PoseRange) else []
    figure, maps, cloud, _ = views(p, planes)
    jumps = False
    for axes, plane in zip(maps, planes, strict=True):
        jumps |= _map(axes, found, found.workspace, plane)
    _cloud(cloud, found)
    many = f"{len(found)} sheet{'' if len(found) == 1 else 's'}"
    head = f"{on_figure(found.task.robot.name)}: {many} for {found.share:.1%} of what the arm reaches"
    size = figure.get_size_inches()
    figure.suptitle(head, x=0.2 / size[0], y=1 - 0.15 / size[1], ha="left", va="top", fontsize=12, color=INK)
    _legend(figure, found, bool(planes), jumps)
    return figure


def color_of(s: int) -> str:
    """The colour of a sheet."""
    return SHEETS[s % len(SHEETS)]


def _map(axes: Any, found: Sheets, space: Any, plane: Plane) -> bool:
    """One plane; returns whether the joints jump in it."""
    from matplotlib.colors import to_rgb

    poses = space.at(plane.points[plane.inside.ravel()])
    within = np.flatnonzero(reached(found.task, poses, None)[1].within)  # a sheet takes long to say no
    answers = found.batch(poses[within])
    sheet, q = np.full(len(poses), -1), np.full((len(poses), found.task.n), np.nan)
    sheet[within], q[within] = answers.sheet, answers.q
    labels = np.full(plane.inside.shape, -2)
    labels[plane.inside] = sheet
    image = np.ones((*labels.shape, 3))
    image[labels == -1] = to_rgb(NONE)
    for s in range(len(found)):
        image[labels == s] = to_rgb(color_of(s))
    cuts = _jumps(found, poses, q, sheet, neighbouring_cells(plane.inside))
    i, j = plane.axes
    plane_map(axes, plane, image, poses[cuts][:, :, [i, j], 3])
    axes.set_title(f"{'xyz'[3 - i - j]} = {plane.at:.3g} m", loc="left", fontsize=10)
    return bool(len(cuts))


def _jumps(found: Sheets, poses: Array, q: Array, sheet: Indices, pairs: Indices) -> Indices:
    """Those of some pairs (e, 2) of poses, both with a sheet, between which the joints do not continue."""
    both = pairs[(sheet[pairs] >= 0).all(axis=1)]
    cut = [
        (sheet[i] != sheet[j] and np.abs(q[i] - q[j]).max() > 0.2)
        or (sheet[i] == sheet[j] and not leads_to(found.sheets[sheet[i]].ik, poses[j], q[i], q[j]))
        for i, j in both
    ]  # fmt: skip
    return both[np.array(cut, dtype=bool)] if len(both) else both


def _cloud(axes: Any, found: Sheets) -> None:
    """All sampled poses at their positions."""
    p, flat = found.poses[:, :3, 3], not hasattr(axes, "get_zlim")
    points = p[:, :2].T if flat else p.T
    style = {"linewidths": 0} if flat else {"linewidths": 0, "depthshade": False}
    for rest in reversed(REST):
        here = found.rest == rest
        if here.any():
            axes.scatter(*points[:, here], color=REST[rest][0], s=16 if rest is PoseRest.NOT_COVERED else 5, **style)
    for s in range(len(found)):
        here = found.labels == s
        if here.any():
            axes.scatter(*points[:, here], color=color_of(s), s=9, alpha=0.9 if flat else 0.6, **style)
    axes.set_title(f"{len(p)} poses", loc="left", fontsize=10)
    if flat:
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
    else:
        frame_cloud(axes, p)


def _lines(name: str) -> str:
    """A sheet's name in lines of the legend."""
    return fill(on_figure(name, 60), 28)


def _share(found: Sheets, rest: PoseRest) -> str:
    """How many poses have no sheet for a reason: of those in reach, or of all."""
    count, every = int((found.rest == rest).sum()), len(found.poses)
    within = int(found.reachable.sum())
    return f"{count / within:.1%}" if rest is PoseRest.NOT_COVERED else f"{count / every:.1%} of all"


def _legend(figure: Any, found: Sheets, maps: bool, jump: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    within = max(1, int(found.reachable.sum()))
    width, height = figure.get_size_inches()
    patches = [
        Patch(
            color=color_of(s),
            label=f"sheet {s}: {(found.labels == s).sum() / within:.1%}\n{_lines(one.name)}",
        )
        for s, one in enumerate(found.sheets)
    ]
    patches += [
        Patch(color=color, label=f"{name}: {_share(found, rest)}")
        for rest, (color, name) in REST.items() if (found.rest == rest).any()
    ]  # fmt: skip
    patches += [Patch(color=NONE, label="no sheet (maps)")] if maps else []
    lines = [Line2D([], [], color=CUT, linewidth=1.8, label="the joints jump here")] if jump else []
    corner = (1 - 2.95 / width, 1 - 0.8 / height)
    figure.legend(handles=[*patches, *lines], loc="upper left", bbox_to_anchor=corner, fontsize=8.5, frameon=False)
