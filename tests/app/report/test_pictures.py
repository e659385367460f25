"""What reports show: robots large and as they are, limits where they are, every line named; the palette; films."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START
from holokin.analysis.coverage import PoseStatus, coverage_slices
from holokin.app.job import open_job, run_job
from holokin.app.job.tables import ChecksTable
from holokin.app.report import animation, plots
from holokin.app.report import animation as films
from holokin.app.report.job_figures import cycles_figure, figures, two_paths_figure
from holokin.app.report.job_report import write_report
from holokin.app.report.job_result import JobResult
from holokin.app.report.plots import COLORS, color_of, drift_per_cycle, joint_cycles, law_colors, legible, rgb
from holokin.app.report.robot_panels import Actor, picture, stage_of
from holokin.app.report.robot_view import Rod, Window, best_view, drawn, pieces_of, posed, solids_at
from holokin.app.report.sheets_plots import coverage_figure
from holokin.robot import Box, obstacle
from holokin.robot.tree import joint_frames
from short_jobs import shortened
from sketches import sketches

PANDA = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])

# --- the palette ---

MACHADO = {
    "nobody": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""What of linear RGB is seen: Machado, Oliveira, Fernandes, IEEE TVCG 15 (6), 1291 (2009), severity 1.0."""


def lab(color: str, seen: list[list[float]]) -> np.ndarray:
    """CIE L*a*b* (D65) of a colour as it is seen."""
    s = np.array(rgb(color)) / 255
    linear = np.clip(np.array(seen) @ np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4), 0, 1)
    to_xyz = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    x = np.array(to_xyz) @ linear / [0.95047, 1.0, 1.08883]
    f = np.where(x > (6 / 29) ** 3, np.cbrt(x), x * (29 / 6) ** 2 / 3 + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("eye", MACHADO)
def test_no_two_colours_of_the_palette_look_alike_to_a_colour_blind_reader(eye: str) -> None:
    """A distance of 2.3 is just noticed; what is drawn beside each other is much farther apart."""
    seen = [lab(color, MACHADO[eye]) for color in COLORS]
    apart = [np.linalg.norm(a - b) for i, a in enumerate(seen) for b in seen[:i]]
    assert min(apart) > 15
    for one, other in (("HOLONOMIC", "NONHOLONOMIC"), ("CLOCKWISE", "COUNTER_CLOCKWISE"), ("GOOD", "BAD")):
        a, b = (lab(getattr(plots, name), MACHADO[eye]) for name in (one, other))
        assert np.linalg.norm(a - b) > 30, (one, other)


def test_laws_of_a_kind_have_colours_of_that_kind() -> None:
    assert law_colors([False, True, True, False]) == (plots.VERMILLION, plots.BLUE, plots.GREEN, plots.ORANGE)
    assert len(set(law_colors([True] * 4 + [False] * 4))) == 8
    assert rgb(color_of(0)) == (0, 0x72, 0xB2) == rgb(color_of(8))


# --- solids ---


def test_a_rod_is_drawn_where_it_is_and_hides_what_is_behind() -> None:
    """A ball of radius 1 covers pi square metres, its top is one radius nearer; one behind it is not seen."""
    window = Window(-2, 2, -2, 2, 200, 200)
    red, blue = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    ball = Rod(np.zeros(3), np.zeros(3), 1.0, red)
    layer = drawn([ball], window)
    assert layer.cover.sum() * window.pixel**2 == pytest.approx(np.pi, rel=0.01)
    assert layer.depth.max() == pytest.approx(1.0, abs=1e-3)
    both = drawn([Rod(np.array([0.2, 0, -3]), np.array([0.2, 0, -3]), 0.5, blue), ball], window)
    assert both.color[100, 100, 0] > 0.4 and both.color[100, 100, 2] < 0.3
    tilted = Rod(np.array([-1.0, 0, 0]), np.array([1.0, 0, 1.0]), 0.3, red)  # its surface: 0.3 m off its axis
    depth = drawn([tilted], window).depth[100, 100]
    assert depth == pytest.approx(0.5 + 0.3 * np.hypot(1, 0.5), abs=0.02)


@pytest.mark.parametrize("name", ["panda", "rail-ur10e", "yumi", "ppr"])
def test_the_drawn_robot_reaches_from_its_base_to_its_tools(name: str) -> None:
    """Every joint and tip of Pinocchio-tested kinematics lies in or on a solid that is drawn."""
    robot = hk.load(name)
    q = np.clip(0.3 * np.ones(robot.n), robot.lower, robot.upper)
    solids = solids_at(pieces_of(robot, q[None]), posed(robot, q), 0, plots.BLUE)
    boxes = np.array([solid.box() for solid in solids])
    points = [robot.pose(q, tip.name)[:3, 3] for tip in robot.tips]
    points += [p[0] for p, _ in joint_frames(robot, q[None])]
    for point in points:
        assert ((boxes[:, 0] - 1e-9 <= point) & (point <= boxes[:, 1] + 1e-9)).all(axis=1).any()


def test_a_rail_lies_along_its_axis_and_its_carriage_rides_on_it() -> None:
    """The beam of a UR10e's rail is along x from limit to limit or a little beyond the motion; it does not move."""
    robot = hk.load("rail-ur10e")
    Q = np.array([[0.4, 0, -1, 1, 0, 0, 0], [1.1, 0, -1, 1, 0, 0, 0]])
    pieces = pieces_of(robot, Q)
    (beam,) = [piece for piece in pieces if piece.role == "rail"]
    low, high = beam.solid.box()
    assert beam.joint == -1 and 5 * np.ptp([low[1], high[1]]) < high[0] - low[0]
    assert low[0] < 0.4 and high[0] > 1.1
    for k, q in enumerate(Q):
        solids = solids_at(pieces, posed(robot, Q), k, plots.BLUE)
        sled = next(s for p, s in zip(pieces, solids, strict=True) if p.role == "carriage")
        assert sled.box().mean(axis=0)[0] == pytest.approx(q[0], abs=1e-9)


# --- the picture of the robot ---


@pytest.mark.parametrize("name", ["panda", "irb140", "ppr", "rail-ur10e", "mobile-ur5e"])
def test_the_robot_fills_its_panel(name: str) -> None:
    robot = hk.load(name)
    q = PANDA if name == "panda" else np.clip(0.4 * np.ones(robot.n), robot.lower, robot.upper)
    stage = stage_of(robot, q[None])
    window = stage.scene.window(160)
    cover = stage.layer(q, plots.BLUE, window).cover > 0.5
    assert max(np.ptp(np.flatnonzero(cover.any(axis=k))) / cover.shape[1 - k] for k in (0, 1)) > 0.5
    assert cover[1:-1, 1:-1].sum() == cover.sum()  # nothing of it is cut off


def test_a_robot_is_seen_from_its_side_and_a_loop_is_not_seen_edge_on() -> None:
    """An arm in the plane of x and z is seen along y; an upright loop in y and z tilts the view towards x."""
    arm = np.array([[0, 0, 0], [0, 0, 0.5], [0.4, 0, 0.8], [0.8, 0, 0.4]], float)
    assert abs(best_view([arm]).axes[2] @ [0, 1, 0]) > 0.8
    turn = np.linspace(0, 2 * np.pi, 50)
    loop = np.array([0.8, 0, 0.4]) + 0.1 * np.column_stack([0 * turn, np.cos(turn), np.sin(turn)])
    assert abs(best_view([arm], [loop]).axes[2] @ [1, 0, 0]) > 0.3


def test_the_robot_is_seen_from_where_its_two_ends_differ_most() -> None:
    one = np.array([[0.0, 0, 0], [0, 0, 1]])
    for way in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
        other = one + 0.1 * np.array(way)
        assert abs(best_view([one, other], (), [(one, other)]).axes[2] @ way) < 0.6


def test_neither_end_of_the_ways_hides_the_other() -> None:
    """The clockwise end is solid; the other one is an outline round it, in its own colour, whether alike or apart."""
    robot = hk.load("planar-3r")
    for other in (0.0, 0.4):
        a, b = np.array([0.3, 0.5, 0.5]), np.array([0.3 + other, 0.5, 0.5])
        stage = stage_of(robot, np.array([a, b]))
        actors = [Actor(a, plots.CLOCKWISE), Actor(b, plots.COUNTER_CLOCKWISE, "outline")]
        seen = picture(stage, actors, [], stage.scene.window(240))
        warm = (seen[..., 0] > seen[..., 2] + 0.3) & (seen[..., 3] > 0.5)
        cool = (seen[..., 2] > seen[..., 0] + 0.15) & (seen[..., 3] > 0.5)
        assert warm.mean() > 0.004 and cool.mean() > 0.02


def test_obstacles_of_the_checks_are_drawn() -> None:
    robot = hk.load("planar-3r")
    q = np.array([0.3, 0.5, 0.5])
    post = obstacle("post", Box([0.2, 0.2, 0.2]), [-0.5, 0.9, 0])
    bare, beside = stage_of(robot, q[None]), stage_of(robot, q[None], obstacles=[post])
    assert beside.scene.bounds != bare.scene.bounds or beside.scene.bounds[0] < -0.4
    window = beside.scene.window(200)
    column, row = int((-0.5 - window.left) / window.pixel), int((window.top - 0.9) / window.pixel)
    assert picture(beside, [Actor(q, plots.BLUE)], [], window)[row, column, 3] > 0.9
    assert picture(replace(beside, obstacles=()), [Actor(q, plots.BLUE)], [], window)[row, column, 3] < 0.1


@pytest.mark.campaign
def test_a_job_hands_its_obstacles_to_its_report(tmp_path: Path) -> None:
    _, _, file = open_job("panda-circle")
    post = 'name = "post"\nkind = "sphere"\nradius = 0.1\nxyz = [0, 1, 0]\n'
    pin = 'name = "pin"\non = "panda_hand_tcp"\nkind = "sphere"\nradius = 0.01\n'
    text = file.read_text("utf-8") + f"[checks]\n[[checks.obstacles]]\n{post}[[checks.obstacles]]\n{pin}"
    (tmp_path / "job.toml").write_text(text.replace("samples = 400", "samples = 20"), "utf-8")
    result = run_job(*open_job(str(tmp_path / "job.toml")))
    assert [one.link for one in result.obstacles] == ["post"]
    assert [one.link for one in result.robot.shapes if one.carried] == ["pin"]


def test_a_tool_of_the_checks_is_drawn_on_its_tip_and_the_arm_as_before() -> None:
    """A pin of 0.1 m, of which the middle is 0.05 m beyond the tip along its z axis."""
    arm, q = hk.load("panda"), PANDA_START
    pin = {"name": "pin", "on": "panda_hand_tcp", "kind": "capsule", "radius": 0.01, "length": 0.1, "xyz": [0, 0, 0.05]}
    shown = ChecksTable.model_validate({"obstacles": [pin]}).drawn(arm)
    pieces, before = pieces_of(shown, q[None]), pieces_of(arm, q[None])
    (tool,) = (piece for piece in pieces if piece.part.carried)
    assert [piece.role for piece in pieces if piece is not tool] == [piece.role for piece in before]
    p, R = joint_frames(shown, q[None])[tool.part.joint]
    tip = arm.pose(q)
    middle = p[0] + R[0] @ tool.part.placement[:3, 3]
    assert middle == pytest.approx(tip[:3, 3] + 0.05 * tip[:3, 2], abs=1e-12)
    assert ChecksTable().drawn(arm) is arm


# --- lines and their names ---


@pytest.fixture(scope="module")
def circle() -> JobResult:
    return shortened("panda-circle", cycles=2, samples=30)


@pytest.mark.campaign
def test_limits_are_drawn_where_they_are(circle: JobResult) -> None:
    """Joint 1 near its limit: a line at it. The others: their numbers at the panel's edge."""
    near = replace(circle.robot.coordinates[0], lower=-0.05, upper=0.35)
    robot = replace(circle.robot, coordinates=(near, *circle.robot.coordinates[1:]))
    made = {stem: figure for stem, _, figure in figures(replace(circle, robot=robot))}
    first, second, *_ = made["paths-moore-penrose"].axes
    dotted = {float(line.get_ydata()[0]) for line in first.lines if line.get_label() == "limit"}
    assert dotted == {-0.05, 0.35}
    assert first.get_ylim()[0] < -0.05 and first.get_ylim()[1] > 0.35
    assert [text.get_text() for text in second.texts] == ["\u2193 -1.76", "\u2191 1.76"]
    bars = made["ranges"].axes[0].patches
    used = circle.strategies[0].cycles.q[:, 0]
    assert bars[0].get_x() == pytest.approx((used.min() + 0.05) / 0.4)
    assert bars[0].get_width() == pytest.approx(np.ptp(used) / 0.4)


def test_nothing_of_a_panel_is_cut_off_at_the_edge_of_the_picture(circle: JobResult) -> None:
    """The limit of joint 4 is the longest number beside a panel."""
    for figure in (two_paths_figure(circle.strategies[0], circle), cycles_figure(circle)):
        legible(figure).canvas.draw()
        box, edge = figure.get_tightbbox(), 0.01  # inches
        assert min(box.x0, box.y0) > -edge
        assert box.x1 < figure.get_figwidth() + edge and box.y1 < figure.get_figheight() + edge


@pytest.mark.parametrize("joints", [2, 7, 14])
def test_every_joint_has_its_name(circle: JobResult, joints: int) -> None:
    import matplotlib.figure

    from holokin.app.report.plots import movers

    walk = circle.strategies[0].cycles
    names = tuple(f"joint {k}" for k in range(joints))
    wide = replace(walk, q=np.resize(walk.q, (len(walk.q), joints)), robot=hk.robot.coordinates(names))
    axes = joint_cycles(matplotlib.figure.Figure().subplots(), wide, movers([wide]))
    said = " ".join(axes.get_legend_handles_labels()[1])
    assert all(name in said for name in names)
    colored = [line for line in axes.lines if line.get_label() in names]
    assert len({line.get_color() for line in colored}) == len(colored) == min(joints, 7)


@pytest.mark.parametrize("laws", [1, 3, 12, 27])
def test_every_law_in_the_picture_of_drift_is_named_or_counted(circle: JobResult, laws: int) -> None:
    import matplotlib.figure

    drifts, repeats = circle.strategies[0].cycles, circle.strategies[1].cycles
    walks = {f"law {k}": drifts if k % 2 else repeats for k in range(laws)}
    figure = matplotlib.figure.Figure(figsize=(9, 4))
    axes = drift_per_cycle(figure.subplots(), walks)
    told = [text for text in axes.texts if "round-off" not in text.get_text()]
    counted = [int(t.get_text().split()[0]) for t in told if "strategies" in t.get_text()]
    named = [t.get_text() for t in told if t.get_text() in walks]
    assert len(named) + sum(counted) == laws
    heights = sorted(text.get_position()[1] for text in told)
    assert len(heights) <= 8 and np.diff(heights).min(initial=1.0) > 0.05  # none over another


@pytest.mark.campaign
def test_one_way_is_not_called_two() -> None:
    name, job, file = open_job("ppr-half-circle")
    result = run_job(name, job.model_copy(update={"expect": {}}), file)
    one_way = replace(result, strategies=tuple(replace(s, two_paths=None) for s in result.strategies))
    stem, caption, _ = next(iter(figures(one_way)))
    assert stem == "robot" and "clockwise" not in caption and "end of its path" in caption


# --- films ---


@pytest.mark.campaign
def test_a_film_has_all_its_frames_and_is_small(
    circle: JobResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import imageio_ffmpeg

    monkeypatch.setattr(films, "WIDTH", 180)
    monkeypatch.setattr(films, "FRAMES", 24)
    monkeypatch.setattr(films, "MOST_FRAMES", 24)

    made = films.animate(circle, tmp_path)
    assert [name for name, _ in made] == ["cycles.mp4", "paths.mp4"]
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "paths.mp4"))
    assert frames == films.FRAMES + 1 + animation.HOLD
    reader = imageio_ffmpeg.read_frames(str(tmp_path / "cycles.mp4"))
    columns, rows = next(reader)["size"]
    pictures = [np.frombuffer(data, np.uint8).reshape(rows, columns, 3).astype(int) for data in reader]
    assert np.abs(pictures[20] - pictures[0]).max() > 50
    assert all((tmp_path / name).stat().st_size < animation.MOST_BYTES for name, _ in made)
    monkeypatch.setattr("holokin.app.report.job_report.figures", sketches)
    folder = write_report(circle, tmp_path / "out", "0", lambda folder: _copied(made, tmp_path, folder))
    assert (folder / "report.html").read_text("utf-8").count("<video autoplay loop muted playsinline controls") == 2


def _copied(made: list[tuple[str, str]], source: Path, folder: Path) -> list[tuple[str, str]]:
    for name, _ in made:
        (folder / name).write_bytes((source / name).read_bytes())
    return made


def test_a_film_of_noise_is_made_smaller_until_it_is_small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise does not compress; without imageio-ffmpeg it is a GIF, of which a smaller one is written."""
    from PIL import Image

    monkeypatch.setattr(animation, "MOST_BYTES", 200_000)
    noise = np.random.default_rng(0).integers(0, 255, (3, 300, 300, 3), dtype=np.uint8)
    animation.write_film(list(noise), tmp_path / "noise.gif")
    assert (tmp_path / "noise.gif").stat().st_size <= 200_000
    with Image.open(tmp_path / "noise.gif") as picture:
        assert picture.n_frames >= 3 and picture.size[0] < 300


@pytest.mark.campaign
def test_nothing_of_a_map_is_cut_off_at_the_edge_of_the_picture() -> None:
    """Every cause that a pose may have is in the legend, with its share; beside it stands the cloud, in space."""
    robot = hk.load("panda")
    law, q0 = hk.holonomic(hk.pose(robot), hk.lock(3)), PANDA_START
    box = hk.workspace(box=([0.3, -0.2, 0.2], [0.7, 0.2, 0.6]))
    found, slices = hk.coverage(law, box, q0, samples=32), coverage_slices(law, box, q0, steps=3)
    every = replace(found, status=np.resize(list(PoseStatus), 32))
    figure = legible(coverage_figure(every, slices))
    figure.canvas.draw()
    size, edge = figure.get_size_inches(), 0.01  # inches
    for part in (*figure.legends, *figure.axes):
        (x0, y0), (x1, y1) = part.get_tightbbox().get_points() / figure.dpi
        assert min(x0, y0) > -edge and x1 < size[0] + edge and y1 < size[1] + edge, part
    legend = figure.legends[0].get_window_extent()
    assert not any(axes.get_tightbbox().overlaps(legend) for axes in figure.axes)
