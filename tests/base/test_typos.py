"""Words that are misspelt: each call below is an error of types, and an error that names the words when it is run.

Pyright reads this file with `src` (see pyproject.toml): where it finds no error in a line that says `pyright: ignore`,
that line is its error.
"""

# pyright: reportUnnecessaryTypeIgnoreComment=true
from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from holokin import export, motion
from holokin import robot as robots

ROBOT = hk.load("planar-3r")
TASK = hk.position(ROBOT)
Q0 = np.array([0.3, 0.6, 0.5])
START = ROBOT.pose(Q0)[:3, 3]
LINE = hk.line(START, START - [0.05, 0.0, 0.0])
LAW = hk.holonomic(TASK, hk.lock(2))
SPACE = hk.workspace(box=(START[:2], [0.1, 0.1]))


def walk() -> hk.Trajectory:
    return hk.follow(LAW, LINE, Q0, samples=20)


def timed() -> motion.TimedTrajectory:
    return hk.retime(walk(), acceleration=4.0)


TYPOS: dict[str, Callable[[], object]] = {
    "orientation of a pose": lambda: hk.pose(ROBOT, orientation="twits"),  # pyright: ignore[reportArgumentType]
    "orientation of a coupling": lambda: hk.coupled(1.0, "zxz"),  # pyright: ignore[reportArgumentType]
    "convention": lambda: hk.from_dh([{"a": 1.0}], convention="modifed"),  # pyright: ignore[reportArgumentType]
    "kind of a row": lambda: hk.from_dh([robots.DHRow(a=1.0, kind="hinge")]),  # pyright: ignore[reportArgumentType]
    "definition": lambda: hk.arm_angle(definition="usual"),  # pyright: ignore[reportArgumentType]
    "method of follow": lambda: hk.follow(LAW, LINE, Q0, method="leave"),  # pyright: ignore
    "method of two paths": lambda: hk.motion.path_spread(LAW, LINE, LINE, Q0, method="leafs"),  # pyright: ignore[reportArgumentType]
    "method of curvature": lambda: hk.curvature(LAW, Q0, method="hesian"),  # pyright: ignore[reportArgumentType]
    "objective": lambda: hk.design(TASK, SPACE, Q0, objective="worst_sped"),  # pyright: ignore[reportArgumentType]
    "profile": lambda: hk.retime(walk(), profile="trapezoid"),  # pyright: ignore[reportArgumentType]
    "by of excess": lambda: timed().excess("differences"),  # pyright: ignore[reportArgumentType]
    "by of approach": lambda: hk.motion.approach(LAW, LINE, Q0, by="hand"),  # pyright: ignore[reportArgumentType]
    "format": lambda: export.to_ros(timed(), format="yml"),  # pyright: ignore[reportArgumentType]
    "servo": lambda: robots.servo(ROBOT, "torques", Q0),  # pyright: ignore[reportArgumentType]
}


@pytest.mark.parametrize("name", TYPOS)
def test_a_word_that_is_misspelt_is_refused_when_it_is_run(name: str) -> None:
    """In words, which name what was given."""
    with pytest.raises(hk.HolokinError, match=r"twits|zxz|modifed|hinge|usual|leave|leafs|hesian|sped|"
                       "trapezoid|differences|hand|yml|torques"):  # fmt: skip
        TYPOS[name]()


@pytest.mark.campaign
@pytest.mark.skipif(find_spec("pyright") is None, reason="no pyright here")
def test_a_word_that_is_misspelt_is_an_error_of_types(tmp_path: Path) -> None:
    """Each of them, and nothing else in this file: as an editor shows it, without the comments that expect it."""
    text = Path(__file__).read_text("utf-8")
    lines = text.partition("@pytest")[0].splitlines()
    (tmp_path / "typos.py").write_text("\n".join(line.partition("  # pyright")[0] for line in lines), "utf-8")
    command = [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    errors = [e for e in json.loads(done.stdout)["generalDiagnostics"] if e["severity"] == "error"]
    places = {e["range"]["start"]["line"] for e in errors}
    expected = {i for i, line in enumerate(lines) if line.lstrip().startswith('"') and "lambda:" in line}
    assert places == expected
