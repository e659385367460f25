"""What a command prints while it works: a progress bar on a terminal, and all texts in the units that are asked for."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib.util import find_spec

DELAY = 1.0
"""Seconds before the bar appears."""


@contextmanager
def progress(label: str, total: float, *, words: bool = False) -> Iterator[Callable[..., None]]:
    """Yields `report(done)`; call it as often as you like. With `words` it is `report(done, words)`."""
    if not sys.stderr.isatty() or find_spec("rich") is None:
        yield lambda _done, _words="": None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TextColumn

    words_column = TextColumn("{task.fields[words]}", markup=False)
    columns = (TextColumn("{task.description}"), BarColumn(), words_column) if words else Progress.get_default_columns()
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    start = last = time.monotonic()
    task = None

    def report(done: float, words: str = "") -> None:
        nonlocal task, last
        now = time.monotonic()
        if now - last < 0.1 or now - start < DELAY:
            return
        last = now
        if task is None:
            bar.start()
            task = bar.add_task(escape(label), total=total, words=words)
        bar.update(task, completed=done, words=words)

    try:
        yield report
    finally:
        bar.stop()


# --- The units in which a command prints: the sentences that it says, the errors and the tables.

_as_printed: ContextVar[Callable[[str], str]] = ContextVar("a text in the units in which this command prints")
_as_printed.set(str)


def print_by(change: Callable[[str], str]) -> None:
    """From now on print each text as this changes it."""
    _as_printed.set(change)


def as_printed(text: str) -> str:
    """A text in the units of what runs: those of its job, else rad and m."""
    return _as_printed.get()(text)
