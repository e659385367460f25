"""The picture of a box of tool poses: what is proven of it, what is refuted, what is undecided, and the robot there."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...analysis.coverage.slices import plane_through
from ...base.types import Matrix
from ...path.workspaces import Box, PoseRange
from ...proof import Certificate, UniqueRegion
from ...proof.open_parts import CAUSES, NEAR
from ...proof.proven_region import region_of
from ...robot import LinkShape
from .clear_words import obstacles_of, refuted_by
from .palette import HOLONOMIC, INK, LOOP, VERMILLION
from .proof_picture import edges_of, start_of
from .region_plot import COLORS, region_map
from .robot_panels import Actor, Curve, draw_panel, stage_of

SIZE = (7.6, 6.5)
"""Of the picture [inch]."""

PIXELS = 60
"""Of a slice, along the longest side."""

INSIDE = 0.999
"""Of a half side of the box, where a slice may be: its faces are not in it, for their rounding."""

NAMES = ("proven", "undecided", *CAUSES[1:NEAR], "refuted: too near")
"""What the parts of a box are called, as their colours."""


def box_figure(found: Certificate) -> Any:
    """The robot beside slices of the box, which go through the posture that is too near, or through the middle.

    The robot stands at this posture, or, where none is known, at the start; with the shapes and obstacles of the proof.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    region, worst = region_of(found), refuted_by(found)
    space, robot = region.workspace, found.equation.strategy.task.robot
    clear = found.demands.clear
    shaped = robot if clear is None else clear.robot
    q = start_of(found)
    actors = [Actor(q, HOLONOMIC)] if worst is None else [Actor(q, HOLONOMIC, "ghost"), Actor(worst.q, VERMILLION)]
    edges = [Curve(edge, LOOP if found.whole else INK) for edge in edges_of(_box(space))]
    figure = Figure(figsize=SIZE)
    things: list[LinkShape] = [] if clear is None else obstacles_of(clear)
    stage = stage_of(shaped, np.array([actor.q for actor in actors]), edges, obstacles=things)
    draw_panel(figure.add_axes((0.01, 0.43, 0.98, 0.56)), stage, actors, edges)
    place = space.solid.center if worst is None else worst.pose[:3, 3]
    pairs = [pair for pair in ((0, 1), (0, 2), (1, 2)) if (space.solid.half[list(pair)] > 0).all()]
    seen: set[int] = set()
    for k, pair in enumerate(pairs):
        axes = figure.add_axes((0.09 + 0.32 * k, 0.14, 0.23, 0.25))
        seen |= _slice(axes, region, pair, place, worst is not None)
    handles = [Patch(color=COLORS[k], label=NAMES[k]) for k in sorted(seen)]
    figure.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.05, 0.0), ncols=4, frameon=False, fontsize=9)
    return figure


def box_picture_words(found: Certificate) -> str:
    """What to see in it."""
    worst = refuted_by(found)
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
    plane = plane_through(region.workspace, pair, PIXELS, inside)
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
