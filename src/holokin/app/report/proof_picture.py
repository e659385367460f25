"""The picture of a certificate: the robot at its start, with the path or the box that the proof is about."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from ...analysis.coverage.cover_workspace import plane_through
from ...base.types import Matrix, Vector
from ...path import Path
from ...path.editing import paths_of
from ...path.workspaces import Box, PoseRange, Workspace
from ...proof import Certificate, UniqueRegion
from ...proof.proven_region import CAUSES, NEAR, region_of
from ...strategies.tasks.frame_task import FrameTask, parts_of
from ...strategies.tasks.task import TipFrame
from .plots import GREY, HOLONOMIC, INK, LOOP, PROOF_COLORS, VERMILLION, new_figure, region_map
from .proof_words import proven_time, refuted_by, shapes_of
from .robot_panels import Actor, Curve, draw_panel, stage_of

DASH = 2
"""Points of a dash, and of a gap, of what is not proven."""

AXES_WORDS = (
    "Rods at the base and the tool: x red, y green, z blue. Beside it along axes of the base, the tool at the start as "
    "a dot."
)
"""What else is to be seen."""


def start_of(certificate: Certificate) -> Vector:
    """The posture (n,) on the leaf that the file names: the start, or the leaf's posture in the middle of a box."""
    return certificate.anchors.q[0][: certificate.equation.joints]


def drawable(certificate: Certificate) -> bool:
    """Whether its tool poses are places in the frame of the robot's base."""
    task = certificate.equation.strategy.task
    tools = task._spatial and all(
        isinstance(part, FrameTask) and isinstance(part.frame, TipFrame) for part in parts_of(task)
    )
    return bool(task.robot.tips) and tools


def proof_figure(certificate: Certificate) -> Any:
    """The robot at its start; the path or the box in green, what is not proven of it dashed and grey."""
    robot, q = certificate.equation.strategy.task.robot, start_of(certificate)
    curves = _curves(certificate)
    # Of the picture [inch].
    figure = new_figure(figsize=(7.6, 4.6))
    stage = stage_of(robot, q[None], curves)
    place = (0.08, 0.09, 0.53, 0.87) if robot.planar else (0.01, 0.01, 0.6, 0.98)
    draw_panel(figure.add_axes(place), stage, [Actor(q, HOLONOMIC)], curves)
    _view(figure.add_axes((0.72, 0.58, 0.26, 0.38)), certificate, curves, (0, 1))
    if not robot.planar:
        _view(figure.add_axes((0.72, 0.09, 0.26, 0.38)), certificate, curves, (0, 2))
    return figure


def _view(axes: Any, certificate: Certificate, curves: list[Curve], plane: tuple[int, int]) -> None:
    """The path or the box along two axes of the base, to a scale, with the start of the tools."""
    i, j = plane
    for curve in curves:
        dash = "--" if curve.dash else "-"
        axes.plot(curve.points[:, i], curve.points[:, j], color=curve.color, linestyle=dash, linewidth=1.3)
    robot, q = certificate.equation.strategy.task.robot, start_of(certificate)
    tips = {part.tip for part in parts_of(certificate.equation.strategy.task)}
    for p in (robot.pose(q, tip)[:3, 3] for tip in tips):
        axes.plot(p[i], p[j], "o", color=HOLONOMIC, markersize=4)
    shown = np.vstack([curve.points for curve in curves])[:, [i, j]]
    middle, half = (shown.min(axis=0) + shown.max(axis=0)) / 2, max(np.ptp(shown, axis=0).max() / 2, 1e-3)
    # Room round a path or a box in its views from above and from the side, over its size.
    reach = (1 + 2 * 0.12) * half
    axes.set(xlim=(middle[0] - reach, middle[0] + reach), ylim=(middle[1] - reach, middle[1] + reach))
    axes.set_aspect("equal")
    axes.set_xlabel(f"{'xyz'[i]} [m]", fontsize=8)
    axes.set_ylabel(f"{'xyz'[j]} [m]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.locator_params(nbins=4)


def picture_words(certificate: Certificate) -> str:
    """What to see in it."""
    box = isinstance(certificate.asked, PoseRange)
    what = "the box of tool positions" if box else "the path"
    return f"The robot at the posture below. {_colors(certificate, what)} {AXES_WORDS}"


def _colors(certificate: Certificate, what: str) -> str:
    if certificate.whole:
        return f"Green: {what}."
    if certificate.covered:
        return f"Red: {what}, along which the joints do not return or are not shown to."
    return f"Green: what is proven of {what}. Dashed grey: what is not."


def _curves(certificate: Certificate) -> list[Curve]:
    space = certificate.asked
    if isinstance(space, PoseRange) and isinstance(space.solid, Box):
        color = LOOP if certificate.whole else GREY
        return [Curve(edge, color, 0 if certificate.whole else DASH) for edge in _edges_of(space.solid)]
    if isinstance(space, Workspace):
        return []
    color = LOOP if certificate.whole or not certificate.covered else VERMILLION
    return [curve for path in paths_of(space) for curve in _path_parts(certificate, path, color)]


def _path_parts(certificate: Certificate, path: Path, color: str) -> list[Curve]:
    """The proven part of a path, and the rest."""
    end = proven_time(certificate, path)
    proven = [Curve(_points(path, 0.0, end), color)] if end > 0 else []
    return proven + ([Curve(_points(path, end, path.duration), GREY, DASH)] if end < path.duration else [])


def _points(path: Path, start: float, stop: float) -> Matrix:
    """Points (k, 3), with all ends of segments among them."""
    inside = path.starts[(path.starts > start) & (path.starts < stop)]
    # Points of a path in the picture.
    return path.at(np.unique(np.concatenate([np.linspace(start, stop, 120), inside]))).position


def _edges_of(box: Box) -> list[Matrix]:
    """The edges (k, 3) of a box that have an extent."""
    corners = [np.array(c) for c in product((-1.0, 1.0), repeat=3)]
    pairs = [(a, b) for a in corners for b in corners if (b - a).sum() == 2 and np.count_nonzero(b - a) == 1]
    steps = np.linspace(0, 1, 12)[:, None]
    edges = [box.center + box.half * (a + steps * (b - a)) for a, b in pairs]
    return [edge for edge in edges if np.ptp(edge, axis=0).any()]


# --- The picture of a box of tool poses: what is proven of it, what is refuted, what is undecided, and the robot there.

INSIDE = 0.999
"""Of a half side of the box, where a slice may be: its faces are not in it, for their rounding."""

NAMES = ("proven", "undecided", *CAUSES[1:NEAR], "refuted: too near")
"""What the parts of a box are called, as their colours."""


def box_figure(certificate: Certificate) -> Any:
    """The robot beside slices of the box, which go through the posture that is too near, or through the middle.

    The robot stands at this posture, or, where none is known, at the start; with the shapes and obstacles of the proof.
    """
    from matplotlib.patches import Patch

    region, worst = region_of(certificate), refuted_by(certificate)
    space, robot = region.workspace, certificate.equation.strategy.task.robot
    clear = certificate.demands.clear
    shaped = robot if clear is None else clear.robot
    q = start_of(certificate)
    actors = [Actor(q, HOLONOMIC)] if worst is None else [Actor(q, HOLONOMIC, "ghost"), Actor(worst.q, VERMILLION)]
    edges = [Curve(edge, LOOP if certificate.whole else INK) for edge in _edges_of(_box(space))]
    # Of the picture [inch].
    figure = new_figure(figsize=(7.6, 6.5))
    things = [] if clear is None else [shape for shape in shapes_of(clear) if shape.obstacle]
    stage = stage_of(shaped, np.array([actor.q for actor in actors]), edges, obstacles=things)
    draw_panel(figure.add_axes((0.01, 0.43, 0.98, 0.56)), stage, actors, edges)
    place = space.solid.center if worst is None else worst.pose[:3, 3]
    pairs = [pair for pair in ((0, 1), (0, 2), (1, 2)) if (space.solid.half[list(pair)] > 0).all()]
    seen: set[int] = set()
    for k, pair in enumerate(pairs):
        axes = figure.add_axes((0.09 + 0.32 * k, 0.14, 0.23, 0.25))
        seen |= _slice(axes, region, pair, place, worst is not None)
    handles = [Patch(color=PROOF_COLORS[k], label=NAMES[k]) for k in sorted(seen)]
    figure.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.05, 0.0), ncols=4, frameon=False, fontsize=9)
    return figure


def box_picture_words(certificate: Certificate) -> str:
    """What to see in it."""
    worst = refuted_by(certificate)
    if worst is None:
        robot = "The robot at the posture below, with the shapes that the proof is about."
        return f"{robot} Below it slices through the middle of the box, the tool in its middle orientation."
    return (
        f"Red: a posture that is too near, {worst}. Pale: the posture below. Slices of the box go through the tool "
        "pose of the red one, marked by a cross. A part is refuted as a whole where one such posture was found in it."
    )


def _slice(axes: Any, region: UniqueRegion, pair: tuple[int, int], place: Matrix, marked: bool) -> set[int]:
    """A plane of the box along two axes of the base; returns which of `NAMES` are seen in it."""
    (i, j), center, half = pair, region.workspace.solid.center, region.workspace.solid.half
    inside = center + np.clip(place - center, -INSIDE * half, INSIDE * half)
    # Of a slice, along the longest side.
    plane = plane_through(region.workspace, pair, 60, inside)
    seen = region_map(axes, region, plane, region.parts_at(region.workspace.at(plane.points)))
    if marked:
        axes.plot(place[i], place[j], "x", color=INK, markersize=7, markeredgewidth=1.8, clip_on=False)
    axes.set_xlabel(f"{'xyz'[i]} [m]", fontsize=8, labelpad=1)
    axes.set_ylabel(f"{'xyz'[j]} [m]", fontsize=8, labelpad=1)
    axes.set_title(f"{'xyz'[3 - i - j]} = {place[3 - i - j]:.3g} m", loc="left", fontsize=8, pad=2)
    axes.tick_params(labelsize=8)
    axes.locator_params(nbins=4, min_n_ticks=2)
    axes.set_anchor("N")
    return seen


def _box(space: PoseRange) -> Box:
    return space.solid  # type: ignore[return-value]  a certified workspace is a box
