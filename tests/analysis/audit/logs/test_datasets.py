"""LeRobot datasets are read as they are: joints by their names, poses by theirs; what is none is refused."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import Command, assert_refused, sampled
from holokin.analysis.audit.logs import bag, chosen_episodes, joint_feature, pose_feature, read_dataset
from holokin.analysis.audit.logs.datasets import batches, postures_of, read_parquet, rows, tool_poses_of
from holokin.base.errors import ArgumentError, FileError
from small_datasets import write_dataset

ARM = hk.load("planar-3r")
NAMES = [*(f"{joint}.pos" for joint in ARM.joint_names), "gripper.pos"]
GOLDEN = Path(__file__).parents[3] / "golden"


def episodes(count: int = 3, length: int = 7) -> list[dict[str, np.ndarray]]:
    """Random joints of a planar arm and a gripper, in radians."""
    out, rng = [], np.random.default_rng(3)
    for _ in range(count):
        state = np.hstack([rng.uniform(-1, 1, (length, 3)), rng.uniform(0, 100, (length, 1))])
        out.append({"observation.state": state, "action": state + 0.01})
    return out


def dataset(folder: Path, version: str = "v3.0", **more: object) -> Path:
    given = more.pop("episodes", None) or episodes()
    names = more.pop("names", {"observation.state": NAMES, "action": NAMES})
    return write_dataset(folder, given, names, version=version, robot_type="arm", **more)


def edit_info(folder: Path, **changes: object) -> None:
    file = folder / "meta" / "info.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | changes))


def postures(folder: Path, robot: hk.Robot = ARM, **options: object) -> np.ndarray:
    data = read_dataset(folder)
    joints = joint_feature(data, robot, "observation.state", **options)
    parts = [postures_of(data, robot, joints, part.values[joints.name]) for part in rows(data, [joints.name])]
    return np.vstack(parts)


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_both_formats_give_the_joints_that_were_written_in_the_order_of_the_episodes(
    tmp_path: Path, version: str
) -> None:
    given = episodes(5)
    folder = dataset(tmp_path / "d", version, episodes=given)
    whole = np.vstack([e["observation.state"][:, :3] for e in given])
    np.testing.assert_allclose(postures(folder), whole, atol=1e-7)
    data = read_dataset(folder)
    some = list(rows(data, ["action"], [1, 4]))
    assert np.concatenate([part.episode for part in some]).tolist() == [1] * 7 + [4] * 7


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_a_dataset_that_lerobot_itself_wrote_is_read_as_lerobot_reads_it(version: str) -> None:
    facts = json.loads((GOLDEN / f"lerobot-{version}.json").read_text())
    data = read_dataset(GOLDEN / f"lerobot-{version}")
    assert (data.version, data.frames, len(data.episodes)) == (version, facts["frames"], facts["episodes"])
    parts = list(rows(data, ["observation.state", "action", "timestamp"]))
    for name, found in facts["columns"].items():
        read = np.vstack([part.values[name] for part in parts])
        assert np.array_equal(read.astype(np.float32), np.array(found, np.float32)), name
    assert np.concatenate([part.episode for part in parts]).tolist() == facts["episode of each row"]


def test_joints_in_another_order_are_told_by_their_names(tmp_path: Path) -> None:
    given = episodes()
    order = [2, 3, 0, 1]
    shuffled = [{name: column[:, order] for name, column in e.items()} for e in given]
    names = [NAMES[i] for i in order]
    folder = dataset(tmp_path / "d", episodes=shuffled, names={"observation.state": names, "action": names})
    np.testing.assert_allclose(postures(folder), np.vstack([e["observation.state"][:, :3] for e in given]), atol=1e-7)


@pytest.mark.parametrize(
    "names", [{"motors": NAMES}, {"arm": NAMES[:3], "gripper": NAMES[3:]}, dict.fromkeys(NAMES, 0)]
)
def test_names_in_groups_are_names(tmp_path: Path, names: object) -> None:
    folder = dataset(tmp_path / "d")
    features = json.loads((folder / "meta/info.json").read_text())["features"]
    features["observation.state"]["names"] = names
    edit_info(folder, features=features)
    assert postures(folder).shape == (21, 3)


def test_entries_without_names_are_told_by_their_numbers(tmp_path: Path) -> None:
    folder = dataset(tmp_path / "d", names={})
    with pytest.raises(FileError, match="joints q1, q2, q3 of planar-3r are not in it"):
        postures(folder)
    np.testing.assert_allclose(postures(folder, columns="2,1,0"), postures(folder, columns="0,1,2")[:, ::-1])


def test_degrees_are_seen_and_asked_for(tmp_path: Path) -> None:
    given = episodes()
    turned = [{n: c * np.array([*[180 / np.pi] * 3, 1.0]) for n, c in e.items()} for e in given]
    folder = dataset(tmp_path / "d", episodes=turned)
    with pytest.raises(FileError, match="every joint fits in degrees"):
        postures(folder)
    whole = np.vstack([e["observation.state"][:, :3] for e in given])
    np.testing.assert_allclose(postures(folder, degrees=True), whole, atol=1e-6)


def test_values_that_are_no_angles_at_all_are_refused(tmp_path: Path) -> None:
    given = episodes()
    given[1]["observation.state"][2, 0] = 5e4
    with pytest.raises(FileError, match=r"reaches 5e\+04.*ticks"):
        postures(dataset(tmp_path / "far", episodes=given))
    for e in given:
        e["observation.state"][0, :3] = [100.0, -100.0, 12.0]
    given[1]["observation.state"][2, 0] = 50.0
    with pytest.raises(FileError, match=r"2 joints of observation\.state reach 100 exactly"):
        postures(dataset(tmp_path / "normalized", episodes=given), degrees=True)


def test_a_servo_arm_must_say_its_unit(tmp_path: Path) -> None:
    folder = dataset(tmp_path / "d")
    edit_info(folder, robot_type="so101_follower")
    with pytest.raises(FileError, match="so101_follower, whose joints LeRobot writes in degrees or from -100 to"):
        postures(folder)
    assert postures(folder, degrees=False).shape == (21, 3)


def test_servos_within_100_are_not_told_from_normalized_ones_and_calibration_tells(
    tmp_path: Path, holokin: Command
) -> None:
    """LeRobot's -100 to 100 has no mark: only values beyond 100 are surely degrees."""
    q = 30 * np.sin(np.linspace(0, 12, 60))[:, None] * np.array([1.0, 0.8, 1.2])
    episodes = [{"observation.state": q}, {"observation.state": q}]
    names = {"observation.state": list(ARM.joint_names)}
    for name, more, code in (("small", 0.0, 2), ("large", 80.0, 0)):
        given = [{n: c + more for n, c in e.items()} for e in episodes]
        folder = write_dataset(tmp_path / name, given, names, robot_type="so101_follower")
        words = ("audit", str(folder), "--robot", "planar-3r", "--position")
        found = holokin(*words, "--degrees")
        assert found.code == code and ("may be degrees, or LeRobot's -100 to 100" in found.err) == (code == 2)
        scales = ", ".join(f"{joint}={np.pi / 180}" for joint in ARM.joint_names)
        assert holokin(*words, "--scales", scales).code == 0


def test_metadata_that_unpacks_to_more_than_a_dataset_has_is_not_unpacked(tmp_path: Path, monkeypatch) -> None:
    """A text column of a few bytes, packed, is left aside; who needs all columns is refused by the footer."""
    folder = dataset(tmp_path / "d")
    file = next((folder / "meta" / "episodes").rglob("*.parquet"))
    table = parquet.read_table(file)
    text = pa.array(["x" * 3_000_000] + [""] * (len(table) - 1))
    parquet.write_table(table.append_column("more", text), file, compression="zstd")
    monkeypatch.setattr("holokin.analysis.audit.logs.datasets.LARGEST_TEXT", 1_000_000)
    assert "more" not in read_dataset(folder).episodes[0].facts
    with pytest.raises(FileError, match=r"unpacks to 30.* bytes, by its own footer"):
        read_parquet(file)


def poses_dataset(folder: Path, names: list[str], values: np.ndarray) -> Path:
    return dataset(folder, episodes=[{"observation.state": values}], names={"observation.state": names})


@pytest.mark.parametrize(
    ("names", "written"),
    [
        (["qx", "qy", "qz", "qw"], lambda R: R.as_quat()),
        (["ee.wx", "ee.wy", "ee.wz"], lambda R: R.as_rotvec()),
        (["tcp_rx.pos", "tcp_ry.pos", "tcp_rz.pos"], lambda R: R.as_rotvec()),
        (["eef_roll", "eef_pitch", "eef_yaw"], lambda R: R.as_euler("xyz")),
    ],
)
def test_tool_poses_are_read_by_the_names_of_their_entries(tmp_path: Path, names: list[str], written: object) -> None:
    R = Rotation.random(9, random_state=1)
    points = np.random.default_rng(4).uniform(-0.5, 0.5, (9, 3))
    values = np.hstack([np.zeros((9, 1)), points, written(R)])
    folder = poses_dataset(tmp_path / "d", ["gripper.pos", "ee.x", "ee.y", "ee.z", *names], values)
    data = read_dataset(folder)
    feature = pose_feature(data, "observation.state")
    part = next(iter(rows(data, ["observation.state"])))
    p, found = tool_poses_of(data, feature, part.values["observation.state"], part.frame)
    np.testing.assert_allclose(p, points, atol=1e-7)
    np.testing.assert_allclose(found, R.as_matrix(), atol=1e-6)


def test_numbered_quaternions_need_their_order_and_long_ones_are_none(tmp_path: Path) -> None:
    q = Rotation.random(4, random_state=2).as_quat()
    names = ["x", "y", "z", "q1", "q2", "q3", "q4"]
    data = read_dataset(poses_dataset(tmp_path / "d", names, np.hstack([np.zeros((4, 3)), q])))
    with pytest.raises(FileError, match="no orientation"):
        pose_feature(data, "observation.state")
    assert pose_feature(data, "observation.state", order="xyzw").columns.kind == "numbered"
    names = ["x", "y", "z", "qx", "qy", "qz", "qw"]
    q[2] *= 1.1
    data = read_dataset(poses_dataset(tmp_path / "long", names, np.hstack([np.zeros((4, 3)), q])))
    part = next(iter(rows(data, ["observation.state"])))
    with pytest.raises(FileError, match=r"frame 2 has a quaternion of length 1\.1"):
        tool_poses_of(data, pose_feature(data, "observation.state"), part.values["observation.state"], part.frame)


@pytest.mark.parametrize(
    "path", ["../../{chunk_index:03d}.parquet", "/etc/passwd", "data/{chunk_index.__class__}", "a\\b"]
)
def test_paths_that_lead_out_of_the_folder_are_refused(tmp_path: Path, path: str) -> None:
    folder = dataset(tmp_path / "d")
    edit_info(folder, data_path=path)
    with pytest.raises(FileError, match="data_path"):
        read_dataset(folder)


def test_a_link_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    folder, other = dataset(tmp_path / "d"), dataset(tmp_path / "other")
    file = folder / "data/chunk-000/file-000.parquet"
    file.unlink()
    file.symlink_to(other / "data/chunk-000/file-000.parquet")
    with pytest.raises(FileError, match="is a link out of the dataset"):
        read_dataset(folder)


def test_a_pipe_is_no_data_file(tmp_path: Path) -> None:
    folder = dataset(tmp_path / "d")
    file = folder / "data/chunk-000/file-000.parquet"
    file.unlink()
    os.mkfifo(file)
    with pytest.raises(FileError, match="no such file, but meta/ names it"):
        postures(folder)


def spoil(folder: Path, what: str) -> None:
    file = folder / "data/chunk-000/file-000.parquet"
    if what == "broken":
        file.write_bytes(file.read_bytes()[:-40])
    elif what == "garbage":
        file.write_bytes(b"PAR1" + bytes(range(200)) + b"PAR1")
    elif what == "lost":
        file.unlink()
    elif what == "short":
        parquet.write_table(parquet.read_table(file).slice(0, 5), file)
    elif what == "mixed":
        table = parquet.read_table(file)
        parquet.write_table(table.take(pa.array(range(len(table) - 1, -1, -1))), file)
    elif what == "no column":
        parquet.write_table(parquet.read_table(file).drop_columns(["observation.state"]), file)
    elif what == "nan":
        table = parquet.read_table(file)
        values = np.full(4 * len(table), np.nan, np.float32)
        column = pa.FixedSizeListArray.from_arrays(pa.array(values), 4)
        parquet.write_table(table.set_column(0, "observation.state", column), file)
    elif what == "text":
        table = parquet.read_table(file)
        parquet.write_table(table.set_column(0, "observation.state", pa.array(["a"] * len(table))), file)
    elif what == "ragged":
        table = parquet.read_table(file)
        column = pa.array([[1.0, 2.0]] * len(table))
        parquet.write_table(table.set_column(0, "observation.state", column), file)
    elif what == "episodes":
        (folder / "meta/episodes/chunk-000/file-000.parquet").write_bytes(b"nothing")


@sampled(
    4,
    ("what", "words"),
    [
        ("broken", "cannot be read"), ("garbage", "cannot be read"), ("lost", "there is no such file"),
        ("short", "has 5 rows, but meta/ says 14 frames"), ("mixed", "was due"), ("no column", "has no column"),
        ("nan", "no finite number"), ("text", "holds string"), ("ragged", "says 4 a row"),
        ("episodes", "cannot be read"),
    ],
)  # fmt: skip
def test_files_that_are_broken_or_of_another_dataset_are_refused_in_a_sentence(
    tmp_path: Path, what: str, words: str, holokin: Command
) -> None:
    folder = dataset(tmp_path / "d")
    spoil(folder, what)
    assert_refused(holokin("audit", str(folder), "--robot", "planar-3r"), words)


@sampled(
    4, "text", ["", "[]", "null", "{", '{"codebase_version": 3}', '{"codebase_version": "v1.6"}', "[" * 100_000,
             '{"codebase_version": "v3.0", "features": {"a": 1}, "data_path": "x"}',
             '{"codebase_version": "v2.1", "features": {}, "data_path": "x", "chunks_size": 0}'],
)  # fmt: skip
def test_an_info_json_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    folder = dataset(tmp_path / "d")
    (folder / "meta" / "info.json").write_text(text)
    with pytest.raises(FileError, match=r"info\.json"):
        read_dataset(folder)


def test_episodes_are_named_by_numbers_and_ranges(tmp_path: Path) -> None:
    data = read_dataset(dataset(tmp_path / "d", episodes=episodes(6, 1)))
    assert chosen_episodes(data, None) == [0, 1, 2, 3, 4, 5]
    assert chosen_episodes(data, "0:2, 4") == [0, 1, 4]
    assert chosen_episodes(data, "3:") == [3, 4, 5]
    for text in ("", "7", "2:1", "-1", "1:9", "a", "1;2"):
        with pytest.raises(ArgumentError, match="--episodes"):
            chosen_episodes(data, text)


def test_a_folder_that_is_no_dataset_is_a_log_and_options_belong_to_one_of_them(
    tmp_path: Path, holokin: Command
) -> None:
    folder = dataset(tmp_path / "d")
    refused = holokin("audit", str(folder), "--robot", "planar-3r", "--split")
    assert_refused(refused, "--split", "only for a log")
    refused = holokin("audit", str(tmp_path), "--robot", "planar-3r", "--episodes", "0:2")
    assert_refused(refused, "--episodes", "only for a LeRobot dataset")
    assert_refused(holokin("audit", str(folder), "--robot", "no-such-robot"), "unknown robot")


@pytest.mark.parametrize("seed", range(4))
def test_rows_are_read_as_they_are_and_never_take_more_memory_than_allowed(
    tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Texts that are all one, or each another one, or images: a batch has as many rows as there is room for."""
    monkeypatch.setattr(bag, "MOST_ROWS", room := 2**20)
    rng = np.random.default_rng(seed)
    count, size = int(rng.integers(20, 400)), int(10 ** rng.uniform(3.5, 5))
    one = {
        "same": ["x" * size] * count,
        "own": [rng.bytes(size // 2).hex() for _ in range(count)],
        "some": [f"{k % 3}" * size for k in range(count)],
        "image": [rng.bytes(size) for _ in range(count)],
    }[("same", "own", "some", "image")[seed]]
    table = pa.table({"q": pa.array(rng.normal(size=count)), "text": one})
    parquet.write_table(table, tmp_path / "t.parquet", row_group_size=int(rng.integers(5, count)))
    found = list(batches(tmp_path / "t.parquet", count))
    assert pa.Table.from_batches(found).equals(table)
    assert max(batch.nbytes for batch in found) < 2 * room + size
    assert len(found) == 1 or sum(batch.nbytes for batch in found[:2]) > room / 2  # and not a few rows each


def test_a_text_that_unpacks_to_thousands_of_times_its_size_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bag, "MOST_ROWS", 2**20)
    table = pa.table({"q": [0.0] * 2, "text": ["x" * 8 * 2**20, ""]})
    parquet.write_table(table, tmp_path / "t.parquet", compression="zstd")
    with pytest.raises(FileError, match="text unpacks to far more"):
        next(batches(tmp_path / "t.parquet", 2))
    assert len(next(batches(tmp_path / "t.parquet", 2, ["q"]))) == 2  # it is not needed
