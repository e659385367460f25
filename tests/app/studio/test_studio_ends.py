"""A session that is closed leaves no memory behind, and a program that ends without closing its studio no thread."""

from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import holokin as hk
from holokin.app.studio import Session, open_session
from holokin.symbolic.native import toolchain as native
from sessions import panda, shifted

GLIBC = sys.platform == "linux" and hasattr(ctypes.CDLL(None), "mallinfo2")
WARM, COUNT = 2, 5  # Sessions that fill caches, and those that are counted

# Bytes of the heap that a session may keep; they are below 1,500. One that loads its libraries anew kept 16,000, and
# 65,000 to 450,000 with their pages
MOST = 6_000


class _Heap(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_size_t) for name in (
        "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost",
    ))  # fmt: skip


def heap() -> int:
    """Bytes that are allocated in this process."""
    ask = ctypes.CDLL(None).mallinfo2
    ask.restype = _Heap
    gc.collect()
    found = ask()
    return int(found.uordblks + found.hblkhd)


def mapped() -> int:
    """Pieces of files and of nameless memory that this process has mapped for code: a library has five."""
    return Path("/proc/self/maps").read_text("utf-8").count("memfd:holokin")


def ready(session: Session) -> None:
    """Until all its strategies are compiled and judged."""
    session.start_work()
    while not all(strategy.judgement for strategy in session.snapshot().strategies):
        time.sleep(0.01)


def made_anew() -> None:
    """A job's own robot, task and strategies."""
    session = open_session("ppr-cycle")
    ready(session)
    session.close()


def used() -> None:
    """Dragged, and round its loop."""
    session = panda(cycles=1)
    ready(session)
    session.drag(shifted(0.03, 0.02))
    session.reset()
    session.play()
    for _ in range(10):
        session.advance(0.2)
    session.close()


@pytest.mark.campaign
@pytest.mark.skipif(not GLIBC, reason="only glibc, on Linux, tells what is allocated and what is loaded")
@pytest.mark.parametrize("live", [made_anew, used])
def test_a_session_that_was_closed_leaves_no_native_memory_behind(live: Callable[[], None]) -> None:
    for _ in range(WARM):
        live()
    before, loaded = heap(), mapped()
    for _ in range(COUNT):
        live()
    assert (heap() - before) / COUNT < MOST
    assert mapped() == loaded
    assert loaded > 0 or native.engine().startswith("CasADi")


PROGRAM = """
import atexit, threading

@atexit.register
def last():  # registered first, so called last
    print("left:", sorted(t.name for t in threading.enumerate() if t.name.startswith("holokin")), flush=True)

import holokin as hk
studio = hk.studio("planar-3r", browser=False, wait=False, port=0, progress=str)
session = studio.session
session.start_cusps(next(strategy.name for strategy in session.strategies if strategy.holonomic))
print("at work:", session.snapshot().cusps.running, flush=True)
"""


@pytest.mark.campaign
def test_a_program_that_ends_while_cusps_are_sought_leaves_no_thread_at_work() -> None:
    pytest.importorskip("viser", reason="the extra `studio` is not installed")
    source = str(Path(hk.__file__).parents[1])
    ways = os.pathsep.join([source, *filter(None, [os.environ.get("PYTHONPATH")])])
    given = os.environ | {"HOLOKIN_NATIVE": "0", "PYTHONPATH": ways}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=given, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "at work: True" in done.stdout and "left: []" in done.stdout
    assert "closed connection" not in done.stderr
