"""Sets of tool poses: they hold what they say, evenly, and the same for the same seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from holokin.base.errors import ArgumentError, NotFiniteError, RecordingError, ShapeError
from holokin.path.workspaces import PoseCloud, pose_cloud

COUNT = 4096
DOWN = np.diag([1.0, -1.0, -1.0])


def unevenness(values: np.ndarray, *spread: float) -> float:
    """The largest distance of how many lie below a value from how many would (Kolmogorov and Smirnov).

    Args:
        spread: least value and range; by default 0 and 1.
    """
    from scipy.stats import kstest  # here, since it takes long to import

    return float(kstest(values, "uniform", spread).statistic)


def test_the_positions_of_a_box_are_even_in_each_side() -> None:
    p = hk.workspace(box=([0.5, 0, 0.3], [0.25, 0.4, 0.3])).poses(COUNT)[:, :3, 3]
    for i, (middle, half) in enumerate(zip([0.5, 0, 0.3], [0.25, 0.4, 0.3], strict=True)):
        assert unevenness(p[:, i], middle - half, 2 * half) < 2e-3


def test_the_positions_of_a_cylinder_and_of_a_sphere_are_even_in_their_volume() -> None:
    p = hk.workspace(cylinder=([1, 2, 3], 0.5, 0.2)).poses(COUNT)[:, :3, 3] - [1, 2, 3]
    assert unevenness((np.hypot(p[:, 0], p[:, 1]) / 0.5) ** 2) < 2e-3
    assert unevenness(np.arctan2(p[:, 1], p[:, 0]), -np.pi, 2 * np.pi) < 2e-3
    assert unevenness(p[:, 2], -0.2, 0.4) < 2e-3
    p = hk.workspace(sphere=([1, 2, 3], 0.5)).poses(COUNT)[:, :3, 3] - [1, 2, 3]
    assert unevenness((np.linalg.norm(p, axis=1) / 0.5) ** 3) < 2e-3
    half = np.count_nonzero(p[:, 2] > 0.25) / COUNT  # Archimedes: a cap of half the radius holds 5/32 of the ball
    assert half == pytest.approx(5 / 32, abs=3e-3)


def test_the_tool_directions_are_even_on_the_cap_and_the_turns_about_the_tools_own_axis() -> None:
    """A cap's area grows as its height (Archimedes); the turn is what is left after the shortest way to the axis."""
    tilt, spin = np.radians(40), np.radians(90)
    R = hk.workspace(sphere=([0, 0, 0], 1), tilt=tilt, spin=spin).poses(COUNT)[:, :3, :3]
    z = R[:, :, 2]
    height = 1 + z[:, 2]  # above the cap's middle, the tool's z axis straight down
    assert height.max() <= 1 - np.cos(tilt) + 1e-12
    assert unevenness(height / (1 - np.cos(tilt))) < 2e-3
    assert unevenness(np.arctan2(z[:, 1], z[:, 0]), -np.pi, 2 * np.pi) < 2e-3
    turns = []
    for rotation, axis in zip(R[:500], z[:500], strict=True):
        across = np.cross([0, 0, -1], axis)
        leaning = Rotation.from_rotvec(across / np.linalg.norm(across) * np.arccos(-axis[2])).as_matrix() @ DOWN
        turns.append(Rotation.from_matrix(leaning.T @ rotation).as_rotvec())
    turns = np.array(turns)
    assert np.abs(turns[:, :2]).max() < 1e-9
    assert np.abs(turns[:, 2]).max() <= spin
    assert unevenness(turns[:, 2], -spin, 2 * spin) < 5e-3


def test_without_tilt_and_spin_all_poses_have_the_middle_rotation_and_the_centre_has_it() -> None:
    region = hk.workspace(box=([0.5, 0, 0.3], [0.1, 0.1, 0.1]))
    assert np.array_equal(region.center[:3], np.column_stack([DOWN, [0.5, 0, 0.3]]))
    assert np.allclose(region.poses(64)[:, :3, :3], DOWN, atol=1e-15)
    R = Rotation.from_rotvec([0.3, 0.2, 0.1]).as_matrix()
    turned = hk.workspace(box=([0.5, 0, 0.3], [0.1, 0.1, 0.1]), rotation=R)
    assert np.allclose(turned.poses(64)[:, :3, :3], R, atol=1e-15)


def test_the_same_seed_gives_the_same_poses_and_more_of_them_go_on_from_the_first() -> None:
    region = hk.workspace(sphere=([0, 0, 1], 0.3), tilt=0.5, spin=0.5)
    assert np.array_equal(region.poses(100, 3), region.poses(400, 3)[:100])
    assert not np.allclose(region.poses(100, 3), region.poses(100, 4))


def test_a_flat_box_and_a_disc_are_workspaces_of_a_planar_arm() -> None:
    flat = hk.workspace(box=([1, 2], [0.5, 0.2])).poses(64)[:, :3, 3]
    assert np.array_equal(flat[:, 2], np.zeros(64))
    disc = hk.workspace(cylinder=([1, 2], 0.5, 0)).poses(64)[:, :3, 3]
    assert np.array_equal(disc[:, 2], np.zeros(64))


@pytest.mark.parametrize(
    ("kind", "given", "cure"),
    [
        (ArgumentError, {}, "give one of box=, cylinder= and sphere="),
        (ArgumentError, {"box": ([0, 0, 0], [1, 1, 1]), "sphere": ([0, 0, 0], 1)}, "give one of"),
        (ArgumentError, {"box": ([0, 0, 0], [1, -1, 1])}, "not two corners"),
        (ArgumentError, {"box": ([0, 0, 0], [0, 0, 0])}, "not all zero"),
        (ShapeError, {"box": ([0, 0, 0], 0.5)}, "half sides"),
        (NotFiniteError, {"box": ([0, np.nan, 0], [1, 1, 1])}, "a point"),
        (NotFiniteError, {"box": ([0, 0, 0], [1, np.nan, 1])}, "a point"),
        (ArgumentError, {"sphere": ([0, 0, 0], 0)}, "positive radius"),
        (ArgumentError, {"sphere": ([0, 0, 0], np.nan)}, "positive radius"),
        (ArgumentError, {"cylinder": ([0, 0, 0], -1, 1)}, "positive radius"),
        (ArgumentError, {"cylinder": ([0, 0, 0], 1, -1)}, "not negative"),
        (ArgumentError, {"cylinder": ([0, 0, 0], 1)}, r"the radius, half the height \[m\], as in cylinder=\(\["),
        (ArgumentError, {"box": [0.5, 0, 0.3, 0.1, 0.1, 0.1]}, r"the half sides \(3,\) \[m\], as in box=\(\["),
        (ArgumentError, {"box": 0.5}, "give a list or None"),
        (ArgumentError, {"sphere": ([0, 0, 0], 1), "tilt": 40}, "angles are in rad"),
        (ArgumentError, {"sphere": ([0, 0, 0], 1), "tilt": -0.1}, "not negative"),
        (ArgumentError, {"sphere": ([0, 0, 0], 1), "tilt": np.nan}, "finite"),
        (ArgumentError, {"sphere": ([0, 0, 0], 1), "spin": 4.0}, "angles are in rad"),
        (ArgumentError, {"sphere": ([0, 0, 0], 1), "rotation": np.diag([1.0, 1, -1])}, "a reflection"),
        (ArgumentError, {"sphere": ([0, 0, 0], 1), "rotation": 2 * np.eye(3)}, "3 away from 1"),
    ],
)
def test_a_workspace_that_is_none_is_refused_with_the_cure(kind: type[Exception], given: dict, cure: str) -> None:
    with pytest.raises(kind, match=cure):
        hk.workspace(**given)


def table(file: Path, header: str, rows: np.ndarray) -> Path:
    file.write_text("\n".join([header, *(", ".join(f"{v:.17g}" for v in row) for row in rows)]), "utf-8")
    return file


@pytest.fixture
def some_poses() -> np.ndarray:
    return hk.workspace(box=([0.5, 0, 0.3], [0.25, 0.4, 0.3]), tilt=0.7, spin=1.5).poses(20)


def test_poses_read_from_a_csv_file_are_those_that_were_written(tmp_path: Path, some_poses: np.ndarray) -> None:
    p, turned = some_poses[:, :3, 3], Rotation.from_matrix(some_poses[:, :3, :3])
    files = {
        "quaternion": table(tmp_path / "a.csv", "x,y,z,qx,qy,qz,qw", np.hstack([p, turned.as_quat()])),
        "angles": table(tmp_path / "b.csv", "x,y,z,roll,pitch,yaw", np.hstack([p, turned.as_euler("xyz")])),
        "matrix": table(
            tmp_path / "c.csv",
            "note;" + ";".join(f"T{i}{j}" for i in range(4) for j in range(4)),
            np.hstack([np.ones((20, 1)), some_poses.reshape(20, 16)]),
        ),
    }
    files["matrix"].write_text(files["matrix"].read_text("utf-8").replace(",", ";"), "utf-8")
    for name, file in files.items():
        cloud = hk.path.read_workspace(file)
        assert np.allclose(cloud.poses(1000), some_poses, atol=1e-14), name
    degrees = table(tmp_path / "d.csv", "yaw,pitch,roll,x,y,z", np.hstack([turned.as_euler("xyz", True)[:, ::-1], p]))
    assert np.allclose(hk.path.read_workspace(degrees, angles="deg").poses(20), some_poses, atol=1e-14)
    with pytest.raises(RecordingError, match="say angles='deg'"):
        hk.path.read_workspace(degrees)


def test_roll_pitch_and_yaw_turn_about_the_axes_of_the_base_in_this_order(tmp_path: Path) -> None:
    R = hk.path.read_workspace(table(tmp_path / "a.csv", "x,y,z,roll,pitch,yaw", np.array([[0, 0, 0, 0.3, 0.2, 0.1]])))
    one, two, three = (Rotation.from_rotvec(a * np.eye(3)[i]) for i, a in enumerate([0.3, 0.2, 0.1]))
    assert np.allclose(R.center[:3, :3], (three * two * one).as_matrix(), atol=1e-15)


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0,0,0,0,0,0,1.1\n", "line 3 has a quaternion of length 1.1, 0.1 away"),
        ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0\n", "line 2 has a quaternion of length 0, 1 away from 1"),
        ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0,nan,0,0,0,0,1\n", "line 3, column 'y' holds 'nan'"),
        ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,one\n", "line 2, column 'qw' holds 'one'"),
        ("x,y,z,qx,qy,qz,qw\n", "no poses"),
        ("x,y\n0,0\n", "has no column z"),
        ("x,y,z,qx\n0,0,0,0\n", "column 'qx' alone is no orientation"),
        ("x,y,z,x\n0,0,0,0\n", "2 columns 'x'"),
        ("x,y,z\n0,0,0\n0,0,0,1\n", "line 3 has 4 cells, the header 3"),
        ("0,0,0,0,0,0,1\n", "no header"),
        (",".join(f"T{i}{j}" for i in range(3) for j in range(4)) + "\n2,0,0,0,0,1,0,0,0,0,1,0\n", "line 2 has no rot"),
    ],
)
def test_a_table_that_holds_no_poses_is_refused_with_the_line(tmp_path: Path, text: str, fact: str) -> None:
    file = tmp_path / "poses.csv"
    file.write_text(text, "utf-8")
    with pytest.raises(RecordingError, match=fact):
        hk.path.read_workspace(file)
    with pytest.raises(RecordingError, match="no such file"):
        hk.path.read_workspace(tmp_path / "none.csv")


def test_a_cloud_gives_its_own_poses_and_of_many_some(some_poses: np.ndarray) -> None:
    cloud = pose_cloud(some_poses)
    assert isinstance(cloud, PoseCloud)
    assert np.array_equal(cloud.poses(1000), some_poses)
    few = cloud.poses(5, 1)
    assert few.shape == (5, 4, 4)
    assert all((some_poses == one).all(axis=(1, 2)).any() for one in few)
    assert np.array_equal(few, cloud.poses(5, 1))
    assert (some_poses == cloud.center).all(axis=(1, 2)).any()
    skewed = some_poses.copy()
    skewed[3, 0, 0] += 0.1
    with pytest.raises(ArgumentError, match="pose 3 of a workspace"):
        pose_cloud(skewed)
