"""Frames, limits, obstacles, axes and postures as one types them beside `holokin advise`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.types import Vector
from ..errors import ArgumentError, UnknownNameError
from ..robot import Robot

SOLIDS = {
    "box": ("X Y Z SX SY SZ", {"sides": 3}), "sphere": ("X Y Z RADIUS", {"radius": 1}),
    "cylinder": ("X Y Z RADIUS LENGTH", {"radius": 1, "length": 1}),
    "capsule": ("X Y Z RADIUS LENGTH", {"radius": 1, "length": 1}),
}  # fmt: skip
"""Obstacles: what is typed after the kind, and the keys of the numbers after the place."""


def frame_words(what: str, text: str) -> dict[str, list[float]]:
    """The frame of "X Y Z" or "X Y Z rpy R P Y" [m, degrees]: xyz and rpy_deg of a job. Raises: ArgumentError."""
    place, _, turn = text.replace(",", " ").partition("rpy")
    xyz, rpy = _numbers(place), _numbers(turn)
    if xyz is None or rpy is None or len(xyz) != 3 or len(rpy) not in (0, 3) or ("rpy" in text and not rpy):
        raise ArgumentError(what, text, 'write "X Y Z" in metres, and behind it, as needed, "rpy R P Y" in degrees')
    return {"xyz": xyz} | ({"rpy_deg": rpy} if rpy else {})


def obstacle_words(text: str) -> dict[str, Any]:
    """An obstacle of a job, of "NAME box X Y Z SX SY SZ" and the like [m]. Raises: ArgumentError."""
    words = text.replace(",", " ").split()
    kind = words[1] if len(words) > 1 else ""
    forms = ", ".join(f'"NAME {name} {form}"' for name, (form, _) in SOLIDS.items())
    cure = f'write {forms} in metres, and behind it, as needed, "rpy R P Y" in degrees'
    if kind not in SOLIDS:
        raise ArgumentError("--obstacle", text, cure)
    sizes = SOLIDS[kind][1]
    rest, _, turn = " ".join(words[2:]).partition("rpy")
    numbers, rpy = _numbers(rest), _numbers(turn)
    if numbers is None or rpy is None or len(numbers) != 3 + sum(sizes.values()) or len(rpy) not in (0, 3):
        raise ArgumentError("--obstacle", text, cure)
    found: dict[str, Any] = {"name": words[0], "kind": kind, "xyz": numbers[:3]}
    left = numbers[3:]
    for key, count in sizes.items():
        found[key] = left[:count] if count > 1 else left[0]
        left = left[count:]
    return found | ({"rpy_deg": rpy} if rpy else {})


def limits_of(texts: Sequence[str], robot: Robot, degrees: bool) -> dict[str, dict[str, float]]:
    """`lower` and `upper` of [robot], of texts "JOINT LOWER UPPER". Raises: ArgumentError, UnknownNameError."""
    lower: dict[str, float] = {}
    upper: dict[str, float] = {}
    for text in texts:
        joint, *values = text.replace(",", " ").split() or [""]
        ends = _numbers(" ".join(values))
        if ends is None or len(ends) != 2:
            raise ArgumentError("--limit", text, 'write "JOINT LOWER UPPER", in rad or m, or with --degrees in degrees')
        if joint not in robot.joint_names:
            raise UnknownNameError("joint", joint, robot.joint_names)
        scale = _scales(robot, degrees)[robot.joint_names.index(joint)]
        lower[joint], upper[joint] = ends[0] * scale, ends[1] * scale
    return {"lower": lower, "upper": upper} if texts else {}


def axis_of(text: str) -> str | list[float]:
    """An axis of the tool, "x", "y", "z" or three numbers. Raises: ArgumentError."""
    if text in ("x", "y", "z"):
        return text
    numbers = _numbers(text.replace(",", " "))
    if numbers is None or len(numbers) != 3:
        raise ArgumentError("--axis", text, 'write x, y or z, or a direction in the tool\'s frame like "0 0.5 1"')
    return numbers


def posture_of(text: str, robot: Robot, degrees: bool) -> list[float]:
    """A posture [rad, m] of numbers with blanks or commas between them. Raises: ArgumentError."""
    numbers = _numbers(text.replace(",", " "))
    if numbers is None:
        cure = "give numbers with blanks between them, in rad and m; with --degrees in degrees and m"
        raise ArgumentError("the start posture", text, cure)
    scales = _scales(robot, degrees)
    if len(numbers) != robot.n:
        return numbers  # who checks the posture says how many there should be
    return (np.array(numbers) * scales).tolist()


def _scales(robot: Robot, degrees: bool) -> Vector:
    """What typed values of each joint are multiplied by (n,)."""
    return np.where(robot.hinges & degrees, np.pi / 180, 1.0)


def _numbers(text: str) -> list[float] | None:
    """The numbers of a text; None where it has other words, or what is not finite."""
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        return None
    return found if np.isfinite(found).all() else None
