"""What must not be proven: singular postures and limits that are only touched, and input that is no use for a proof."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import holokin as hk
from conftest import SOUND
from holokin.app.cli.main import app
from holokin.base.errors import JobError, JointLimitError, MissingExtraError
from holokin.proof import Certificate, Extent

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


def tool(strategy: hk.Strategy, q: np.ndarray) -> np.ndarray:
    return strategy.task.robot.pose(q)[:3, 3]


def ended(proof: Certificate, extent: Extent, place: str = "") -> None:
    """Refused for one reason at one place, with what was proven up to there."""
    assert proof.extent is extent and not proof.whole, proof.theorem
    assert proof.where.startswith(place), proof.where
    assert len(proof) > 0
    assert str(proof).startswith(f"Not all is proven, since at {proof.where} {extent.cause}")


@pytest.mark.campaign
def test_a_joint_that_only_touches_its_limit_is_refused_there(slider: hk.strategies.HolonomicStrategy) -> None:
    """At the end of a path, in a corner, at the tangent of a circle: what is proven stays within the limit."""
    x = tool(slider, SLIDING)
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
    x = tool(slider, SLIDING)
    proof = hk.certify(slider, hk.line(x, x + [0.25 - 1e-6, 0.0, 0.0]), SLIDING)
    assert proof.whole and 0 < proof.to_limit[0] <= 1e-6


@pytest.mark.campaign
def test_a_joint_that_goes_beyond_its_limit_or_begins_at_it_is_refused(slider: hk.strategies.HolonomicStrategy) -> None:
    """Nothing is proven from a start at the limit; a start beyond it is an error."""
    x = tool(slider, SLIDING)
    ended(hk.certify(slider, hk.line(x, x + [0.3, 0.0, 0.0]), SLIDING), Extent.LIMIT, "83")
    at = np.array([0.5, 0.0, 0.7])
    proof = hk.certify(slider, hk.line(tool(slider, at), x), at)
    assert proof.extent is Extent.LIMIT and not len(proof) and str(proof).startswith("Nothing is proven")
    beyond = np.array([0.6, 0.0, 0.7])
    with pytest.raises(JointLimitError):
        hk.certify(slider, hk.line(tool(slider, beyond), x), beyond)


def test_a_posture_that_is_singular_at_the_very_end_of_a_path_is_refused() -> None:
    """A planar arm that becomes straight there, and not before."""
    robot, q = hk.load("planar-3r"), np.array([0.3, 0.3, 0.3])
    law = hk.holonomic(hk.position(robot), hk.linear([[0, 1, -1]]))
    x = tool(law, q)
    reach = float(np.linalg.norm(robot.pose(np.zeros(3))[:3, 3]))
    ended(hk.certify(law, hk.line(x, x / np.linalg.norm(x) * reach), q, limits=False), Extent.END, "99")
    assert hk.certify(law, hk.line(x, x / np.linalg.norm(x) * (reach - 0.01)), q, limits=False).whole


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
    x = tool(regular, q)
    q = hk.follow(regular, hk.line(x, x - [0.1, 0, 0]), q, samples=20, limits=False).q[-1]
    box = hk.workspace(box=(tool(regular, q), (0.011, 0.0, 0.0)), rotation=robot.pose(q)[:3, :3])
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
    law = hk.holonomic(hk.position(robot, rows=[0, 1]), hk.lock(k := int(rng.integers(3))))
    q = rng.uniform(-1.5, 1.5, 3)
    q[k] = rng.choice([-2.0, 2.0])
    while law.gain(q)[1] < 0.1:  # nearly singular
        q[[(k + 1) % 3, (k + 2) % 3]] = rng.uniform(-1.5, 1.5, 2)
    T = robot.pose(q)
    box = hk.workspace(box=(T[:3, 3], [0.01, 0.01, 0.0]), rotation=T[:3, :3])
    path = hk.line(T[:3, 3], T[:3, 3] + [0.005, 0.005, 0.0])
    for where in (box, path):
        proof = hk.certify(law, where, q)
        assert proof.extent is Extent.LIMIT and "a joint is at its limit" in str(proof) and len(proof) == 0
    assert hk.follow(law, path, q, samples=5).status is hk.motion.Status.COMPLETE
    assert hk.ik(law, q, limits=True).nearest(T[:3, 3] + [0.005, 0.005, 0.0]).status == 0
    control = hk.controller(law, dt=0.01, q0=q)
    control.step(q, T[:3, 3] + 1e-5, np.full(3, 1e-3))
    assert control.status is hk.motion.StepStatus.OK
    assert not hk.unique_region(law, q, box, budget=200).whole
