"""Inverse kinematics as a differentiable function of torch tensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..base.arguments import typed
from ..base.types import Value
from ..control_laws.extra_library import extra
from ..errors import ArgumentError
from ..inverse_kinematics import InverseKinematics
from .joint_map import JointMap
from .pose_tensors import JointTensors, read_tensors


@dataclass(frozen=True, eq=False)
class TorchInverse(Value):
    """poses -> (q, status), differentiable twice. Make one with `hk.interop.torch.inverse`."""

    ik: InverseKinematics
    _joints: JointMap

    def __call__(self, poses: Any, quaternions: Any = None, *, order: str | None = None) -> JointTensors:
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
        torch = extra("torch", "torch", "interop")
        from .torch_rules import Inverse

        turns = None if quaternions is None else _on_processor(torch, "the quaternions", quaternions)
        wanted = _on_processor(torch, "the tool poses", poses)
        read = read_tensors(torch, self._joints, torch.tensor, wanted, turns, order)
        q, status = Inverse.apply(self._joints, read.given.detach(), read.p, read.R)
        return JointTensors(q.to(dtype=poses.dtype, device=poses.device), status.to(device=poses.device))


@typed
def inverse(ik: InverseKinematics) -> TorchInverse:
    """Inverse kinematics as a function of torch tensors, with exact first and second derivatives.

    It serves `backward`, `torch.func` (`grad`, `vmap`, `jacrev`, `jacfwd`, `hessian`) and `torch.autograd.gradcheck`.
    See `TorchInverse.__call__` for what it takes.

    Args:
        ik: of `hk.inverse(strategy, q0)`.

    Raises:
        MissingExtraError: torch is not installed.
    """
    extra("torch", "torch", "interop")
    return TorchInverse(ik, JointMap(ik))


def _on_processor(torch: Any, what: str, tensor: Any) -> Any:
    """A tensor of floats in float64 on the processor. Raises: ArgumentError."""
    if not isinstance(tensor, torch.Tensor):
        raise ArgumentError(what, tensor, "give a torch tensor; ik.batch(poses) takes arrays")
    if not tensor.is_floating_point():
        raise ArgumentError(what, str(tensor.dtype), "give a tensor of floats, as by .float() or .double()")
    if tensor.is_meta:
        raise ArgumentError(what, "on the device 'meta'", "it has no numbers: give a tensor on the device of your data")
    return tensor.to(device="cpu", dtype=torch.float64)
