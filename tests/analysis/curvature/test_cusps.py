"""Cusps: leaves with two postures of one tool pose, joined without a singular posture. Theory 7.3."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from conftest import campaign, sampled
from holokin.analysis.curvature import cuspidal_leaf, witness_between
from holokin.analysis.curvature.cusp_search import CuspPoints, cusp_functions
from holokin.analysis.curvature.cuspidal_leaf import candidates
from holokin.base.errors import ArgumentError, SingularityError
from holokin.strategies import HolonomicStrategy

PANDA = np.array([0.0, 0.4, 0.2, -1.8, 0.1, 2.2, 0.8])
IIWA = np.array([0.1, 0.4, 0.2, -1.2, 0.1, 1.2, 0.8])
Q1_Q3 = (1, 0, -1, 0, 0, 0, 0)


def law(name: str, constraint: hk.Constraint) -> hk.Strategy:
    return hk.holonomic(hk.pose(hk.load(name)), constraint)


def three_joints(first: float) -> hk.Strategy:
    """Wenger's arm of three joints: d3, d4, r2, r3 = 2, 1.5, 1, 0, alpha = -90, 90 degrees; `first` is its d2."""
    tool = np.eye(4)
    tool[0, 3] = 1.5
    rows = [
        {"a": 0, "alpha": 0, "d": 0},
        {"a": first, "alpha": -np.pi / 2, "d": 1},
        {"a": 2, "alpha": np.pi / 2, "d": 0},
    ]
    return hk.moore_penrose(hk.position(hk.from_dh(rows, "modified", name="three", tool=tool)))


LAWS = {"q1 - q3": hk.linear(Q1_Q3), "lock 3": hk.lock(2), "arm angle": hk.arm_angle()}


@cache
def found(name: str) -> hk.analysis.curvature.Cusps:
    """Those of a Panda, searched once."""
    return hk.cusps(law("panda", LAWS[name]), PANDA, starts=100)


@pytest.mark.parametrize(
    ("name", "steps"), [("lock 3", 400), *(campaign(("name", "steps"), (name, 2_000)) for name in LAWS)]
)
def test_round_a_cusp_the_joints_of_a_panda_do_not_come_back(name: str, steps: int) -> None:
    """Pinocchio and small Newton steps of our own go the tool path, regular all along, to the other posture."""
    cusps = found(name)
    strategy, robot = cusps.strategy, cusps.strategy.task.robot
    small, regular = cusps.witness, cusps.most_regular
    assert cusps.cuspidal and small is not None and regular is not None
    assert regular.rcond >= small.rcond and small.size <= regular.size
    for one in cusps.witnesses:
        assert one.path.closed and one.apart > 0.02 and one.margin > 0
        assert one.path.gap < 1e-12
        assert np.abs(strategy.task.pose(one.first) - strategy.task.pose(one.second)).max() < 1e-9
        assert np.abs(strategy.g(one.first) - strategy.g(one.second)).max() < 1e-9
        model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
        end, signs = continued(model, model.getFrameId(robot.tip), strategy, one, steps)
        assert np.abs(end - one.second).max() < 1e-7
        assert len(signs) == 1


def continued(
    model: Any, frame: int, strategy: HolonomicStrategy, one: hk.analysis.curvature.CuspWitness, steps: int
) -> tuple[np.ndarray, set[float]]:
    """(the posture at the end of the path, the signs of det [J; J_g] on it) by Pinocchio and small steps."""
    data, q, signs = model.createData(), one.first.copy(), set()
    level, samples = strategy.g(one.first), one.path.at(np.linspace(0, one.path.duration, steps + 1))
    begun = strategy.task.pose(one.first)[:3, :3]
    rotations = samples.rotation @ (samples.rotation[0].T @ begun)
    for p, R in zip(samples.position, rotations, strict=True):
        for _ in range(3):
            pin.framesForwardKinematics(model, data, q)
            M = data.oMf[frame]
            J = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            E = np.vstack([J, slope(strategy.g, q)])
            error = np.concatenate([p - M.translation, pin.log3(R @ M.rotation.T)])
            gap = np.atleast_1d(strategy.constraint.nearest(level - strategy.g(q)))
            q = q + np.linalg.solve(E, np.concatenate([error, gap]))
            signs.add(float(np.sign(np.linalg.det(E))))
    return q, signs


def slope(g: Callable[[np.ndarray], np.ndarray], q: np.ndarray) -> np.ndarray:
    h = 1e-6
    return np.array([(g(q + h * e) - g(q - h * e)) / (2 * h) for e in np.eye(len(q))]).T


@sampled(1, "name", ["lock 3", "q1 - q3"])
def test_a_controller_led_round_a_cusp_comes_to_rest_at_the_other_posture(name: str) -> None:
    """At 0.01 m/s, within the joints' speeds and limits. Its error of tracking, 1e-5 at the end, fades to round-off."""
    cusps = found(name)
    strategy, task = cusps.strategy, cusps.strategy.task
    for one in cusps.witnesses:
        path = one.path.at_speed(0.01)
        dt = path.duration / 5_000
        law = hk.controller(strategy, dt=dt, q0=one.first)
        walk = hk.simulate(law, task, path, one.first, dt=dt)
        q, pose = walk.q[-1], task.pose(one.first)
        assert (np.abs(np.diff(walk.q, axis=0)).max(axis=0) <= task.robot.max_velocity * dt * (1 + 1e-9)).all()
        assert np.abs(q - one.second).max() < 1e-5 and np.abs(walk.q[0] - one.first).max() == 0.0
        for _ in range(300):  # the tool is held where the path ends, and began
            q = q + dt * law.step(q, pose, np.zeros(6))
        assert np.abs(q - one.second).max() < 1e-9 and np.abs(q - one.first).max() > 0.9


@sampled(1, ("name", "joint", "q0"), [("panda", 6, PANDA), ("iiwa14", 2, IIWA)])
def test_crossing_singular_sheets_are_no_cusps(name: str, joint: int, q0: np.ndarray) -> None:
    """A spherical wrist or shoulder splits det [J; J_g] in factors: many starts end where both are zero."""
    cusps = hk.cusps(law(name, hk.lock(joint)), q0, starts=200)
    assert len(cusps) == 0 and not cusps.cuspidal and cusps.witness is None
    assert cusps.double > 50
    assert "no cusp found" in cusps.sentence and "no proof" in cusps.sentence


def test_wengers_arm_is_cuspidal_and_one_whose_first_axes_meet_is_not() -> None:
    """[Wen07]: four postures at rho = 2.5, z = 0.6, two of each sign of det J, joined two by two."""
    strategy, pose = three_joints(1.0), np.eye(4)
    pose[:3, 3] = 2.5, 0.0, 0.6
    cusps = hk.cusps(strategy, [0.1, 0.3, 0.6], starts=80)
    assert cusps.cuspidal
    postures = hk.motion.ik.all_postures(cusps.strategy, pose)
    signs = [np.sign(np.linalg.det(strategy.task.jacobian(q))) for q in postures.q]
    assert sorted(signs) == [-1, -1, 1, 1]
    assert not hk.cusps(three_joints(0.0), [0.1, 0.3, 0.6], starts=80).cuspidal


def test_a_planar_arm_with_two_joints_tied_has_none() -> None:
    strategy = hk.holonomic(hk.position(hk.load("planar-3r")), hk.linear([0, 1, -1]))
    assert len(hk.cusps(strategy, [0.1, 0.5, 0.4], starts=200)) == 0


def test_at_a_cusp_three_postures_of_one_pose_come_together() -> None:
    """The tool pose along the lost direction v changes as s^3: not with s, and not with s^2."""
    cusps = found("lock 3")
    strategy = cusps.strategy
    extended, slopes = cusp_functions(strategy)
    for q in cusps.q[:20]:
        E = extended(q)[0]
        U, S, Vt = np.linalg.svd(E)
        kappa = slopes(q, U[:, -1], Vt[-1])[2]
        assert S[-1] < 1e-8 and S[-2] > 1e-4
        assert abs(kappa) < 1e-7
        h = 1e-3  # the same second derivative by differences of E itself
        change = U[:, -1] @ (extended(q + h * Vt[-1])[0] - extended(q - h * Vt[-1])[0]) @ Vt[-1] / (2 * h)
        assert abs(change) < 1e-5


def test_what_cannot_be_searched_is_refused() -> None:
    panda = hk.pose(hk.load("panda"))
    with pytest.raises(ArgumentError, match="leaves"):
        hk.cusps(hk.moore_penrose(panda), PANDA)
    cusps = found("lock 3")
    with pytest.raises(SingularityError):
        hk.cusps(cusps.strategy, cusps.q[0])
    with pytest.raises(ArgumentError, match="starts"):
        hk.cusps(hk.holonomic(panda, hk.lock(2)), PANDA, starts=0)


def test_ctrl_c_keeps_the_cusps_that_were_found(monkeypatch: pytest.MonkeyPatch) -> None:
    seek, calls = cuspidal_leaf.seek_cusps, []

    def twice(*args: Any) -> Any:
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return seek(*args)

    monkeypatch.setattr(cuspidal_leaf, "seek_cusps", twice)
    monkeypatch.setattr(cuspidal_leaf, "first_witness", lambda *_: None)  # whose loops take longer
    cusps = hk.cusps(law("panda", hk.lock(2)), PANDA, starts=400)
    assert cusps.stopped and cusps.starts == cuspidal_leaf.CHUNK and len(cusps)
    assert "Ctrl-C" in cusps.sentence


def test_the_page_of_the_catalogue_says_what_the_rows_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows as the benchmark writes them: a loop for one lock and one sum, cusps for another, else none."""
    root = Path(__file__).parents[3]
    monkeypatch.syspath_prepend(str(root / "docs"))
    from benchmarks.cusps import questions

    cusps_page = importlib.import_module("cusps_page")
    rows = []
    for one in questions():
        if one.arm in ("panda", "ur5e"):
            rows.append(
                {"arm": one.arm, "law": one.law, "joints": one.joints, "cusps": 0, "version": "9", "seconds": 60}
            )
            loop = (one.law, one.joints) in (("lock", (2,)), ("sum", (3, 4)))
            rows[-1] |= {"cusps": 5, "smallest": {"length": 0.031, "apart": 0.5}} if loop else {}
            rows[-1] |= {"cusps": 7} if one.law == "arm angle" else {}
    assert len(rows) == 51
    (tmp_path / "rows.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    cusps_page.main([str(tmp_path / "rows.jsonl"), "--docs", str(tmp_path)])
    text = (tmp_path / "cusps.md").read_text("utf-8")
    assert "| Panda | none | none | **3.1 cm**, 0.50 | none | none | none | none | 7 cusps |" in text
    assert "| Panda | 1 | 0 | 41 | q1+q2" in text and "| UR5e | none |" in text and "$" not in text
    assert "Of 50 questions" in text and "2 (4 %) have such a loop" in text and "51 minutes" in text


def test_where_no_two_postures_part_there_is_no_motion() -> None:
    """Directions of length zero: both sides come to one posture. Levels that no posture has: none is found at all."""
    strategy = law("panda", hk.lock(2))
    still = CuspPoints(PANDA[None], np.zeros((1, 7)), np.zeros((1, 7)))
    for level in (np.array([0.2]), np.array([np.nan])):
        motions, measures = candidates(strategy, level, still, True)
        assert len(motions.first) == 0 and measures.shape == (0, 3)


@pytest.mark.campaign
def test_two_postures_far_apart_are_joined_by_a_closed_tool_path() -> None:
    """A posture of a Panda with q1 - q3 held, whose pose has another one 2.705 rad away (theory 7.3). Not every pair
    is joined: across the singular postures there is no path."""
    strategy = law("panda", LAWS["q1 - q3"])
    first = np.array([2.778185, 1.133355, 2.251297, -1.304203, 1.262484, 1.838727, 2.005767])
    pose, level = strategy.task.pose(first), strategy.constraint_value(first)
    found = hk.motion.ik.all_postures(strategy, pose, level, limits=True, near=first).q
    apart = np.abs(found - first).max(axis=1)
    (second,) = found[np.abs(apart - 2.705) < 1e-3]
    one = witness_between(strategy, first, second)
    assert one is not None and one.path.closed and one.margin > 0 and one.rcond > 1e-3
    walk = hk.follow(strategy, one.path, first, samples=2000)
    assert np.abs(walk.q[-1] - second).max() < 1e-9
    other = found[(apart > 0.1) & (np.abs(apart - 2.705) > 1e-3)]
    assert len(other) and witness_between(strategy, first, other[0], via=60) is None
    with pytest.raises(ArgumentError, match="another posture of the same tool pose"):
        witness_between(strategy, first, first)
    with pytest.raises(ArgumentError, match="same leaf"):
        witness_between(strategy, first, PANDA)
