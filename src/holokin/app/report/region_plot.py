"""A picture of a region that is proven, and of what the rest of its workspace is."""

from __future__ import annotations

from typing import Any

from ...analysis.coverage.slices import Plane, grid_planes
from ...base.types import Indices
from ...proof import UniqueRegion
from ...proof.open_parts import CAUSES
from .palette import ORANGE, PURPLE, SKY, VERMILLION
from .plots import style
from .words import on_figure

COLORS = ("#1f7a6b", "#c9d1da", PURPLE, ORANGE, SKY, VERMILLION)
"""Of a pose that is proven, and of the others by `CAUSES`."""


def region_figure(region: UniqueRegion, steps: int = 25) -> Any:
    """Planes through the centre of a workspace, the tool in its middle orientation: proven poses, and why the others
    are not.

    Args:
        steps: cells along the longest side.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    space = region.workspace
    planes = list(grid_planes(space, steps))
    with rc_context(style()):
        figure = Figure(figsize=(3.4 * len(planes) + 1.9, 3.6), layout="constrained")
        seen: set[int] = set()
        for axes, plane in zip(figure.subplots(1, len(planes), squeeze=False)[0], planes, strict=True):
            i, j = plane.axes
            seen |= region_map(axes, region, plane, region.causes(space.at(plane.points)))
            axes.set(xlabel=f"{'xyz'[i]} [m]", ylabel=f"{'xyz'[j]} [m]")
            axes.set_title(f"{'xyz'[3 - i - j]} = {plane.at:.3g} m", loc="left", fontsize=10)
        names = ("proven", *CAUSES)
        figure.legend(handles=[Patch(color=COLORS[k], label=names[k]) for k in sorted(seen)], loc="outside right upper")
        title = f"{on_figure(region.strategy.name)}: {region.share:.0%} of the box is proven"
        figure.suptitle(title, x=0.02, ha="left", fontsize=12)
    return figure


def region_map(axes: Any, region: UniqueRegion, plane: Plane, causes: Indices) -> set[int]:
    """Draw the cells of a plane by `COLORS`, of causes (k,) of its poses, -1 for proven; returns which are seen."""
    from matplotlib.colors import ListedColormap

    (i, j), solid = plane.axes, region.workspace.solid
    found, low, high = 1 + causes.reshape(plane.inside.shape), solid.center - solid.half, solid.center + solid.half
    shown = {"cmap": ListedColormap(COLORS), "vmin": 0, "vmax": len(COLORS) - 1, "interpolation": "nearest"}
    axes.imshow(found, origin="lower", extent=(low[i], high[i], low[j], high[j]), aspect="equal", **shown)
    axes.grid(False)
    return set(found.ravel().tolist())
