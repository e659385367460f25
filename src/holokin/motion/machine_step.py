"""The control step on CasADi's virtual machine, where there is no compiler."""

from __future__ import annotations

import threading
from collections.abc import Callable
from math import isfinite
from typing import Any

import numpy as np

from ..base.tolerances import TOLERANCES
from ..base.types import Array, Vector
from ..symbolic import Function
from ..symbolic.native import Port, StepMemory
from .step_expression import AT_LIMIT, Rates, StepStatus


class _Memory(threading.local):
    """What a thread needs for steps on the virtual machine: (trigger, arguments, results, its results of a step)."""

    def __init__(self, port: Port, parameters: Vector, memory: StepMemory) -> None:
        port.arguments[-1][...] = parameters
        self.all = (port.trigger, port.arguments, port.results, memory.out)


def machine_step(
    function: Function, parameters: Vector, memory: StepMemory, convert: Callable[..., tuple[Array, Array, Array]]
) -> Rates:
    """The step by CasADi's virtual machine, on memory of its own, and each thread's own."""
    mine, latest = _Memory(function.port(), parameters, memory), memory.latest
    change = parameters.flags.writeable
    shapes = tuple(function.input_shapes.values())[:3]
    double, least, clear = np.dtype(float), TOLERANCES.singular, TOLERANCES.representation
    ok, slowed, limit = (int(status) for status in (StepStatus.OK, StepStatus.SLOWED, StepStatus.LIMIT))

    def step(q: Any, pose: Any, twist: Any) -> Vector:
        try:
            fit = (q.shape, pose.shape, twist.shape) == shapes and q.dtype is pose.dtype is twist.dtype is double
            fit = fit and (pose.ndim == 1 or (len(pose) == 4 and pose[3].tolist() == [0.0, 0.0, 0.0, 1.0]))
        except AttributeError:  # no arrays
            fit = False
        if not fit:
            q, pose, twist = convert(q, pose, twist)
        trigger, (q_in, pose_in, twist_in, parameters_in), results, out = mine.all
        latest[0], memory.stepped = out, True
        q_in[...], pose_in[...], twist_in[...] = q, pose, twist
        if change:
            parameters_in[...] = parameters
        trigger()
        rates, scale, rcond, margin, room, off, given, holding = results
        share = scale.item()
        size = rates @ rates + share + given.item()
        most, singular = parameters_in[-2:].tolist()
        sound = isfinite(size) and rcond.item() > max(least, singular) and margin.item() > clear
        if sound and off.item() <= most:
            out[-3], out[-2] = share, holding.item()
            out[-1] = ok if share >= 1.0 else slowed if room.item() > AT_LIMIT else limit
            return rates.copy()
        out[-3] = out[-2] = 0.0
        given_all = isfinite(given.item())
        out[-1] = StepStatus.NOT_FINITE if not given_all else StepStatus.LOST if sound else StepStatus.SINGULAR
        return np.zeros(len(rates))

    return step
