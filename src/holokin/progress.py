"""A progress bar that appears when work takes longer than a second, on a terminal only."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

DELAY = 1.0
"""Seconds before the bar appears."""


@contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """Yields `report(done)`; call it as often as you like."""
    if not sys.stderr.isatty():
        yield lambda _done: None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress

    bar = Progress(console=Console(stderr=True), transient=True)
    start = last = time.monotonic()
    task = None

    def report(done: int) -> None:
        nonlocal task, last
        now = time.monotonic()
        if now - last < 0.1 or now - start < DELAY:
            return
        last = now
        if task is None:
            bar.start()
            task = bar.add_task(escape(label), total=total)
        bar.update(task, completed=done)

    try:
        yield report
    finally:
        bar.stop()
