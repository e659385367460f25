"""The orientation rows of a task: coordinates of a rotation R, or its angular velocity; three rows, or two of an axis.

Coordinates w(R) have an exact Jacobian dw/dq and a place where they are singular, told by `margin`; the geometric rows
of `twist` have neither.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

from ...base.errors import UnknownNameError
from ...base.types import ArrayLike, Matrix, Value, Vector
from ...symbolic import SX, cos, fmax, if_else, jacobian, norm_2, sin, sumsqr, vec, vertcat, wrapped
from ...symbolic.rotations import (
    exp_so3,
    frame_about,
    log_s2,
    log_so3,
    rotation_about,
    rpy_angles,
    shortest_turn,
    skew,
    zyz_angles,
)

Angles = Literal["zyz", "rpy", "rotation-vector"]
"""Coordinates of a rotation by three angles."""

Orientation = Literal["twist", "zyz", "rpy", "rotation-vector", "axis"]
"""The kinds of orientation rows."""

ORIENTATIONS: tuple[Orientation, ...] = get_args(Orientation)

X, Y, Z = np.eye(3)

UP = (0.0, 0.0, 1.0)
"""The z axis of the tool, which an axis task keeps unless told otherwise."""


@dataclass(frozen=True, eq=False)
class Representation(Value, ABC):
    """Rows (k,) of a rotation R (3, 3): w(R), the error to a wanted rotation, the rates of a turning one."""

    row_names: ClassVar[tuple[str, ...]]
    geometric: ClassVar[bool] = False

    @abstractmethod
    def value(self, R: SX) -> SX:
        """w (k,) [rad]."""

    @abstractmethod
    def margin(self, R: SX) -> SX:
        """How far w is from where it is singular; 1 where it never is."""

    def error(self, wanted: SX, R: SX) -> SX:
        """What w lacks to that of a wanted rotation (k,) [rad]."""
        return wrapped(self.value(wanted) - self.value(R))

    def rates(self, R: SX, angular: SX) -> SX:
        """w' (k,) of a rotation that turns with an angular velocity (3,)."""
        turn = vertcat(*(vec(skew(SX(np.eye(3)[:, i])) @ R).T for i in range(3))).T  # R' = [angular]x R
        return jacobian(self.value(R), R) @ turn @ angular  # (15), (16), (17): x' = T^-1 w

    @abstractmethod
    def rotation(self, w: SX) -> SX:
        """R (3, 3) of coordinates: what `value` undoes."""

    def completed(self, wanted: SX, rows: Sequence[int], here: SX) -> SX:
        """The rotation (3, 3) that has some rows of a wanted one, and all else as it is in `here`.

        Where the rows tell a direction of the tool, or of the base seen by the tool, it is `here` turned to it by the
        smallest angle; else the other coordinates are those of `here`.
        """
        if len(rows) == 3:
            return wanted
        if not rows:
            return here
        direction = self.directions.get(tuple(rows))
        if direction is None:
            return self._mixed(wanted, rows, here)
        fixed, of_base = direction
        if of_base:
            return here @ shortest_turn(wanted.T @ SX(fixed), here.T @ SX(fixed))
        return shortest_turn(here @ SX(fixed), wanted @ SX(fixed)) @ here

    @property
    def directions(self) -> dict[tuple[int, ...], tuple[ArrayLike, bool]]:
        """Rows that tell a direction (3,) and nothing else: one fixed in the tool, or, with True, in the base."""
        return {}

    def _mixed(self, wanted: SX, rows: Sequence[int], here: SX) -> SX:
        """The rotation with some coordinates of a wanted one and the others of `here`."""
        w, there = self.value(here), self.value(wanted)
        for row in rows:
            w[row] = there[row]
        return self.rotation(w)


@dataclass(frozen=True, eq=False)
class Turn(Representation):
    """The angular velocity itself, and log(R_d R^T) for its error; its value shows log(R reference^T)."""

    reference: Matrix
    row_names = ("wx", "wy", "wz")
    geometric = True

    def value(self, R: SX) -> SX:
        """log(R reference^T)."""
        return log_so3(R @ SX(self.reference.T))

    def margin(self, R: SX) -> SX:
        """1: angular velocities are nowhere singular."""
        return SX(1)

    def error(self, wanted: SX, R: SX) -> SX:
        """log(R_d R^T) (3,)."""
        return log_so3(wanted @ R.T)

    def rates(self, R: SX, angular: SX) -> SX:
        """The angular velocity."""
        return angular

    def rotation(self, w: SX) -> SX:
        """exp(w) reference."""
        return exp_so3(w) @ SX(self.reference)

    def _mixed(self, wanted: SX, rows: Sequence[int], here: SX) -> SX:
        """exp of some rows of the error: of the tool of a plane, its turn in the plane."""
        gap, w = self.error(wanted, here), SX.zeros(3)
        for row in rows:
            w[row] = gap[row]
        return exp_so3(w) @ here


@dataclass(frozen=True, eq=False)
class EulerZYZ(Representation):
    """(phi, theta, psi) with R = Rz(phi) Ry(theta) Rz(psi)."""

    row_names = ("phi", "theta", "psi")

    def value(self, R: SX) -> SX:
        """phi, theta, psi."""
        return zyz_angles(R)

    def margin(self, R: SX) -> SX:
        """sin theta."""
        return sin(self.value(R)[1])

    def rotation(self, w: SX) -> SX:
        """Rz(phi) Ry(theta) Rz(psi)."""
        return rotation_about(Z, w[0]) @ rotation_about(Y, w[1]) @ rotation_about(Z, w[2])

    @property
    def directions(self) -> dict[tuple[int, ...], tuple[ArrayLike, bool]]:
        """Without psi the z axis of the tool; without phi that of the base."""
        return {(0, 1): (Z, False), (1, 2): (Z, True)}


@dataclass(frozen=True, eq=False)
class RollPitchYaw(Representation):
    """(roll, pitch, yaw) with R = Rz(yaw) Ry(pitch) Rx(roll)."""

    row_names = ("roll", "pitch", "yaw")

    def value(self, R: SX) -> SX:
        """roll, pitch, yaw."""
        return rpy_angles(R)

    def margin(self, R: SX) -> SX:
        """cos pitch."""
        return cos(self.value(R)[1])

    def rotation(self, w: SX) -> SX:
        """Rz(yaw) Ry(pitch) Rx(roll)."""
        return rotation_about(Z, w[2]) @ rotation_about(Y, w[1]) @ rotation_about(X, w[0])

    @property
    def directions(self) -> dict[tuple[int, ...], tuple[ArrayLike, bool]]:
        """Without roll the x axis of the tool; without yaw the z axis of the base."""
        return {(1, 2): (X, False), (0, 1): (Z, True)}


@dataclass(frozen=True, eq=False)
class RotationVector(Representation):
    """log(R reference^T), axis times angle."""

    reference: Matrix
    row_names = ("rx", "ry", "rz")

    def value(self, R: SX) -> SX:
        """log(R reference^T)."""
        return log_so3(R @ SX(self.reference.T))

    def margin(self, R: SX) -> SX:
        """What the angle has left to pi."""
        return np.pi - norm_2(self.value(R))

    def error(self, wanted: SX, R: SX) -> SX:
        """The difference to the nearer of the two rotation vectors of the wanted rotation."""
        here, there = self.value(R), self.value(wanted)
        angle = norm_2(there)
        other = there * (1 - 2 * np.pi / fmax(angle, 1e-3))  # a turn below 1e-3 rad has no near double
        return if_else(sumsqr(other - here) < sumsqr(there - here), other, there) - here

    def rotation(self, w: SX) -> SX:
        """exp(w) reference."""
        return exp_so3(w) @ SX(self.reference)


@dataclass(frozen=True, eq=False)
class AxisDirection(Representation):
    """(ax, ay): the direction R a is that of the reference, turned by them about lines perpendicular to it.

    Singular at one direction, that against the reference's, as two coordinates of a sphere must be somewhere.
    """

    reference: Matrix
    axis: Vector
    row_names = ("ax", "ay")

    def value(self, R: SX) -> SX:
        """ax, ay."""
        return log_s2(SX((self.reference @ frame_about(self.axis)).T) @ (R @ SX(self.axis)))

    def margin(self, R: SX) -> SX:
        """Half of what the turn has left to pi: coordinates of an even turn bend by up to 4.3 / left^2 of its rate."""
        return (np.pi - norm_2(self.value(R))) / 2

    def error(self, wanted: SX, R: SX) -> SX:
        """The difference."""
        return self.value(wanted) - self.value(R)

    def rotation(self, w: SX) -> SX:
        """That of least angle from the reference; of one row alone `completed` takes its axis."""
        reference = SX(self.reference @ frame_about(self.axis))
        return reference @ exp_so3(vertcat(w, 0)) @ SX(frame_about(self.axis)).T

    @property
    def directions(self) -> dict[tuple[int, ...], tuple[ArrayLike, bool]]:
        """The axis."""
        return {(0, 1): (self.axis, False)}

    def _mixed(self, wanted: SX, rows: Sequence[int], here: SX) -> SX:
        """The direction of one row of the wanted one and of the other one of `here`."""
        return super().completed(super()._mixed(wanted, rows, here), (0, 1), here)


_KINDS: dict[str, Callable[[Matrix, Vector], Representation]] = {
    "twist": lambda reference, _axis: Turn(reference),
    "zyz": lambda _reference, _axis: EulerZYZ(),
    "rpy": lambda _reference, _axis: RollPitchYaw(),
    "rotation-vector": lambda reference, _axis: RotationVector(reference),
    "axis": AxisDirection,
}


def representation(kind: str, reference: Matrix | None = None, axis: Vector | None = None) -> Representation:
    """The representation of a kind: "twist", "zyz", "rpy", "rotation-vector" or "axis". Raises: UnknownNameError.

    Args:
        reference: rotation (3, 3) to count from, the identity by default. axis: unit vector (3,) of the tool.
    """
    if kind not in _KINDS:
        raise UnknownNameError("representation of orientation", kind, ORIENTATIONS)
    return _KINDS[kind](np.eye(3) if reference is None else reference, np.array(UP) if axis is None else axis)


def three_angles(kind: str) -> Representation:
    """One of three coordinates: "zyz", "rpy" or "rotation-vector". Raises: UnknownNameError."""
    if kind not in get_args(Angles):
        raise UnknownNameError("representation of orientation by angles", kind, get_args(Angles))
    return representation(kind)
