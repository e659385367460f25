"""The orientation rows of a task: coordinates of a rotation R, or its angular velocity; three rows, or two of an axis.

Coordinates w(R) have an exact Jacobian dw/dq and a place where they are singular, told by `margin`; the geometric rows
of `twist` have neither.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

from ..base.types import Matrix, Value, Vector
from ..errors import UnknownNameError
from ..symbolic import SX, cos, fmax, if_else, jacobian, norm_2, sin, sumsqr, vec, vertcat, wrapped
from ..symbolic.rotations import frame_about, log_s2, log_so3, rpy_angles, skew, zyz_angles

Angles = Literal["zyz", "rpy", "rotation-vector"]
"""Coordinates of a rotation by three angles."""

Orientation = Literal["twist", "zyz", "rpy", "rotation-vector", "axis"]
"""The kinds of orientation rows."""

ORIENTATIONS: tuple[Orientation, ...] = get_args(Orientation)

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
