"""Where the joints of a robot stand in a Pinocchio or MuJoCo model, which may have more of them, in another order."""

from __future__ import annotations

import contextlib
import importlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.types import Indices, Value, Vector
from ..errors import ArgumentError, MissingExtraError, UnknownNameError
from ..symbolic import wrapped

_CURE = "name the model's joint with one degree of freedom for each of the robot's: joints=[...]"


@dataclass(frozen=True, eq=False)
class ModelJoints(Value):
    """Places of n joints in a model: in its configuration (nq,) and in its velocity (nv,).

    Pinocchio keeps a joint without limits as cosine and sine: `sines` are the places of the sine for these, and those
    of the value itself for the others.
    """

    places: Indices
    sines: Indices
    columns: Indices
    velocities: int

    def read(self, configuration: Vector, near: Vector) -> Vector:
        """Joints (n,) of a configuration (nq,); those kept as cosine and sine within half a turn of `near` (n,)."""
        q = configuration[self.places]
        turning = self.places != self.sines
        if turning.any():
            angle = np.arctan2(configuration[self.sines[turning]], q[turning])
            q[turning] = near[turning] + wrapped(angle - near[turning])
        return q

    def write(self, q: Vector, configuration: Vector) -> Vector:
        """The configuration (nq,) with the joints (n,) in it, in place."""
        turning = self.places != self.sines
        configuration[self.places] = np.where(turning, np.cos(q), q)
        configuration[self.sines[turning]] = np.sin(q[turning])
        return configuration


def pinocchio_joints(model: Any, names: Sequence[str]) -> ModelJoints:
    """The places of joints in a `pinocchio.Model`. Raises: UnknownNameError, ArgumentError."""
    found = []
    for name in names:
        if not model.existJointName(name):
            raise UnknownNameError("joint of the Pinocchio model", name, list(model.names)[1:])
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1 or joint.nq not in (1, 2):
            raise ArgumentError(f"joint {name!r} of the Pinocchio model", joint.shortname(), _CURE)
        found.append((joint.idx_q, joint.idx_q + joint.nq - 1, joint.idx_v))
    places, sines, columns = np.array(found, dtype=np.intp).T
    return ModelJoints(places, sines, columns, int(model.nv))


def mujoco_joints(model: Any, names: Sequence[str]) -> ModelJoints:
    """The places of joints in a `mujoco.MjModel`. Raises: UnknownNameError, ArgumentError."""
    mujoco = extra("mujoco", "mink", "mink")
    known = [model.joint(i).name for i in range(model.njnt)]
    found = []
    for name in names:
        if name not in known:
            raise UnknownNameError("joint of the MuJoCo model", name, known)
        joint = known.index(name)
        kind = mujoco.mjtJoint(int(model.jnt_type[joint]))
        if kind not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            raise ArgumentError(f"joint {name!r} of the MuJoCo model", kind.name, _CURE)
        found.append((model.jnt_qposadr[joint], model.jnt_dofadr[joint]))
    places, columns = np.array(found, dtype=np.intp).T
    return ModelJoints(places, places, columns, int(model.nv))


def extra(module: str, package: str, name: str) -> Any:
    """An optional library, by the extra that has it. Raises: MissingExtraError."""
    try:
        with Path(os.devnull).open("w") as nothing, contextlib.redirect_stdout(nothing):  # some print when imported
            return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(package, name) from None
