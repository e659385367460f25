"""Jobs of several paths: their order and postures, the ways between them, programs of procedures, and scenes."""

from __future__ import annotations

import json
from itertools import combinations, pairwise, permutations, product
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command
from holokin.app.job import certify_job, program_of_paths, read_job, run_paths
from holokin.app.job.advice_job import question
from holokin.app.job.path_order import Choices, best_sequence, in_order, least_pool
from holokin.app.job.paths_job import plan_paths
from holokin.app.report.paths_figures import motion_figure
from holokin.app.report.paths_report import write_paths_report
from holokin.base.errors import JobError
from holokin.motion import TimedTrajectory

# --- Order and postures: held against all orders with all postures.


def random_choices(rng: np.random.Generator, paths: int, each: int, sheets: int) -> Choices:
    k = paths * each
    between = np.where(rng.random((k, k)) < 0.1, np.inf, rng.uniform(0.1, 3, (k, k)))
    path, sheet = np.repeat(np.arange(paths), each), rng.integers(0, sheets, k)
    return Choices(path, sheet, rng.uniform(0.1, 3, k), between, rng.uniform(0.1, 3, k))


def least_of_all(choices: Choices, orders: list[tuple[int, ...]]) -> tuple[int, float]:
    """(changes, seconds) of the best of all orders and all postures, one by one."""
    best = (10**9, np.inf)
    for order in orders:
        for chosen in product(*(np.flatnonzero(choices.path == p) for p in order)):
            seconds = choices.first[chosen[0]] + choices.last[chosen[-1]]
            seconds += sum(choices.between[a, b] for a, b in pairwise(chosen))
            changes = sum(choices.sheet[a] != choices.sheet[b] for a, b in pairwise(chosen))
            if np.isfinite(seconds):
                best = min(best, (int(changes), float(seconds)))
    return best


def test_no_order_and_no_posture_has_fewer_changes_or_less_time() -> None:
    rng = np.random.default_rng(3)
    for _ in range(3):
        choices = random_choices(rng, 6, 2, 4)
        found = best_sequence(choices, given=False)
        changes, seconds = least_of_all(choices, list(permutations(range(6))))
        assert (found.exact, found.changes) == (True, changes)
        assert found.cost % 1e6 == pytest.approx(seconds)
        given = best_sequence(choices, given=True)
        changes, seconds = least_of_all(choices, [tuple(range(6))])
        assert (given.changes, given.cost % 1e6) == (changes, pytest.approx(seconds))


def test_the_fewest_sheets_serve_all_paths_and_none_fewer_do() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        path, sheet = rng.integers(0, 6, 20), rng.integers(0, 7, 20)
        pool, count = least_pool(path, sheet)
        every = set(path.tolist())
        covers = [
            sheets
            for size in range(1, 8)
            for sheets in combinations(range(7), size)
            if set(path[np.isin(sheet, sheets)].tolist()) == every
        ][:1]
        assert count == len(covers[0])
        assert set(path[pool].tolist()) == every


def test_above_the_exact_search_it_is_said_and_no_order_is_worse_than_the_given_one() -> None:
    choices = random_choices(np.random.default_rng(1), 22, 3, 2)
    found = best_sequence(choices, given=False)
    assert not found.exact
    assert sorted(choices.path[list(found.chosen)].tolist()) == list(range(22))
    assert found.cost <= in_order(choices, range(22))[0]


# --- Sheets: an elbow arm of two links whose shoulder turns by 90 degrees each way.

ELBOW = """
title = "Two links"
[robot]
name = "two.toml"
[start]
q = [0.3, 1.0]
[task]
rows = [0, 1]
[strategies.only]
kind = "moore-penrose"
[timing]
acceleration = 5.0
dt = 0.01
"""
TWO = """
name = "two"
source = "two links of half a metre"
convention = "standard"
tip = "tool"
[[joints]]
joint = "shoulder"
a = 0.5
lower = -1.5707963
upper = 1.5707963
max_velocity = 2.0
[[joints]]
joint = "elbow"
a = 0.5
lower = -2.5
upper = 2.5
max_velocity = 2.0
"""


def at(degrees: float, reach: float = 0.6) -> list[float]:
    return [round(reach * float(f(np.deg2rad(degrees))), 9) for f in (np.cos, np.sin)]


def elbow_job(folder: Path, angles: dict[str, float], order: str = "given") -> Path:
    """Short paths outwards, at angles from the x axis: near +-100 degrees one elbow alone keeps the limits."""
    (folder / "two.toml").write_text(TWO)
    text = ELBOW + f'[air]\norder = "{order}"\n'
    for name, angle in angles.items():
        points = [at(angle), at(angle, 0.65)]
        text += f'[[path]]\nname = "{name}"\nkind = "polyline"\npoints = {points}\nsamples = 50\n'
    (folder / "job.toml").write_text(text, encoding="utf-8")
    return folder / "job.toml"


def result_of(file: Path):
    return run_paths("job", read_job(file), file)


def test_where_two_changes_are_needed_two_are_made_and_one_in_the_best_order(tmp_path: Path) -> None:
    # At 100 degrees the elbow must point one way, at -100 the other one, whatever the rest does.
    angles = {"left": 100.0, "right": -100.0, "left again": 95.0}
    (rule,) = result_of(elbow_job(tmp_path, angles)).rules
    assert rule.changes == 2
    assert [row.sheet for row in rule.rows] == [1, 2, 1, 0]
    (rule,) = result_of(elbow_job(tmp_path, angles, "shortest")).rules
    assert (rule.changes, rule.exact, rule.left_out) == (1, True, {})
    (rule,) = result_of(elbow_job(tmp_path, {"left": 100.0, "middle": 0.0})).rules
    assert rule.changes == 0


def test_a_rule_of_two_rows_takes_a_level_that_serves_all_paths(tmp_path: Path) -> None:
    # Four links of a quarter of a metre: with the start's forearm, which is folded, the far path is out of reach.
    link = '[[joints]]\njoint = "{}"\na = 0.25\nlower = -2.5\nupper = 2.5\nmax_velocity = 2.0\n'
    head = TWO[: TWO.index("[[joints]]")]
    (tmp_path / "two.toml").write_text(head + "".join(link.format(f"j{i}") for i in range(1, 5)))
    rule = 'kind = "lock"\njoints = ["j3", "j4"]'
    text = ELBOW.replace("q = [0.3, 1.0]", "q = [0.3, 0.4, 2.0, 2.0]").replace('kind = "moore-penrose"', rule)
    for name, reach in (("near", 0.6), ("far", 0.85)):
        points = [at(10.0, reach), at(10.0, reach + 0.05)]
        text += f'[[path]]\nname = "{name}"\nkind = "polyline"\npoints = {points}\nsamples = 50\n'
    (tmp_path / "job.toml").write_text(text)
    plan = plan_paths(read_job(tmp_path / "job.toml"), tmp_path / "job.toml", "only")
    assert (plan.left_out, plan.changes, plan.levels > 1) == ({}, 0, True)
    for each, reach in zip(plan.paths, (0.6, 0.85), strict=True):
        q = each.timed.q
        tool = 0.25 * np.array([f(np.cumsum(q, axis=1)).sum(axis=1) for f in (np.cos, np.sin)])
        assert tool[:, 0] == pytest.approx(at(10.0, reach), abs=1e-8)
        assert np.abs(q[:, 2:] - plan.paths[0].level).max() < 1e-8


def test_a_path_out_of_reach_is_left_out_and_the_others_are_done(tmp_path: Path, holokin: Command) -> None:
    file = elbow_job(tmp_path, {"near": 10.0, "far": 20.0, "last": 30.0})
    file.write_text(
        file.read_text().replace(str(at(20.0, 0.65)), str(at(20.0, 1.4))).replace(str(at(20.0)), str(at(20.0, 1.3)))
    )
    result = result_of(file)
    (rule,) = result.rules
    assert [row.name for row in rule.rows] == ["near", "last", "home"]
    assert "no posture within the limits has the tool at its start" in rule.left_out["far"]
    assert result.exit_code == 1
    done = holokin("run", str(file), "--out", str(tmp_path / "out"))
    assert done.code == 1
    assert "left out" in done.out


def test_a_file_of_several_paths_stands_for_all_of_them(tmp_path: Path) -> None:
    file = elbow_job(tmp_path, {"one": 10.0})
    rows = [(*at(angle, reach), name) for name, angle in (("a", 20.0), ("b", -20.0)) for reach in (0.6, 0.65, 0.7)]
    lines = ["x [m],y [m],z [m],path", *(f"{x},{y},0,{name}" for x, y, name in rows)]
    (tmp_path / "seams.csv").write_text("\n".join(lines))
    text = file.read_text() + '[[path]]\nname = "file"\nkind = "file"\nfile = "seams.csv"\nsamples = 50\n'
    file.write_text(text)
    (rule,) = result_of(file).rules
    assert [row.name for row in rule.rows] == ["one", "file a", "file b", "home"]
    assert [round(row.length, 6) for row in rule.rows] == [0.05, 0.1, 0.1, 0.0]
    file.write_text(text + 'only = "b"\n')
    assert [row.name for row in result_of(file).rules[0].rows] == ["one", "file", "home"]


def test_two_paths_of_one_name_and_keys_of_one_path_are_refused(tmp_path: Path) -> None:
    file = elbow_job(tmp_path, {"one": 10.0, "two": 20.0})
    text = file.read_text()
    for old, new, said in (
        ('name = "two"\nkind', 'name = "one"\nkind', r"path\.1\.name.*'one' is the name of path\.0"),
        ('name = "two"\nkind', "kind", r"path\.1\.name.*missing"),
        ('kind = "polyline"', 'kind = "polyline"\nentry = "joints"', "entry is of a job of one path"),
        ('kind = "polyline"', 'kind = "polyline"\nframe = "fixtur"', "no frame of"),
        ("[timing]\nacceleration = 5.0\ndt = 0.01", "", "timing.*missing"),
    ):
        file.write_text(text.replace(old, new))
        with pytest.raises(JobError, match=said):
            read_job(file)


def test_each_path_is_proven_from_the_posture_at_which_it_begins(tmp_path: Path, holokin: Command) -> None:
    # 100 degrees are reached with the elbow on one side alone, -100 with it on the other; the third is out of reach.
    file = elbow_job(tmp_path, {"left": 100.0, "right": -100.0, "far": 0.0})
    text = file.read_text()
    file.write_text(text.replace(str(at(0.0, 0.65)), str(at(0.0, 1.4))).replace(str(at(0.0)), str(at(0.0, 1.3))))
    done = holokin("certify", str(file), "--out", str(tmp_path / "out"))
    assert (done.code, done.out.count("Verified by the independent checker")) == (1, 2)
    assert "only, far: not certified: no posture within the limits" in " ".join(done.out.split())
    folder = tmp_path / "out" / "job-proof"
    for name, angle, elbow in (("left", 100.0, 1), ("right", -100.0, -1)):
        a, b = json.loads((folder / f"only--{name}-certificate.json").read_text())["pieces"][0]["q"]
        tool = 0.5 * np.array([np.cos(a) + np.cos(a + b), np.sin(a) + np.sin(a + b)])
        assert tool == pytest.approx(at(angle), abs=1e-6)
        assert np.sign(b) == elbow
    with pytest.raises(JobError, match="leave --workspace out"):
        list(certify_job(read_job(file), file, workspace=True))


def test_keys_of_every_path_stand_for_those_that_a_path_does_not_give(tmp_path: Path) -> None:
    file = elbow_job(tmp_path, {"one": 10.0, "two": 20.0})
    text = file.read_text()
    alone = read_job(file).paths
    shared = text.replace('kind = "polyline"\n', "").replace("samples = 50\n", "", 1)
    file.write_text(shared + '[every_path]\nkind = "polyline"\nsamples = 70\n')
    assert [(t.kind, t.samples, t.points) for t in read_job(file).paths] == [
        (t.kind, samples, t.points) for t, samples in zip(alone, (70, 50), strict=True)
    ]
    for line, said in (
        ("speed = -1.0", r"\[every_path\.speed\] is -1\.0"),
        ("sped = 1.0", r"\[every_path\.sped\] is an unknown key.*speed"),
        ('frame = "fixtur"', r"no frame of \[frames\]"),
    ):
        file.write_text(text + f"[every_path]\n{line}\n")
        with pytest.raises(JobError, match=said):
            read_job(file)
    one = text[: text.index("[air]")] + '[path]\nkind = "polyline"\nrelative = true\npoints = [[0, 0], [0, 0.1]]\n'
    file.write_text(one + "[every_path]\nspeed = 0.1\n")
    with pytest.raises(JobError, match=r"every_path.*is for several paths"):
        read_job(file)


def test_the_report_draws_the_paths_and_the_distances_that_checks_found(tmp_path: Path) -> None:
    file = elbow_job(tmp_path, {"left": 30.0, "right": -30.0})
    file.write_text(file.read_text().replace('"given"', '"given"\nvia = [[0.0, 2.4]]') + POST)
    result = result_of(file)
    (rule,) = result.rules
    found = min(row.clearance for row in rule.rows)
    assert 0 <= result.distances(rule.motion.q).min() - found < 1e-4  # checks look between samples, too
    seconds = [part.duration for row in rule.rows for part in (row.air, row.own) if part is not None]
    assert sum(seconds) == pytest.approx(rule.motion.duration)
    page = (write_paths_report(result, tmp_path / "out", "0") / "report.html").read_text()
    assert page.count("<figure") == 2  # of a robot in space a view from above, too
    figure = motion_figure(result, rule)
    joints, distances = figure.axes
    drawn = [line.get_ydata() for line in joints.lines[:2]]
    np.testing.assert_allclose(np.array(drawn).T[[0, -1]], rule.motion.q[[0, -1]])
    assert [text.get_text() for text in joints.texts[:2]] == ["1", "2"]
    assert min(distances.lines[0].get_ydata()) >= found


# --- Programs: an arm of six axes along three seams, as its controller reads them.

WELD = """
title = "Three seams"
[robot]
name = "ur10e"
tool = {{ xyz = [0.0, 0, 0.25] }}
[start]
q = [0, -100, 100, -90, -90, 0]
degrees = true
[task]
kind = "pose"
orientation = "axis"
[strategies.wrist]
kind = "lock"
joints = ["wrist_3_joint"]
level = 0.0
[frames.fixture]
xyz = [-0.75, -0.17, 0.2]
[timing]
acceleration = 8.0
dt = 0.02
[program]
tolerance = 0.002
on = ["output 5 on"]
off = ["output 5 off"]
[checks]
floor = 0.0
radius = {{ wrist_3_joint = {torch} }}
clearance = 0.005
[[checks.obstacles]]
name = "box"
{box}
frame = "fixture"
[[path]]
name = "Naht links"
kind = "polyline"
points = [[-0.15, 0.215, 0.065], [0.15, 0.215, 0.065]]
frame = "fixture"
samples = 100
[[path]]
name = "Näht rechts"
kind = "polyline"
points = [[-0.15, -0.215, 0.065], [0.15, -0.215, 0.065]]
frame = "fixture"
samples = 100
[[path]]
name = "loop"
kind = "polyline"
points = [{loop}]
frame = "fixture"
samples = 100
on = ["output 6 on"]
"""
BOX = 'kind = "box"\nsides = [0.3, 0.4, 0.1]'
ABOVE = "[0.0, -0.1, 0.08], [0.0, 0.1, 0.08]"


@pytest.fixture(scope="module")
def weld(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("weld") / "weld.toml"
    file.write_text(WELD.format(torch=0.006, box=BOX, loop=ABOVE), encoding="utf-8")
    return file


def test_names_that_a_language_cannot_hold_become_others_and_it_is_said(weld: Path) -> None:
    program, _ = program_of_paths("weld", read_job(weld), weld, "krl")
    assert all(text.isascii() for text in program.files.values())
    assert "Naht_rechts.src" in program.files
    assert "p_loop.src" in program.files  # a word of the language
    assert any("'Näht rechts' is Naht_rechts" in note for note in program.notes)


def test_advice_is_over_the_poses_of_all_paths_where_the_tip_is(weld: Path, tmp_path: Path) -> None:
    file = tmp_path / "weld.toml"
    frame = "tool_frame = { xyz = [0.0, 0.05, 0.1], rpy_deg = [0, 20, 0] }\n"
    file.write_text(weld.read_text().replace('name = "loop"\n', f'name = "loop"\n{frame}'))
    space = question(str(file)).workspace
    assert space is not None
    T = space.poses(255)
    tool = T[:, :3, 3] - [-0.75, -0.17, 0.2]
    third = (T @ [0.0, 0.05, 0.1, 1.0])[:, :3] - [-0.75, -0.17, 0.2]
    assert sum(abs(np.abs(tool[:, 1]) - 0.215) < 1e-9) == 170
    on_loop = (abs(third[:, 0]) < 1e-9) & (abs(third[:, 2] - 0.08) < 1e-9)
    assert (on_loop.sum(), np.ptp(third[on_loop, 1])) == (85, pytest.approx(0.2))


@pytest.mark.campaign
def test_a_job_of_several_paths_is_written_again_with_the_advised_rule(
    weld: Path, tmp_path: Path, holokin: Command
) -> None:
    out = tmp_path / "advised.toml"
    done = holokin("advise", str(weld), "--out", str(out))
    assert (done.code, "Note:" in done.out) == (0, False), done.out
    result = result_of(out)
    assert [rule.name for rule in result.rules] == ["advised", "wrist"]
    assert all(rule.passed for rule in result.rules)


# --- Ways through the air: over a height, and by way of postures.


def rests(timed: TimedTrajectory, way: int) -> None:
    """A motion that begins and ends at rest, within its limits of speed and acceleration, by differences of joints."""
    dt, limits = np.diff(timed.t)[:, None], timed.limits
    rates = np.diff(timed.q, axis=0) / dt
    assert (np.abs(rates) <= limits.velocity * 1.001).all(), way
    assert limits.acceleration is not None
    assert (np.abs(np.diff(rates, axis=0) / dt[1:]) <= limits.acceleration * 1.02).all(), way
    assert max(np.abs(rates[0]).max(), np.abs(rates[-1]).max()) <= 0.6 * (limits.acceleration * dt[0]).max(), way


def torch_gap(robot: hk.Robot, Q: np.ndarray) -> float:
    """The least distance [m] of the torch's axis, the last 0.25 m before the tool's point, from the box of `BOX`."""
    T = np.array([robot.pose(q) for q in Q])
    along = T[:, None, :3, 3] - np.linspace(0, 0.25, 126)[:, None] * T[:, None, :3, 2]
    outside = np.abs(along - [-0.75, -0.17, 0.2]) - [0.15, 0.2, 0.05]
    return float(np.linalg.norm(np.maximum(outside, 0), axis=2).min())


def test_a_way_over_a_height_rises_straight_and_is_clear_where_the_straight_one_is_not(tmp_path: Path) -> None:
    file = tmp_path / "job.toml"  # two seams beside the box, below its top
    file.write_text(WELD.format(torch=0.006, box=BOX, loop=ABOVE).replace("0.065]", "0.0]"), encoding="utf-8")
    plan = plan_paths(read_job(file), file, "wrist")
    robot, over = plan.paths[0].strategy.task.robot, 0
    ends = [np.deg2rad(read_job(file).start.q), *(each.timed.q[-1] for each in plan.paths)]
    for before, each in zip(ends, plan.paths, strict=False):
        for leg in each.air.legs:
            rests(leg, over)
        assert each.air.timed is not None
        assert torch_gap(robot, each.air.timed.q) >= 0.006 + 0.005 - 1e-4  # its radius and the clearance
        if not each.air.by.startswith("over a height of 0.1 m"):
            continue
        over += 1
        *_, down = each.air.legs
        up = each.air.legs[0]
        for leg, way in ((up, 1), (down, -1)) if len(each.air.legs) == 3 else ((down, -1),):
            p = np.array([robot.pose(q)[:3, 3] for q in leg.q])
            assert np.ptp(p[:, :2], axis=0).max() < 1e-4  # straight up or down
            assert way * (p[-1, 2] - p[0, 2]) == pytest.approx(0.1, abs=1e-6)
        straight = before + np.linspace(0, 1, 400)[:, None] * (each.timed.q[0] - before)
        assert torch_gap(robot, straight) < 0.006 + 0.005
    assert over


POST = """
[checks]
self_collision = false
radius = 0.02
[[checks.obstacles]]
name = "post"
kind = "capsule"
radius = 0.03
length = 0.5
xyz = [0.66, 0.0, 0.0]
"""


def test_a_way_round_a_post_passes_the_posture_given(tmp_path: Path) -> None:
    file = elbow_job(tmp_path, {"left": 30.0, "right": -30.0})
    file.write_text(file.read_text() + POST)
    (rule,) = result_of(file).rules
    assert "postures in via" in " ".join(rule.left_out.values())
    text = file.read_text().replace('order = "given"', 'order = "given"\nvia = [[0.0, 2.4]]')
    file.write_text(text)
    plan = plan_paths(read_job(file), file, "only")
    assert [each.name for each in plan.paths] == ["left", "right"]
    way = plan.paths[1].air
    assert way.by == "by way of posture 1" and way.timed is not None
    stop = [leg.q[-1] for leg in way.legs if np.abs(leg.q[-1] - [0.0, 2.4]).max() < 1e-9]
    assert len(stop) == 1
    for number, leg in enumerate(way.legs):
        rests(leg, number)
    # Both links, as points on their axes, keep their radius and the clearance from the post.
    a, b = way.timed.q[:, 0], way.timed.q.sum(axis=1)
    s = np.linspace(0, 0.5, 200)
    elbow = 0.5 * np.stack([np.cos(a), np.sin(a)], axis=1)
    ray = [np.stack([np.cos(x), np.sin(x)], axis=1)[:, None] * s[:, None] for x in (a, b)]
    near = min(np.linalg.norm(points - [0.66, 0.0], axis=2).min() for points in (ray[0], elbow[:, None] + ray[1]))
    assert near >= 0.02 + 0.03 + 0.01 - 1e-4


# --- Scenes: meshes with pockets, pieces, frames.


def pocket(file: Path, half: float) -> None:
    """A box of 0.3 x 0.4 x 0.1 m in mm with a square pocket, 80 mm deep, open above."""
    trimesh = pytest.importorskip("trimesh")
    x, y, low, high = 150.0, 200.0, -50.0, 50.0
    boxes = [((-x, -y, low), (x, y, high - 80)), ((-x, -y, low), (-half, y, high)), ((half, -y, low), (x, y, high))]
    boxes += [((-half, -y, low), (half, -half, high)), ((-half, half, low), (half, y, high))]
    trimesh.util.concatenate([trimesh.creation.box(bounds=bounds) for bounds in boxes]).export(file)


def test_a_pocket_stays_open_for_a_thin_torch_and_one_that_is_smaller_is_told(tmp_path: Path) -> None:
    file, mesh = tmp_path / "job.toml", 'kind = "mesh"\nfile = "box.stl"\nscale = 0.001'
    inside = "[0.0, -0.01, 0.0], [0.0, 0.01, 0.0]"  # 50 mm below the rim
    pocket(tmp_path / "box.stl", 60.0)
    file.write_text(WELD.format(torch=0.006, box=mesh, loop=inside), encoding="utf-8")
    (rule,) = result_of(file).rules
    assert rule.left_out == {}
    assert next(row for row in rule.rows if row.name == "loop").clearance < 0.06
    pocket(tmp_path / "box.stl", 12.0)  # 24 mm wide, for 10 mm of way, 12 mm of torch and twice 5 mm
    (rule,) = result_of(file).rules
    assert list(rule.left_out) == ["loop"]
    assert "box" in rule.left_out["loop"]
    file.write_text(WELD.format(torch=0.006, box=mesh.replace("\nscale = 0.001", ""), loop=inside), encoding="utf-8")
    with pytest.raises(JobError, match=r"scale = 0\.001"):
        result_of(file)


@pytest.mark.campaign
def test_convex_pieces_hold_the_mesh_and_leave_its_pocket_open(tmp_path: Path) -> None:
    pytest.importorskip("coacd")
    pocket(tmp_path / "box.stl", 60.0)
    mesh = hk.robot.Mesh(tmp_path / "box.stl", np.full(3, 1e-3))
    pieces = hk.robot.convex_pieces(mesh)

    def inside(point: list[float]) -> bool:
        """By the support of each piece: no direction in which the point is beyond it."""
        rng = np.random.default_rng(0)
        d = rng.normal(size=(4000, 3))
        d = np.vstack([d / np.linalg.norm(d, axis=1)[:, None], np.eye(3), -np.eye(3)])
        return any((d @ np.array(point) <= piece.support(d)).all() for piece in pieces)

    assert len(pieces) > 1
    assert not inside([0.0, 0.0, 0.0])
    assert not inside([0.04, 0.04, 0.03])
    assert inside([0.1, 0.0, 0.0])
    assert inside([0.0, 0.0, -0.045])
