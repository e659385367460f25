"""What must not be proven: singular postures and limits that are only touched, and input that is no use for a proof."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import casadi
import numpy as np
import pytest
from typer.testing import CliRunner

import holokin as hk
from conftest import SOUND
from holokin.app.cli.main import app
from holokin.base.errors import JobError, JointLimitError, MissingExtraError
from holokin.proof import Certificate, Extent
from holokin.proof.certify_leaf import ONCE, PARTS, Parts, Pathway, Revisits
from roots import start

SLIDING = np.array([0.25, 0.0, 0.7])


@pytest.fixture(autouse=True)
def pictureless(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages of proofs have no picture: what they say is looked at."""
    monkeypatch.setattr("holokin.app.report.proof_report.drawable", lambda _found: False)


@pytest.fixture(scope="module")
def slider() -> hk.strategies.HolonomicStrategy:
    """A PPR arm whose turn is locked, so that q1 = x - cos q3: its first joint ends at 0.5 m."""
    robot = hk.load("ppr")
    first, *others = robot.coordinates
    robot = replace(robot, coordinates=(replace(first, lower=-1.0, upper=0.5), *others))
    return hk.holonomic(hk.position(robot), hk.lock(2))


def ended(proof: Certificate, extent: Extent, place: str = "") -> None:
    """Refused for one reason at one place, with what was proven up to there."""
    assert proof.extent is extent and not proof.whole, proof.theorem
    assert proof.where.startswith(place), proof.where
    assert len(proof) > 0
    assert str(proof).startswith("Not all is proven") and proof.where in str(proof) and proof.cause in str(proof)


@pytest.mark.campaign
def test_a_joint_that_only_touches_its_limit_is_refused_there(slider: hk.strategies.HolonomicStrategy) -> None:
    """At the end of a path, in a corner, at the tangent of a circle: what is proven stays within the limit."""
    x = start(slider.task.robot, SLIDING)
    most = x + [0.25, 0.0, 0.0]
    touching = {
        "100 % of piece 1": hk.line(x, most),
        "100 % of piece 1 ": hk.polyline([x, most, x + [0.2, 0.1, 0.0]]),
        "50 % of piece 1": hk.circle(x, center=(x + most) / 2),
    }
    for place, path in touching.items():
        proof = hk.certify(slider, path, SLIDING)
        ended(proof, Extent.LIMIT, place)
        assert 0.499 < proof.high[0] <= 0.5 and proof.to_limit[0] >= 0
        assert hk.certify(slider, path, SLIDING, limits=False).whole


def test_a_joint_that_stops_a_micrometre_before_its_limit_is_proven(slider: hk.strategies.HolonomicStrategy) -> None:
    x = start(slider.task.robot, SLIDING)
    proof = hk.certify(slider, hk.line(x, x + [0.25 - 1e-6, 0.0, 0.0]), SLIDING)
    assert proof.whole and 0 < proof.to_limit[0] <= 1e-6


@pytest.mark.campaign
def test_a_joint_that_goes_beyond_its_limit_or_begins_at_it_is_refused(slider: hk.strategies.HolonomicStrategy) -> None:
    """Nothing is proven from a start at the limit; a start beyond it is an error."""
    x = start(slider.task.robot, SLIDING)
    ended(hk.certify(slider, hk.line(x, x + [0.3, 0.0, 0.0]), SLIDING), Extent.LIMIT, "83")
    at = np.array([0.5, 0.0, 0.7])
    proof = hk.certify(slider, hk.line(start(slider.task.robot, at), x), at)
    assert proof.extent is Extent.LIMIT and not len(proof) and str(proof).startswith("Nothing is proven")
    beyond = np.array([0.6, 0.0, 0.7])
    with pytest.raises(JointLimitError):
        hk.certify(slider, hk.line(start(slider.task.robot, beyond), x), beyond)


def test_a_posture_that_is_singular_at_the_very_end_of_a_path_is_refused() -> None:
    """A planar arm that becomes straight there, and not before."""
    robot, q = hk.load("planar-3r"), np.array([0.3, 0.3, 0.3])
    G = hk.holonomic(hk.position(robot), hk.linear([[0, 1, -1]]))
    x = start(robot, q)
    reach = float(np.linalg.norm(robot.pose(np.zeros(3))[:3, 3]))
    ended(hk.certify(G, hk.line(x, x / np.linalg.norm(x) * reach), q, limits=False), Extent.END, "99")
    assert hk.certify(G, hk.line(x, x / np.linalg.norm(x) * (reach - 0.01)), q, limits=False).whole


@pytest.mark.campaign
def test_a_box_that_holds_a_singular_pose_of_an_arm_angle_is_proven_only_in_part(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The conventional one of an iiwa, with the wrist over the shoulder 1 cm from the middle of a row of poses."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # a compiler takes five times as long as both proofs
    robot, q = hk.load("iiwa14"), np.array([0.0, -0.5, 0.0, -1.4, 0.0, 0.6, 0.0])
    regular, conventional = (
        hk.holonomic(hk.pose(robot), hk.arm_angle(definition=d)) for d in ("stereographic", "conventional")
    )
    x = start(robot, q)
    q = hk.follow(regular, hk.line(x, x - [0.1, 0, 0]), q, samples=20, limits=False).q[-1]
    box = hk.workspace(box=(start(robot, q), (0.011, 0.0, 0.0)), rotation=robot.pose(q)[:3, :3])
    proof = hk.certify(conventional, box, q, limits=False, budget=300)
    ended(proof, Extent.BUDGET, "the pose at [0.126656")
    assert (proof.proven.boxes.low[:, 0] > -0.99).all()  # of the end where it is singular nothing
    assert hk.certify(regular, box, q, limits=False, budget=100).whole


JOB = SOUND["title"] + SOUND["robot"] + SOUND["start"] + SOUND["path"]
LOCK = '[strategies.lock]\nkind = "lock"\njoints = [2]\n'


def test_a_spent_budget_ends_the_command_with_1_and_leaves_a_file_that_holds(tmp_path: Path) -> None:
    pytest.importorskip("flint")
    job = tmp_path / "small.toml"
    job.write_text(JOB + LOCK, "utf-8")
    call = CliRunner().invoke
    found = call(app, ["certify", str(job), "--budget", "9", "--out", str(tmp_path)])
    assert found.exit_code == 1 and "allow more with budget=" in found.output.replace("\n", " ")
    file = tmp_path / "small-proof" / "lock-certificate.json"
    data = json.loads(file.read_text("utf-8"))
    assert not data["claims"]["whole"] and 0 < file.read_text("utf-8").count('"q0"') <= 9
    again = call(app, ["check-certificate", str(file)])
    assert again.exit_code == 0 and "a part of what was asked" in again.output


def test_without_python_flint_a_proof_is_found_and_its_checker_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "flint", None)
    monkeypatch.delitem(sys.modules, "holokin.proof.checker", raising=False)
    job = tmp_path / "small.toml"
    job.write_text(JOB + LOCK, "utf-8")
    call = CliRunner().invoke
    found = call(app, ["certify", str(job), "--out", str(tmp_path)])
    assert found.exit_code == 0, found.output
    again = call(app, ["check-certificate", str(tmp_path / "small-proof" / "lock-certificate.json")])
    assert isinstance(again.exception, MissingExtraError) and "holokin[proof]" in str(again.exception)


def test_a_start_off_the_path_or_a_strategy_without_leaves_is_named_by_the_command(tmp_path: Path) -> None:
    """The first ends it with 2 in `main`, as any bad input; the second is said, and the others are done."""
    call, job = CliRunner().invoke, tmp_path / "small.toml"
    far = '[path]\nkind = "polyline"\npoints = [[1.0, 0.0], [1.1, 0.0]]\n'
    job.write_text(JOB.replace(SOUND["path"], far) + LOCK, "utf-8")
    found = call(app, ["certify", str(job), "--out", str(tmp_path)])
    assert isinstance(found.exception, JobError) and "the start of the path" in str(found.exception)
    job.write_text(JOB + SOUND["strategies"] + LOCK, "utf-8")
    found = call(app, ["certify", str(job), "--out", str(tmp_path)])
    assert found.exit_code == 0 and "moore-penrose: not certified: it has no leaves" in found.output


def test_a_box_of_the_other_elbow_is_not_proven_for_a_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Were the inverse kinematics to lead to the other branch, its cells would say nothing of the start."""
    arm = hk.load("planar-3r")
    G, q0 = hk.holonomic(hk.position(arm), hk.lock(0)), np.array([0.2, 0.9, 0.7])
    p = arm.pose(q0)[:3, 3]
    elbow = np.array([0.2, 1.6, -0.7])
    assert np.abs(arm.pose(elbow)[:3, 3] - p).max() < 1e-12
    space = hk.workspace(box=(p, [0.01, 0.01, 0.0]))
    assert hk.certify(G, space, q0).whole
    monkeypatch.setattr("holokin.proof.box_proof.ik", lambda *_, **_more: lambda _pose: elbow)
    found = hk.certify(G, space, q0)
    assert found.extent is Extent.APART and found.where == "the start"
    assert np.abs(found.cells.q0[0] - elbow).max() < 0.1


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.campaign) for seed in range(1, 20))])
def test_a_joint_that_is_held_at_its_limit_is_refused_as_that_and_not_as_singular(seed: int) -> None:
    """The posture is regular, is followed, found and commanded: what is not proven is that it keeps off the limit."""
    rng = np.random.default_rng(seed)
    robot = hk.from_dh([{"a": 1.0, "lower": -2.0, "upper": 2.0} for _ in range(3)], name="bars")
    G = hk.holonomic(hk.position(robot, rows=[0, 1]), hk.lock(k := int(rng.integers(3))))
    q = rng.uniform(-1.5, 1.5, 3)
    q[k] = rng.choice([-2.0, 2.0])
    while G.gain(q)[1] < 0.1:  # nearly singular
        q[[(k + 1) % 3, (k + 2) % 3]] = rng.uniform(-1.5, 1.5, 2)
    T = robot.pose(q)
    box = hk.workspace(box=(T[:3, 3], [0.01, 0.01, 0.0]), rotation=T[:3, :3])
    path = hk.line(T[:3, 3], T[:3, 3] + [0.005, 0.005, 0.0])
    for where in (box, path):
        proof = hk.certify(G, where, q)
        assert (
            proof.extent is Extent.LIMIT and f"q{k + 1} is at its limit or beyond it" in str(proof) and len(proof) == 0
        )
    assert hk.follow(G, path, q, samples=5).status is hk.motion.Status.COMPLETE
    assert hk.ik(G, q, limits=True).nearest(T[:3, 3] + [0.005, 0.005, 0.0]).status == 0
    control = hk.controller(G, dt=0.01, q0=q)
    control.step(q, T[:3, 3] + 1e-5, np.full(3, 1e-3))
    assert control.status is hk.motion.StepStatus.OK
    assert not hk.unique_region(G, q, box, budget=200).whole


# --- What a path's certificate says where the tool comes to a pose again: the joints return, or they are others.

PLANAR, Q = hk.load("planar-3r"), np.array([-3.0, 0.9, 0.9])


def round_base(a: list[float], q: np.ndarray = Q) -> tuple[hk.strategies.HolonomicStrategy, hk.Path]:
    """A linear constraint of a planar arm, and a circle round its base."""
    x = start(PLANAR, q)
    return hk.holonomic(hk.position(PLANAR), hk.linear([a])), hk.circle(x, center=(0.0, 0.0, x[2]))


def half_angle() -> tuple[hk.strategies.HolonomicStrategy, np.ndarray]:
    """A PPR arm whose q3 is half the direction of the tool from the base: round it, q3 goes on by half a turn."""
    robot = hk.load("ppr")

    def g(q: casadi.SX) -> casadi.SX:
        return 2 * q[2] - casadi.atan2(q[1] + casadi.sin(q[2]), q[0] + casadi.cos(q[2]))

    return hk.holonomic(hk.position(robot), hk.custom(g, angular=True)), np.array([0.5, 0.3, 0.2])


@pytest.fixture(scope="module")
def drifting() -> Certificate:
    return hk.certify(*round_base([0.02, 0.0, 1.0]), Q, limits=False)


def test_a_closed_path_that_leaves_the_joints_elsewhere_is_not_proven_and_its_drift_is(
    drifting: Certificate,
) -> None:
    """The joints at its end, by following it."""
    walk = hk.follow(*round_base([0.02, 0.0, 1.0]), Q, limits=False)
    moved = walk.q[-1] - walk.q[0]
    assert drifting.extent is Extent.ELSEWHERE and not drifting.whole and drifting.covered
    assert drifting.gap == np.inf and moved[0] > 6
    assert (drifting.revisit.low <= moved + 1e-9).all() and (moved - 1e-9 <= drifting.revisit.high).all()
    assert (drifting.revisit.high - drifting.revisit.low < 1e-9).all()
    assert "function of the pose" not in drifting.theorem and "q1 by 6.2315" in drifting.theorem


@pytest.mark.campaign
def test_joints_return_where_the_proof_is_whole_whatever_the_law_and_the_circle() -> None:
    """Drawn at random: starts, circles round the base and beside it, strategies in which q1 counts and does not."""
    rng, ends = np.random.default_rng(26), []
    for k in range(8):
        q = np.array([rng.uniform(-3, 3), *rng.uniform(0.5, 1.2, 2)])
        a = [rng.uniform(-0.06, 0.06) * rng.integers(0, 2), rng.uniform(-0.5, 0.5), 1.0]
        x = start(PLANAR, q)
        G = hk.holonomic(hk.position(PLANAR), hk.linear([a]))
        center = np.zeros(3) if k % 4 else x - [*rng.uniform(0.05, 0.3, 2), 0]
        path = hk.circle(x, center=(*center[:2], x[2]))
        proof = hk.certify(G, path, q, limits=False)
        if proof.covered:
            moved = np.ptp(hk.follow(G, path, q, limits=False).q[[0, -1]], axis=0)
            assert proof.whole == bool((np.abs(moved - np.abs(2 * np.pi * proof.turns)) < 1e-6).all()), proof.theorem
            ends.append(proof.whole)
    assert len(ends) >= 6 and 0 < sum(ends) < len(ends)


def test_an_open_path_that_crosses_itself_is_judged_by_the_joints_at_the_crossing() -> None:
    """Round the base and back to a crossing q3 is half a turn on; beside the base it is as it was."""
    G, q = half_angle()
    x = start(G.task.robot, q)
    corners = [[-0.5, 1, 0], [-1, -1, 0], [1.5, -1.0, 0], [1.4, 1.5, 0]]
    proof = hk.certify(G, hk.polyline([x, *corners]), q)
    assert proof.extent is Extent.ELSEWHERE and proof.covered
    np.testing.assert_allclose((proof.revisit.low[2], proof.revisit.high[2]), np.pi, atol=1e-9)
    (i, u), (k, v) = proof.revisit.first, proof.revisit.second
    ends = np.array([x, *corners])
    np.testing.assert_allclose(ends[i] + u * (ends[i + 1] - ends[i]), ends[k] + v * (ends[k + 1] - ends[k]), atol=2e-9)
    for points in ([x, x + [0.5, 0, 0], x + [0.5, 0.5, 0], x + [0.2, -0.3, 0]], [x, x + [0.5, 0, 0], x]):
        proof = hk.certify(G, hk.polyline(points), q)
        assert proof.whole and "comes back to a tool pose, the joints are the same" in proof.theorem


@pytest.mark.campaign
def test_a_second_lap_with_other_joints_is_found_though_all_of_it_lies_on_the_first() -> None:
    """Twice round, q3 has made one whole turn: the end is the beginning, and what is between is not."""
    G, q = half_angle()
    x = start(G.task.robot, q)
    lap = hk.circle(x, center=(0, 0, 0))
    assert hk.certify(G, lap + lap, q).extent is Extent.ELSEWHERE
    assert hk.certify(G, lap + hk.line(x, x + [0.1, 0, 0]), q).extent is Extent.ELSEWHERE
    planar, path = round_base([0.0, 1.0, -1.0])  # the joints of the second lap are a whole turn on: the same posture
    proof = hk.certify(planar, path + path, Q, limits=False)
    assert proof.whole and "but for the whole turns" in proof.theorem


@pytest.mark.campaign
def test_near_by_is_not_the_same_and_what_is_not_decided_is_not_proven() -> None:
    """Lines 1e-6 m apart after a way round the base have no common pose; of tubes too small nothing is known."""
    G, q = half_angle()
    robot = G.task.robot
    x = start(robot, q)
    path = hk.polyline([x, [-0.5, 1, 0], [-1, -1, 0], [1.5, -1, 0], x + [0.1, -1e-6, 0], x + [-0.1, -1e-6, 0]])
    assert hk.certify(G, path, q).extent is Extent.WHOLE
    there_and_back = hk.polyline([x, x + [0.3, 0, 0], x])
    proof = hk.certify(G, there_and_back, q)
    domain = Pathway(proof.equation, proof.c, (), proof.pieces, np.ones(2), np.zeros((2, PARTS)))
    small = replace(proof.proven, findings=replace(proof.findings, alone=0.0 * proof.findings.alone))
    assert Revisits(domain, proof.proven).anywhere() == (Extent.WHOLE, None)
    assert Revisits(domain, small).anywhere() == (Extent.RETURN, None)
    assert Revisits(domain, small).end() == (Extent.RETURN, None)


def test_the_command_line_ends_with_1_where_a_closed_path_drifts_and_says_by_how_much(tmp_path: Path) -> None:
    job, call, q = tmp_path / "round.toml", CliRunner().invoke, np.array([-3.13, 0.9, 0.9])
    center = (-start(PLANAR, q)).tolist()
    job.write_text(
        f'title = "round the base"\n[robot]\nname = "planar-3r"\n[start]\nq = {q.tolist()}\n[task]\nkind = "position"\n'
        f'[path]\nkind = "circle"\ncenter = {center}\nrelative = true\n'
        '[strategies.home]\nkind = "linear"\nmatrix = [[0.02, 0, 1]]\n',
        "utf-8",
    )
    found = call(app, ["certify", str(job), "--out", str(tmp_path)])
    assert found.exit_code == 1, found.output + repr(found.exception)
    text = " ".join(found.output.split())
    assert "drifts" in text and "at the end of the path the tool is where it was at its start" in text
    facts = json.loads((tmp_path / "round-proof" / "result.json").read_text("utf-8"))["strategies"]["home"]
    assert not facts["proven"] and 6.2 < facts["drift"]["least"][0] < facts["drift"]["most"][0] < 6.3
    again = call(app, ["check-certificate", str(tmp_path / "round-proof" / "home-certificate.json")])
    assert again.exit_code == 0 and "covers all that was asked" not in again.output


def test_the_tool_poses_that_are_compared_hold_those_of_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of random parts of cells, halved up to and beyond what is enclosed at once; some cells as small as rounding."""
    made: list[Revisits] = []
    monkeypatch.setattr(Revisits, "anywhere", lambda self: made.append(self) or (Extent.WHOLE, None))
    q = np.array([0.3, 0.9, 0.9])
    G, x = hk.holonomic(hk.position(PLANAR), hk.linear([[0, 1, -1]])), start(PLANAR, q)
    hk.certify(G, hk.circle(x, center=x - [0.1, 0, 0]), q, limits=False)
    rng, found = np.random.default_rng(0), made[0].proven
    low, high = found.boxes.low.copy(), found.boxes.high.copy()
    high[-1], low[-2] = low[-1] + 2.0**-50, high[-2] - 2.0**-50
    tiny = Revisits(made[0].domain, replace(found, boxes=replace(found.boxes, low=low, high=high)))
    for level in range(ONCE + 2):
        cell = np.concatenate([rng.integers(0, len(found), 60), np.repeat(len(found) - np.array([1, 2]), 20)])
        parts = Parts(cell, low[cell, 0], high[cell, 0])
        for _ in range(level):
            upper = rng.random(len(cell)) < 0.5
            one, other = parts.half(False), parts.half(True)
            parts = Parts(cell, np.where(upper, other.low, one.low), np.where(upper, other.high, one.high))
        below, above = tiny._poses_at(parts, level)
        for u in (parts.low, (parts.low + parts.high) / 2, parts.high):
            least, most = tiny._poses(Parts(cell, u, u))
            assert (below <= (least + most) / 2).all() and ((least + most) / 2 <= above).all()
