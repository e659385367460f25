"""The rules of JAX's derivatives for inverse kinematics. Imports JAX: only `jax.inverse` of this room loads it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax  # pyright: ignore[reportMissingImports]
import jax.numpy as jnp  # pyright: ignore[reportMissingImports]
import numpy as np

from ..base.types import Array
from .joint_map import TURN, JointMap, angular_velocity, third_derivative


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def solve(joints: JointMap, given: Any, p: Any, R: Any) -> tuple[Any, Any]:
    """(q (..., n), status (...)) of positions (..., 3F) and rotations (..., F, 3, 3), by `ik.batch`."""
    lead, n = p.shape[:-1], joints.task.n
    axes = given.ndim - len(lead)

    def solve_on_host(given: Array, R: Array) -> tuple[Any, Any]:
        q, status = joints.solve(*_rows((given, axes), (R, 3)))
        return q, status.astype(np.int32)

    shapes = (jax.ShapeDtypeStruct((*lead, n), p.dtype), jax.ShapeDtypeStruct(lead, np.int32))
    return _on_host(solve_on_host, shapes, given, R)


@solve.defjvp
def _(joints: JointMap, primals: tuple[Any, ...], tangents: tuple[Any, ...]) -> tuple[Any, Any]:
    """dq = D t."""
    _, p, R = primals
    _, dp, dR = tangents
    q, status = solve(joints, *primals)
    w = angular_velocity(jnp, jnp.asarray(TURN, R.dtype), R, dR).reshape(p.shape)
    moved = jnp.einsum("...nt,...t->...n", gain(joints, q, R), jnp.concatenate([dp, w], -1))
    return (q, status), (moved, np.zeros(status.shape, jax.dtypes.float0))


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def gain(joints: JointMap, q: Any, R: Any) -> Any:
    """D (..., n, 6F), by `JointMap.gain`."""
    shape = jax.ShapeDtypeStruct((*q.shape, 6 * R.shape[-3]), q.dtype)
    return _on_host(lambda q, R: (joints.gain(*_rows((q, 1), (R, 3))),), (shape,), q, R)[0]


@gain.defjvp
def _(joints: JointMap, primals: tuple[Any, ...], tangents: tuple[Any, ...]) -> tuple[Any, Any]:
    """By `JointMap.slopes`."""
    (q, R), (dq, dR) = primals, tangents
    by_joints, by_turns = slopes(joints, q, R)
    w = angular_velocity(jnp, jnp.asarray(TURN, R.dtype), R, dR).reshape(*q.shape[:-1], 3 * R.shape[-3])
    moved = jnp.einsum("...ntj,...j->...nt", by_joints, dq) + jnp.einsum("...ntw,...w->...nt", by_turns, w)
    return gain(joints, q, R), moved


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def slopes(joints: JointMap, q: Any, R: Any) -> tuple[Any, Any]:
    """The derivatives of D by the joints and by turns, by `JointMap.slopes`."""
    D = (*q.shape, 6 * R.shape[-3])
    shapes = tuple(jax.ShapeDtypeStruct((*D, by), q.dtype) for by in (q.shape[-1], 3 * R.shape[-3]))
    return _on_host(lambda q, R: joints.slopes(*_rows((q, 1), (R, 3))), shapes, q, R)


@slopes.defjvp
def _(joints: JointMap, primals: tuple[Any, ...], tangents: tuple[Any, ...]) -> Any:
    """There are no derivatives of these. Raises: ArgumentError."""
    raise third_derivative()


def _on_host(function: Callable[..., tuple[Array, ...]], shapes: tuple[Any, ...], *tensors: Any) -> Any:
    """A function of arrays with any leading axes, called on the host; `vmap` gives it one more."""

    def host(*given: Any) -> tuple[Array, ...]:
        results = function(*(np.asarray(array, dtype=float) for array in given))
        lead = np.shape(given[-1])[:-3]
        return tuple(
            np.reshape(array, (*lead, *array.shape[1:])).astype(shape.dtype)
            for array, shape in zip(results, shapes, strict=True)
        )

    return jax.pure_callback(host, shapes, *tensors, vmap_method="broadcast_all")


def _rows(*arrays: tuple[Array, int]) -> list[Array]:
    """Arrays with one leading axis in place of all: of each, how many axes are not leading ones."""
    return [np.reshape(array, (-1, *array.shape[array.ndim - axes :])) for array, axes in arrays]
