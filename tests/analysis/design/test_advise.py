"""The advice: laws that fit, compared on a workspace; its tips, starts and words; the command and its job file."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, R3_START, Command, campaign, fails, urdf
from holokin.analysis.coverage import fitting_task, locked_joints, regular_starts
from holokin.analysis.coverage.cover_workspace import largest_part
from holokin.analysis.coverage.leaf_lines import along_leaf, along_radial
from holokin.analysis.coverage.starts import candidates, postures_at, unwound
from holokin.analysis.coverage.tool_chain import chain_to_tool
from holokin.analysis.design import Advice, advice_case, nearby_cusps
from holokin.analysis.design.advice_words import lines
from holokin.analysis.design.trials import EASY, EQUAL, RatedStrategy, more_speed, ranked
from holokin.app.job import open_job, run_job
from holokin.app.report.advice_report import bars_height, name_bars
from holokin.base.errors import (
    ArgumentError,
    JointLimitError,
    NotFiniteError,
    OutOfReachError,
    RobotFileError,
    RowsError,
    UnknownNameError,
)
from holokin.path.workspaces import pose_cloud

PLANE = hk.workspace(box=([1.2, 0.4, 0.0], [0.25, 0.25, 0.0]), rotation=np.eye(3))


def arm(limits: dict[int, float] | None = None) -> hk.Robot:
    """A planar arm of three links of a metre, joints in +-2.6 rad but for those named."""
    wide = [(limits or {}).get(i, 2.6) for i in range(3)]
    return hk.from_dh([{"a": 1.0, "lower": -w, "upper": w, "max_velocity": 2.0} for w in wide], name="planar")


def least_anywhere(task: hk.Task, space: hk.Workspace) -> float:
    """The least mean squared joint speed within the limits, on a grid of each self-motion of the arm."""
    least = []
    for pose in space.poses(40):
        p = pose[:2, 3]
        turns = np.linspace(-np.pi, np.pi, 721)
        wrist = p - np.stack([np.cos(turns), np.sin(turns)], axis=1)  # where the third joint is
        far = np.linalg.norm(wrist, axis=1)
        ok = (far < 2) & (far > 1e-3)
        for sign in (1, -1):
            q2 = sign * np.arccos(np.clip(far[ok] ** 2 / 2 - 1, -1, 1))
            q1 = np.arctan2(wrist[ok, 1], wrist[ok, 0]) - q2 / 2
            Q = np.stack([q1, q2, (turns[ok] - q1 - q2 + np.pi) % (2 * np.pi) - np.pi], axis=1)
            J = task.jacobian_batch(Q[task.robot.within(Q)])[0]
            least.append(np.min(np.sum(np.linalg.pinv(J) ** 2, axis=(1, 2)), initial=np.inf))
    return float(np.min(np.reshape(least, (-1, 2)), axis=1).mean())


@pytest.fixture(scope="module", params=[8, campaign("less", 1)])
def advice(request: pytest.FixtureRequest) -> Advice:
    """Of poses, of those of a design and of starts as many as users have, or an eighth."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name in ((advice_case, "POSES"), (advice_case, "DESIGNED"), (nearby_cusps, "STARTS")):
            patch.setattr(module, name, getattr(module, name) // request.param)
        return hk.advise(hk.position(arm()), PLANE)


def test_the_best_law_serves_the_workspace_near_the_least_speed(advice: Advice) -> None:
    """Referee: `coverage` of the best law at other poses, and the pseudo-inverse on a grid of each self-motion."""
    best = advice.best
    assert best.coverage == 1.0
    assert hk.coverage(best.strategy, PLANE, best.q0, samples=200, seed=7).share == 1.0
    found = least_anywhere(advice.task, PLANE)
    assert advice.floor == pytest.approx(found, rel=0.02)
    assert 1.0 <= best.speed < 1.03
    assert all(law.speed > 0.999 for law in advice.strategies if law.coverage > 0.5)


def test_every_law_that_fits_is_in_the_table_and_the_order_is_the_ranking(advice: Advice) -> None:
    names = {law.name for law in advice.strategies}
    expected = {"lock q1", "lock q2", "lock q3", "radial", "stationary centring", "stationary manipulability"}
    assert expected <= names
    assert any(" - " in name or " + " in name for name in names)
    assert any(name.startswith("designed from") for name in names)
    assert [law.name for law in ranked(advice.strategies)] == [law.name for law in advice.strategies]
    shares = [law.easy for law in advice.strategies]
    assert all(b <= a + EASY + EQUAL for a, b in pairwise(shares))
    assert advice.reasons[0].startswith(f"Take {advice.best.name!r}")
    assert advice.best.name in str(advice) and advice.part is None


@pytest.mark.campaign
def test_the_same_advice_is_given_twice() -> None:
    advice, again = (hk.advise(hk.position(arm()), PLANE) for _ in range(2))
    assert [law.name for law in again.strategies] == [law.name for law in advice.strategies]
    assert np.array_equal(again.q0, advice.q0)
    assert again.to_dict() == advice.to_dict()


@pytest.mark.campaign
def test_a_narrow_limit_is_avoided_and_named() -> None:
    """Joint 3 may turn by 0.2 rad alone: a law that turns it more loses poses, and the advice does not take it."""
    far = hk.workspace(box=([1.9, 0.4, 0.0], [0.25, 0.25, 0.0]), rotation=np.eye(3))
    narrow = hk.advise(hk.position(arm({2: 0.2})), far)
    at = {law.name: law.coverage for law in narrow.strategies}
    assert at[narrow.best.name] == at["lock q3"] == 1.0
    assert at["lock q2"] < 0.9
    assert 1.0 <= narrow.best.speed < 1.1
    assert narrow.floor == pytest.approx(least_anywhere(narrow.task, far), rel=0.02)


def test_no_start_has_a_whole_turn_too_many() -> None:
    """Joints of two turns and more: postures at one place stay what they are, at most half a turn from mid range."""
    rows = [{"a": 1.0, "lower": low, "upper": high} for low, high in ((-6.3, 6.3), (-1.0, 12.0), (-2.6, 2.6))]
    robot = hk.from_dh(rows, name="wound")
    Q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (200, 3))
    found = unwound(robot, Q)
    assert np.abs(np.array([robot.pose(q) for q in Q]) - [robot.pose(q) for q in found]).max() < 1e-12
    assert (np.abs(found - [0, 5.5, 0]) <= np.pi + 1e-12).all()
    assert (np.abs(found - Q).max(axis=0) > 6).tolist() == [True, True, False]
    starts = postures_at(hk.position(robot), robot.pose([0.4, 5.0, 0.5]))
    assert (np.abs(starts - [0, 5.5, 0]) <= np.pi + 1e-12).all()
    one_side = hk.from_dh([{"a": 1.0, "lower": -0.5}, {"a": 1.0}])
    assert np.array_equal(unwound(one_side, np.array([[5.6, 7.0]])), [[5.6, 7.0 - 2 * np.pi]])


@pytest.mark.campaign
def test_where_no_law_serves_the_whole_the_part_is_told_and_served() -> None:
    wide = hk.workspace(box=([2.2, 0.0, 0.0], [1.2, 0.8, 0.0]), rotation=np.eye(3))
    found = hk.advise(hk.position(arm()), wide)
    assert 0.3 < found.best.coverage < 1.0
    assert any("out of reach" in sentence for sentence in found.reasons)
    part = found.part
    assert part is not None and 0.1 < part.share < 1.0
    assert hk.coverage(part.strategy.strategy, part.workspace, part.strategy.q0, samples=200, seed=3).share > 0.985
    farthest = np.linalg.norm(part.workspace.solid.center[:2] + part.workspace.solid.half[:2])
    assert farthest < 3.0


def test_the_largest_part_of_a_known_disc_is_found() -> None:
    """Poses are served up to 0.6 m from the origin: of a sphere of 1 m the part has the share 0.6."""
    space = hk.workspace(sphere=([0, 0, 0], 1.0))

    def near(T: np.ndarray) -> np.ndarray:
        return np.linalg.norm(T[:, :3, 3], axis=1) < 0.6

    T = space.poses(256)
    found = largest_part(space, T, near(T), lambda T: bool(near(T).all()))
    assert found is not None
    assert 0.55 < found[0] <= 0.62
    assert largest_part(space, T, near(T) & False, lambda T: False) is None


def test_lines_side_by_side_end_where_inverse_kinematics_ends() -> None:
    task = hk.pose(hk.load("panda"))
    space = hk.workspace(
        box=([0.45, 0.1, 0.4], [0.1, 0.2, 0.1]), rotation=task.robot.pose(PANDA_START)[:3, :3], tilt=0.2
    )
    T, law = space.poses(24), hk.holonomic(task, hk.lock(2))
    ends = along_leaf(law, PANDA_START[None], T)
    closely = hk.ik(law, PANDA_START).batch(T)
    assert ends.reached[0].sum() >= 22
    both = ends.reached[0] & closely.reached
    assert np.abs(ends.q[0][both] - closely.q[both]).max() < 1e-7


@pytest.mark.parametrize("name", ["planar", campaign("name", "panda")])
def test_radial_lines_end_where_the_inverse_of_radial_ends(name: str) -> None:
    task, q0 = (hk.pose(hk.load("panda")), PANDA_START) if name == "panda" else (hk.position(arm()), R3_START)
    at = task.robot.pose(q0)
    words = {"box": (at[:2, 3], [0.2, 0.2])} if name == "planar" else {"box": (at[:3, 3], [0.1] * 3), "tilt": 0.2}
    T = hk.workspace(**words, rotation=at[:3, :3]).poses(4)
    exact = hk.ik(hk.radial(hk.moore_penrose(task), q0, steps=16), q0)
    assert np.abs(along_radial(task, q0[None], T).q[0] - [exact(pose) for pose in T]).max() < 2e-4


@pytest.mark.parametrize(
    ("file", "tip", "joints"),
    [
        ("panda.urdf", "panda_hand_tcp", 7), ("xarm7.urdf", "link_eef", 7), ("tiago.urdf", "hand_grasping_frame", 8),
        ("talos_full_v2.urdf", "arm_left_7_link", 9), ("ur5_robot.urdf", "tool0", 6),
        ("pr2.urdf", "r_gripper_tool_frame", 8),
        ("g1_29dof_with_hand_rev_1_0.urdf", "left_hand_palm_link", 10), ("so100.urdf", "gripper", 5),
    ],
)  # fmt: skip
def test_the_tip_is_the_palm_of_the_longest_arm(file: str, tip: str, joints: int) -> None:
    """Fingers, legs and heads are no arms; of two hands it is the first one in the file."""
    found = chain_to_tool(urdf(file)).tip
    robot = hk.from_urdf(urdf(file), tip=found)
    assert robot.n == joints
    if file != "talos_full_v2.urdf":
        assert found == tip
    assert not any(word in name for name in robot.joint_names for word in ("finger", "thumb", "leg", "head"))


def test_the_answer_begins_with_the_strategy_to_take_and_names_the_arm_and_the_tips_that_were_not_taken(
    advice: Advice,
) -> None:
    chain = chain_to_tool(urdf("pr2.urdf"))
    assert (chain.base, chain.tip, chain.chosen) == ("base_footprint", "r_gripper_tool_frame", True)
    assert chain.others == ("l_gripper_tool_frame",)
    given = chain_to_tool(urdf("pr2.urdf"), tip=chain.others[0], base="torso_lift_link")
    assert (given.robot.n, given.others, given.chosen) == (7, ("r_gripper_tool_frame",), False)
    first, *_, last = str(advice).splitlines()
    assert first.startswith(f"Take {advice.best.name!r}: ")
    assert len(advice.reasons) <= 8 and advice.reasons[1].startswith("It serves 100.0% of the workspace")
    assert last.startswith("planar: 3 joints, q1 to q3, tip tool. Task: position of planar. Workspace: box")
    fails(ArgumentError, "only files of models", lambda: chain_to_tool(arm(), base="world"))


def test_starts_hold_the_pose_within_the_limits_and_lie_apart(panda: hk.Robot) -> None:
    task = fitting_task(panda)
    first = regular_starts(task)[0]
    found = postures_at(task, panda.pose(first))
    assert len(found) == 8
    for q in found:
        panda.check_limits(q)
        assert np.abs(panda.pose(q) - panda.pose(first)).max() < 1e-3
    gaps = np.linalg.norm(found[:, None] - found[None], axis=2) + 10 * np.eye(len(found))
    assert gaps.min() > 0.3
    assert locked_joints(task, first) == [int(np.argmax(np.abs(task.null_space(first))))]


@pytest.mark.campaign
def test_two_redundant_joints_get_sets_of_locks_and_the_trunk_below_a_law() -> None:
    robot = hk.from_urdf(urdf("tiago.urdf"), tip="hand_grasping_frame")
    task = fitting_task(robot)
    laws = candidates(task, regular_starts(task)[:3])
    assert all(law.strategy is None or law.strategy.constraint.rows == 2 for law in laws)
    names = [law.name for law in laws]
    assert any(name.count(",") == 1 and name.startswith("lock") for name in names)
    assert any(name.startswith("lock torso_lift_joint over") for name in names)
    assert "stationary centring" in names and names[-1] == "radial"


@pytest.mark.campaign
def test_an_arm_of_five_joints_is_advised_on_positions_and_on_directions() -> None:
    """An SO-101: two joints too many for the tool's position, none for its position and axis."""
    space = hk.workspace(box=([0.22, 0, 0.15], [0.04, 0.06, 0.03]))
    found = hk.advise(hk.position(hk.load("so101")), space)
    assert found.best.strategy.task.n - found.best.strategy.task.m == 2
    assert found.best.coverage > 0.95
    fails(RowsError, "n = 5 joints", lambda: hk.advise(hk.pose(hk.load("so101")), space))


def test_bad_input_is_refused_with_a_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(advice_case, "POSES", 16)
    with pytest.raises(OutOfReachError, match="nearer to the base"):
        hk.advise(hk.position(arm()), hk.workspace(box=([9.0, 0, 0], [0.1, 0.1, 0])))
    fails(ArgumentError, r"hk\.ik", lambda: hk.advise(hk.pose(hk.load("irb140"))))
    fails(NotFiniteError, "", lambda: hk.advise(hk.position(arm()), PLANE, q0=[0.1, np.nan, 0.2]))
    fails(JointLimitError, "q2", lambda: hk.advise(hk.position(arm()), PLANE, q0=[0.1, 3.0, 0.2]))
    fails(UnknownNameError, "panda_hand_tcp", lambda: chain_to_tool(urdf("panda.urdf"), tip="panda_hand_tpc"))
    fails(ArgumentError, "two, to be redundant", lambda: fitting_task(hk.from_dh([{"a": 1.0}])))
    with pytest.raises(ArgumentError, match=r"give a Task, as hk\.pose\(robot\) makes it"):
        hk.advise(arm(), PLANE)  # type: ignore[arg-type]
    fails(ArgumentError, "", lambda: hk.advise(hk.position(arm()), pose_cloud([arm().pose(R3_START)])))
    with pytest.raises(RobotFileError, match=r"range of joint 'joint1' is from 0 to 0, at speed 0; fill in"):
        hk.advise(fitting_task(hk.load(urdf("double_pendulum.urdf"))))  # its exporter left all limits at 0


@pytest.mark.campaign
def test_the_command_writes_a_job_that_runs_and_a_picture(holokin: Command, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    outcome = holokin("advise", "planar-3r", "--box", "1.2 0.4 0.25 0.25", "--out", file)
    assert (outcome.code, outcome.err) == (0, "")
    command = outcome.out.splitlines()[-1].removeprefix("certify it by: holokin ").split()
    assert command == ["certify", str(file), "--workspace"]
    assert holokin(*command, "--out", tmp_path).code == 0
    assert "Take " in outcome.out and "holokin run" in outcome.out
    assert "seconds" in outcome.out.splitlines()[0]
    assert file.with_suffix(".png").stat().st_size > 20_000
    name, job, path = open_job(str(file))
    result = run_job(name, job.model_copy(update={"verdict": job.verdict.model_copy(update={"samples": 4})}), path)
    assert result.passed
    law = next(s for s in result.strategies if s.name == "advised")
    assert law.metrics["coverage"] == 1.0
    assert law.metrics["drift_total"] < 1e-9


def test_the_names_of_laws_do_not_overlap_in_the_picture() -> None:
    """Joints of a PR2 have long names: a name of four lines beside names of one."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    long = "lock torso_lift_joint over r_upper_arm_roll_joint - r_forearm_roll_joint"
    names = (f"designed from {long}", "radial", *[long] * 10)
    laws: Any = [SimpleNamespace(name=name, candidate=SimpleNamespace(strategy=None)) for name in names]
    figure = Figure(figsize=(7.3, 2 * bars_height(laws)))
    axes = name_bars(figure.add_axes((0.31, 0.2, 0.3, 0.5)), laws)
    FigureCanvasAgg(figure).draw()
    boxes = [label.get_window_extent() for label in axes.get_yticklabels()]
    assert len(boxes) == 12
    assert all(upper.y0 > lower.y1 for upper, lower in pairwise(boxes))


def test_the_picture_of_advice_can_be_read_on_a_page_and_nothing_of_it_is_cut_off(advice: Advice) -> None:
    from matplotlib.text import Text

    from holokin.app.report.advice_report import advice_figure
    from holokin.app.report.plots import legible

    figure = legible(advice_figure(advice))
    figure.canvas.draw()
    shown = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    for panel in figure.axes[:3]:
        advised, *others = [bar.get_facecolor() for bar in panel.patches]
        assert advised not in others, "the bar of the advice is darker"
        assert any(text.get_fontweight() == "bold" for text in panel.texts), "the best number is bold"
    share = min(1.0, 7.3 / figure.get_figwidth())
    assert len(shown) > 10 and share * min(text.get_fontsize() for text in shown) > 7.99
    box, edge = figure.get_tightbbox(), 0.01  # inches
    assert min(box.x0, box.y0) > -edge
    assert box.x1 < figure.get_figwidth() + edge and box.y1 < figure.get_figheight() + edge


def rated(name: str, joint: int, coverage: float, speed: float) -> RatedStrategy:
    strategy = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(joint))
    served = np.arange(100) < 100 * coverage
    return RatedStrategy(
        name,
        (),
        {"kind": "lock", "joints": ["j"]},
        strategy,
        PANDA_START,
        coverage,
        served,
        coverage,
        0.1,
        "j",
        0.1,
        speed,
        speed,
    )


def test_of_strategies_alike_that_which_is_proven_comes_first_and_what_it_costs_is_said() -> None:
    """Joint 7 held is proven, joints 3 and 5 are not; the latter has a closed form all the same."""
    plain, proven = rated("lock 3", 2, 1.0, 1.0), rated("lock 7", 6, 1.0, 1.21)
    assert [entry.name for entry in ranked([plain, proven])] == ["lock 7", "lock 3"]
    told = lines([proven, plain], {}, [], None)
    assert any(text.startswith("Equal tool poses have equal joints on the whole arm: proven") for text in told)
    assert "joint speed counts more than that proof: it serves 100.0% and needs 9% less joint speed" in told[-1]
    far, less = rated("lock 7", 6, 1.0, 1.4), rated("lock 7", 6, 0.6, 1.0)
    assert [ranked([plain, other])[0].name for other in (far, less)] == ["lock 3", "lock 3"]
    cusps: Any = {"lock 3": SimpleNamespace(sentence="a cusp lies in it")}
    told = lines([plain, less], cusps, [], None)
    assert "It is not proven on the whole arm: a cusp lies in it." in told
    assert "one function on the whole arm, which is proven of it: it serves 60.0%" in told[-1]
    quartic = rated("lock 5", 4, 1.0, 1.02)
    assert ranked([plain, quartic])[0] is plain
    assert not any("proven of it" in text for text in lines([plain, quartic], cusps, [], None))


def test_what_it_costs_is_said_without_signs() -> None:
    words = {1.1: "10% more joint speed than", 0.96: "4% less joint speed than", 1.001: "no more joint speed than"}
    assert {ratio: more_speed(ratio) for ratio in words} == words
    assert more_speed(2.5) == "2.5 times as much joint speed as"


@pytest.mark.campaign
@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("name", ["fr3", "panda", "iiwa14", "xarm7"])
def test_a_level_that_stands_still_along_a_self_motion_is_no_stretch_of_it(name: str) -> None:
    """On some self-motions a joint does not move: its level changes by round-off there, and no posture is beside it."""
    found = hk.advise(hk.pose(hk.load(name)))
    assert found.best.served > 0.9
