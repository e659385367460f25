"""The colours of everything drawn: plots, films, tables of the terminal, the studio. Safe for colour-blind readers.

The eight colours are those of Okabe and Ito, "Color Universal Design", 2008 (https://jfly.uni-koeln.de/color/), also in
B. Wong, "Points of view: Color blindness", Nature Methods 8, 441 (2011). A colour is never the only sign: lines
differ by their dashes or have their names beside them too.
"""

from __future__ import annotations

from collections.abc import Sequence

BLUE = "#0072B2"
VERMILLION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
ORANGE = "#E69F00"
SKY = "#56B4E9"
BLACK = "#000000"
YELLOW = "#F0E442"

COLORS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, YELLOW)
"""All eight, best seen on white first; yellow is for fills with a dark edge."""

HOLONOMIC = BLUE
"""The (first) holonomic law: what comes back to its start."""
NONHOLONOMIC = VERMILLION
"""The pseudo-inverse, and the first of other laws that are not holonomic: what drifts."""
LIMIT = PURPLE
"""Limits of joints, speeds and torques."""
LOOP = GREEN
"""The path that the tool shall follow."""
CLOCKWISE = SKY
"""The clockwise path round a loop, or the path there."""
COUNTER_CLOCKWISE = ORANGE
"""The counter-clockwise path round a loop, or the path back."""

GOOD = GREEN
"""In tables: as expected."""
BAD = VERMILLION
"""In tables: failed, or not holonomic."""
WARNING = ORANGE
"""In tables: not what was asked for, though computed."""

HOLONOMIC_TEXT = SKY
"""In tables of the terminal: holonomic. Blue, as light as black and white grounds both need."""

INK = "#22262E"
"""Text."""
GREY = "#8A919C"
"""What is for comparison only, as the robot at the start."""
PALE = "#E5E7EB"
"""Grids, floors, and bands behind lines."""

AXES = (VERMILLION, GREEN, BLUE)
"""The x, y and z axis of a frame."""

_HOLONOMIC = (BLUE, GREEN, SKY, BLACK)
_NONHOLONOMIC = (VERMILLION, ORANGE, PURPLE, YELLOW)


def color_of(index: int) -> str:
    """The colour of the line, joint or ghost of a number, as #RRGGBB; the eight repeat."""
    return COLORS[index % len(COLORS)]


def rgb(color: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of a colour #RRGGBB."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def law_colors(holonomic: Sequence[bool]) -> tuple[str, ...]:
    """A colour for each law: of cool ones, blue first, for holonomic laws, of warm ones, vermillion first, for others.

    Args:
        holonomic: of each law, whether it is.

    Returns:
        As many colours; the first four laws of each kind have one of their own, then they repeat.
    """
    taken = {True: 0, False: 0}
    found: list[str] = []
    for kind in map(bool, holonomic):
        of_kind = _HOLONOMIC if kind else _NONHOLONOMIC
        found.append(of_kind[taken[kind] % len(of_kind)])
        taken[kind] += 1
    return tuple(found)
