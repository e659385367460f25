"""Joints that follow the tool's pose: q_k = h(x) + level. The robot's own pose and h in NumPy are the referees."""

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import campaign
from holokin.base.errors import ArgumentError, BranchError, JointLimitError, ShapeError
from holokin.base.types import Array
from holokin.motion.ik import InverseKinematics, InverseStatus
from holokin.motion.ik.closed_leaf import ClosedBranch, Following, closed_leaf
from holokin.robot import Robot
from holokin.strategies import HolonomicStrategy
from holokin.strategies.constraints import stack, tilted, total

READY = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785])
BENT = READY + [0.1, 0, 0.2, 0, -0.3, 0, 0]
IIWA = np.array([0.1, 0.6, 0.2, -1.4, 0.3, 0.9, -0.2])
ARMS = {
    "panda": (READY, 6),
    "fr3": (BENT, 5),
    "iiwa14": (IIWA, 2),
    "openarm-left": (IIWA + 0.2, 4),
}
"""Starts, and joints that follow."""


class Smooth:
    """h: a random polynomial of degree two of the tool's place and matrix, and a sine of it; for CasADi and NumPy."""

    def __init__(self, seed: int, size: float = 0.3) -> None:
        rng = np.random.default_rng(seed)
        self.a, self.b, self.B = rng.normal(0, size, 12), rng.normal(0, 1, 12), rng.normal(0, size / 4, (12, 12))

    def __call__(self, p, R):
        x = ca.vertcat(p, ca.vec(R))
        return ca.dot(ca.DM(self.a), x) + ca.bilin(ca.DM(self.B), x, x) + 0.3 * ca.sin(ca.dot(ca.DM(self.b), x))

    def at(self, poses: Array) -> Array:
        """h (k,) at poses (k, 4, 4)."""
        x = np.concatenate([poses[:, :3, 3], np.swapaxes(poses[:, :3, :3], 1, 2).reshape(-1, 9)], axis=1)
        return x @ self.a + np.einsum("ki,ij,kj->k", x, self.B, x) + 0.3 * np.sin(x @ self.b)


def following(name: str, seed: int) -> tuple[Robot, Smooth, HolonomicStrategy, Array, int]:
    robot, h, (q0, k) = hk.load(name), Smooth(seed), ARMS[name]
    return robot, h, hk.holonomic(hk.pose(robot), hk.lock(robot.joint_names[k], follows=h)), q0, k


def around(robot: Robot, q0: Array, count: int, size: float, seed: int = 0) -> Array:
    return robot.pose(q0 + np.random.default_rng(seed).uniform(-size, size, (count, robot.n)))


def by_paths(ik: InverseKinematics) -> InverseKinematics:
    """The same without its closed form."""
    vars(ik._paths)["closed"] = None
    return ik


@pytest.mark.parametrize("name", [name if name == "panda" else campaign("name", name) for name in ARMS])
def test_answers_have_the_pose_and_the_joint_is_h_of_it_and_the_paths_come_to_the_same(name):
    robot, h, G, q0, k = following(name, 1)
    ik = hk.ik(G, q0, limits=False)
    assert isinstance(ik._paths.closed, ClosedBranch)
    poses = around(robot, q0, 10, 0.25)
    q = ik.batch(poses)
    arrived = q.reached
    assert arrived.mean() > 0.4
    assert np.abs(robot.pose(q.q[arrived]) - poses[arrived]).max() < 1e-10
    level = q0[k] - h.at(robot.pose(q0)[None])[0]
    assert np.abs(q.q[arrived, k] - level - h.at(poses[arrived])).max() < 1e-10
    assert np.abs(np.array([ik(pose) for pose in poses[arrived][:40]]) - q.q[arrived][:40]).max() < 1e-12
    paths = by_paths(hk.ik(G, q0, limits=False)).batch(poses)
    both = arrived & paths.reached
    assert both.mean() > 0.4 and not (paths.reached & ~arrived).any()
    assert np.abs(q.q[both] - paths.q[both]).max() < 1e-8


def check_signs(name: str, count: int, seed: int) -> None:
    """Every posture of a random pose is told by its signs, and det [J; J_g] is their product or minus it."""
    robot, h, G, _, k = following(name, seed)
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, (count, robot.n))
    poses, factors = robot.pose(q), []
    for posture, pose, level in zip(q, poses, q[:, k] - h.at(poses), strict=True):
        leaf = closed_leaf(G, np.array([level]), False)
        assert isinstance(leaf, Following)
        answers = leaf.one(pose)
        real = answers[:, 9] > 1e-7
        if not real.any():  # two postures meet
            assert (np.abs(answers[:, 9]) < 1e-7).any()
            continue
        found = leaf.postures(answers[real])
        assert len({tuple(row) for row in np.sign(answers[real, 6:9])}) == len(found)
        gap = (found[:, None] - found[None] + np.pi) % (2 * np.pi) - np.pi
        assert (np.abs(gap).max(axis=2) + 10 * np.eye(len(found))).min(initial=10) > 1e-6
        assert np.abs(robot.pose(found) - pose).max() < 1e-10 and np.abs(G.g(found) - level).max() < 1e-10
        own = np.abs((found - posture + np.pi) % (2 * np.pi) - np.pi).max(axis=1).min(initial=np.inf)
        assert own < 1e-6 or (np.abs(answers[:, 9]) < 1e-7).any()
        det = np.linalg.det(np.concatenate([robot.jacobian(found), G.rows(found)], axis=1))
        factors += (det / answers[real, 6:9].prod(axis=1)).tolist()
    assert np.abs(np.abs(factors) - 1).max() < 1e-5 and len(np.unique(np.sign(factors))) == 1


@pytest.mark.parametrize("name", ARMS)
def test_signs_tell_all_postures_of_a_pose_apart_and_h_changes_no_determinant(name):
    check_signs(name, 50, 2)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ARMS)
def test_signs_tell_all_postures_of_many_poses_apart(name):
    check_signs(name, 2000, 3)


def test_roots_along_self_motions_are_the_postures_of_the_closed_form_and_no_others(monkeypatch):
    robot, _, G, q0, _ = following("panda", 4)
    ik, poses = hk.ik(G, q0), around(robot, q0, 4, 0.4, 5)
    closed = [ik.all(pose) for pose in poses]
    monkeypatch.setattr("holokin.motion.ik.postures_of_pose.closed_leaf", lambda *_: None)
    for some, pose in zip(closed, poses, strict=True):
        searched = ik.all(pose)
        assert some.closed and not searched.closed and len(some.q) == len(searched.q) > 0
        assert np.abs(some.q - searched.q).max() < 1e-8


def test_the_followed_value_must_lie_within_the_limits():
    panda, q = hk.load("panda"), READY.copy()
    q[6] = 3.2  # of which 2.8973 are allowed; the other joints stay
    pose, slope = panda.pose(q), (3.2 - READY[6]) / (panda.pose(q)[0, 0] - panda.pose(READY)[0, 0])
    G = hk.holonomic(hk.pose(panda), hk.lock("panda_joint7", follows=lambda _p, R: slope * R[0, 0]))
    ik = hk.ik(G, READY)
    assert ik.batch(pose[None]).status[0] == InverseStatus.LIMIT
    with pytest.raises(JointLimitError, match="panda_joint7"):
        ik(pose)
    assert not len(ik.all(pose).q) and ik.all(pose).outside
    assert np.abs(hk.ik(G, READY, limits=False)(pose) - q).max() < 1e-9


def test_a_rail_follows_the_tools_x():
    robot = hk.load("rail-ur10e")
    q0 = np.array([0.2, 0.3, -1.2, 1.4, -0.9, 0.7, 0.2])
    G = hk.holonomic(hk.pose(robot), hk.lock(0, follows=lambda p, _R: p[0]))
    ik, poses = hk.ik(G, q0, limits=False), around(robot, q0, 30, 0.3)
    q = ik.batch(poses)
    assert q.reached.mean() > 0.9
    good, offset = q.reached, q0[0] - robot.pose(q0)[0, 3]
    assert np.abs(robot.pose(q.q[good]) - poses[good]).max() < 1e-10
    assert np.abs(q.q[good, 0] - poses[good, 0, 3] - offset).max() < 1e-10


def test_several_joints_follow_and_stacks_and_sums_are_taken_apart():
    robot = hk.load("mobile-ur5e")
    q0 = np.array([0.2, 0.1, 0.3, 0.3, -1.2, 1.4, -0.9, 0.7, 0.2])
    base, task = robot.joint_names[:3], hk.pose(robot)
    heading = lambda p, R: [0.4 * p[0] + 0.1 * R[1, 0], p[1] / 2, 0.2 * R[0, 0]]  # noqa: E731
    rules = [
        hk.lock(*base, follows=heading),
        stack(
            hk.lock(base[0], follows=lambda p, R: 0.4 * p[0] + 0.1 * R[1, 0]),
            total(hk.lock(base[1], follows=lambda p, _R: p[1]), hk.lock(base[1]), weights=[0.5, 0.5]),
            tilted(hk.lock(base[2], follows=lambda _p, R: 0.1 * R[0, 0]), lambda x: 0.05 * x[0]),
        ),
    ]
    poses = around(robot, q0, 12, 0.2)
    for i, rule in enumerate(rules):
        G = hk.holonomic(task, rule)
        ik = hk.ik(G, q0, limits=False)
        assert isinstance(ik._paths.closed, ClosedBranch)
        q = ik.batch(poses)
        assert q.reached.mean() > 0.8
        assert np.abs(robot.pose(q.q[q.reached]) - poses[q.reached]).max() < 1e-10
        assert np.abs(G.g(q.q[q.reached]) - G.g(q0)).max() < 1e-10
        assert ("(x, y, " in hk.certify(G).theorem) or i or base[0] != "x"


def test_a_designed_strategy_over_a_held_joint_is_answered_and_proven_and_its_polynomial_may_be_followed(design):
    panda, G = hk.load("panda"), design.strategy
    ik, poses = hk.ik(G, design.q0), around(panda, design.q0, 20, 0.1)
    assert isinstance(ik._paths.closed, ClosedBranch)
    same = hk.ik(hk.holonomic(G.task, hk.lock("panda_joint7", follows=design.polynomial)), design.q0)
    q, other, paths = ik.batch(poses), same.batch(poses), by_paths(hk.ik(G, design.q0)).batch(poses)
    assert q.reached.mean() > 0.9 and (paths.reached <= q.reached).all()
    assert np.abs(panda.pose(q.q[q.reached]) - poses[q.reached]).max() < 1e-10
    assert np.abs(q.q[paths.reached] - paths.q[paths.reached]).max() < 1e-8
    assert np.abs(q.q[q.reached] - other.q[q.reached]).max() < 1e-10
    assert "panda_joint7 = h(tool pose)" in hk.certify(G).theorem


@pytest.fixture(scope="module")
def design():
    task, space = hk.pose(hk.load("panda")), hk.workspace(box=([0.5, 0.05, 0.4], [0.05, 0.1, 0.05]), tilt=0.3, spin=0.5)
    return hk.design(task, space, READY, base=hk.lock("panda_joint7"), degree=1, samples=8)


def test_the_whole_arm_is_proven_and_the_file_stands_by_itself(tmp_path):
    from holokin.proof import whole_checker

    pytest.importorskip("flint")
    G = following("panda", 6)[2]
    proof = hk.certify(G)
    assert (
        proof.whole and "with panda_joint7 = h(tool pose) + any level" in proof.theorem and proof.to_dict()["follows"]
    )
    assert proof.data["held"] == [6] and proof.data["follows"]
    assert whole_checker.check(str(proof.save(tmp_path / "whole.json")))
    plain = hk.certify(hk.holonomic(G.task, hk.lock("panda_joint7")))
    assert "h(tool pose)" not in str(plain) and not plain.data["follows"]


def test_functions_that_do_not_fit_are_refused():
    task = hk.pose(hk.load("panda"))
    with pytest.raises(ShapeError, match="what 'lock' follows"):
        hk.holonomic(task, hk.lock(6, follows=lambda p, _R: [p[0], p[1]])).g(READY)
    with pytest.raises(ShapeError, match="what 'lock' follows"):
        hk.holonomic(task[[0, 1, 2]], hk.lock(2, 4, 5, 6, follows=lambda p, _R: p)).g(READY)
    for bad in (lambda p: p[0], 0.3):
        with pytest.raises(ArgumentError, match="function of 2 arguments"):
            hk.lock(6, follows=bad)  # type: ignore[arg-type]


def test_where_h_jumps_paths_decide_and_a_jump_is_refused():
    panda = hk.load("panda")
    G = hk.holonomic(hk.pose(panda), hk.lock(6, follows=lambda p, _R: ca.if_else(p[1] > 0.05, 0.3, 0.0)))
    ik, pose = hk.ik(G, READY), panda.pose(READY)
    pose[1, 3] += 0.04
    assert ik._paths.closed is None and np.abs(panda.pose(ik(pose)) - pose).max() < 1e-9
    pose[1, 3] += 0.04
    with pytest.raises(BranchError, match=r"jumps by 0\.3"):
        ik(pose)


def test_a_rule_that_does_not_hold_single_joints_stays_with_its_paths():
    task = hk.pose(hk.load("panda"))
    tied = tilted(hk.linear([0, 0, 1.0, 0, 0, 0, 1.0]), lambda x: 0.1 * x[0])
    for rule in (tied, tilted(hk.arm_angle(), lambda x: 0.1 * x[0])):
        assert hk.ik(hk.holonomic(task, rule), READY)._paths.closed is None
    of_degree_four = hk.ik(hk.holonomic(task, hk.lock(4, follows=lambda p, _R: p[0])), READY)._paths.closed
    assert of_degree_four is not None and of_degree_four.row is None


def test_without_a_compiler_the_answers_are_the_same(monkeypatch):
    robot, _, G, q0, _ = following("panda", 7)
    poses, leaf = around(robot, q0, 12, 0.3), closed_leaf(G, G.g(q0), True)
    assert leaf is not None
    natively = np.array([leaf.one(pose) for pose in poses])
    batch = leaf.answers(poses)
    monkeypatch.setitem(vars(leaf.inverse), "kernel", None)
    real = natively[:, :, 9] > 1e-6
    for rows in (batch, leaf.answers(poses), np.array([leaf.one(pose) for pose in poses])):
        assert np.abs(rows - natively)[real].max() < 1e-9


@pytest.mark.parametrize("orientation", ["rotation-vector", "twist", "zyz", "rpy"])
def test_where_coordinates_of_the_pose_jump_paths_decide(orientation):
    """Rotation vectors jump half a turn from their reference, three angles where they wrap."""
    panda, start = hk.load("panda"), BENT + [0, 0, 0, 0, 0, 0, 1.0]
    task = hk.pose(panda, orientation, reference=panda.pose(BENT + [0, 0, 0, 0, 0, 0, -1.0])[:3, :3])
    ik = hk.ik(hk.holonomic(task, tilted(hk.lock(6), lambda x: 0.2 * x[3] + 0.1 * x[5])), start)
    branch = ik._paths.closed
    of_place = hk.holonomic(task, tilted(hk.lock(6), lambda x: 0.2 * x[1] ** 2))
    free = hk.ik(of_place, start)._paths.closed
    assert free is not None and free.turn == np.inf  # h takes nothing that jumps
    if orientation in ("zyz", "rpy"):
        assert branch is None
        return
    assert branch is not None  # 2 rad are used: 1.14 rad are left
    for angle, told in ((0.2, True), (1.1, True), (-1.1, True), (1.2, False), (-1.2, False)):
        pose = panda.pose(start + [0, 0, 0, 0, 0, 0, angle])
        assert branch.reach(pose[None, :3, 3], pose[None, :3, :3])[2][0] == told
        assert told or branch.one(pose) is None
    pose = panda.pose(start + [0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
    assert branch.one(pose) is not None and np.abs(panda.pose(ik(pose)) - pose).max() < 1e-10
