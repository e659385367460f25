"""A dataset on one leaf: same tool poses with one posture each, all else as it was; referee: LeRobot itself."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

import holokin as hk
from conftest import Command, assert_refused, sampled
from holokin.analysis.audit.logs import joint_feature, pose_feature, read_dataset
from holokin.analysis.audit.logs.datasets import rows
from holokin.base.errors import ArgumentError, FileError
from holokin.learning import Retargeted, retarget
from printed import assert_alike
from small_datasets import stats, write_dataset

GOLDEN = Path(__file__).parents[1] / "golden"
PANDA = hk.load("panda")
Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
JOINTS = ("observation.state", "action")
LOCKED = hk.ik(hk.holonomic(hk.pose(PANDA), hk.lock("panda_joint3")), Q0, limits=True)

ARM = hk.load("planar-3r")
NAMES = ["gripper.pos", *(f"{joint}.pos" for joint in ARM.joint_names[::-1])]
START = np.array([0.3, 0.8, 0.5])
PLANAR = hk.ik(hk.holonomic(hk.position(ARM), hk.lock(2)), START, limits=True)


def on_leaf(folder: Path, out: Path, ik: Any = LOCKED, robot: hk.Robot = PANDA, **options: Any) -> Retargeted:
    data = read_dataset(folder)
    return retarget(data, ik, [joint_feature(data, robot, name) for name in JOINTS], out, **options)


def column(folder: Path, name: str) -> np.ndarray:
    return np.vstack([part.values[name] for part in rows(read_dataset(folder), [name])])


def planar_episodes(count: int = 4, length: int = 9) -> list[dict[str, np.ndarray]]:
    rng = np.random.default_rng(2)
    out = []
    for _ in range(count):
        q = START + rng.uniform(-0.3, 0.3, 3) + 0.2 * np.sin(np.linspace(0, 3, length))[:, None] * rng.uniform(-1, 1, 3)
        state = np.hstack([rng.uniform(0, 1, (length, 1)), q[:, ::-1]])
        out.append({"observation.state": state, "action": state + 0.01, "force": rng.uniform(-1, 1, (length, 2))})
    return out


def planar(folder: Path, episodes: list | None = None, **more: Any) -> Path:
    names = {"observation.state": NAMES, "action": NAMES, "force": ["fx", "fy"]}
    return write_dataset(folder, episodes or planar_episodes(), names, robot_type="arm", **more)


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_a_dataset_of_lerobots_own_keeps_its_poses_and_gets_one_posture_for_each(tmp_path: Path, version: str) -> None:
    """Referees: LeRobot's loader read the same numbers, and its compute_episode_stats found the same statistics."""
    facts = json.loads((GOLDEN / f"lerobot-{version}.json").read_text())
    old, new = GOLDEN / f"lerobot-{version}", tmp_path / "new"
    done = on_leaf(old, new)
    assert done.kept < 1e-9 and done.rounded < 1e-6
    for name in JOINTS:
        joints = column(new, name)
        np.testing.assert_allclose(joints, facts["retargeted"][name], atol=3e-7)
        assert np.array_equal(joints[:, 7], column(old, name)[:, 7])  # the gripper
        assert np.abs(joints[:, 2] - Q0[2]).max() < 1e-7  # the locked joint
        here, there = (PANDA.pose_batch(column(folder, name)[:, :7]) for folder in (old, new))
        assert np.abs(here[0] - there[0]).max() < 5e-7 and np.abs(here[1] - there[1]).max() < 1e-6
    mine = read_dataset(new)
    assert mine.features == read_dataset(old).features
    for e, wanted in enumerate(facts["episode stats"]):
        for name in JOINTS:
            found = episode_statistics(new, version, e)[name]
            wide = np.ptp(column(new, name), axis=0).max()
            for what in found:
                off = np.abs(np.ravel(found[what]) - wanted[name].get(what, found[what]))
                assert off.max() < (wide / 5000 if what.startswith("q") else 2e-5), (name, what)  # LeRobot's bins


def episode_statistics(folder: Path, version: str, episode: int) -> dict[str, dict[str, Any]]:
    if version == "v2.1":
        lines = (folder / "meta/episodes_stats.jsonl").read_text().splitlines()
        return json.loads(lines[episode])["stats"]
    row = parquet.read_table(next((folder / "meta/episodes").rglob("*.parquet"))).to_pylist()[episode]
    found: dict[str, dict[str, Any]] = {}
    for name, value in row.items():
        if name.startswith("stats/"):
            found.setdefault(name.split("/")[1], {})[name.split("/")[2]] = value
    return found


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_all_other_columns_videos_and_metadata_are_as_they_were(tmp_path: Path, version: str) -> None:
    old, new = planar(tmp_path / "old", version=version, video=True), tmp_path / "new"
    on_leaf(old, new, PLANAR, ARM)
    before, after = read_dataset(old), read_dataset(new)
    assert before.info == after.info
    for a, b in zip(before.files(), after.files(), strict=True):
        one, other = parquet.read_table(a), parquet.read_table(b)
        assert one.schema == other.schema
        changed = [name for name in one.column_names if not one[name].equals(other[name])]
        assert sorted(changed) == ["action", "observation.state"]
    videos = list(old.rglob("*.mp4"))
    assert videos and all((new / file.relative_to(old)).samefile(file) for file in videos)
    same = ["tasks.jsonl", "episodes.jsonl"] if version == "v2.1" else ["strategies.tasks.parquet"]
    assert all((new / "meta" / name).read_bytes() == (old / "meta" / name).read_bytes() for name in same)
    for e in range(4):
        was, now = (episode_statistics(folder, version, e) for folder in (old, new))
        assert [name for name in was if was[name] != now[name]] == ["observation.state", "action"]


def test_in_double_precision_the_tool_is_where_it_was_to_1e_9(tmp_path: Path) -> None:
    old, new = planar(tmp_path / "old", dtype="float64"), tmp_path / "new"
    assert on_leaf(old, new, PLANAR, ARM, double=True).rounded < 1e-9
    for name in JOINTS:
        here, there = (ARM.pose_batch(column(folder, name)[:, :0:-1].copy())[0] for folder in (old, new))
        np.testing.assert_allclose(here, there, atol=1e-9)
        assert np.abs(column(new, name)[:, 1] - START[2]).max() < 1e-9  # the locked joint, first of the reversed


def test_the_statistics_of_the_whole_dataset_follow_from_its_rows(tmp_path: Path) -> None:
    """Mean, deviation and extremes over all rows; quantiles are averages over the episodes, as LeRobot has them."""
    old, new = planar(tmp_path / "old"), tmp_path / "new"
    on_leaf(old, new, PLANAR, ARM)
    found = json.loads((new / "meta/stats.json").read_text())
    for name in (*JOINTS, "force"):
        wanted = stats(column(new, name), False)
        for what, value in wanted.items():
            np.testing.assert_allclose(found[name][what], value, atol=1e-6, err_msg=f"{name} {what}")


def bad_episodes() -> list[dict[str, np.ndarray]]:
    """Episodes 1 and 3 stretch the arm beyond what it reaches with its last joint locked."""
    given = planar_episodes()
    for e, frames in ((1, [4]), (3, [0, 1])):
        for name in JOINTS:
            given[e][name][frames, 1:] = [0.0, 0.0, 0.4]
    return given


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_poses_out_of_reach_are_said_by_episode_and_the_joints_are_kept(tmp_path: Path, version: str) -> None:
    old = planar(tmp_path / "old", bad_episodes(), version=version)
    done = on_leaf(old, tmp_path / "new", PLANAR, ARM)
    assert done.written is None and not (tmp_path / "new").exists()
    assert [(b.episode, b.count, b.first) for b in done.bad if b.column == "action"] == [(1, 1, 4), (3, 2, 0)]
    assert "episode 1: 1 frame of action, the first is 4" in str(done)
    table = parquet.read_table(tmp_path / "new-joints.parquet").to_pylist()
    assert len(table) == 2 * 36
    assert sum(bool(row["bad"]) for row in table) == 6
    good = [row for row in table if not row["bad"] and row["column"] == "action"]
    assert all(np.isfinite([row[joint] for joint in ARM.joint_names]).all() for row in good)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["new-joints.parquet", "old"]


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_episodes_with_bad_frames_are_left_out_if_asked_and_the_others_move_up(tmp_path: Path, version: str) -> None:
    old, new = planar(tmp_path / "old", bad_episodes(), version=version, video=True), tmp_path / "new"
    done = on_leaf(old, new, PLANAR, ARM, bad="skip")
    assert (done.left_out, done.frames) == ((1, 3), 18)
    data = read_dataset(new)
    assert (data.info["total_episodes"], data.info["total_frames"], data.info["splits"]) == (2, 18, {"train": "0:2"})
    kept = np.r_[0:9, 18:27]
    assert np.array_equal(column(new, "force"), column(old, "force")[kept])
    assert column(new, "index").ravel().tolist() == list(range(18))
    for e in range(2):
        found = episode_statistics(new, version, e)
        assert (found["episode_index"]["max"], found["index"]["min"]) == ([e], [9 * e])
        assert found["force"] == episode_statistics(old, version, 2 * e)["force"]
    if version == "v2.1":
        assert len(list(new.rglob("*.mp4"))) == 2


def test_the_nearest_pose_is_taken_if_asked_and_its_distance_is_said(tmp_path: Path) -> None:
    """Out of reach by a known length: links of 1 m, of which the last two are rigid, at 0.5 rad to each other."""
    old, new = planar(tmp_path / "old", bad_episodes()), tmp_path / "new"
    done = on_leaf(old, new, PLANAR, ARM, bad="nearest")
    assert done.written == new and done.nearest[0] == 6
    missing = 3 - (1 + abs(1 + np.exp(1j * START[2])))
    assert missing <= done.nearest[1] < missing + 0.005  # it keeps a little off the stretched posture
    assert np.isfinite(column(new, "action")).all()


def test_joints_beyond_their_limits_are_no_answer_unless_limits_are_left_out(tmp_path: Path) -> None:
    narrow = hk.from_dh(
        [{"a": 1.0, "joint": f"q{i}", "lower": -0.5, "upper": 1.2, "max_velocity": 1.0} for i in (1, 2, 3)],
        convention="standard", name="narrow",
    )  # fmt: skip
    given = planar_episodes(1)
    for name in JOINTS:
        given[0][name][:, 1:] = START[::-1] + np.linspace(0, 0.4, 9)[:, None] * [0.0, 1.0, 0.0]
        given[0][name][:, 1] = 0.2
    folder = planar(tmp_path / "old", given)
    task = hk.holonomic(hk.position(narrow), hk.lock(2))
    ik = hk.ik(task, START, limits=True)
    kinds = {b.why for b in on_leaf(folder, tmp_path / "new", ik, narrow).bad}
    free = on_leaf(folder, tmp_path / "free", hk.ik(task, START), narrow)
    assert kinds <= {"beyond the joint limits", "the strategy does not lead there"}
    assert free.written is not None or not kinds


def test_a_dataset_of_tool_poses_gets_a_column_of_joints(tmp_path: Path) -> None:
    poses = column(GOLDEN / "lerobot-v3.0", "action")
    p, R = PANDA.pose_batch(poses[:, :7].copy())
    from scipy.spatial.transform import Rotation

    names = ["ee.x", "ee.y", "ee.z", "ee.wx", "ee.wy", "ee.wz", "ee.gripper_pos"]
    values = np.hstack([p, Rotation.from_matrix(R).as_rotvec(), poses[:, 7:]])
    folder = write_dataset(tmp_path / "old", [{"action": values}], {"action": names}, robot_type="panda")
    data = read_dataset(folder)
    done = retarget(data, LOCKED, [pose_feature(data, "action")], tmp_path / "new")
    assert done.columns == ("action.joints",)
    new = read_dataset(tmp_path / "new")
    assert new.features["action.joints"]["names"] == [f"{joint}.pos" for joint in PANDA.joint_names]
    joints = column(tmp_path / "new", "action.joints")
    np.testing.assert_allclose(PANDA.pose_batch(joints)[0], p, atol=1e-6)
    assert np.array_equal(column(tmp_path / "new", "action"), column(folder, "action"))


def test_degrees_stay_degrees(tmp_path: Path) -> None:
    given = planar_episodes()
    for e in given:
        for name in JOINTS:
            e[name][:, 1:] *= 180 / np.pi
    folder = planar(tmp_path / "old", given)
    data = read_dataset(folder)
    sources = [joint_feature(data, ARM, name, degrees=True) for name in JOINTS]
    retarget(data, PLANAR, sources, tmp_path / "new")
    assert np.abs(column(tmp_path / "new", "action")[:, 1] - np.rad2deg(START[2])).max() < 1e-5


def test_what_cannot_be_written_or_read_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    folder = planar(tmp_path / "old", version="v2.1")
    data = read_dataset(folder)
    with pytest.raises(ArgumentError, match="it exists"):
        on_leaf(folder, folder, PLANAR, ARM)
    with pytest.raises(ArgumentError, match="columns to retarget"):
        retarget(data, PLANAR, [], tmp_path / "new")
    with pytest.raises(ArgumentError, match='"refuse", "skip" or "nearest"'):
        on_leaf(folder, tmp_path / "new", PLANAR, ARM, bad="ignore")
    (folder / "meta/episodes_stats.jsonl").unlink()
    with pytest.raises(FileError, match=r"no such file, and a dataset of v2.1 has one"):
        on_leaf(folder, tmp_path / "new", PLANAR, ARM)
    (folder / "meta/episodes_stats.jsonl").write_text('{"episode_index": 0}\n')
    with pytest.raises(FileError, match="has not a line with the statistics of each episode"):
        on_leaf(folder, tmp_path / "new", PLANAR, ARM)
    assert [p.name for p in tmp_path.iterdir()] == ["old"]


def test_a_link_to_a_strangers_file_is_not_copied(tmp_path: Path) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("mine")
    for place in ("meta/notes.txt", "videos/observation.images.top/chunk-000/file-000.mp4"):
        folder = planar(tmp_path / place.split("/")[0], video=True)
        (folder / place).unlink(missing_ok=True)
        (folder / place).symlink_to(secret)
        with pytest.raises(FileError, match="is a link out of the dataset"):
            on_leaf(folder, tmp_path / "new", PLANAR, ARM)
        assert not (tmp_path / "new").exists()


def test_the_command_writes_a_dataset_that_repeats(tmp_path: Path, holokin: Command) -> None:
    old, new = GOLDEN / "lerobot-v3.0", tmp_path / "new"
    assert holokin("audit", str(old), "--robot", "panda").code == 1
    done = holokin("retarget", str(old), "--robot", "panda", "--strategy", "lock panda_joint3", "--out", str(new))
    assert done.code == 0
    assert "26 frames of observation.state, action written" in done.out
    assert holokin("audit", str(new), "--robot", "panda").code == 0
    about = json.loads((new / "meta/holokin.json").read_text())
    assert about["strategy"] == "lock panda_joint3" and about["robot"] == "panda"


def test_angles_modulo_a_turn_get_the_same_joints(tmp_path: Path, holokin: Command) -> None:
    """Also by their first frame, which is a turn outside the limits, and by their actions, across the cut."""
    given, new = planar_episodes(), []
    for e in given:
        for name in JOINTS:
            e[name][:, 3] -= 0.3 - 3e-3 * (name == "action")  # joint 1 is cut at 0, and where the action is beside it
    wrapped = [{n: c % (2 * np.pi) if n in JOINTS else c for n, c in e.items()} for e in given]
    for kind, episodes in (("plain", given), ("wrapped", wrapped)):
        folder, out = planar(tmp_path / kind, episodes), tmp_path / f"new-{kind}"
        words = ["--robot", "planar-3r", "--position", "--strategy", "lock q3"]
        assert holokin("retarget", str(folder), *words, "--out", str(out)).code == 0
        new.append([column(out, name) for name in JOINTS])
    np.testing.assert_allclose(new[0], new[1], atol=2e-6)


def test_actions_that_are_rates_are_doubted(tmp_path: Path, holokin: Command) -> None:
    given = planar_episodes()
    for e in given:
        e["action"][:, 1:] *= 0.01
    folder = planar(tmp_path / "old", given)
    arguments = ("retarget", str(folder), "--robot", "planar-3r", "--position", "--strategy", "lock q3")
    assert_refused(holokin(*arguments, "--out", str(tmp_path / "new")), "it seems no position", "--column")
    done = holokin(*arguments, "--column", "observation.state", "--out", str(tmp_path / "new"))
    assert done.code == 0
    assert "action does not name the joints of planar-3r, or was not asked for: it is as it was" in done.out
    assert np.array_equal(column(tmp_path / "new", "action"), column(folder, "action"))


@sampled(
    2,
    ("words", "said"),
    [
        ("no-such-kind", "unknown kind of strategy"), ("lock", "joints"), ("moore-penrose", "it has no leaves"),
        ("linear 1 0 x", "takes numbers"), ("lock joints=", "write a kind"), ("lock 3", "unknown index of a joint"),
        ("arm-angle q1", "write a kind"), ("linear 1 0", "shape"),
    ],
)  # fmt: skip
def test_words_that_are_no_strategy_are_refused(tmp_path: Path, words: str, said: str, holokin: Command) -> None:
    folder = planar(tmp_path / "old")
    done = holokin(
        "retarget", str(folder), "--robot", "planar-3r", "--position", "--strategy", words, "--out", str(tmp_path / "n")
    )  # fmt: skip
    assert done.code == 2 and said in done.err and "Traceback" not in done.err


@sampled(2, "words", ["lock 2", "lock q3", "lock joints=['q3']", "linear 0 0 1", "linear matrix=[[0, 0, 1]]"])
def test_a_strategy_is_typed_as_it_stands_in_a_job(tmp_path: Path, words: str, holokin: Command) -> None:
    folder = planar(tmp_path / "old")
    done = holokin(
        "retarget", str(folder), "--robot", "planar-3r", "--position", "--strategy", words, "--q0", "0.3 0.8 0.5",
        "--out", str(tmp_path / "new"),
    )  # fmt: skip
    assert done.code == 0, done.err
    assert np.abs(column(tmp_path / "new", "action")[:, 1] - 0.5).max() < 1e-6


# --- The page on logs and datasets: its commands run on its log and on three circles, and print what stands below them.


ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "logs.md").read_text("utf-8")
BLOCK = re.compile(r"^```(python|sh|text)\n(.*?)^```", re.DOTALL | re.MULTILINE)


@pytest.mark.campaign
def test_its_commands_print_what_stands_below_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], holokin: Command
) -> None:
    """What is shown after "..." is the end of what is printed."""
    monkeypatch.chdir(tmp_path)
    scope: dict[str, object] = {}
    blocks = [match.groups() for match in BLOCK.finditer(PAGE)]
    exec(next(text for kind, text in blocks if kind == "python"), scope)
    capsys.readouterr()
    write_circles(tmp_path / "demos", 3)
    codes = []
    for (kind, text), (_, below) in zip(blocks, [*blocks[1:], ("", "")], strict=True):
        if kind == "sh":
            done = holokin(*shlex.split(text)[1:])
            codes.append(done.code)
            assert done.err == ""
            shown = below.removeprefix("...\n")
            printed = done.out.split()
            assert_alike(" ".join(printed[-len(shown.split()) :] if shown != below else printed), shown)
    assert codes == [1, 1, 0, 0]
    assert all((tmp_path / name).stat().st_size > 20_000 for name in ("demos.png", "panda-log.png"))


def write_circles(folder: Path, episodes: int) -> None:
    """A dataset in which a Panda draws a circle in each episode, with the pseudo-inverse; its gripper rests."""
    robot, q0 = hk.load("panda"), [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
    start = robot.pose(q0)[:3, 3]
    circle = hk.circle(start, center=start - [0.1, 0, 0])
    joints = hk.follow(hk.moore_penrose(hk.pose(robot)), circle, q0, samples=90, cycles=episodes).q
    names = [*(f"{joint}.pos" for joint in robot.joint_names), "gripper.pos"]
    columns = []
    for e in range(episodes):
        states = np.hstack([joints[90 * e : 90 * e + 91], np.full((91, 1), 0.04)])
        columns.append({"observation.state": states, "action": np.vstack([states[1:], states[-1:]])})
    write_dataset(folder, columns, {"observation.state": names, "action": names})


def test_its_excerpt_stands_in_the_tree() -> None:
    (found,) = re.findall(r'```py title="(.+?)"\n(.*?)```', PAGE, re.DOTALL)
    assert found[1].strip() in (ROOT / found[0]).read_text("utf-8")
