"""Where the joints of a robot stand in a MuJoCo or Pinocchio model, which may have more of them, in another order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..base.errors import ArgumentError, NotFiniteError, ShapeError, UnknownNameError
from ..base.types import Array, ArrayLike, Flags, Indices, Value, finite, numbers
from ..symbolic import wrapped

_CURE = "name the model's joint with one degree of freedom for each of the robot's: joints=[...]"

_WHOLE = "give all its numbers, as data.qpos or data.qvel of this model"

_KINDS = ("free", "ball", "slide", "hinge")
"""What MuJoCo's jnt_type counts."""


@dataclass(frozen=True, eq=False)
class ModelJoints(Value):
    """Places of n joints in a model: in its configuration (nq,) and in its velocity (nv,).

    Pinocchio keeps a joint without limits as cosine and sine: `sines` are the places of the sine for these, and those
    of the value itself for the others.
    """

    places: Indices
    sines: Indices
    columns: Indices
    length: int
    velocities: int
    hinges: Flags
    what: str = "the configuration"

    def read(self, configuration: Array, near: Array | float = 0.0) -> Array:
        """Joints (..., n) of configurations (..., nq); those kept as cosine and sine within half a turn of `near`."""
        q = configuration[..., self.places]
        if not self._turning.any():
            return q
        turn = self._turning
        angle = np.arctan2(configuration[..., self.sines[turn]], q[..., turn])
        about = np.broadcast_to(near, q.shape)[..., turn]
        q[..., turn] = about + wrapped(angle - about)
        return q

    def write(self, q: Array, configuration: Array) -> Array:
        """The configurations (..., nq) with the joints (..., n) in them, in place."""
        turn = self._turning
        configuration[..., self.places] = np.where(turn, np.cos(q), q) if turn.any() else q
        configuration[..., self.sines[turn]] = np.sin(q[..., turn])
        return configuration

    @cached_property
    def moving(self) -> ModelJoints:
        """Their places in the velocity, of which each joint has one number."""
        return replace(self, places=self.columns, sines=self.columns, length=self.velocities, what="the velocity")

    @cached_property
    def _turning(self) -> Flags:
        return self.places != self.sines


def pinocchio_joints(model: Any, names: Sequence[str]) -> ModelJoints:
    """The places of joints in a `pinocchio.Model`. Raises: UnknownNameError, ArgumentError."""
    found, hinges = [], []
    for name in names:
        if not model.existJointName(name):
            raise UnknownNameError("joint of the Pinocchio model", name, list(model.names)[1:])
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1 or joint.nq not in (1, 2):
            raise ArgumentError(f"joint {name!r} of the Pinocchio model", joint.shortname(), _CURE)
        found.append((joint.idx_q, joint.idx_q + joint.nq - 1, joint.idx_v))
        hinges.append(not joint.shortname().startswith("JointModelP"))
    places, sines, columns = np.array(found, dtype=np.intp).reshape(-1, 3).T
    return ModelJoints(places, sines, columns, int(model.nq), int(model.nv), np.array(hinges, dtype=bool))


def mujoco_joints(model: Any, names: Sequence[str]) -> ModelJoints:
    """The places of joints in a `mujoco.MjModel`. Raises: UnknownNameError, ArgumentError."""
    known = _mujoco_names(model)
    numbered = {name: i for i, name in enumerate(known)}
    found, hinges = [], []
    for name in names:
        if name not in numbered:
            raise UnknownNameError("joint of the MuJoCo model", name, list(numbered))
        joint = numbered[name]
        kind = _KINDS[int(model.jnt_type[joint])]
        if kind not in ("slide", "hinge"):
            raise ArgumentError(f"joint {name!r} of the MuJoCo model", f"a {kind} joint", _CURE)
        found.append((model.jnt_qposadr[joint], model.jnt_dofadr[joint]))
        hinges.append(kind == "hinge")
    places, columns = np.array(found, dtype=np.intp).reshape(-1, 2).T
    return ModelJoints(places, places, columns, int(model.nq), int(model.nv), np.array(hinges, dtype=bool))


def places_in(
    model: Any, names: tuple[str, ...], hinges: Flags, prefix: str, joints: Sequence[str] | None
) -> ModelJoints:
    """The places of a robot's joints in a model of either library.

    Those in a MuJoCo model, whose joints stay as they are once it is compiled, are kept as long as the model lives.

    Args:
        names: of the robot's joints. hinges (n,): which of them are hinges.
        prefix: what stands before each of these names in the model.
        joints: the model's own names, in the robot's order, in the place of `names` and `prefix`.

    Raises:
        UnknownNameError, ArgumentError, ShapeError.
    """
    wanted = tuple(prefix + name for name in names) if joints is None else tuple(joints)
    compiled = _is_compiled(model)
    if not compiled and not hasattr(model, "existJointName"):
        raise ArgumentError("model", model, "give a mujoco.MjModel or a pinocchio.Model, not its data")
    kept = _known.setdefault(model, {}) if compiled else {}
    if wanted not in kept:
        kept[wanted] = _found(model, wanted, names, prefix, joints, hinges)
    return kept[wanted]


_known: WeakKeyDictionary[Any, dict[tuple[str, ...], ModelJoints]] = WeakKeyDictionary()


def _found(
    model: Any, wanted: tuple[str, ...], names: tuple[str, ...], prefix: str, joints: Sequence[str] | None,
    hinges: Flags,
) -> ModelJoints:  # fmt: skip
    if len(wanted) != len(names):
        raise ShapeError("joints", (len(names),), (len(wanted),), f"name one for each of {', '.join(names)}")
    compiled = _is_compiled(model)
    known = _mujoco_names(model) if compiled else list(model.names)[1:]
    if joints is None and not set(wanted) <= set(known):
        others = _prefixes(names, known)
        if others:
            cure = (
                f"in this model these joints begin with {' or '.join(map(repr, others))}: give one of these as prefix"
            )
            raise ArgumentError("prefix", prefix, cure)
    found = (mujoco_joints if compiled else pinocchio_joints)(model, wanted)
    for name, ours, theirs in zip(wanted, hinges, found.hinges, strict=True):
        if ours != theirs:
            kind, other = ("a hinge", "a slide") if ours else ("a slide", "a hinge")
            raise ArgumentError(
                f"joint {name!r} of the model", other, f"the robot's is {kind}: name another by joints="
            )
    if len(set(found.places.tolist())) < len(names):
        raise ArgumentError("joints", list(wanted), "name each joint once")
    return found


def _is_compiled(model: Any) -> bool:
    """Whether it is a `mujoco.MjModel`."""
    return hasattr(model, "jnt_qposadr") and hasattr(model, "joint")


def _prefixes(names: tuple[str, ...], known: Sequence[str]) -> list[str]:
    """What stands in a model before all of these names."""
    found = [name.removesuffix(names[0]) for name in known if names and name.endswith(names[0])]
    return [prefix for prefix in found if {prefix + name for name in names} <= set(known)]


def _mujoco_names(model: Any) -> list[str]:
    """The names of all joints; one without a name is called by its number, as `from_mjcf` does."""
    return [model.joint(i).name or f"joint {i}" for i in range(model.njnt)]


def taken_from(places: ModelJoints, given: ArrayLike, names: Sequence[str], near: ArrayLike = 0.0) -> Array:
    """Joints (..., n) in the numbers (..., nq) of a model. Raises: ShapeError, NotFiniteError, ArgumentError."""
    array = numbers(places.what, given)
    if array.shape[-1:] != (places.length,):
        raise ShapeError(places.what, ("...", places.length), array.shape, _WHOLE)
    found = places.read(array, numbers("near", near))
    if not np.isfinite(found).all():
        bad = [
            name for name, row in zip(names, found.reshape(-1, len(names)).T, strict=True) if not np.isfinite(row).all()
        ]
        raise NotFiniteError(places.what, f"at {', '.join(bad)}")
    return found


def put_into(places: ModelJoints, array: Array, q: ArrayLike) -> Array:
    """The numbers (..., nq) of a model with joints (..., n) in them, in place.

    Raises: ShapeError, NotFiniteError, ArgumentError.
    """
    if not isinstance(array, np.ndarray) or array.dtype.kind != "f" or not array.flags.writeable:
        raise ArgumentError(places.what, array, "give an array of floats that can be written to, as data.qpos")
    if array.shape[-1:] != (places.length,):
        raise ShapeError(places.what, ("...", places.length), array.shape, _WHOLE)
    given, wanted = finite("the joints", q), (*array.shape[:-1], len(places.places))
    if given.shape not in (wanted, wanted[-1:]):
        raise ShapeError("the joints", wanted, given.shape)
    return places.write(given, array)
