"""Small pieces of HTML for the panels of the page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape
from typing import Any

from ..report.plots import BAD, GREY, HOLONOMIC, INK, PALE

Cell = str  # HTML of a cell: what a user wrote was escaped


def block(*lines: str) -> str:
    """Lines below each other, in the type of the page."""
    return f'<div style="padding:2px 10px;font-size:13px;color:{INK}">{"".join(lines)}</div>'


def line(text: str, bold: bool = False) -> str:
    """A line of plain text."""
    return f'<div style="font-weight:{600 if bold else 400}">{escape(text)}</div>'


def quiet(text: str) -> str:
    """A line that explains."""
    return f'<div style="color:{GREY};font-size:12px">{escape(text)}</div>'


def warning(text: str) -> str:
    """A line that says what is wrong; none of an empty text."""
    return f'<div style="color:{BAD};font-weight:600;margin-top:3px">{escape(text)}</div>' if text else ""


def gauge(share: float) -> str:
    """A thin bar, filled by a share of 0 to 1."""
    inner = f'<div style="height:4px;background:{HOLONOMIC};width:{100 * share:.0f}%"></div>'
    return f'<div style="height:4px;background:{PALE};margin:4px 0">{inner}</div>'


def swatch(color: str, framed: bool = False) -> Cell:
    """A square of a colour; `framed` with an edge round it."""
    edge = f"outline:2px solid {INK};outline-offset:1px;" if framed else ""
    return f'<div style="width:12px;height:12px;border-radius:3px;background:{color};{edge}"></div>'


def ramp(low: str, high: str, left: str, right: str) -> str:
    """A bar whose colour goes from one to another, with a word at each end."""
    bar = f'<div style="height:8px;border-radius:4px;background:linear-gradient(to right,{low},{high})"></div>'
    ends = f'<div style="display:flex;justify-content:space-between"><span>{escape(left)}</span><span>{escape(right)}'
    return f'<div style="font-size:12px;color:{INK};margin:5px 2px">{bar}{ends}</span></div></div>'


def short_names(names: Sequence[str], most: int = 14) -> list[str]:
    """Names without the words that all of them begin or end with, and what is too long still without its end."""
    words = [re.split("([_/.])", name) for name in names]
    first = 2 * _common([parts[::2] for parts in words])
    last = 2 * _common([parts[first:][::-2] for parts in words])
    if any(parts[first : first + 1][0].isdigit() for parts in words):  # "joint_1" tells more than "1"
        first = max(first - 2, 0)
    shortened = ["".join(parts[first : len(parts) - last]) for parts in words]
    return [name if len(name) <= most else f"{name[: most - 1]}\u2026" for name in shortened]


def _common(words: Sequence[Sequence[str]]) -> int:
    """How many words several names begin with; of each at least one is left."""
    most = min(map(len, words)) - 1 if len(words) > 1 else 0
    return next((i for i in range(most) if len({parts[i] for parts in words}) > 1), most)


def plain(text: str, red: bool = False, grey: bool = False, right: bool = False) -> Cell:
    """A text in a cell."""
    color = BAD if red else GREY if grey else INK
    place = "text-align:right;white-space:nowrap" if right else "text-align:left"
    return f'<div style="color:{color};{place}">{escape(text)}</div>'


def named(name: str, note: str = "") -> Cell:
    """A name, and something about it in grey."""
    return f'<b>{escape(name)}</b> <span style="color:{GREY}">{escape(note)}</span>'


def verdict(holonomic: bool | None) -> str:
    """Whether a strategy is holonomic, in a word or two."""
    return "not judged" if holonomic is None else "holonomic" if holonomic else "not holonomic"


def table(rows: Sequence[Sequence[Cell]], hints: Sequence[str] = ()) -> str:
    """Cells in rows; a hint is shown where the mouse rests on its row."""
    titles = [*hints, *[""] * (len(rows) - len(hints))]
    lines = [
        f'<tr title="{escape(hint)}">{"".join(f"<td>{cell}</td>" for cell in row)}</tr>'
        for row, hint in zip(rows, titles, strict=True)
    ]
    return f'<table style="width:100%;font-size:12.5px;color:{INK};border-spacing:2px 3px">{"".join(lines)}</table>'


def marks(values: Sequence[float], colors: Sequence[str], ended: bool) -> Cell:
    """A bar with a mark at each of some shares of 0 to 1; `ended`: the ends of the bar are limits."""
    html = ""
    for index, (value, color) in enumerate(zip(values, colors, strict=False)):
        place = f"left:calc({100 * value:.1f}% - 2px);top:{-1 if index else -3}px"
        size = f"width:4px;height:{14 if index else 18}px;border-radius:2px"
        html += f'<div style="position:absolute;{place};{size};background:{color}"></div>'
    edge = f"2px solid {INK if ended else PALE}"
    style = f"position:relative;height:12px;min-width:120px;background:{PALE};border-left:{edge};border-right:{edge}"
    return f'<div style="{style}">{html}</div>'


def put(handle: Any, content: str) -> None:
    """Set the content of a text, if it is another one: every message costs all browsers time."""
    if handle.content != content:
        handle.content = content


def file_name(title: str) -> str:
    """A title as the name of a file."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:60] or "studio"
