"""Axes and postures as one types them beside a command."""

from __future__ import annotations

import numpy as np

from ...base.errors import ArgumentError
from ...robot import Robot


def axis_of(text: str) -> str | list[float]:
    """An axis of the tool, "x", "y", "z" or three numbers. Raises: ArgumentError."""
    if text in ("x", "y", "z"):
        return text
    numbers = numbers_of(text)
    if numbers is None or len(numbers) != 3:
        raise ArgumentError("--axis", text, 'write x, y or z, or a direction in the tool\'s frame like "0 0.5 1"')
    return numbers


def posture_of(text: str, robot: Robot, degrees: bool) -> list[float]:
    """A posture [rad, m] of numbers with blanks or commas between them. Raises: ArgumentError."""
    numbers = numbers_of(text)
    if numbers is None:
        cure = "give numbers with blanks between them, in rad and m; with --degrees in degrees and m"
        raise ArgumentError("the start posture", text, cure)
    if len(numbers) != robot.n:
        return numbers  # who checks the posture says how many there should be
    return (np.array(numbers) * np.where(robot.hinges & degrees, np.pi / 180, 1.0)).tolist()


def numbers_of(text: str) -> list[float] | None:
    """Finite numbers with blanks or commas between them; None where the text has anything else."""
    try:
        found = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return None
    return found if np.isfinite(found).all() else None
