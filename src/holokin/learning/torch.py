"""Inverse kinematics as a differentiable function of torch tensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..base.arguments import typed
from ..base.poses import QuaternionOrder
from ..base.types import Value
from ..motion.control.libraries import extra
from ..motion.ik import InverseKinematics
from .joint_map import JointMap, JointTensors


@dataclass(frozen=True, eq=False)
class TorchInverse(Value):
    """poses -> (q, status), differentiable twice. Make one with `hk.learning.torch.inverse`."""

    ik: InverseKinematics
    _joints: JointMap

    def __call__(self, poses: Any, quaternions: Any = None, *, order: QuaternionOrder | None = None) -> JointTensors:
        """Joints of tool poses, each as `ik.batch` finds it, with exact first and second derivatives.

            dq = G(q) E(R) (v, w),  v = p',  w the angular velocity of R

        The function is extended to matrices that are no poses by the nearest rotation, R (R^T R)^(-1/2), and without
        regard to the last row. So the gradient by the entries of R (3, 3) is a tangent of the rotations, and that by
        the last row is zero; finite differences of the entries agree with it.

        Args:
            poses: (..., 4, 4), or positions (..., 3) or (..., 2), with the orientation of the start unless quaternions
                are given; of a task of F frames (..., F, 4, 4) or (..., F, 3). A tensor of floats, on any device.
            quaternions: (..., 4), or (..., F, 4), of any length but 0, for the positions `poses`.
            order: "wxyz" or "xyzw", how the quaternions are written.

        Returns:
            q (..., n) in the dtype and on the device of `poses`, computed in float64 on the processor; status (...),
            an `InverseStatus` as int64. Where a pose is not reached q is NaN and its derivative zero: mask the loss by
            `status == 0`, and the other poses of the batch keep their gradients.

        Raises:
            ArgumentError: what is no tensor of floats; quaternions without an order; third derivatives. ShapeError.
        """
        from .torch_rules import solved

        return solved(self._joints, poses, quaternions, order)


@typed
def inverse(ik: InverseKinematics) -> TorchInverse:
    """Inverse kinematics as a function of torch tensors, with exact first and second derivatives.

    It serves `backward`, `torch.func` (`grad`, `vmap`, `jacrev`, `jacfwd`, `hessian`) and `torch.autograd.gradcheck`.
    `torch.compile` calls it as it is, with a break of the graph.
    See `TorchInverse.__call__` for what it takes.

    Args:
        ik: of `hk.ik(strategy, q0)`.

    Raises:
        MissingExtraError: torch is not installed.
    """
    extra("torch", "torch", "interop")
    return TorchInverse(ik, JointMap(ik))
