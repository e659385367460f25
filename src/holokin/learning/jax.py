"""Inverse kinematics as a differentiable function of JAX arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.poses import QuaternionOrder
from ..base.types import Array, Value
from ..motion.control.libraries import extra
from ..motion.ik import InverseKinematics
from .joint_map import JointMap, JointTensors, read_tensors


@dataclass(frozen=True, eq=False)
class JaxInverse(Value):
    """poses -> (q, status), differentiable twice. Make one with `hk.learning.jax.inverse`."""

    ik: InverseKinematics
    _joints: JointMap

    def __call__(self, poses: Any, quaternions: Any = None, *, order: QuaternionOrder | None = None) -> JointTensors:
        """Joints of tool poses, each as `ik.batch` finds it, with exact first and second derivatives.

        It is the function of `hk.learning.torch.inverse`, for JAX: see there what the derivative by the entries of a
        matrix is. Under `jit` and `vmap` it is one call on the host for the whole batch.

        Args:
            poses: (..., 4, 4), or positions (..., 3) or (..., 2), with the orientation of the start unless quaternions
                are given; of a task of F frames (..., F, 4, 4) or (..., F, 3). An array of floats.
            quaternions: (..., 4), or (..., F, 4), of any length but 0, for the positions `poses`.
            order: "wxyz" or "xyzw", how the quaternions are written.

        Returns:
            q (..., n) in the dtype of `poses`, computed in float64 on the processor, and status (...), an
            `InverseStatus` as int32. Where a pose is not reached q is NaN and its derivative zero.

        Raises:
            ArgumentError: what is no array of floats; quaternions without an order; third derivatives. ShapeError.
        """
        extra("jax", "jax", "interop")
        import jax.numpy as jnp  # pyright: ignore[reportMissingImports]
        from jax.lax import stop_gradient  # pyright: ignore[reportMissingImports]

        from .jax_rules import solve

        wanted = _floats(jnp, "the tool poses", poses)
        turns = None if quaternions is None else _floats(jnp, "the quaternions", quaternions).astype(wanted.dtype)

        def tensor(array: Array) -> Any:
            return jnp.asarray(array, wanted.dtype)

        read = read_tensors(jnp, self._joints, tensor, wanted, turns, order)
        return JointTensors(*solve(self._joints, stop_gradient(read.given), read.p, read.R))


@typed
def inverse(ik: InverseKinematics) -> JaxInverse:
    """Inverse kinematics as a function of JAX arrays, with exact first and second derivatives.

    It serves `grad`, `jacfwd`, `jacrev`, `hessian`, `vmap` and `jit`. See `JaxInverse.__call__` for what it takes.

    Args:
        ik: of `hk.ik(strategy, q0)`.

    Raises:
        MissingExtraError: JAX is not installed.
    """
    extra("jax", "jax", "interop")
    return JaxInverse(ik, JointMap(ik))


def _floats(jnp: Any, what: str, array: Any) -> Any:
    """An array of floats. Raises: ArgumentError."""
    if not (hasattr(array, "dtype") and hasattr(array, "shape") and jnp.issubdtype(array.dtype, jnp.floating)):
        cure = "give a JAX array of floats, as by jnp.asarray(poses, dtype=float)"
        raise ArgumentError(what, getattr(array, "dtype", array), cure)
    return jnp.asarray(array)
