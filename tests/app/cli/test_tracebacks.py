"""A user's mistake in Python shows one traceback, which ends with what is wrong and how it is cured."""

from __future__ import annotations

import io
import traceback
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import holokin as hk

PANDA_START = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
BENT = [{"a": 0.3}, {"a": 0.3}, {"a": 0.2}]


def written(folder: Path, name: str, text: str) -> Path:
    file = folder / name
    file.write_text(text, "utf-8")
    return file


def _out_of_reach() -> None:
    arm = hk.from_dh(BENT)
    q0 = np.array([0.3, 0.9, 0.7])
    p = arm.pose(q0)[:3, 3]
    hk.follow(hk.holonomic(hk.position(arm), hk.lock(2)), hk.line(p, p + [3.0, 0, 0]), q0)


MISTAKES: dict[str, Callable[[Path], object]] = {
    "a robot that there is not": lambda _: hk.load("pandaa"),
    "a file that there is not": lambda folder: hk.load(str(folder / "arm.urdf")),
    "a URDF that is none": lambda folder: hk.load(str(written(folder, "arm.urdf", "<robot><link/>"))),
    "an MJCF that is none": lambda folder: hk.load(str(written(folder, "arm.xml", "<mujoco><body/></mujoco>"))),
    "a table that is none": lambda folder: hk.load(str(written(folder, "arm.toml", 'name = "a"\njoints = 3\n'))),
    "a table with a bad row": lambda folder: hk.load(
        str(written(folder, "arm.toml", 'name = "a"\nsource = "s"\n[[joints]]\na = "long"\n'))
    ),
    "a DH row with a bad key": lambda _: hk.from_dh([{"b": 1.0}]),
    "a pose that is none": lambda _: hk.ik(hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(2)),
                                                [0.3, 0.9, 0.7])(np.eye(3)),
    "a posture too short": lambda _: hk.load("planar-3r").pose([0.1]),
    "a constraint of text": lambda _: hk.holonomic(hk.position(hk.load("planar-3r")), hk.custom(lambda q: "q", rows=1)),
    "a path that leaves the reach": lambda _: _out_of_reach(),
    "a start elsewhere": lambda _: hk.follow(
        hk.moore_penrose(hk.position(hk.load("planar-3r"))), hk.line([0, 0, 0], [0.1, 0, 0]), [0.3, 0.9, 0.7]),
    "waypoints that are none": lambda folder: hk.read_paths(written(folder, "w.csv", "x,y\n1,2\n")).paths[0],
    "a drawing that is none": lambda folder: hk.read_paths(written(folder, "d.svg", "<svg")),
    "a joint that there is not": lambda _: hk.with_limits(hk.load("planar-3r"), max_velocity={"q9": 1.0}),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_shows_one_traceback(mistake: str, tmp_path: Path) -> None:
    with pytest.raises((hk.HolokinError, TypeError)) as told:
        MISTAKES[mistake](tmp_path)
    assert isinstance(told.value, hk.HolokinError), told.value
    shown = io.StringIO()
    traceback.print_exception(told.value, file=shown)
    assert shown.getvalue().count("Traceback (most recent call last)") == 1, shown.getvalue()
