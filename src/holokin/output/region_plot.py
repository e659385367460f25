"""A picture of a region that is proven, and of what the rest of its workspace is."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from ..base.types import whole
from ..proof import UniqueRegion
from ..proof.proven_region import CAUSES
from .palette import ORANGE, PURPLE, VERMILLION
from .plots import style
from .words import on_figure

COLORS = ("#1f7a6b", "#c9d1da", PURPLE, ORANGE, VERMILLION)
"""Of a pose that is proven, and of the others by `CAUSES`."""


def region_figure(region: UniqueRegion, steps: int = 25) -> Any:
    """Planes through the centre of a workspace, the tool in its middle orientation: proven poses, and why the others
    are not.

    Args:
        steps: cells along the longest side.
    """
    from matplotlib import rc_context
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    space, steps = region.workspace, whole("steps", steps, 2)
    center, half = space.solid.center, space.solid.half
    planes = list(combinations(np.flatnonzero(half > 0).tolist(), 2))
    with rc_context(style()):
        figure = Figure(figsize=(3.4 * len(planes) + 1.9, 3.6), layout="constrained")
        seen: set[int] = set()
        for axes, (i, j) in zip(figure.subplots(1, len(planes), squeeze=False)[0], planes, strict=True):
            counts = np.maximum(2, np.rint(steps * half[[i, j]] / half.max())).astype(int)
            sides = zip((i, j), counts, strict=True)
            u, v = (center[k] + half[k] * (2 * (np.arange(n) + 0.5) / n - 1) for k, n in sides)
            points = np.tile(center, (len(u) * len(v), 1))
            points[:, i], points[:, j] = np.tile(u, len(v)), np.repeat(v, len(u))
            found = 1 + region.causes(space.at(points)).reshape(len(v), len(u))
            seen |= set(found.ravel().tolist())
            extent = (center[i] - half[i], center[i] + half[i], center[j] - half[j], center[j] + half[j])
            shown = {"cmap": ListedColormap(COLORS), "vmin": 0, "vmax": 4, "interpolation": "nearest"}
            axes.imshow(found, origin="lower", extent=extent, aspect="equal", **shown)
            axes.grid(False)
            axes.set(xlabel=f"{'xyz'[i]} [m]", ylabel=f"{'xyz'[j]} [m]")
            axes.set_title(f"{'xyz'[3 - i - j]} = {center[3 - i - j]:.3g} m", loc="left", fontsize=10)
        names = ("proven", *CAUSES)
        figure.legend(handles=[Patch(color=COLORS[k], label=names[k]) for k in sorted(seen)], loc="outside right upper")
        title = f"{on_figure(region.strategy.name)}: {region.share:.0%} of the box is proven"
        figure.suptitle(title, x=0.02, ha="left", fontsize=12)
    return figure
