"""What strategies serve, read off the self-motions of the poses: leaves, designs, and what is in the way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, sampled
from holokin.analysis.coverage.starts import Candidate
from holokin.analysis.design import Advice, advice_case, nearby_cusps
from holokin.analysis.design.advice_case import Case
from holokin.analysis.design.served_curves import FASTEST, best_leaf, designed_on, leaf_through, pieces_of
from holokin.analysis.design.trials import is_proven, tried
from holokin.base.errors import ArgumentError, OutOfReachError
from holokin.motion.checks import Clearances
from holokin.motion.ik import all_postures
from holokin.robot import Box
from holokin.strategies.constraints import tilted

SPACE = hk.workspace(box=([0.45, 0.1, 0.35], [0.12, 0.12, 0.12]), tilt=0.25, spin=0.5)


def panda(**limits: tuple[float, float]) -> hk.Robot:
    """With other limits of some joints."""
    lower, upper = ({name: ends[side] for name, ends in limits.items()} for side in (0, 1))
    return hk.robot.with_limits(hk.load("panda"), lower=lower, upper=upper) if limits else hk.load("panda")


@pytest.fixture(scope="module")
def case() -> Case:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(advice_case, "POSES", 128)
        return Case(hk.pose(panda()), SPACE, None, None, lambda _: None)


@pytest.fixture(scope="module")
def advice() -> Advice:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(advice_case, "POSES", 128)
        patch.setattr(nearby_cusps, "STARTS", 60)
        return hk.advise(hk.pose(panda()), SPACE)


RULES: dict[str, Callable[[], hk.Constraint]] = {
    "joint 3": lambda: hk.lock("panda_joint3"),
    "joint 6": lambda: hk.lock("panda_joint6"),
    "two joints": lambda: hk.linear([0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0]),
    "arm angle": hk.arm_angle,
}


def candidate(name: str) -> Candidate:
    task = hk.pose(panda())
    return Candidate(name, {"kind": "lock"}, task, hk.holonomic(task, RULES[name](), name=name))


@sampled(2, "name", RULES)
def test_the_share_that_a_leaf_serves_is_the_one_that_paths_on_it_find(case: Case, name: str) -> None:
    """Referee: `coverage`, which follows the leaf from its start to each pose."""
    one, curves = candidate(name), case.curves
    assert curves is not None
    pieces = pieces_of(curves, one, curves.levels([one])[:, 0])
    leaf = best_leaf(curves, pieces)
    assert leaf is not None and one.strategy is not None
    (trial,) = tried(leaf.candidate, leaf.q[None], case.poses)
    assert -0.08 < trial.coverage - leaf.coverage < 0.04  # two branches may seem to be one, which paths tell apart
    assert hk.coverage(one.strategy, SPACE, trial.q0, samples=128, explain=False).share == trial.coverage
    if name != "joint 6":  # nearly singular postures decide its mean, and are not told between those of the curves
        assert trial.squared_speed == pytest.approx(leaf.squared_speed, rel=0.2)
    through = leaf_through(curves, pieces, trial.q0)
    assert through is not None and through.branch == leaf.branch
    assert abs(through.coverage - leaf.coverage) < 0.03


def test_the_joint_speed_of_a_design_is_the_least_and_what_its_slope_adds(case: Case) -> None:
    """|G P|^2 = |J^+ P|^2 + |z|^2 |D_P h - J_g J^+ P|^2. Referee: G of the strategy that is built."""
    one, curves = candidate("joint 6"), case.curves
    assert curves is not None and one.strategy is not None
    leaf = best_leaf(curves, pieces_of(curves, one, curves.levels([one])[:, 0]))
    assert leaf is not None
    made = designed_on(curves, leaf, degree=1)
    assert made is not None
    h, task = made[0], one.task
    strategy = hk.holonomic(task, tilted(one.strategy.constraint, h, chart=h.chart))
    rows = np.flatnonzero(curves.linked)[::97][:40]
    slopes = h.coefficients[0, 1:] * curves.costs.columns / curves.coordinates.scale
    least, metric, wanted = curves.terms(one, rows)
    moved = strategy.batch(curves.q[rows]) @ curves.twists[curves.pose[rows]]
    known = np.sum(moved**2, axis=(1, 2))
    said = least + metric * np.sum((slopes - wanted) ** 2, axis=1)
    usual = metric < FASTEST  # beyond it the strategy is singular
    assert usual.mean() > 0.8 and np.median(np.abs(said / known - 1)[usual]) < 1e-9
    assert np.abs(said / known - 1)[usual].max() < 1e-3  # where a limit cuts a curve a posture is beside the pose


def test_what_is_advised_is_one_function_on_the_whole_arm_where_that_costs_little(advice: Advice) -> None:
    best = advice.best
    assert is_proven(best) and best.coverage > 0.95
    assert max(other.coverage for other in advice.strategies) <= best.coverage + 0.02
    assert abs(hk.coverage(best.strategy, SPACE, best.q0, samples=128, seed=5).share - best.coverage) < 0.03
    assert 1.0 <= best.speed < 1.3 and best.margin > 0.0
    assert any("proven by the signs" in line for line in advice.reasons) and len(advice.reasons) <= 8
    assert not any("-" in line.split("needs")[-1].split("%")[0] for line in advice.reasons if "needs" in line)


def test_a_leaf_through_a_start_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(advice_case, "POSES", 48)
    given = hk.advise(hk.pose(panda()), SPACE, q0=PANDA_START)
    own = [one for one in given.strategies if one.keys["kind"] != "designed"]
    assert own and all(np.abs(one.q0 - PANDA_START).max() < 1e-9 for one in own)


# --- What is in the way.

TABLE = hk.obstacle("table", Box(np.array([0.3, 0.6, 0.01])), (0.65, 0.1, 0.35))


def blocked(scene: hk.Scene, monkeypatch: pytest.MonkeyPatch, robot: hk.Robot | None = None) -> str:
    monkeypatch.setattr(advice_case, "POSES", 32)
    with pytest.raises(OutOfReachError) as problem:
        hk.advise(hk.pose(robot or panda()), SPACE, scene=scene)
    return str(problem.value)


def test_one_reason_for_all_poses_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """A block about the workspace, in which the hand is wherever the tool is; a workspace that is out of reach; a
    joint whose range is too narrow; the start."""
    block = hk.obstacle("block", Box(np.array([0.3, 0.3, 0.3])), (0.45, 0.1, 0.35))
    assert "block" in (said := blocked(hk.Scene([block]), monkeypatch)) and "block overlap" in said and "m: 32" in said
    assert "no strategy can serve" in said
    far = hk.workspace(box=([3.0, 0, 0.3], [0.1] * 3))
    with pytest.raises(OutOfReachError, match="no posture has any of its poses"):
        hk.advise(hk.pose(panda()), far)
    with pytest.raises(OutOfReachError, match=r"beyond the joint limits: panda_joint4 by"):
        hk.advise(hk.pose(panda(panda_joint4=(-0.2, -0.1))), SPACE)
    with pytest.raises(ArgumentError, match=r"block (overlap|are)"):
        at = panda().pose(PANDA_START)[:3, 3]
        near = hk.obstacle("block", Box(np.array([0.1, 0.1, 0.1])), at)
        hk.advise(hk.pose(panda()), SPACE, q0=PANDA_START, scene=hk.Scene([near]))


def test_poses_at_which_nothing_helps_are_those_without_a_clear_posture(monkeypatch: pytest.MonkeyPatch) -> None:
    """A board across the workspace. Referee: all postures of each pose with joint 7 at each of 60 angles."""
    monkeypatch.setattr(advice_case, "POSES", 16)
    robot, scene = panda(), hk.Scene([TABLE])
    task = hk.pose(robot)
    case, apart = Case(task, SPACE, None, scene, lambda _: None), Clearances.of(robot, scene)
    lost, other = case.blocked.impossible, hk.holonomic(task, hk.lock("panda_joint7"))
    assert 3 < lost.sum() < 13
    angles = np.linspace(robot.lower[6], robot.upper[6], 60)
    wrong = 0
    for pose, impossible in zip(case.poses.T, lost, strict=True):
        Q = np.vstack([all_postures(other, pose, level=c).q.reshape(-1, 7) for c in angles])
        wrong += bool(impossible) != (not np.all(apart.distances(Q) >= apart.limits, axis=1).any())
    assert wrong <= 1  # where but a few hundredths of a radian are clear
    causes = case.blocked.causes(lost)
    assert sum(count for _, count in causes) == lost.sum() and "table" in causes[0][0]


def test_what_is_found_before_ctrl_c_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(advice_case, "POSES", 16)
    heard: list[str] = []

    def progress(text: str) -> None:
        heard.append(text)
        if sum(word.endswith("on its leaf") for word in heard) == 2 and text.endswith("on its leaf"):
            raise KeyboardInterrupt

    found = hk.advise(hk.pose(hk.load("iiwa14")), progress=progress)
    assert len(found.strategies) == 1 and found.reasons[-1].startswith("It was interrupted")
