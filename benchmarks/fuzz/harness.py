"""Runs mutants of one kind in processes of their own, with limits of time and memory, and counts what became of them.

A kind is a row of `doors`, or `calls`: it makes the mutant of a seed, in an empty folder of its own, and gives it to
holokin, which answers or raises a `HolokinError`; anything else is a crash. The same seed makes the same mutant.
"""

from __future__ import annotations

import _thread
import contextlib
import multiprocessing
import os
import random
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.fuzz import calls, doors
from holokin.base.errors import HolokinError

SECONDS = 20
"""Longest time of one mutant [s]."""

MEGABYTES = 1000
"""Most memory that a process may come to with one mutant [MB]."""

LONGEST_MESSAGE = 2000
"""Characters of a refusal that somebody still reads."""


@dataclass
class Tally:
    """What became of the mutants of a kind; `faults` (seed, what happened) are those that must not be."""

    kind: str
    done: int = 0
    refused: int = 0
    slowest: float = 0.0
    memory: float = 0.0
    faults: list[tuple[int, str]] = field(default_factory=list)

    def __str__(self) -> str:
        return (
            f"{self.kind}: {self.done} mutants, {self.refused} refused, {len(self.faults)} faults, "
            f"slowest {self.slowest:.1f} s, at most {self.memory:.0f} MB"
        )


class TooLongError(BaseException):
    """What took more seconds than it may; no `except Exception` in what runs holds it up."""


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Lets what runs inside, in a main thread, take so many seconds.

    By a timer that interrupts the main thread: SIGALRM is not on Windows. One operation of compiled code is interrupted
    when it returns. Raises (inside): TooLongError; KeyboardInterrupt for a Ctrl-C, as ever.
    """
    late, inside = False, True

    def interrupt() -> None:
        nonlocal late
        late = True
        _thread.interrupt_main()

    def stop(signal_: int, frame: Any) -> None:
        if not late:
            signal.default_int_handler(signal_, frame)
        if inside:
            raise TooLongError(f"took more than {seconds} s")

    timer, before = threading.Timer(seconds, interrupt), signal.signal(signal.SIGINT, stop)
    timer.daemon = True
    try:
        timer.start()
        yield
    finally:
        inside = False
        timer.cancel()
        timer.join()
        signal.signal(signal.SIGINT, before)


def one(kind: str, seed: int) -> tuple[int, bool, float, str]:
    """(seed, refused, seconds, fault or nothing) of one mutant, in this process."""
    good = calls.mutant if kind == "calls" else doors.DOORS[kind][0]
    good(random.Random(0))  # what is good is made once, and not in the time of a mutant
    begin, refused, fault = time.perf_counter(), False, ""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        try:
            with limited(SECONDS):
                if kind == "calls":
                    calls.attempt(seed, Path(folder))
                else:
                    doors.attempt(kind, seed, Path(folder))
        except HolokinError as problem:
            refused = True
            if len(str(problem)) > LONGEST_MESSAGE:
                fault = f"a refusal of {len(str(problem))} characters"
        except BaseException:  # noqa: BLE001  whatever it is, it is what we are looking for
            fault = traceback.format_exc(limit=-6)
    return seed, refused, time.perf_counter() - begin, fault


def _work(arguments: tuple[str, list[int]]) -> tuple[list[tuple[int, bool, float, str]], float]:
    kind, seeds = arguments
    found = [one(kind, seed) for seed in seeds]
    return found, _most_memory()


def _most_memory() -> float:
    """The most memory this process has held [MB]. Linux counts a parent's into `ru_maxrss`, not into `VmHWM`."""
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text("ascii", "replace").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    import resource  # not on Windows

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024**2 if sys.platform == "darwin" else 1024)


def run(kind: str, count: int, *, first: int = 0, workers: int | None = None, chunk: int = 25) -> Tally:
    """`count` mutants of a kind, from the seed `first` on."""
    seeds = list(range(first, first + count))
    parts = [(kind, seeds[i : i + chunk]) for i in range(0, count, chunk)]
    tally = Tally(kind)
    for found, memory in _pooled(parts, workers or os.cpu_count() or 1):
        tally.memory = max(tally.memory, memory)
        for seed, refused, seconds, fault in found:
            tally.done += 1
            tally.refused += refused
            tally.slowest = max(tally.slowest, seconds)
            if fault:
                tally.faults.append((seed, fault))
    if tally.memory > MEGABYTES:
        tally.faults.append((-1, f"{tally.memory:.0f} MB in one process"))
    return tally


def _pooled(parts: list[tuple[str, list[int]]], workers: int) -> Iterator[Any]:
    if workers == 1:
        yield from map(_work, parts)
        return
    with multiprocessing.get_context("spawn").Pool(workers, maxtasksperchild=20) as pool:
        yield from pool.imap_unordered(_work, parts)
