"""Inverse kinematics of a batch of tool poses with its exact derivatives, in NumPy: what torch and JAX call.

The tools move with the twist t = (v, w) (6F,), the velocities (3F,) of all frames and then their angular velocities.
The joints then move by

    dq = D t,  D = G(q) E(R) (n, 6F),

with the strategy G and the rates E of the task's rows. `slopes` has the derivatives of D, for second derivatives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import ArgumentError, ShapeError
from ..base.types import ROTATION, Array, Indices, Matrix, Value, Vector, rotation_gap
from ..motion.ik import InverseKinematics
from ..strategies.tasks.task import Task
from ..symbolic import SX, Function, horzcat, jacobian, symbol, vec, vertcat
from ..symbolic.rotations import skew

# Poses from which native code is worth its compiler, which takes a second once: a policy is trained in many steps.
NATIVE_FROM = 64

NATIVE_SLOPES_FROM = 2_000  # the same for second derivatives, whose code is ten times as long


@dataclass(frozen=True, eq=False)
class JointMap(Value):
    """q(pose) of `hk.ik`, over batches, with its derivatives. Rows that were not reached have NaN and zeros."""

    ik: InverseKinematics

    @property
    def task(self) -> Task:
        """Of the strategy."""
        return self.ik.strategy.task

    @property
    def start(self) -> tuple[Vector, Array]:
        """Positions (3F,) and rotations (F, 3, 3) of the tools at the start."""
        p, R = self.task._place(self.ik.q0)
        return p, R.reshape(-1, 3, 3)

    @property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """The shapes of one pose: a pose, positions, fewer positions."""
        frames = self.task.frames
        return ((4, 4), (3,), (2,)) if frames == 1 else ((frames, 4, 4), (frames, 3), (self.task._point,))

    def solve(self, given: Array, R: Array) -> tuple[Matrix, Indices]:
        """Joints (k, n), NaN where a pose is not reached, and an `InverseStatus` (k,) for each.

        Args:
            given: poses or positions, as `ik.batch` takes them.
            R: of poses, the rotations (k, F, 3, 3) nearest to theirs. They take the place of those that are rotations
                up to rounding; what is none keeps its status.
        """
        poses = np.array(given, dtype=float)
        if poses.shape[-2:] == (4, 4):
            turned = poses[..., :3, :3]
            rounded = rotation_gap(turned) < ROTATION
            turned[...] = np.where(rounded[..., None, None], R.reshape(turned.shape), turned)
        solutions = self.ik.batch(poses)
        return solutions.q, solutions.status

    def gain(self, q: Matrix, R: Array) -> Array:
        """D = G(q) E(R) (k, n, 6F) at joints (k, n) and rotations (k, F, 3, 3); zeros where q is not finite."""
        sound = np.isfinite(q).all(axis=1)
        D = np.zeros((len(q), self.task.n, 6 * self.task.frames))
        if sound.any():
            D[sound] = self._G(q[sound]) @ self._E(R[sound])
        return D

    def slopes(self, q: Matrix, R: Array) -> tuple[Array, Array]:
        """The derivatives of D by the joints (k, n, 6F, n) and by turns of the rotations (k, n, 6F, 3F).

        A turn w (3F,) is the angular velocity of R' = w x R, frame by frame.
        """
        n, frames = self.task.n, self.task.frames
        sound = np.isfinite(q).all(axis=1)
        by_joints, by_turns = np.zeros((len(q), n, 6 * frames, n)), np.zeros((len(q), n, 6 * frames, 3 * frames))
        if sound.any():
            k, m = int(sound.sum()), self.task.m
            rotations = _stacked(R[sound])
            dG = self._gain_slopes.batch(q[sound], native_from=NATIVE_SLOPES_FROM)
            dE = self._rate_slopes.batch(rotations, native_from=NATIVE_SLOPES_FROM)
            by_joints[sound] = np.einsum("kijm,kmt->kitj", dG.reshape(k, n, n, m), self._E(R[sound]))
            dE = dE.reshape(k, 6 * frames, m, 3 * frames)
            by_turns[sound] = np.einsum("kim,ktmw->kitw", self._G(q[sound]), dE)
        return by_joints, by_turns

    def _G(self, q: Matrix) -> Array:
        G, _, _ = self.ik.strategy.gain.batch(q, native_from=NATIVE_FROM)
        return G.reshape(len(q), self.task.n, self.task.m)

    def _E(self, R: Array) -> Array:
        E = self._rates.batch(_stacked(R), native_from=NATIVE_FROM)
        return E.reshape(len(R), self.task.m, 6 * self.task.frames)

    @cached_property
    def _rates(self) -> Function:
        R, E = _rates_of(self.task)
        return Function("pose_rates", {"R": R}, {"E": E})

    @cached_property
    def _rate_slopes(self) -> Function:
        """R -> dE / dw (6F m, 3F), the rows of the columns of E one below the other."""
        R, E = _rates_of(self.task)
        turn = symbol("turn", 3 * self.task.frames)
        turned = vertcat(*(skew(turn[i : i + 3]) @ R[i : i + 3, :] for i in range(0, 3 * self.task.frames, 3)))
        slopes = jacobian(vec(E), vec(R)) @ jacobian(vec(turned), turn)
        return Function("pose_rate_slopes", {"R": R}, {"dE": slopes})

    @cached_property
    def _gain_slopes(self) -> Function:
        # q -> dG / dq_j (n, n m), side by side: with M = [J; J_g], dG = -M^-1 (dM) G, so no factorisation is derived.
        strategy = self.ik.strategy
        e, m = strategy.expressions, strategy.task.m
        G = e.rate(SX.eye(m), written_out=True).X
        joints = range(strategy.task.n)
        tool, rule = (horzcat(*(_slope(M, e.q[j]) @ G for j in joints)) for M in (e.J, e.planes))
        solution = e.rate(tool, rule, written_out=True)
        return Function("gain_slopes", {"q": e.q}, {"dG": -solution.X})


def _slope(M: SX, variable: SX) -> SX:
    return jacobian(vec(M), variable).reshape(M.shape)


def _rates_of(task: Task) -> tuple[SX, SX]:
    """(R (3F, 3), E (m, 6F)): the rates of the task's rows by the twist of the tools."""
    _, R = task._target_symbols()
    v, w = symbol("v", 3 * task.frames), symbol("w", 3 * task.frames)
    return R, jacobian(task._rates_expression(R, v, w), vertcat(v, w))


def _stacked(R: Array) -> Array:
    """Rotations (k, F, 3, 3) one below the other (k, 3F, 3)."""
    return np.ascontiguousarray(R.reshape(len(R), -1, 3))


# --- Tool poses as tensors of torch or JAX: positions and rotations of all frames, and the twist with which they move.
#
# The library is an argument `xp`: of torch and of `jax.numpy` the functions used here have one signature. Leading axes,
# any number, are those of a batch.

ORDERS = {"wxyz": (0, 1, 2, 3), "xyzw": (1, 2, 3, 0)}  # which of w, x, y, z each number of a quaternion is


class JointTensors(NamedTuple):
    """What inverse kinematics of a batch found: `q` (..., n), `status` (...), an `InverseStatus` as a number.

    q is NaN, and its derivative zero, where the status is not REACHED, which is 0.
    """

    q: Any
    status: Any


def _levi_civita() -> Array:
    e = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        e[i, j, k], e[i, k, j] = 1.0, -1.0
    return e


def _quaternion_form() -> Array:
    """C (3, 3, 4, 4) with R_ij = C_ijab q_a q_b of a unit quaternion q = (w, x, y, z)."""
    C = np.zeros((3, 3, 4, 4))
    C[:, :, 0, 0] = np.eye(3)  # (w^2 - v.v) 1 + 2 v v^T + 2 w [v]x
    for k in range(3):
        C[:, :, k + 1, k + 1] -= np.eye(3)
        C[:, :, 0, k + 1] = -2 * _levi_civita()[:, :, k]
        for i in range(3):
            C[i, k, i + 1, k + 1] += 2.0
    return C


# w_k = TURN_kij (dR R^T)_ij: the angular velocity of the part of dR that keeps R a rotation.
TURN = -0.5 * _levi_civita()

QUATERNION = _quaternion_form()


def _nearest_rotations(R: Any) -> Any:
    """The rotations nearest to matrices (..., 3, 3) that are rotations up to rounding, with their derivatives.

    Two Newton-Schulz steps R (3 - R^T R) / 2 towards the polar factor [Hig08]: from a gap s they leave s^4, so that
    at a rotation the first two derivatives are those of the nearest rotation.
    """
    for _ in range(2):
        R = 1.5 * R - 0.5 * _product(R, _product(R.mT, R))
    return R


def _product(A: Any, B: Any) -> Any:
    """A B (..., 3, 3), elementwise: the libraries' own products of many small matrices take 20 times longer."""
    return (A[..., :, :, None] * B[..., None, :, :]).sum(-2)


def angular_velocity(xp: Any, turn: Any, R: Any, dR: Any) -> Any:
    """w (..., 3) of the part of dR (..., 3, 3) that keeps R a rotation."""
    return xp.einsum("kij,...il,...jl->...k", turn, dR, R)


def rotation_gradient(xp: Any, turn: Any, R: Any, w: Any) -> Any:
    """The transpose of `angular_velocity`: w (..., 3) -> (..., 3, 3)."""
    return xp.einsum("kij,...k,...jl->...il", turn, w, R)


def third_derivative() -> ArgumentError:
    """What is said of derivatives that are not computed."""
    return ArgumentError("the derivative of inverse kinematics", "a third one", "ask for first and second derivatives")


class GivenTensors(NamedTuple):
    """Batches as they are given: `given` as `ik.batch` takes it, positions (..., 3F), rotations (..., F, 3, 3)."""

    given: Any
    p: Any
    R: Any


def read_tensors(
    xp: Any, joints: JointMap, tensor: Callable[[Array], Any], poses: Any, turns: Any, order: Any
) -> GivenTensors:
    """Positions and rotations of poses, of positions alone, or of positions and quaternions `turns`.

    Args:
        xp: the library. tensor: makes its tensor of an array.

    Raises:
        ShapeError; ArgumentError: quaternions without their order.
    """
    frames, (start_p, start_R) = joints.task.frames, joints.start
    axes = _leading_axes(tuple(poses.shape), joints.shapes)
    lead, shape = tuple(poses.shape[:axes]), tuple(poses.shape[axes:])
    if turns is not None:
        wanted = (*poses.shape[:-1], 4)
        if shape[-1] != 3 or tuple(turns.shape) != wanted:
            raise ShapeError("the quaternions", f"{wanted}, with positions (..., 3)", tuple(turns.shape))
        if not isinstance(order, str) or order not in ORDERS:
            cure = f"say how the quaternions are written: {' or '.join(map(repr, ORDERS))}"
            raise ArgumentError("order", order, cure)
        # Rotations (..., 3, 3) of quaternions (..., 4) of any length, by the form of their order.
        form = QUATERNION[:, :, ORDERS[order]][:, :, :, ORDERS[order]]
        square = (turns * turns).sum(-1)[..., None, None]
        R = xp.einsum("ijab,...a,...b->...ij", tensor(form), turns, turns) / square
        last = xp.broadcast_to(tensor(np.array([[0.0, 0.0, 0.0, 1.0]])), (*poses.shape[:-1], 1, 4))
        given = xp.concatenate([xp.concatenate([R, poses[..., None]], -1), last], -2)
        return GivenTensors(given, poses.reshape(*lead, 3 * frames), R.reshape(*lead, frames, 3, 3))
    if shape[-2:] == (4, 4):
        p = poses[..., :3, 3].reshape(*lead, 3 * frames)
        return GivenTensors(poses, p, _nearest_rotations(poses[..., :3, :3].reshape(*lead, frames, 3, 3)))
    size = int(np.prod(shape))
    rest = xp.broadcast_to(tensor(start_p[size:]), (*lead, 3 * frames - size))
    p = xp.concatenate([poses.reshape(*lead, size), rest], -1)
    return GivenTensors(poses, p, xp.broadcast_to(tensor(start_R), (*lead, frames, 3, 3)))


def _leading_axes(shape: tuple[int, ...], known: tuple[tuple[int, ...], ...]) -> int:
    """How many axes of a shape are of the batch: those before the first known shape that fits. Raises: ShapeError."""
    for inner in known:
        axes = len(shape) - len(inner)
        if axes >= 0 and shape[axes:] == inner:
            return axes
    words = " or ".join(f"(..., {', '.join(map(str, inner))})" for inner in known)
    raise ShapeError("the tool poses", words, shape)
