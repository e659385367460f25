"""The rules of torch's autograd for inverse kinematics. Imports torch: only `torch.inverse` of this room loads it."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]

from ..base.errors import ArgumentError
from .joint_map import TURN, JointMap, JointTensors, angular_velocity, read_tensors, rotation_gradient, third_derivative


def _turns() -> Any:
    """The generators of rotations. Made at import they would belong to a transform that is the first to ask."""
    return torch.tensor(TURN, dtype=torch.float64)


def _solved(joints: JointMap, poses: Any, quaternions: Any, order: str | None) -> JointTensors:
    """`TorchInverse.__call__`."""
    turns = None if quaternions is None else _on_processor("the quaternions", quaternions)
    read = read_tensors(torch, joints, torch.tensor, _on_processor("the tool poses", poses), turns, order)
    q, status = Inverse.apply(joints, read.given.detach(), read.p, read.R)
    return JointTensors(q.to(dtype=poses.dtype, device=poses.device), status.to(device=poses.device))


# Not for torch's compiler, which would trace through NumPy into native code, for minutes.
solved: Any = torch.compiler.disable(_solved)


def _on_processor(what: str, tensor: Any) -> Any:
    """A tensor of floats in float64 on the processor. Raises: ArgumentError."""
    if not isinstance(tensor, torch.Tensor):
        raise ArgumentError(what, tensor, "give a torch tensor; ik.batch(poses) takes arrays")
    if not tensor.is_floating_point():
        raise ArgumentError(what, str(tensor.dtype), "give a tensor of floats, as by .float() or .double()")
    if tensor.is_meta:
        raise ArgumentError(what, "on the device 'meta'", "it has no numbers: give a tensor on the device of your data")
    return tensor.to(device="cpu", dtype=torch.float64)


class Inverse(torch.autograd.Function):
    """(map, given, p (..., 3F), R (..., F, 3, 3)) -> (q (..., n), status (...)), in float64 on the processor."""

    @staticmethod
    def forward(joints: JointMap, given: Any, p: Any, R: Any) -> tuple[Any, Any]:
        """The joints, by `ik.batch`."""
        lead = p.shape[:-1]
        q, status = joints.solve(_rows(given, given.shape[len(lead) :]), _rows(R, R.shape[-3:]))
        return torch.tensor(q).reshape(*lead, q.shape[-1]), torch.tensor(status.astype(np.int64)).reshape(lead)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Any, ...]) -> None:
        """What the derivatives need: the joints and the rotations."""
        joints, _, _, R = inputs
        q, status = output
        ctx.joints = joints
        ctx.mark_non_differentiable(status)
        ctx.set_materialize_grads(False)
        ctx.save_for_backward(q, R)
        ctx.save_for_forward(q, R)

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> tuple[Any, ...]:
        """t = D^T g, and of its turning part the gradient by the entries of R."""
        q, R = ctx.saved_tensors
        if gradients[0] is None:
            return None, None, None, None
        t = torch.einsum("...nt,...n->...t", Gain.apply(ctx.joints, q, R), gradients[0])
        half = t.shape[-1] // 2
        w = t[..., half:].reshape(R.shape[:-1])
        return None, None, t[..., :half], rotation_gradient(torch, _turns(), R, w)

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> tuple[Any, None]:
        """dq = D t."""
        q, R = ctx.saved_tensors
        _, _, dp, dR = tangents
        half = 3 * R.shape[-3]
        v = torch.zeros((*q.shape[:-1], half), dtype=q.dtype) if dp is None else dp
        w = torch.zeros_like(v) if dR is None else angular_velocity(torch, _turns(), R, dR).reshape(v.shape)
        return torch.einsum("...nt,...t->...n", Gain.apply(ctx.joints, q, R), torch.cat([v, w], dim=-1)), None

    @staticmethod
    def vmap(info: Any, in_dims: tuple[Any, ...], *args: Any) -> tuple[Any, Any]:
        """One more leading axis."""
        return Inverse.apply(args[0], *_in_front(info, in_dims[1:], args[1:])), (0, 0)


class Gain(torch.autograd.Function):
    """(map, q (..., n), R (..., F, 3, 3)) -> D (..., n, 6F). Its derivatives are the last: no third ones."""

    @staticmethod
    def forward(joints: JointMap, q: Any, R: Any) -> Any:
        """By `JointMap.gain`."""
        D = joints.gain(_rows(q, q.shape[-1:]), _rows(R, R.shape[-3:]))
        return torch.from_numpy(D.reshape(*q.shape[:-1], *D.shape[1:]))

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
        """What the derivatives need."""
        ctx.joints, q, R = inputs
        ctx.save_for_backward(q, R)
        ctx.save_for_forward(q, R)

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> tuple[Any, ...]:
        """By `JointMap.slopes`."""
        q, R = ctx.saved_tensors
        by_joints, by_turns = Slopes.apply(ctx.joints, q, R)
        w = torch.einsum("...ntw,...nt->...w", by_turns, gradients[0]).reshape(R.shape[:-1])
        by_q = torch.einsum("...ntj,...nt->...j", by_joints, gradients[0])
        return None, by_q, rotation_gradient(torch, _turns(), R, w)

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> Any:
        """By `JointMap.slopes`."""
        q, R = ctx.saved_tensors
        _, dq, dR = tangents
        by_joints, by_turns = Slopes.apply(ctx.joints, q, R)
        moved = 0.0 if dq is None else torch.einsum("...ntj,...j->...nt", by_joints, dq)
        if dR is None:
            return moved
        w = angular_velocity(torch, _turns(), R, dR).reshape(*q.shape[:-1], -1)
        return moved + torch.einsum("...ntw,...w->...nt", by_turns, w)

    @staticmethod
    def vmap(info: Any, in_dims: tuple[Any, ...], *args: Any) -> tuple[Any, Any]:
        """One more leading axis."""
        return Gain.apply(args[0], *_in_front(info, in_dims[1:], args[1:])), 0


class Slopes(torch.autograd.Function):
    """(map, q, R) -> the derivatives of D by the joints and by turns, which have none themselves."""

    @staticmethod
    def forward(joints: JointMap, q: Any, R: Any) -> tuple[Any, Any]:
        """By `JointMap.slopes`."""
        slopes = joints.slopes(_rows(q, q.shape[-1:]), _rows(R, R.shape[-3:]))
        by_joints, by_turns = (torch.from_numpy(part.reshape(*q.shape[:-1], *part.shape[1:])) for part in slopes)
        return by_joints, by_turns

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
        """Nothing is kept."""

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        """There are none. Raises: ArgumentError."""
        raise third_derivative()

    jvp = backward

    @staticmethod
    def vmap(info: Any, in_dims: tuple[Any, ...], *args: Any) -> tuple[Any, Any]:
        """One more leading axis."""
        return Slopes.apply(args[0], *_in_front(info, in_dims[1:], args[1:])), (0, 0)


def _rows(tensor: Any, shape: tuple[int, ...]) -> np.ndarray:
    """A tensor (..., *shape) as an array (k, *shape)."""
    return tensor.detach().numpy().reshape(-1, *shape)


def _in_front(info: Any, dims: tuple[Any, ...], tensors: tuple[Any, ...]) -> list[Any]:
    """The tensors with the mapped axis in front; those that have none, repeated along it."""
    return [
        tensor.unsqueeze(0).expand(info.batch_size, *tensor.shape) if dim is None else tensor.movedim(dim, 0)
        for tensor, dim in zip(tensors, dims, strict=True)
    ]
