"""A part of a result as one value, with its three writers: a page in HTML, a terminal in colour, plain text."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Any, Literal, final

from ...base.errors import brief
from ...base.progress import as_printed
from .plots import BAD, GOOD, HOLONOMIC_TEXT, WARNING, legible, style

Tone = Literal["", "good", "holonomic", "warning", "bad", "failed", "small", "strong", "code"]
"""How a text is shown: by a colour of the terminal and a class or a tag of HTML."""

_COLORS = {"good": GOOD, "holonomic": HOLONOMIC_TEXT, "warning": WARNING, "bad": BAD, "failed": f"bold {BAD}"}
_CLASSES = {"good": "yes", "holonomic": "yes", "warning": "no", "bad": "no", "failed": "no", "small": "small"}
_TAGS = {"strong": "b", "code": "code"}


@final
@dataclass(frozen=True)
class Note:
    """A sentence or a cell: `text` in its tone, `then` in the usual one, and `detail`, which a page folds away."""

    text: str
    tone: Tone = ""
    then: str = ""
    detail: str = ""


Words = Note | str
Column = tuple[str, Literal["left", "right"]]
"""Heading and alignment."""

WRAPPED = ("strategy", "joint")
"""Columns of names, which may have several lines in a terminal."""


_WIDEST = 1_000
"""Characters of a line at most, where no terminal is."""


@final
@dataclass(frozen=True, eq=False)
class Image:
    """An image or a film for a page, of a MIME type as "image/svg+xml", with what to see in it.

    wide: it is wider than the screen of a telephone, which may scroll it.
    """

    data: bytes
    caption: str
    mime: str = "image/svg+xml"
    wide: bool = False

    def html(self) -> str:
        """The data inside the page, and the caption below it."""
        text = escape(self.caption, quote=True)
        source = f"src='data:{self.mime};base64,{base64.b64encode(self.data).decode('ascii')}'"
        if self.mime.startswith("video"):
            shown = f"<video autoplay loop muted playsinline controls aria-label='{text}' {source}></video>"
        else:
            shown = f"<img alt='{text}' {source}>"
        kind = " class='many'" if self.wide else ""
        return f"<figure{kind}>{shown}<figcaption>{escape(self.caption)}</figcaption></figure>"


def drawn(draw: Callable[[], Any], caption: str) -> Image:
    """The matplotlib figure that `draw` makes, as SVG."""
    from matplotlib import rc_context

    stream = io.BytesIO()
    with rc_context(style()):
        legible(draw()).savefig(stream, format="svg", facecolor="white")
    return Image(stream.getvalue(), caption)


def right(*headings: str) -> list[Column]:
    """Columns of numbers."""
    return [(heading, "right") for heading in headings]


@final
@dataclass(frozen=True, eq=False)
class Section:
    """A part of a result, in the order in which it is written.

    title: its heading. notes: sentences above the figure and the table. head: the columns, those of text by their
    headings alone; without it the rows are facts, each a name and a value. remarks, points: sentences below the table,
    and a list of them. parts: sections of it.
    """

    title: str = ""
    notes: Sequence[Words] = ()
    figure: Image | None = None
    head: Sequence[Column | str] = ()
    rows: Sequence[Sequence[Words]] = ()
    remarks: Sequence[Words] = ()
    points: Sequence[Words] = ()
    parts: Sequence[Section] = ()

    def reworded(self, change: Callable[[str], str]) -> Section:
        """The same with each sentence, caption and cell of the table changed, but for the title.

        A column of numbers whose heading has a unit in brackets is changed as if each had this unit behind it.
        """

        def each(listed: Sequence[Words]) -> list[Words]:
            return [_changed(words, change) for words in listed]

        texts = {part: each(getattr(self, part)) for part in ("notes", "remarks", "points")}
        parts = [part.reworded(change) for part in self.parts]
        figure = self.figure and replace(self.figure, caption=change(self.figure.caption))
        head: list[Column | str] = []
        changes: list[Callable[[str], str]] = []
        for k, entry in enumerate(self.head):
            name, *side = (entry,) if isinstance(entry, str) else entry
            name, change_cell = _column(name, [_plain(row[k]) for row in self.rows], change)
            head.append((name, side[0]) if side else name)
            changes.append(change_cell)
        cells = changes or [change] * max(map(len, self.rows), default=0)
        rows = [[_changed(cell, each) for cell, each in zip(row, cells, strict=False)] for row in self.rows]
        return replace(self, figure=figure, head=head, rows=rows, parts=parts, **texts)

    @property
    def columns(self) -> list[Column]:
        """Heading and alignment of each column."""
        return [(entry, "left") if isinstance(entry, str) else entry for entry in self.head]

    def html(self, level: int = 2) -> str:
        """The section in HTML, with a heading of this level; all text is escaped."""
        lines = [f"<h{level}>{escape(self.title)}</h{level}>"] if self.title else []
        lines += [_block("p", words) for words in self.notes]
        lines += [self.figure.html()] if self.figure is not None else []
        lines += [self._html_table()] if self.rows or self.head else []
        lines += [_block("p", words) for words in self.remarks]
        lines += [f"<ul>{''.join(_block('li', words) for words in self.points)}</ul>"] if self.points else []
        lines += [part.html(level + bool(self.title)) for part in self.parts]
        return "\n".join(lines)

    def _html_table(self) -> str:
        """The rows; of facts the names are headings of rows, of a table numbers stand at the right."""
        if not self.head:
            facts = [
                f"<tr><th scope='row'>{_inline(name)}</th><td>{_inline(value)}</td></tr>" for name, value in self.rows
            ]
            return f"<table><tbody>{''.join(facts)}</tbody></table>"
        classes = ["" if side == "left" else " class='n'" for _, side in self.columns]

        def cells(tag: str, row: Sequence[Words]) -> str:
            listed = [f"<{tag}{kind}>{_inline(cell)}</{tag}>" for kind, cell in zip(classes, row, strict=True)]
            return f"<tr>{''.join(listed)}</tr>"

        head, body = cells("th", [name for name, _ in self.columns]), "".join(cells("td", row) for row in self.rows)
        return f"<div class='wide'><table><thead>{head}</thead><tbody>{body}</tbody></table></div>"

    def rich(self, console: Any) -> None:
        """Print the section on a console of rich, in the units of what runs, without its figure."""
        self.reworded(as_printed)._rich(console, "")

    def _rich(self, console: Any, indent: str) -> None:
        # The table under its title, names of facts pale.
        if self.rows:
            from rich.table import Table
            from rich.text import Text

            table = Table(
                title=Text(self.title) if self.title else None,
                title_justify="left",
                title_style="bold",
                header_style="dim",
                show_header=bool(self.head),
            )
            for heading, side in self.columns:
                table.add_column(Text(heading), justify=side, no_wrap=heading not in WRAPPED)
            if not self.head:
                table.add_column(style="dim", no_wrap=True)
                table.add_column()
            for row in self.rows:
                table.add_row(*(Text(brief(_plain(cell)), style=_color(cell) or "") for cell in row))
            # Columns are not cut where nothing but the console says how wide a line is, as in a pipe.
            width = console.width
            if not console.is_terminal:
                whole = console.measure(table, options=console.options.update(width=_WIDEST)).maximum
                console.width = max(width, whole)
            console.print(table)
            console.width = width
        elif self.title:
            console.print(f"{indent}{self.title}", markup=False, highlight=False)
        # The sentences and the sections below it, indented.
        indent += "  " if self.title else ""
        for words in (*self.notes, *self.remarks, *self.points):
            console.print(f"{indent}{_plain(words)}", style=_color(words), markup=False, highlight=False)
        for part in self.parts:
            part._rich(console, indent)

    def __str__(self) -> str:
        """The section in plain text, in the units of what runs, columns of one width."""
        return self.reworded(as_printed)._text

    @property
    def _text(self) -> str:
        lines = [self.title] if self.title else []
        lines += map(_plain, self.notes)
        if self.rows:
            rows = [[heading.replace("\n", " ") for heading, _ in self.columns]] if self.head else []
            rows += [[_plain(cell) for cell in row] for row in self.rows]
            widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
            lines += ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]
        lines += map(_plain, (*self.remarks, *self.points))
        lines += [f"  {line}" for part in self.parts for line in part._text.splitlines()]
        return "\n".join(lines)


def _changed(words: Words, change: Callable[[str], str]) -> Words:
    if isinstance(words, str):
        return change(words)
    return replace(words, text=change(words.text), then=change(words.then), detail=change(words.detail))


_OF_COLUMN = re.compile(r"\[((?:rad|m)(?:/s)?|rad or m)\]")


def _column(name: str, cells: Sequence[str], change: Callable[[str], str]) -> tuple[str, Callable[[str], str]]:
    """(heading, what changes the cells) of a column; of one with a unit and numbers alone these have that unit."""
    unit = _OF_COLUMN.search(name)
    if unit is None or not all(re.fullmatch(r"-|-?[\d.]+(?:e[-+]?\d+)?|", cell) for cell in cells):
        return name, change

    def with_unit(cell: str) -> str:
        return change(f"{cell} {unit[1]}").partition(" ")[0] if cell.strip("-") else cell

    return name.replace(unit[0], f"[{change(f'1 {unit[1]}').partition(' ')[2]}]"), with_unit


def _plain(words: Words) -> str:
    """Without tone and detail."""
    return words if isinstance(words, str) else words.text + words.then


def _color(words: Words) -> str | None:
    return None if isinstance(words, str) else _COLORS.get(words.tone)


def _inline(words: Words) -> str:
    """Words inside a line of HTML."""
    if isinstance(words, str):
        return escape(words)
    text, tag, kind = escape(words.text), _TAGS.get(words.tone), _CLASSES.get(words.tone)
    text = f"<{tag}>{text}</{tag}>" if tag else f"<span class='{kind}'>{text}</span>" if kind else text
    return text + escape(words.then) if words.then else text


def _block(tag: str, words: Words) -> str:
    """Words as a paragraph or an entry of a list; with a detail they unfold it, text of several lines as it is."""
    note = Note(words) if isinstance(words, str) else words
    if note.detail:
        detail = escape(note.detail)
        detail = f"<pre>{detail}</pre>" if "\n" in detail else f"<p class='small'>{detail}</p>"
        folded = f"<details><summary>{_inline(words)}</summary>{detail}</details>"
        return f"<li class='fold'>{folded}</li>" if tag == "li" else folded
    if (kind := _CLASSES.get(note.tone)) and not note.then:
        return f"<{tag} class='{kind}'>{escape(note.text)}</{tag}>"
    return f"<{tag}>{_inline(note)}</{tag}>"
