"""Is the action of a dataset a joint position? Joint rates and differences have the same names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..analysis.audit.logs import STATE, Dataset, JointFeature
from ..analysis.audit.logs.dataset_columns import postures_of
from ..analysis.audit.logs.dataset_folder import INFO, rows
from ..analysis.audit.logs.logged_turns import less_turns
from ..base.errors import RecordingError
from ..robot import Robot

FAR = 0.5
"""Median distance [rad or m] of an action from the state beyond which it is doubted to be a position."""


def check_targets(dataset: Dataset, robot: Robot, columns: Sequence[JointFeature]) -> None:
    """Raises: RecordingError: a column of the first episode that is far from the measured joints."""
    state = next((one for one in columns if one.name == STATE), None)
    others = [one for one in columns if one.name != STATE]
    if state is None or not others:
        return
    found: dict[str, list[float]] = {one.name: [] for one in others}
    for part in rows(dataset, [one.name for one in columns], [0]):
        here = postures_of(dataset, robot, state, part.values[STATE])
        for one in others:
            gap = less_turns(postures_of(dataset, robot, one, part.values[one.name]) - here, robot.hinges)
            found[one.name] += np.abs(gap).max(axis=1).tolist()
    for name, gaps in found.items():
        if np.median(gaps) > FAR:
            fact = f"{name} is {np.median(gaps):.2g} rad or m from {STATE} (median of episode 0): it seems no position"
            cure = f"leave it as it is by --column {STATE}, or name both columns if it is one"
            raise RecordingError(dataset.folder / INFO, fact, cure)
