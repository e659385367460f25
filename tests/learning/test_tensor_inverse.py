"""Inverse kinematics inside torch and JAX: the joints of `ik.batch`, derivatives that finite differences confirm."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, campaign, sampled
from holokin.base.errors import ArgumentError, ShapeError
from holokin.motion.ik import InverseKinematics, InverseStatus

for library in ("torch", "jax"):
    if find_spec(library) is None:
        pytest.skip(f"{library} is not installed", allow_module_level=True)


class Later:
    """A library that is imported when a test asks for something of it: to import these two takes as long as all others
    together, and each worker collects this file."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "_mock_name":  # what pytest asks of every name in a file
            raise AttributeError(name)
        return getattr(import_module(self._name), name)


torch: Any = Later("torch")
jax: Any = Later("jax")
jnp: Any = Later("jax.numpy")


@pytest.fixture(scope="module", autouse=True)
def doubles() -> None:
    jax.config.update("jax_enable_x64", True)


def _two_arms() -> hk.strategies.HolonomicStrategy:
    robot = hk.load("planar-3r")
    pair = hk.compose(
        hk.robot.Part(robot, prefix="a_"), hk.robot.Part(robot, on="base", pose=[1.0, 0.0, 0.0], prefix="b_")
    )
    first, second = (hk.position(pair, tip=tip.name) for tip in pair.tips)
    return hk.holonomic(hk.stacked(first, second), hk.strategies.constraints.stack(hk.lock(2), hk.lock(5)))


LAWS: dict[str, Callable[[], hk.Strategy]] = {
    "planar": lambda: hk.holonomic(hk.position(hk.load("planar-3r")), hk.linear([0.0, -1.0, 1.0])),
    "panda pose": lambda: hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle()),
    "panda zyz": lambda: hk.holonomic(hk.pose(hk.load("panda"), "zyz"), hk.linear([1, 0, -1, 0, 0, 0, 0])),
    "panda axis": lambda: hk.holonomic(
        hk.pose(hk.load("panda"), "axis", reference=hk.load("panda").pose(PANDA_START)[:3, :3]),
        hk.strategies.constraints.stack(hk.lock(2), hk.lock(6)),
    ),
    "irb five rows": lambda: hk.holonomic(hk.pose(hk.load("irb140"), "zyz", rows=[0, 1, 2, 3, 4]), hk.lock(5)),
    "irb pose": lambda: hk.moore_penrose(hk.pose(hk.load("irb140"), "rotation-vector")),
    "radial": lambda: hk.radial(hk.moore_penrose(hk.position(hk.load("planar-3r"))), [0.3, 0.8, -0.4]),
    "two arms": _two_arms,
}
every = sampled(1, "name", LAWS)


@cache
def solved(name: str) -> InverseKinematics:
    strategy = LAWS[name]()
    return hk.ik(strategy, start_of(strategy))


def start_of(strategy: hk.Strategy) -> np.ndarray:
    known = {3: [0.3, 0.8, -0.4], 7: PANDA_START, 6: [0.3, 0.8, -0.4, 2.8, -0.8, 0.4]}
    if strategy.task.robot.name == "irb140":
        return np.array([0.2, 0.3, -0.2, 0.4, 0.7, 0.3])
    return np.array(known[strategy.task.n])


def given(ik: InverseKinematics, count: int, size: float = 0.03) -> np.ndarray:
    """What `ik.batch` takes, of postures about the start."""
    Q = ik.q0 + size * np.random.default_rng(1).standard_normal((count, len(ik.q0)))
    return np.stack([ik.strategy.task.pose(q) for q in Q])


def joints(ik: InverseKinematics) -> Callable[[Any], Any]:
    f = hk.learning.torch.inverse(ik)
    return lambda x: f(x).q


@every
def test_the_joints_and_what_became_of_each_pose_are_those_of_a_batch(name: str) -> None:
    ik = solved(name)
    poses = given(ik, 5)
    poses[1, ..., :3, 3] += 50.0  # beyond reach
    poses[2, ..., 0, 0] = np.nan
    poses[3, ..., :3, 0] *= -1.0  # left-handed
    known = ik.batch(poses)
    for found in (
        hk.learning.torch.inverse(ik)(torch.tensor(poses)),
        hk.learning.jax.inverse(ik)(jnp.asarray(poses)),
        jax.jit(hk.learning.jax.inverse(ik))(jnp.asarray(poses)),
    ):
        assert np.array_equal(np.asarray(found.status), known.status)
        np.testing.assert_allclose(np.asarray(found.q), known.q, rtol=0, atol=1e-12)
    assert {0, InverseStatus.NOT_FINITE, InverseStatus.NOT_A_ROTATION} < set(known.status)


@every
def test_first_and_second_derivatives_by_the_entries_of_the_poses_are_those_of_finite_differences(name: str) -> None:
    """`gradcheck` moves each entry of a matrix, which is then no pose: the function is of the nearest rotation."""
    ik = solved(name)
    poses = torch.tensor(given(ik, 2), requires_grad=True)
    assert torch.autograd.gradcheck(joints(ik), (poses,), check_forward_ad=True)
    one = poses[:1].detach().requires_grad_()
    assert torch.autograd.gradgradcheck(joints(ik), (one,), atol=1e-4)


def _moved(poses: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """Poses (4, 4) or (F, 4, 4) after a small motion: their points by v, their rotations by exp([w]x)."""
    out = poses.copy()
    for T, (v, w) in zip(out.reshape(-1, 4, 4), twist.reshape(-1, 2, 3), strict=True):
        T[:3, 3] += v
        T[:3, :3] = Rotation.from_rotvec(w).as_matrix() @ T[:3, :3]
    return out


@every
def test_the_derivative_is_that_of_moving_on_the_poses(name: str) -> None:
    """Of exponential coordinates, by central differences of `ik.batch` itself: v of the point, exp([w]x) R."""
    ik = solved(name)
    T = given(ik, 1)[0]
    rng, h = np.random.default_rng(2), 1e-5
    f = hk.learning.torch.inverse(ik)
    for _ in range(3):
        twist = rng.standard_normal(6 * ik.strategy.task.frames)
        ends = ik.batch(np.stack([_moved(T, h * twist), _moved(T, -h * twist)])).q
        tangent = (_moved(T, h * twist) - _moved(T, -h * twist)) / (2 * h)
        _, moved = torch.func.jvp(lambda t: f(t).q, (torch.tensor(T),), (torch.tensor(tangent),))
        np.testing.assert_allclose(moved.numpy(), (ends[0] - ends[1]) / (2 * h), rtol=1e-6, atol=1e-7)


def test_a_planar_arm_with_its_hand_held_moves_as_the_formula_of_two_links_says() -> None:
    """Law of cosines: c2 = (d^2 - a^2 - b^2) / (2 a b) for links a, b; torch differentiates the formula itself."""
    robot = hk.from_dh([{"a": a, "joint": f"j{a}"} for a in (0.7, 0.5, 0.3)], name="links")
    ik = hk.ik(hk.holonomic(hk.position(robot, rows=[0, 1]), hk.lock(2)), [0.3, 0.8, 0.0])
    f, a, b = hk.learning.torch.inverse(ik), 0.7, 0.8

    def formula(x: Any) -> Any:
        c2 = (x.square().sum() - a * a - b * b) / (2 * a * b)
        q2 = torch.acos(c2)
        q1 = torch.atan2(x[1], x[0]) - torch.atan2(b * torch.sin(q2), a + b * c2)
        return torch.stack([q1, q2, torch.zeros((), dtype=x.dtype)])

    point = torch.tensor([0.9, 0.8], dtype=torch.float64)
    np.testing.assert_allclose(f(point).q, formula(point), atol=1e-12)
    for derivative in (torch.func.jacrev, torch.func.jacfwd, torch.func.hessian):
        found, known = (derivative(one)(point) for one in (lambda x: f(x).q, formula))
        np.testing.assert_allclose(found, known, atol=1e-9)


@pytest.mark.parametrize("name", [name if name == "planar" else campaign("name", name) for name in LAWS])
def test_torch_and_jax_agree_and_vmap_is_a_loop(name: str) -> None:
    ik = solved(name)
    poses = given(ik, 3)
    in_torch, in_jax = hk.learning.torch.inverse(ik), hk.learning.jax.inverse(ik)
    tensor, array = torch.tensor(poses), jnp.asarray(poses)
    one = torch.stack([torch.func.jacrev(lambda t: in_torch(t).q)(t) for t in tensor])
    for many in (torch.func.jacrev, torch.func.jacfwd):
        np.testing.assert_allclose(torch.func.vmap(many(lambda t: in_torch(t).q))(tensor), one, atol=1e-12)
    for many in (jax.jacrev, jax.jacfwd):
        np.testing.assert_allclose(jax.jit(jax.vmap(many(lambda t: in_jax(t).q)))(array), one, atol=1e-10)


@pytest.mark.campaign
@pytest.mark.parametrize("name", LAWS)
def test_second_derivatives_of_torch_and_jax_agree_and_a_third_one_is_refused(name: str) -> None:
    ik = solved(name)
    poses = given(ik, 1)
    in_torch, in_jax = hk.learning.torch.inverse(ik), hk.learning.jax.inverse(ik)
    tensor, array = torch.tensor(poses), jnp.asarray(poses)
    known = torch.func.hessian(lambda t: in_torch(t).q)(tensor[0])
    np.testing.assert_allclose(jax.hessian(lambda t: in_jax(t).q)(array[0]), known, rtol=1e-9, atol=1e-9)
    with pytest.raises(ArgumentError, match="a third one"):
        jax.jacfwd(jax.hessian(lambda t: in_jax(t).q))(array[0])


@sampled(1, "order", ["wxyz", "xyzw"])
def test_a_quaternion_is_the_rotation_it_stands_for_whatever_its_length_and_order(order: str) -> None:
    ik = solved("panda pose")
    poses = given(ik, 3)
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat(scalar_first=order == "wxyz") * [[1.0], [-1.0], [2.5]]
    points = torch.tensor(poses[:, :3, 3])
    for f, tensor in ((hk.learning.torch.inverse(ik), torch.tensor), (hk.learning.jax.inverse(ik), jnp.asarray)):
        found = f(tensor(poses[:, :3, 3]), tensor(turns), order=order)
        np.testing.assert_allclose(np.asarray(found.q), ik.batch(poses).q, atol=1e-12)
    f = hk.learning.torch.inverse(ik)
    inputs = (points.requires_grad_(), torch.tensor(turns, requires_grad=True))
    assert torch.autograd.gradcheck(lambda p, r: f(p, r, order=order).q, inputs)
    assert torch.autograd.gradgradcheck(lambda p, r: f(p[:1], r[:1], order=order).q, inputs, atol=1e-4)


def test_a_pose_that_is_not_reached_gives_nan_and_leaves_the_gradients_of_the_others_alone() -> None:
    ik = solved("panda pose")
    poses = given(ik, 3)
    poses[1, 0, 3] = 9.0
    tensor = torch.tensor(poses, requires_grad=True)
    q, status = hk.learning.torch.inverse(ik)(tensor)
    assert q.isnan().all(-1).tolist() == [False, True, False] and status[1] != 0
    torch.where((status == 0)[:, None], q, 0.0).square().sum().backward()
    known = torch.func.jacrev(lambda t: hk.learning.torch.inverse(ik)(t).q.square().sum())(torch.tensor(poses[0]))
    np.testing.assert_allclose(tensor.grad[0], known, atol=1e-12)
    assert (tensor.grad[1] == 0).all() and tensor.grad[2].isfinite().all() and tensor.grad[2].any()
    f = hk.learning.jax.inverse(ik)

    def loss(poses: Any) -> Any:
        q, status = f(poses)
        return jnp.where((status == 0)[:, None], q, 0.0).sum()

    slope = np.asarray(jax.jit(jax.grad(loss))(jnp.asarray(poses)))
    assert (slope[1] == 0).all() and np.isfinite(slope).all() and slope[2].any()


def test_dtype_device_and_any_leading_axes_are_kept() -> None:
    ik = solved("planar")
    f, points = hk.learning.torch.inverse(ik), torch.tensor(given(ik, 6)[:, :3, 3])
    known = ik.batch(points.numpy()).q
    for dtype, close in ((torch.float32, 1e-5), (torch.float64, 1e-12), (torch.bfloat16, 0.2), (torch.float16, 0.02)):
        x = points.to(dtype).reshape(2, 1, 3, 3).requires_grad_()
        q, status = f(x)
        assert q.dtype is dtype and q.shape == (2, 1, 3, 3) and status.shape == (2, 1, 3) and q.device == x.device
        np.testing.assert_allclose(q.detach().double().reshape(6, 3), known, atol=close)
        q.sum().backward()
        assert x.grad.dtype is dtype and x.grad.shape == x.shape
    apart = torch.stack([points, points], dim=-1)[..., 0]
    assert not apart.is_contiguous()
    np.testing.assert_allclose(f(apart).q, known, atol=1e-12)
    np.testing.assert_allclose(f(points.flip(0)).q.flip(0), known, atol=1e-12)
    empty = torch.zeros(0, 4, 4, requires_grad=True)
    f(empty).q.sum().backward()
    assert f(empty).q.shape == (0, 3) and f(empty).status.shape == (0,) and empty.grad.shape == (0, 4, 4)
    single = hk.learning.jax.inverse(ik)(jnp.asarray(points.numpy(), jnp.float32))
    assert single.q.dtype == jnp.float32
    np.testing.assert_allclose(single.q, known, atol=1e-5)
    assert hk.learning.jax.inverse(ik)(jnp.zeros((0, 3))).q.shape == (0, 3)


def test_what_is_no_tensor_of_poses_is_refused_with_the_cure() -> None:
    ik = solved("panda pose")
    poses = given(ik, 2)
    f, g = hk.learning.torch.inverse(ik), hk.learning.jax.inverse(ik)
    tensor, array = torch.tensor(poses), jnp.asarray(poses)
    for bad in (poses, tensor.int(), tensor.to(torch.complex128), None, "poses", [tensor]):
        with pytest.raises(ArgumentError, match="give a t"):
            f(bad)
    for bad in (array.astype(int), None, "poses", poses.tolist(), array.astype(complex)):
        with pytest.raises(ArgumentError, match="give a JAX array of floats"):
            g(bad)
    for one, make in ((f, torch.tensor), (g, jnp.asarray)):
        for shape in ((), (4,), (4, 1), (3, 4), (2, 16), (4, 4, 1)):
            with pytest.raises(ShapeError, match="the tool poses"):
                one(make(np.zeros(shape)))
        points, turns = make(np.zeros((2, 3))), make(np.ones((2, 4)))
        for order in (None, "wyxz", 4, ["wxyz"]):
            with pytest.raises(ArgumentError, match="how the quaternions are written"):
                one(points, turns, order=order)
        for p, r in ((make(poses), turns), (points, turns[:1]), (points, points), (points[:, :2], turns)):
            with pytest.raises(ShapeError, match="the quaternions"):
                one(p, r, order="wxyz")
        with pytest.raises(ArgumentError):
            one(points, "turns", order="wxyz")
        nothing = one(points, make(np.zeros((2, 4))), order="wxyz")
        assert (np.asarray(nothing.status) == InverseStatus.NOT_FINITE).all()
    with pytest.raises(ArgumentError, match="a tensor on the device"):
        f(tensor.to("meta"))
    for make in (hk.learning.torch.inverse, hk.learning.jax.inverse):
        with pytest.raises(ArgumentError):
            make(ik.strategy)


def test_native_code_serves_a_large_batch_and_its_gradients(monkeypatch: pytest.MonkeyPatch) -> None:
    ik = hk.ik(LAWS["planar"](), [0.3, 0.8, -0.4])
    points = torch.tensor(given(ik, 300)[:, :3, 3], requires_grad=True)
    hk.learning.torch.inverse(ik)(points).q.sum().backward()
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    slow = hk.ik(LAWS["planar"](), [0.3, 0.8, -0.4])
    again = points.detach().requires_grad_()
    hk.learning.torch.inverse(slow)(again).q.sum().backward()
    np.testing.assert_allclose(points.grad, again.grad, atol=1e-9)


def test_a_layer_goes_to_other_processes_as_workers_of_a_loader_take_it() -> None:
    ik = solved("planar")
    points = given(ik, 2)[:, :3, 3]
    for f, make in ((hk.learning.torch.inverse(ik), torch.tensor), (hk.learning.jax.inverse(ik), jnp.asarray)):
        again = pickle.loads(pickle.dumps(f))
        np.testing.assert_array_equal(np.asarray(again(make(points)).q), np.asarray(f(make(points)).q))


def test_torch_compile_calls_the_layer_as_it_is_and_traces_nothing_of_it() -> None:
    """Values and gradients to the last bit. The graph breaks at the layer alone, in the caller and in the call."""
    ik = solved("planar")
    f, counters = hk.learning.torch.inverse(ik), torch._dynamo.utils.counters
    torch._dynamo.reset()
    counters.clear()
    layer = torch.compile(lambda poses: 2 * f(poses)[0], backend="eager")
    for size in (0.03, 0.05):
        poses = torch.tensor(given(ik, 4, size))
        a, b = poses.clone().requires_grad_(), poses.clone().requires_grad_()
        traced, plain = layer(a), 2 * f(b)[0]
        traced.sum().backward()
        plain.sum().backward()
        assert torch.equal(traced, plain) and torch.equal(a.grad, b.grad)
    (reason,) = counters["graph_break"]
    assert "solved" in reason and counters["graph_break"][reason] == 2
