"""A program that ends without closing its studio ends the studio's threads before Python goes down."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import holokin as hk

pytest.importorskip("viser", reason="the extra `studio` is not installed")

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
    source = str(Path(hk.__file__).parents[1])
    ways = os.pathsep.join([source, *filter(None, [os.environ.get("PYTHONPATH")])])
    given = os.environ | {"HOLOKIN_NATIVE": "0", "PYTHONPATH": ways}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=given, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "at work: True" in done.stdout and "left: []" in done.stdout
    assert "closed connection" not in done.stderr
