"""`Robot`: a tree of joints from a base to one tip, or several, and its kinematics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..base.arguments import check, typed
from ..base.errors import ArgumentError, JointLimitError, NotFiniteError, ShapeError, UnknownNameError, shown
from ..base.tolerances import TOLERANCES
from ..base.types import (
    Array,
    ArrayLike,
    ByValue,
    Flags,
    Indices,
    Matrix,
    Value,
    Vector,
    finite,
    frozen,
    kept,
    numbers,
    one_or_each,
)
from ..symbolic import (
    SX,
    Evaluator,
    Function,
    as_map,
    check_length,
    cross,
    densify,
    horzcat,
    horzsplit,
    symbol,
    vertcat,
    wrapped,
)
from ..symbolic.rotations import rotation_about
from .joints import FARTHEST, MOST_MOVING, WOUND, Body, Coordinate, Joint, Kinematics, Tip, joint_rows, joints_above
from .shapes.link_shapes import LinkShape
from .shapes.visuals import Visual

# --- Where the joints of a robot stand in a MuJoCo or Pinocchio model, which may have more of them, in another order.

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
    at_columns, hinges = [], []
    for name in names:
        if not model.existJointName(name):
            raise UnknownNameError("joint of the Pinocchio model", name, list(model.names)[1:])
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1 or joint.nq not in (1, 2):
            raise ArgumentError(f"joint {name!r} of the Pinocchio model", joint.shortname(), _CURE)
        at_columns.append((joint.idx_q, joint.idx_q + joint.nq - 1, joint.idx_v))
        hinges.append(not joint.shortname().startswith("JointModelP"))
    places, sines, columns = np.array(at_columns, dtype=np.intp).reshape(-1, 3).T
    return ModelJoints(places, sines, columns, int(model.nq), int(model.nv), np.array(hinges, dtype=bool))


def mujoco_joints(model: Any, names: Sequence[str]) -> ModelJoints:
    """The places of joints in a `mujoco.MjModel`. Raises: UnknownNameError, ArgumentError."""
    known = _mujoco_names(model)
    numbered = {name: i for i, name in enumerate(known)}
    at_columns, hinges = [], []
    for name in names:
        if name not in numbered:
            raise UnknownNameError("joint of the MuJoCo model", name, list(numbered))
        joint = numbered[name]
        kind = _KINDS[int(model.jnt_type[joint])]
        if kind not in ("slide", "hinge"):
            raise ArgumentError(f"joint {name!r} of the MuJoCo model", f"a {kind} joint", _CURE)
        at_columns.append((model.jnt_qposadr[joint], model.jnt_dofadr[joint]))
        hinges.append(kind == "hinge")
    places, columns = np.array(at_columns, dtype=np.intp).reshape(-1, 2).T
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
    cache = _known.setdefault(model, {}) if compiled else {}
    if wanted not in cache:
        cache[wanted] = _find_joints(model, wanted, names, prefix, joints, hinges)
    return cache[wanted]


_known: WeakKeyDictionary[Any, dict[tuple[str, ...], ModelJoints]] = WeakKeyDictionary()


def _find_joints(
    model: Any,
    wanted: tuple[str, ...],
    names: tuple[str, ...],
    prefix: str,
    joints: Sequence[str] | None,
    hinges: Flags,
) -> ModelJoints:
    if len(wanted) != len(names):
        raise ShapeError("joints", (len(names),), (len(wanted),), f"name one for each of {', '.join(names)}")
    compiled = _is_compiled(model)
    known = _mujoco_names(model) if compiled else list(model.names)[1:]
    if joints is None and not set(wanted) <= set(known):
        # What stands in the model before all of these names.
        prefixes = [name.removesuffix(names[0]) for name in known if names and name.endswith(names[0])]
        others = [repr(other) for other in prefixes if {other + name for name in names} <= set(known)]
        if others:
            cure = f"in this model these joints begin with {' or '.join(others)}: give one of these as prefix"
            raise ArgumentError("prefix", prefix, cure)
    places = (mujoco_joints if compiled else pinocchio_joints)(model, wanted)
    for name, ours, theirs in zip(wanted, hinges, places.hinges, strict=True):
        if ours != theirs:
            kind, other = ("a hinge", "a slide") if ours else ("a slide", "a hinge")
            raise ArgumentError(
                f"joint {name!r} of the model", other, f"the robot's is {kind}: name another by joints="
            )
    if len(set(places.places.tolist())) < len(names):
        raise ArgumentError("joints", list(wanted), "name each joint once")
    return places


def _is_compiled(model: Any) -> bool:
    """Whether it is a `mujoco.MjModel`."""
    return hasattr(model, "jnt_qposadr") and hasattr(model, "joint")


def _mujoco_names(model: Any) -> list[str]:
    """The names of all joints; one without a name is called by its number, as `from_mjcf` does."""
    return [model.joint(i).name or f"joint {i}" for i in range(model.njnt)]


def _taken_from(places: ModelJoints, given: ArrayLike, names: Sequence[str], near: ArrayLike = 0.0) -> Array:
    """Joints (..., n) in the numbers (..., nq) of a model. Raises: ShapeError, NotFiniteError, ArgumentError."""
    array = numbers(places.what, given)
    if array.shape[-1:] != (places.length,):
        raise ShapeError(places.what, ("...", places.length), array.shape, _WHOLE)
    values = places.read(array, numbers("near", near))
    if not np.isfinite(values).all():
        bad = [
            name
            for name, row in zip(names, values.reshape(-1, len(names)).T, strict=True)
            if not np.isfinite(row).all()
        ]
        raise NotFiniteError(places.what, f"at {', '.join(bad)}")
    return values


def _put_into(places: ModelJoints, array: Array, q: ArrayLike) -> Array:
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


@dataclass(frozen=True, eq=False)
class Robot(ByValue):
    """A kinematic tree with n independent coordinates. Joints stand in topological order.

    The first tip is the one that `pose`, `jacobian` and tasks use when none is named. `shapes` are what may be touched,
    `visuals` what its links look like. Robots are equal, and one key, when all this is; `source` does not count.
    """

    _aside = ("source",)

    name: str
    coordinates: tuple[Coordinate, ...]
    joints: tuple[Joint, ...]
    tips: tuple[Tip, ...]
    source: str = ""
    bodies: tuple[Body, ...] = ()
    shapes: tuple[LinkShape, ...] = ()
    visuals: tuple[Visual, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.coordinates:
            raise ArgumentError(f"the number of moving joints of {self.name!r}", 0, "choose a tip behind a joint")
        if len(self.joints) > MOST_MOVING:
            cure = f"give at most {MOST_MOVING:,}, or choose base= and tip= nearer to each other"
            raise ArgumentError(f"the number of moving joints of {self.name!r}", len(self.joints), cure)
        for joint in self.joints:
            sizes = np.abs([*joint.placement[:3, 3], joint.multiplier, joint.offset])
            if not sizes.max() <= FARTHEST:  # NaN included
                cure = f"keep lengths, angles and gear ratios within {FARTHEST:g} m or rad"
                raise ArgumentError(f"the placement or gear of joint {joint.name!r}", sizes.max(), cure)
        for tip in self.tips:
            if not np.abs(tip.placement[:3, 3]).max() <= FARTHEST:
                raise ArgumentError(f"the place of tip {tip.name!r}", tip.placement[:3, 3].tolist(), "bring it nearer")
        for name in self.joint_names:
            if self.joint_names.count(name) > 1:
                raise ArgumentError(f"the name of two joints of {self.name!r}", name, "give each a name of its own")
            if not name.isprintable():
                raise ArgumentError(f"the name of a joint of {self.name!r}", name, "leave out its control characters")

    def __repr__(self) -> str:
        tip = f", tip={self.tip!r}" if self.tips else ""
        return f"Robot({self.name!r}, n={self.n}{tip})"

    def _shown_rows(self) -> list[Sequence[str]]:
        return [("name", self.name), *joint_rows(self.coordinates), ("tips", ", ".join(tip.name for tip in self.tips))]

    @property
    def n(self) -> int:
        """Number of independent joint coordinates."""
        return len(self.coordinates)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the coordinates, in the order of q."""
        return tuple(c.name for c in self.coordinates)

    @cached_property
    def lower(self) -> Vector:
        """Lower joint limits (n,) [m or rad]."""
        return frozen([c.lower for c in self.coordinates])

    @cached_property
    def upper(self) -> Vector:
        """Upper joint limits (n,) [m or rad]."""
        return frozen([c.upper for c in self.coordinates])

    @cached_property
    def max_velocity(self) -> Vector:
        """Joint speed limits (n,) [m/s or rad/s]."""
        return frozen([c.max_velocity for c in self.coordinates])

    @cached_property
    def hinges(self) -> Flags:
        """Which coordinates are angles (n,)."""
        return frozen(np.array([c.unit == "rad" for c in self.coordinates]))

    @cached_property
    def planar(self) -> bool:
        """True when the tool stays in a plane z = const: sliders in it, hinges normal to it."""
        z = np.array([0.0, 0.0, 1.0])
        rotations: list[Matrix] = []
        for joint in self.joints:
            before = rotations[joint.parent] if joint.parent >= 0 else np.eye(3)
            rotations.append(before @ joint.placement[:3, :3])
            along = abs(float((rotations[-1] @ joint.axis) @ z))
            if abs(along - (0.0 if joint.kind == "prismatic" else 1.0)) > 1e-12:
                return False
        return bool(self.joints)

    @typed
    def joint_index(self, joint: str | int) -> int:
        """Index in q, from 0, of a joint by its name, or by its index (-1 is the last). Raises: UnknownNameError."""
        names = self.joint_names
        if isinstance(joint, str):
            if joint not in names:
                raise UnknownNameError("joint", joint, names)
            return names.index(joint)
        if not -self.n <= joint < self.n:
            raise UnknownNameError("index of a joint", shown(joint), [f"{i} ({name})" for i, name in enumerate(names)])
        return int(joint) % self.n

    @typed
    def kinematics(self, q: SX, tip: str | None = None) -> Kinematics:
        """Expressions of a tip's pose and geometric Jacobian (columns: v = a x (p - o), w = a, or v = a)."""
        chosen = self._find_tip(tip)
        return self._kinematics_at(q, chosen.joint, chosen.placement)

    @typed
    def _kinematics_at(self, q: SX, joint: int, placement: Matrix) -> Kinematics:
        """The same for any frame (4, 4) on a joint's moving side. Raises: ShapeError, NotFiniteError, ArgumentError."""
        check_length("q", q, self.n)
        p, R, J, origins = _frame_function(
            self, joint, tuple(finite("a placement", placement, (4, 4)).ravel().tolist())
        )(q)
        return Kinematics(p, R, J, dict(zip((joint.name for joint in self.joints), horzsplit(origins), strict=True)))

    @typed
    def origins(self, q: SX) -> dict[str, SX]:
        """The origin (3,) of every joint's frame, by the joint's name, as expressions."""
        return {joint.name: origin for joint, (origin, _) in zip(self.joints, self._frames(q), strict=True)}

    @typed
    def _joint_columns(self, q: SX, tip: str | None = None) -> list[tuple[int, float, SX, SX]]:
        """(coordinate, multiplier, v (3,), w (3,)) of each joint from the base to a tip: what it does to the tool."""
        chosen, frames = self._find_tip(tip), self._frames(q)
        return self._columns(frames, chosen.joint, _compose(frames, chosen.joint, chosen.placement)[0])

    def _columns(self, frames: Any, joint: int, p: SX) -> list[tuple[int, float, SX, SX]]:
        columns = []
        for above in joints_above(self.joints, joint):
            moving, (origin, rotation) = self.joints[above], frames[above]
            axis = rotation @ SX(moving.axis)
            v, w = (axis, SX.zeros(3, 1)) if moving.kind == "prismatic" else (cross(axis, p - origin), axis)
            columns.append((moving.coordinate, moving.multiplier, v, w))
        return columns[::-1]

    def pose(self, q: ArrayLike, tip: str | None = None) -> Matrix:
        """Pose (4, 4) of a tip in the base frame at q (n,); at many postures (k, n) -> (k, 4, 4), as `ik.batch` takes.

        Raises: ShapeError, NotFiniteError: q is not n finite numbers. UnknownNameError: no such tip. ArgumentError.
        """
        return self._evaluator(self._poses, tip).call(q)

    @typed
    def pose_batch(self, Q: Matrix, tip: str | None = None) -> tuple[Matrix, Array]:
        """Positions (k, 3) and rotations (k, 3, 3) of a tip at postures (k, n).

        Raises:
            UnknownNameError, ShapeError, ArgumentError.
        """
        position, rotation = self._numeric(tip).batch(self.postures(Q))
        return position.reshape(-1, 3), rotation.reshape(-1, 3, 3)

    def jacobian(self, q: ArrayLike, tip: str | None = None) -> Matrix:
        """Geometric Jacobian (6, n) of a tip, or (k, 6, n): rows v then w, in the base frame [m or 1 per joint unit].

        Raises: ShapeError, NotFiniteError: q is not n finite numbers. UnknownNameError: no such tip. ArgumentError.
        """
        return self._evaluator(self._jacobians, tip).call(q)

    def skeleton(self, q: ArrayLike) -> list[Matrix]:
        """Points to draw: for each tip the polyline (k, 3) from where the robot stands through the joints to it."""
        if not self.tips:
            return []
        origins, lines = self._skeleton(self.checked(q)).reshape(-1, 3), []
        for tip in self.tips:
            above = joints_above(self.joints, tip.joint)[::-1]
            start = self.joints[above[0]].start if above else np.zeros(3)
            lines.append(np.array([start, *origins[above], self.pose(q, tip.name)[:3, 3]]))
        return lines

    def checked(self, q: ArrayLike, what: str = "q") -> Vector:
        """q as (n,) finite floats; values by the joints' names, as of a dict or a row of pandas, in the robot's order.

        Raises: ShapeError, NotFiniteError, ArgumentError if they are not numbers, or a joint is missing.
        """
        array = numbers(what, q, self.joint_names)
        if array.shape != (self.n,):
            many = "; many by their names are put in order by robot.postures(Q)" * (array.ndim == 2)
            raise ShapeError(what, (self.n,), array.shape, f"the joints are {', '.join(self.joint_names)}{many}")
        if not (isfinite(sum(array.tolist())) or np.isfinite(array).all()):
            bad = [f"{name} {v}" for name, v in zip(self.joint_names, array, strict=True) if not isfinite(v)]
            raise NotFiniteError(what, ", ".join(bad))
        return array

    def postures(self, Q: ArrayLike) -> Matrix:
        """Postures as (k, n) floats, also of columns by the joints' names. Raises: ShapeError; ArgumentError."""
        array = numbers("the postures", Q, self.joint_names)
        if array.ndim != 2 or array.shape[1] != self.n:
            raise ShapeError("a batch of postures", ("k", self.n), array.shape)
        return array

    def beyond(self, q: ArrayLike) -> Array:
        """How far joints are beyond their limits, max(lower - q, q - upper) (..., n). Raises: ShapeError."""
        array = numbers("q", q, self.joint_names)
        if array.shape[-1:] != (self.n,):
            raise ShapeError("q", (self.n,), array.shape, f"the joints are {', '.join(self.joint_names)}")
        return np.maximum(self.lower - array, array - self.upper)

    def ranges(self, free: float | Vector) -> tuple[Vector, Vector]:
        """The joint limits (n,); a joint without them has `free` [joint units] on either side of zero, one with a
        single limit 2 `free` from there. Raises: ArgumentError, ShapeError, NotFiniteError."""
        free = finite("free", one_or_each("free", free, self.n))
        lower = np.where(np.isfinite(self.lower), self.lower, np.minimum(-free, self.upper - 2 * free))
        upper = np.where(np.isfinite(self.upper), self.upper, np.maximum(free, self.lower + 2 * free))
        return lower, upper

    @cached_property
    def middle(self) -> Vector:
        """The middle of each joint's range (n,) [joint units]; 0 of a joint without both limits."""
        with np.errstate(invalid="ignore"):
            return frozen(np.where(np.isfinite(self.lower + self.upper), 0.5 * (self.lower + self.upper), 0.0))

    def within(self, q: ArrayLike) -> Flags:
        """Whether postures (..., n) have every joint within its limits (...,). Raises: ShapeError."""
        return np.asarray((self.beyond(q) <= 0).all(axis=-1))

    def check_limits(self, q: ArrayLike, cure: str = "") -> None:
        """Raises: JointLimitError naming the joint that is farthest outside its limits, and a cure of the caller's."""
        array = self.checked(q)
        past = self.beyond(array)
        i = int(np.argmax(past))
        if past[i] > TOLERANCES.limit:
            facts = float(array[i]), float(self.lower[i]), float(self.upper[i])
            rad = "give angles in rad, as np.radians(...) makes them of degrees, or take whole turns off"
            unit = self.coordinates[i].unit
            raise JointLimitError(self.joint_names[i], *facts, unit, cure=rad if past[i] > WOUND else cure)

    @typed
    def q_of(
        self,
        model: Any,
        configuration: ArrayLike,
        *,
        prefix: str = "",
        joints: Sequence[str] | None = None,
        near: ArrayLike = 0.0,
    ) -> Array:
        """The joints q (..., n) in configurations (..., nq) of a MuJoCo or Pinocchio model, found by their names.

        The model may have other joints, as fingers and free joints, and more arms, and its joints in another order.

        Args:
            model: a `mujoco.MjModel` or `pinocchio.Model`.
            configuration: `data.qpos`, or the q of Pinocchio.
            prefix: what stands before the robot's joint names in the model, as "left/".
            joints: the model's names (n,) of the joints, in the robot's order, where they differ by more.
            near: of joints that Pinocchio keeps as cosine and sine, the turn is taken that is nearest to these.

        Raises:
            UnknownNameError, ArgumentError: the model lacks a joint, or it is another kind of joint there.
            ShapeError, NotFiniteError: the configuration.
        """
        places = self._places(model, prefix, joints)
        return _taken_from(places, configuration, self.joint_names, near)

    @typed
    def put(
        self, model: Any, configuration: Array, q: ArrayLike, *, prefix: str = "", joints: Sequence[str] | None = None
    ) -> Array:
        """Writes joints q (..., n) into configurations (..., nq), in place, and returns these: the other way of `q_of`.

        All other joints stay as they are, those that follow others too. Raises: as `q_of`.
        """
        return _put_into(self._places(model, prefix, joints), configuration, q)

    @typed
    def rates_of(
        self, model: Any, velocity: ArrayLike, *, prefix: str = "", joints: Sequence[str] | None = None
    ) -> Array:
        """The joint rates (..., n) in velocities (..., nv) of a model, as `data.qvel`. Raises: as `q_of`."""
        return _taken_from(self._places(model, prefix, joints).moving, velocity, self.joint_names)

    @typed
    def put_rates(
        self, model: Any, velocity: Array, rates: ArrayLike, *, prefix: str = "", joints: Sequence[str] | None = None
    ) -> Array:
        """Writes joint rates (..., n) into velocities (..., nv), in place, and returns these. Raises: as `q_of`."""
        return _put_into(self._places(model, prefix, joints).moving, velocity, rates)

    def _places(self, model: Any, prefix: str, joints: Sequence[str] | None) -> ModelJoints:
        return places_in(model, self.joint_names, self.hinges, prefix, joints)

    def _check_links(self) -> None:
        """Raises: ArgumentError: these are `coordinates`, without links."""
        if not self.tips:
            raise ArgumentError("the robot", self, "it has coordinates and no links: give their task by hk.custom_task")

    @property
    def tip(self) -> str | None:
        """Name of the tool, of several the first; None of `coordinates`, which have none."""
        return self.tips[0].name if self.tips else None

    @typed
    def _find_tip(self, name: str | None = None) -> Tip:
        """A tip by name, by default the first. Raises: UnknownNameError, ArgumentError: these are `coordinates`."""
        self._check_links()
        for tip in self.tips:
            if name in (None, tip.name):
                return tip
        raise UnknownNameError("tip", str(name), [tip.name for tip in self.tips])

    def _frames(self, q: SX) -> list[tuple[SX, SX]]:
        """(origin, rotation) of every joint's moving frame, in the base frame. Raises: ShapeError."""
        check_length("q", q, self.n)
        frames: list[tuple[SX, SX]] = []
        for joint in self.joints:
            p, R = _compose(frames, joint.parent, joint.placement)
            value = joint.multiplier * q[joint.coordinate] + joint.offset
            if joint.kind == "prismatic":
                p = p + R @ SX(joint.axis) * value
            else:
                R = R @ rotation_about(joint.axis, value)
            frames.append((p, R))
        return frames

    @cached_property
    def _functions(self) -> dict[str, Function]:
        return {}

    def _numeric(self, tip: str | None) -> Function:
        name = self._find_tip(tip).name
        if name not in self._functions:
            q = symbol("q", self.n)
            k = self.kinematics(q, name)
            self._functions[name] = Function("kinematics", {"q": q}, {"p": k.position, "R": k.rotation})
        return self._functions[name]

    @cached_property
    def _poses(self) -> dict[str | None, Evaluator]:
        return {}

    @cached_property
    def _jacobians(self) -> dict[str | None, Evaluator]:
        return {}

    def _evaluator(self, known: dict[str | None, Evaluator], tip: str | None) -> Evaluator:
        """That of poses or of Jacobians of a tip. Raises: ArgumentError, UnknownNameError."""
        try:
            return known[tip]
        except (KeyError, TypeError):  # a new one, or no name at all
            check("tip", str | None, tip)
        name = self._find_tip(tip).name
        if name not in known:
            q = symbol("q", self.n)
            k = self.kinematics(q, name)
            if known is self._poses:
                T = vertcat(horzcat(k.rotation, k.position), SX([[0, 0, 0, 1]]))
                function, shape = Function("pose", {"q": q}, {"T": T}), (4, 4)
            else:
                function, shape = Function("jacobian", {"q": q}, {"J": k.jacobian}), (6, self.n)
            known[name] = function.checked(shape, self.checked, self._doubtful)
        return known.setdefault(tip, known[name])

    def _doubtful(self, q: Vector, result: Matrix) -> Matrix:
        """What was found at q, unless q is not finite."""
        self.checked(q)
        return result

    @cached_property
    def _skeleton(self) -> Function:
        q = symbol("q", self.n)
        return Function("skeleton", {"q": q}, {"origins": vertcat(*(p for p, _ in self._frames(q)))})


def start_posture(robot: Robot, q: ArrayLike, limits: bool, what: str = "the start posture") -> Vector:
    """q as (n,) finite floats: a posture to begin from, which keeps the joint limits unless `limits` is False.

    Raises:
        ShapeError, NotFiniteError, ArgumentError: as `Robot.checked`. JointLimitError: with limits, a joint is beyond
        them; without, more than two turns beyond them, as degrees are.
    """
    start = robot.checked(q, what)
    if limits or robot.beyond(start).max() > WOUND:
        cure = "choose another start posture, widen the limits by hk.with_limits, or ask with limits=False"
        robot.check_limits(start, cure)
    return start


@kept
def _frame_function(robot: Robot, joint: int, placement: tuple[float, ...]) -> Callable[[SX], tuple[SX, SX, SX, SX]]:
    """q -> (p, R, J, origins (3, joints)) of a frame on a joint: many tasks of a robot are written of the same."""
    q, J = symbol("q", robot.n), SX.zeros(6, robot.n)
    frames = robot._frames(q)
    p, R = _compose(frames, joint, np.reshape(placement, (4, 4)))
    for coordinate, gain, v, w in robot._columns(frames, joint, p):
        J[:, coordinate] = J[:, coordinate] + gain * vertcat(v, w)
    return as_map([q], p, R, densify(J), horzcat(*(origin for origin, _ in frames)))


def _compose(frames: Sequence[tuple[SX, SX]], parent: int, placement: Matrix) -> tuple[SX, SX]:
    if parent < 0:
        return SX(placement[:3, 3]), SX(placement[:3, :3])
    p, R = frames[parent]
    return p + R @ SX(placement[:3, 3]), R @ SX(placement[:3, :3])


def hessian_expression(robot: Robot, q: SX, tip: str | None = None) -> list[SX]:
    """H_i (n, n) for the six rows i of the geometric Jacobian, H_i[a, b] = d J_ia / d q_b [m or 1 per joint unit^2].

    A joint b at or before a turns a's column, w_b x (v_a, w_a); one behind it moves the tool's point, w_a x v_b.
    """
    moving = robot._joint_columns(q, tip)
    out = [SX.zeros(robot.n, robot.n) for _ in range(6)]
    for i, (a, gain_a, v_a, w_a) in enumerate(moving):
        for j, (b, gain_b, v_b, w_b) in enumerate(moving):
            linear, angular = (cross(w_b, v_a), cross(w_b, w_a)) if j <= i else (cross(w_a, v_b), SX.zeros(3, 1))
            column = gain_a * gain_b * vertcat(linear, angular)
            for row in range(6):
                out[row][a, b] = out[row][a, b] + column[row]
    return out
