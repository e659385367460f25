"""The pictures of the site, from the library itself: `python docs/pictures.py` writes docs/pictures/*.png again."""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import holokin as hk
from holokin.analysis.curvature.obstructions import ElbowField, field_on_leaf, sphere_of
from holokin.analysis.curvature.sphere_index import spread
from holokin.app.job import open_job, run_job
from holokin.app.report.animation import CONTROLS, cycles_frames, shown_strategies, write_film
from holokin.app.report.job_figures import cycles_figure, robot_figure
from holokin.app.report.job_result import JobResult
from holokin.app.report.plots import BLUE, SKY, legible, region_figure, style
from holokin.app.report.plots import VERMILLION as RED
from holokin.app.report.proof_picture import box_figure
from holokin.app.report.self_motion_plots import self_motion_figure
from holokin.app.report.sheets_plots import sheets_figure

HERE = Path(__file__).parent

OUT = HERE / "pictures"
PANDA = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")


def save(figure: plt.Figure, name: str, dpi: int = 110) -> None:
    """As a PNG, small enough for a repository."""
    OUT.mkdir(exist_ok=True)
    legible(figure).savefig(OUT / f"{name}.png", dpi=dpi, bbox_inches="tight", facecolor="white")
    plt.close(figure)
    with Image.open(OUT / f"{name}.png") as picture:
        whole = picture.convert("RGB")
    whole.save(OUT / f"{name}.png", optimize=True)
    print(name, (OUT / f"{name}.png").stat().st_size // 1000, "kB")


def arm(axes: plt.Axes, robot: hk.Robot, q: np.ndarray, **line: object) -> None:
    """A planar arm as sticks, its joints as dots."""
    points = np.array([[0.0, 0.0], *(reach(robot, q, k) for k in range(1, robot.n + 1))])
    axes.plot(*points.T, "-o", markersize=3, solid_capstyle="round", **line)


def reach(robot: hk.Robot, q: np.ndarray, links: int) -> np.ndarray:
    """Where the first `links` links of an arm of equal links end: (2,)."""
    length = np.linalg.norm(robot.pose(np.zeros(robot.n))[:2, 3]) / robot.n
    angles = np.cumsum(q)[:links]
    return length * np.array([np.cos(angles).sum(), np.sin(angles).sum()])


def self_motion() -> None:
    """One tool position, many postures."""
    robot = hk.load("planar-3r")
    q0 = np.array([0.9, -0.9, -0.7])
    postures = hk.strategies.self_motion_curve(hk.position(robot, rows=[0, 1]), q0, limits=False).q
    figure, axes = plt.subplots(figsize=(4.6, 4.0))
    colours = plt.get_cmap("viridis")(np.linspace(0, 0.95, 9))
    for q, colour in zip(postures[:: len(postures) // 9], colours, strict=False):
        arm(axes, robot, q, color=colour, linewidth=1.6, alpha=0.75)
    tool = robot.pose(q0)[:2, 3]
    axes.plot(*tool, "o", markersize=11, markerfacecolor="none", markeredgecolor="k", markeredgewidth=1.6)
    axes.annotate("tool", tool, (8, 8), textcoords="offset points")
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="Self-motion: one tool position, many postures")
    save(figure, "self-motion")


def leaf_on_self_motions() -> None:
    """All self-motions of a Panda's tool pose, and a leaf of the arm angle as a level on them."""
    task = hk.pose(hk.load("panda"))
    pose = task.robot.pose([-0.53, 0.17, -2.74, -0.81, 0.22, 1.23, 1.67])
    motion = hk.motion.ik.self_motion(task, pose)
    save(self_motion_figure(motion, hk.holonomic(task, hk.arm_angle()), -1.0), "leaf-on-self-motions", dpi=100)


def planar_loops() -> None:
    """The same ten loops by two strategies: where the arm stands after each."""
    robot = hk.load("planar-3r")
    task, q0 = hk.position(robot, rows=[0, 1]), np.array([0.2, 1.1, 1.2])
    tool = robot.pose(q0)[:3, 3]
    loop = hk.circle(tool, center=tool - [0.0, 0.4, 0])
    figure, pair = plt.subplots(1, 2, figsize=(8.6, 3.9), sharex=True, sharey=True)
    laws = {
        "pseudo-inverse": hk.moore_penrose(task),
        "holonomic, g(q) = q1 + q2 + q3": hk.holonomic(task, hk.linear([1, 1, 1])),
    }
    for axes, (name, law) in zip(pair, laws.items(), strict=True):
        walk = hk.follow(law, loop, q0, samples=400, cycles=10, limits=False)
        axes.plot(*np.array([robot.pose(q)[:2, 3] for q in walk.q[:401:4]]).T, color="0.6", linewidth=1)
        ends = walk.q[np.linspace(0, len(walk.q) - 1, 6).round().astype(int)]
        for k, q in enumerate(ends):
            colour = plt.get_cmap("viridis")(0.95 * k / 5)
            arm(axes, robot, q, color=colour, linewidth=1.8, label=f"after {2 * k} loops")
        largest = float(np.abs(ends[-1] - ends[0]).max())
        said = f"{largest:.2f} rad away" if largest > 1e-6 else f"{largest:.0e} rad away"
        axes.set(aspect="equal", title=f"{name}\nafter 10 loops {said}", xlabel="x [m]")
    pair[0].set_ylabel("y [m]")
    pair[1].legend(fontsize=8, loc="center left", bbox_to_anchor=(1.02, 0.5))
    save(figure, "ten-loops")


def leaves() -> None:
    """Over the plane of the tool the joint space of the PPR arm: leaves, and what a loop of the tool does there."""
    robot = hk.load("ppr")
    task = hk.position(robot)
    G = hk.null_basis(task, lambda q: [[ca.cos(q[2]) ** 2, 0], [0, 1], [-ca.sin(q[2]), 0]])
    g = hk.holonomic(task, hk.custom(lambda q: q[0] + ca.cos(q[2]) + ca.log(ca.tan(q[2] / 2))))
    figure = plt.figure(figsize=(5.6, 4.9))
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    x, y = np.meshgrid(np.linspace(-0.7, 0.7, 15), np.linspace(-0.7, 0.7, 9))
    for angle, alpha in ((0.85, 0.32), (1.35, 0.32)):
        ik = hk.ik(g, on_tool(0.0, 0.0, angle))
        height = np.array([ik([a, b, 0.0])[2] for a, b in zip(x.flat, y.flat, strict=True)]).reshape(x.shape)
        axes.plot_surface(x, y, height, color=SKY, alpha=alpha, linewidth=0, zorder=1)
        axes.plot_wireframe(x, y, height, color=BLUE, linewidth=0.4, alpha=0.6, zorder=2)
    start = hk.ik(g, on_tool(0.0, 0.0, 0.85))([0.5, 0.0, 0.0])
    tool = robot.pose(start)[:3, 3]
    loop = hk.circle(tool, center=tool - [0.5, 0, 0])
    for law, colour, label, cycles in (
        (hk.moore_penrose(task), RED, "pseudo-inverse: it climbs", 3),
        (G, BLUE, "holonomic: it stays on its leaf", 1),
    ):
        walk = hk.follow(law, loop, start, samples=300, cycles=cycles, limits=False)
        places = np.array([robot.pose(q)[:2, 3] for q in walk.q])
        axes.plot(*places.T, walk.q[:, 2], color=colour, linewidth=2, label=label, zorder=5)
        axes.plot(*places.T, 0.2, color="0.55", linewidth=1, zorder=0)
    axes.plot([tool[0]] * 2, [tool[1]] * 2, [0.2, 2.2], color="0.35", linewidth=1, linestyle=":", zorder=4)
    axes.text(tool[0], tool[1], 2.25, "self-motion", fontsize=8, ha="center")
    axes.text(-0.1, -1.0, 0.2, "path of the tool", fontsize=8, color="0.35")
    axes.set(xlabel="tool x [m]", ylabel="tool y [m]", zlabel="q3 [rad]", zlim=(0.2, 2.2))
    axes.set(xticks=[-0.5, 0, 0.5], yticks=[-0.5, 0, 0.5], zticks=[0.5, 1.0, 1.5, 2.0])
    axes.view_init(18, -58)
    axes.legend(fontsize=8, loc="upper left")
    save(figure, "leaves")


def on_tool(x: float, y: float, angle: float) -> np.ndarray:
    """The posture of the PPR arm with its tool at (x, y) and its hinge at an angle."""
    link = np.array([hk.load("ppr").pose([0, 0, angle])[0, 3], hk.load("ppr").pose([0, 0, angle])[1, 3]])
    return np.array([x - link[0], y - link[1], angle])


EDGE_DT, HAND_SPEED = 1e-3, 0.5
EDGE_CORNERS = np.array([[0, 0, 0], [0.55, 0, 0.1], [0.45, 0.45, 0.1], [0.2, 0.35, 0], [0, 0, 0]])
"""Of a hand that leaves the reach of a Panda along the tool's x axis and comes back elsewhere [m]."""


def hand_at_the_edge(robot: hk.Robot, ready: np.ndarray) -> np.ndarray:
    """The poses (k, 4, 4) of the hand, one a millisecond, in one orientation."""
    counts = [int(np.ceil(np.linalg.norm(b - a) / (EDGE_DT * HAND_SPEED))) for a, b in pairwise(EDGE_CORNERS)]
    legs = zip(pairwise(EDGE_CORNERS), counts, strict=True)
    shifts = np.vstack([*(np.linspace(*leg, k, endpoint=False) for leg, k in legs), EDGE_CORNERS[-1:]])
    poses = np.tile(robot.pose(ready), (len(shifts), 1, 1))
    poses[:, :3, 3] += shifts
    return poses


def damped_step(robot: hk.Robot, q: np.ndarray, pose: np.ndarray, damping: float) -> np.ndarray:
    """q + J^T (J J^T + damping^2)^-1 e, the whole error in one step."""
    J, tool = robot.jacobian(q), robot.pose(q)
    turn = np.cross(tool[:3, :3].T, pose[:3, :3].T).sum(axis=0) / 2
    e = np.concatenate([pose[:3, 3] - tool[:3, 3], turn])
    return q + J.T @ np.linalg.solve(J @ J.T + damping**2 * np.eye(6), e)


def edge_of_reach() -> None:
    """A hand leaves the reach of a Panda: the nearest pose, damped steps, and a robot that waits."""
    robot, ready = hk.load("panda"), np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    poses = hand_at_the_edge(robot, ready)
    ik = hk.ik(hk.holonomic(hk.pose(robot), hk.lock(2)), ready)
    answers = ik.batch(poses)
    solved = {pose.tobytes(): q for pose, q, ok in zip(poses, answers.q, answers.reached, strict=True) if ok}
    laws = {
        "`ik`, waits where the pose is out of reach": lambda q, pose: solved.get(pose.tobytes(), q),
        "damped least squares, 0.1": lambda q, pose: damped_step(robot, q, pose, 0.1),
        "`ik.nearest`": lambda q, pose: ik.nearest(pose, q, limits=True).q,
    }
    time = EDGE_DT * np.arange(len(poses))
    figure, (top, joint, speed) = plt.subplots(1, 3, figsize=(9.4, 3.7), width_ratios=(1, 1.1, 1.1))
    top.plot(*poses[:, :2, 3].T, "--", color="0.45", linewidth=1.4, label="hand")
    lines = {
        "`ik`, waits where the pose is out of reach": ("0.6", 1.6),
        "damped least squares, 0.1": (RED, 1.6),
        "`ik.nearest`": (BLUE, 1.9),
    }
    for name, (colour, width) in lines.items():
        Q = [ready]
        for pose in poses[1:]:
            Q.append(laws[name](Q[-1], pose))
        tool = robot.pose_batch(np.array(Q))[0]
        top.plot(*tool[:, :2].T, color=colour, linewidth=width, label=name.replace("`", ""))
        joint.plot(time, [q[3] for q in Q], color=colour, linewidth=width)
        rates = np.abs(np.diff(Q, axis=0)).max(axis=1) / EDGE_DT
        speed.plot(time[1:], rates, color=colour, linewidth=width)
    top.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="the tool from above")
    joint.set(xlabel="time [s]", ylabel="elbow, joint 4 [rad]", title="a joint")
    speed.set(xlabel="time [s]", ylabel="rad/s", yscale="log", ylim=(0.1, 1e3), title="the fastest joint")
    figure.tight_layout(rect=(0, 0.08, 1, 1))
    figure.legend(loc="lower center", ncols=4)
    save(figure, "edge")


def swivel() -> None:
    """Where an iiwa's elbow points, over all directions of its wrist, for two swivel angles; their poles."""
    task = hk.pose(hk.load("iiwa14"))
    arm = hk.strategies.constraints.find_arm(task)
    figure, pair = plt.subplots(1, 2, figsize=(9.6, 5.2))
    for axes, definition, level, view in (
        (pair[0], "conventional", np.pi / 2, (0.55, -0.65, 0.62)),
        (pair[1], "stereographic", 0.0, (-0.83, -0.42, 0.36)),
    ):
        law = hk.holonomic(task, hk.arm_angle(definition=definition))
        start = on_sphere(law, level, (0.55, -0.62, 0.56))
        found = hk.analysis.curvature.obstruction(law, hk.analysis.curvature.Directions(), start)
        field = field_on_leaf(law, start, sphere_of(task, start, arm), arm)
        states, *_ = spread(field, field.start, field.sphere.direction, 2)
        globe(axes, np.array(view))
        for state in states:
            streak(axes, field, state, np.array(view))
        for witness in found.witnesses:
            x, y, depth = seen(witness.direction, np.array(view))
            at, faint = np.array([x, y]), 1.0 if depth > 0 else 0.35
            axes.plot(*at, "o", color=RED, markersize=11, alpha=faint, zorder=6)
            side = (12, 14) if depth > 0 else (12, -20)
            behind = "" if depth > 0 else " (behind)"
            axes.annotate(
                f"index {witness.index}{behind}",
                at,
                side,
                textcoords="offset points",
                color=RED,
                weight="bold",
                fontsize=12,
                alpha=max(faint, 0.6),
                zorder=7,
                bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.5},
            )
        count = "two poles" if len(found.witnesses) == 2 else "one pole"
        axes.set_title(f"{definition} angle: {count}, index {found.total} in all", fontsize=12)
    figure.suptitle("Where the elbow points, over all directions from shoulder to wrist", fontsize=14)
    figure.tight_layout(rect=(0, 0, 1, 0.97))
    save(figure, "swivel")


def on_sphere(law: hk.Strategy, level: float, direction: tuple[float, float, float]) -> np.ndarray:
    """A posture of an iiwa 14 on a leaf, its wrist in a direction from the shoulder, its tool down."""
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[:3, 3] = [0, 0, 0.36] + 0.6 * np.array(direction) / np.linalg.norm(direction) + 0.126 * T[:3, 2]
    return hk.motion.ik.all_postures(law, T, level, limits=False).q[0]


def seen(u: np.ndarray, view: np.ndarray) -> np.ndarray:
    """(right, up, towards the eye) of points (..., 3), seen from a direction, z upwards."""
    back = view / np.linalg.norm(view)
    right = np.cross([0, 0, 1.0], back)
    right /= np.linalg.norm(right)
    return u @ np.array([right, np.cross(back, right), back]).T


def globe(axes: plt.Axes, view: np.ndarray) -> None:
    """A sphere with its circles, and the axes of the base."""
    shade = np.linspace(-1.02, 1.02, 400)
    x, y = np.meshgrid(shade, shade)
    light = np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    shown = np.where(
        x**2 + y**2 < 1, 0.80 + 0.17 * (0.75 * light + 0.25 * np.clip(0.6 * y - 0.5 * x + light, 0, 1)), np.nan
    )
    axes.imshow(shown, extent=(-1.02, 1.02, -1.02, 1.02), origin="lower", cmap="gray", vmin=0, vmax=1, zorder=0)
    turn = np.linspace(0, 2 * np.pi, 200)
    circle = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    for height in np.deg2rad([-60, -30, 0, 30, 60]):
        front(axes, np.cos(height) * circle + [0, 0, np.sin(height)], view)
    for angle in np.deg2rad(np.arange(0, 180, 30)):
        ring = np.stack([np.cos(angle) * circle[:, 0], np.sin(angle) * circle[:, 0], circle[:, 1]], axis=1)
        front(axes, ring, view)
    for name, axis in zip("xyz", np.eye(3), strict=True):
        for side, label in ((1, name), (-1, f"-{name}")):
            tip = seen(side * axis * np.array([1.0, 1.16])[:, None], view)
            if tip[0, 2] > -0.15:
                axes.plot(*tip[:, :2].T, color="0.25", linewidth=1.3, zorder=5)
                axes.annotate(
                    label,
                    tip[0, :2] + 1.75 * (tip[1, :2] - tip[0, :2]),
                    ha="center",
                    va="center",
                    fontsize=11,
                    color="0.2",
                    zorder=5,
                )
    axes.set(aspect="equal", xlim=(-1.18, 1.18), ylim=(-1.12, 1.34))
    axes.axis("off")


def front(axes: plt.Axes, points: np.ndarray, view: np.ndarray) -> None:
    """A line on the sphere, where it is on the side of the eye."""
    flat = seen(points, view)
    flat[flat[:, 2] < 0] = np.nan
    axes.plot(*flat[:, :2].T, color="0.6", linewidth=0.5, zorder=1)


def streak(axes: plt.Axes, field: ElbowField, state: tuple[np.ndarray, np.ndarray], view: np.ndarray) -> None:
    """A short arrow along the elbow's direction, from the postures of the arm."""
    points = [state[1]]
    for _ in range(10):
        there = field.step(state, points[-1])
        if there is None:
            break
        ahead = points[-1] + 0.017 * there[1]
        state, points = there[0], [*points, ahead / np.linalg.norm(ahead)]
    flat = seen(np.array(points), view)
    if flat[0, 2] < 0.08 or len(flat) < 3:
        return
    axes.plot(*flat[:, :2].T, color=BLUE, linewidth=1.7, solid_capstyle="round", zorder=3)
    axes.annotate(
        "",
        flat[-1, :2],
        flat[-3, :2],
        arrowprops={
            "arrowstyle": "-|>",
            "color": BLUE,
            "mutation_scale": 13,
            "shrinkA": 0,
            "shrinkB": 0,
            "linewidth": 0,
        },
        zorder=3,
    )


def cusp() -> None:
    """A leaf that folds over the poses, with a loop about the cusp; and the joints of a Panda along such a loop."""
    figure = plt.figure(figsize=(9.6, 4.4))
    axes = figure.add_subplot(1, 2, 1, projection="3d", computed_zorder=False)
    y = np.linspace(-1.05, 0.9, 61)
    edge_s = np.array([np.roots([1, 0, v, -1.1])[np.isreal(np.roots([1, 0, v, -1.1]))].real.max() for v in y])
    s, y = np.linspace(-1, 1, 81) * edge_s[:, None], np.tile(y[:, None], (1, 81))
    axes.plot_surface(s**3 + y * s, y, s, color=SKY, alpha=0.6, linewidth=0, rstride=1, cstride=1, zorder=1)
    floor, fold = -2.9, np.linspace(-0.59, 0.59, 61)
    axes.plot(-2 * fold**3, -3 * fold**2, floor, color="0.35", linewidth=1.6, zorder=0)
    t = np.linspace(-1, 1, 161)
    up, over = 0.9 * t, 0.62 - (0.62 + 0.81) * t**6  # on the leaf, and the loop of the tool below it
    along = up**3 + over * up
    axes.plot(along, over, up, color=RED, linewidth=2.4, zorder=4)
    axes.plot(along, over, floor, color=RED, linewidth=2.4, zorder=1)
    for end in (0, -1):
        axes.plot(*([v[end]] * 2 for v in (along, over)), [floor, up[end]], ":", color="0.4", linewidth=1, zorder=2)
        axes.plot([along[end]], [over[end]], [up[end]], "o", color="k", markersize=6, zorder=5)
    axes.plot([along[0]], [over[0]], [floor], "o", color="k", markersize=6, zorder=5)
    axes.plot([0], [0], [floor], "*", color="0.2", markersize=11, zorder=5)
    axes.text(0.15, 0.1, floor, "cusp", fontsize=10, zorder=6)
    axes.text(along[-1] + 0.1, over[-1], up[-1] + 0.15, "after", fontsize=10, zorder=6)
    axes.text(along[0] + 0.1, over[0], up[0] - 0.35, "before", fontsize=10, zorder=6)
    axes.set(zlim=(floor, 1.4), xlabel="tool poses", zlabel="joints", title="The leaf folds over the tool poses")
    axes.set_xticks([]), axes.set_yticks([]), axes.set_zticks([])
    axes.zaxis.labelpad = -14
    axes.view_init(26, -118)
    robot = hk.load("panda")
    found = hk.cusps(hk.holonomic(hk.pose(robot), hk.lock(2)), [0.0, 0.4, 0.2, -1.8, 0.1, 2.2, 0.8]).witness
    strategy = hk.holonomic(hk.pose(robot), hk.lock(2))
    walk = hk.follow(strategy, found.path, found.first, samples=400)
    share = np.linspace(0, 100, len(walk.q))
    axes = figure.add_subplot(1, 2, 2)
    for i, colour in zip(range(7), plt.get_cmap("viridis")(np.linspace(0, 0.92, 7)), strict=True):
        axes.plot(share, walk.q[:, i] - walk.q[0, i], color=colour, label=f"joint {i + 1}")
    tool = np.linalg.norm([robot.pose(q)[:3, 3] - robot.pose(walk.q[0])[:3, 3] for q in walk.q], axis=1)
    axes.plot(share, 100 * tool, "--", color=RED, linewidth=2, label="tool [cm]")
    axes.set(
        xlabel="share of the tool loop [%]",
        ylabel="change since the start [rad]; tool [cm]",
        title=f"Panda, joint 3 locked: a loop of {100 * found.length:.1f} cm",
    )
    axes.legend(fontsize=8, ncols=2)
    figure.tight_layout(w_pad=3)
    save(figure, "cusp")


ORTHOGONAL = ((0.5, 0.15), (1.7, 1.0), (1.2, 1.6), (2.0, 3.0), (0.5, 1.6))
"""d3, d4 of an arm of each of five domains; d2 = 1, r2 = 0.5."""


def orthogonal_arm(d3: float, d4: float, d2: float = 1.0, r2: float = 0.5) -> hk.Robot:
    """Three hinges at right angles to one another."""
    rows = [{}, {"a": d2, "alpha": -np.pi / 2, "d": r2}, {"a": d3, "alpha": np.pi / 2}]
    tool = np.eye(4)
    tool[0, 3] = d4
    return hk.from_dh(rows, "modified", name="orthogonal", tool=tool)


def cusps_of_orthogonal_arms() -> None:
    """Half planes through the first axis: how many postures a tool position has, the singular curves, the cusps."""
    figure, panels = plt.subplots(2, 3, figsize=(10.2, 8.4))
    shades = ("#FFFFFF", "#DCEBF5", "#A9CFE8")
    for number, ((d3, d4), axes) in enumerate(zip(ORTHOGONAL, panels.ravel()[:5], strict=True), 1):
        task = hk.position(orthogonal_arm(d3, d4))
        law = hk.moore_penrose(task)

        # how many joints q3 solve z^2 + (F cos q2)^2 = F^2, where rho and z give F cos q2 as a function of q3
        q3 = np.linspace(-np.pi, np.pi, 721)
        F, height = d3 + d4 * np.cos(q3), 0.5 + d4 * np.sin(q3)
        far = 1.06 * (1 + d3 + d4)
        rho, z = np.meshgrid(np.linspace(0, far, 240), np.linspace(-0.85 * far, 0.85 * far, 400))
        rest = [(r**2 + h**2 - 1)[:, None] - F**2 - height**2 for r, h in zip(rho, z, strict=True)]
        left = [h[:, None] ** 2 + part**2 / 4 - F**2 for h, part in zip(z, rest, strict=True)]
        count = np.array([np.sum(np.diff(np.sign(one), axis=1) != 0, axis=1) for one in left])
        axes.contourf(rho, z, count, levels=[-1, 1, 3, 5], colors=shades)

        # where det J = 0, over the last two joints
        grid = np.linspace(-np.pi, np.pi, 361)
        q = np.stack([np.zeros((361, 361)), *np.meshgrid(grid, grid)], axis=-1)
        det = np.linalg.det(task.jacobian_batch(q.reshape(-1, 3))[0]).reshape(361, 361)
        lines = plt.figure().gca().contour(grid, grid, det, [0.0]).allsegs[0]
        plt.close()
        for line in lines:
            p = task._poses(np.column_stack([np.zeros(len(line)), line]))[0]
            axes.plot(np.hypot(p[:, 0], p[:, 1]), p[:, 2], color="0.25", linewidth=1.1)

        found = hk.cusps(law, [0.1, 0.3, 0.6], starts=300)
        firsts = [found.poses[family[0], :3, 3] for family in found.families]
        for p in firsts:
            axes.plot(np.hypot(p[0], p[1]), p[2], "*", color=RED, markersize=13, markeredgecolor="white", zorder=5)
        several = "no cusp" if not firsts else f"{len(firsts)} cusps"
        axes.set_title(f"{number}: {several}", fontsize=11)
        axes.grid(False)
        axes.set(aspect="equal", xlabel="distance from the first axis [m]", ylabel="height [m]", xlim=(0, far))

    axes, d3 = panels[1, 2], np.linspace(0.02, 2.6, 700)
    A, B, square = np.hypot(d3 + 1, 0.5), np.hypot(d3 - 1, 0.5), d3**2 + 0.25
    first = np.sqrt((square - (square**2 - d3**2 + 0.25) / (A * B)) / 2)
    second, top = d3 / (1 + d3) * A, 3.2
    with np.errstate(divide="ignore"):
        last = np.minimum(d3 / np.abs(d3 - 1) * B, top)
    low = d3 < 1
    for below, above, where, shade in (
        (0 * d3, first, ~(d3 < 0), "#F2F2F2"),
        (first, second, ~(d3 < 0), "#F3B98A"),
        (second, last, ~(d3 < 0), "#FBE3D0"),
        (last, top + 0 * d3, ~low, "#F3B98A"),
        (last, top + 0 * d3, low, "#F2F2F2"),
    ):
        axes.fill_between(d3, below, above, where=where, color=shade, linewidth=0)
    for curve in (first, second, np.where(last < top, last, np.nan)):
        axes.plot(d3, curve, color="0.25", linewidth=1.1)
    for number, (a, b) in enumerate(ORTHOGONAL, 1):
        axes.plot([a], [b], "o", color="k", markersize=5)
        axes.annotate(str(number), (a, b), (6, -3), textcoords="offset points", fontsize=10)
    axes.grid(False)
    axes.set(xlim=(0, 2.6), ylim=(0, top), xlabel="d3 [m]", ylabel="d4 [m]")
    axes.set_title("Number of cusps by the lengths", fontsize=11)
    for at, text in (((0.06, 2.6), "0"), ((1.55, 2.6), "4"), ((1.0, 2.2), "2"), ((2.2, 0.9), "4"), ((1.1, 0.08), "0")):
        axes.text(*at, text, fontsize=11, color="k", fontweight="bold")
    marks = [plt.Line2D([], [], color="0.25", linewidth=1.1), plt.Line2D([], [], ls="", marker="*", color=RED, ms=12)]
    fills = [plt.Rectangle((0, 0), 1, 1, facecolor=shade, edgecolor="0.6") for shade in shades[1:]]
    names = ["singular", "cusp, found by hk.cusps", "2 postures", "4 postures"]
    figure.legend([*marks, *fills], names, loc="lower center", ncols=4, frameon=False, fontsize=10)
    figure.tight_layout(rect=(0, 0.04, 1, 1))
    save(figure, "orthogonal-cusps")


def region() -> None:
    """What of a square a planar arm's leaf is proven to be one function over, and what the rest is."""
    law = hk.holonomic(hk.position(hk.load("planar-3r")), hk.linear([[0.3, 0, 1]]))
    found = hk.unique_region(law, [0.3, 0.9, 0.7], hk.workspace(box=([0.8, 1.2], [2.0, 2.0])), limits=False)
    save(region_figure(found, 80), "region")


def clear_of_a_ball() -> None:
    """A cube of tool poses over a table: proven but for a corner, where the arm comes too near to a ball."""
    robot = hk.load("panda")
    law, T = hk.holonomic(hk.pose(robot), hk.lock(2)), robot.pose(PANDA)
    box = hk.workspace(box=(T[:3, 3], [0.05, 0.05, 0.05]), rotation=T[:3, :3])
    ball = hk.obstacle("ball", hk.robot.Capsule(0.05), T[:3, 3] + [0.13, 0.1, 0.05])
    table = hk.obstacle("table", hk.robot.Box([1.0, 1.0, 0.05]), (0.6, 0.0, -0.03))
    found = hk.unique_region(law, PANDA, box, scene=hk.Scene(obstacles=[ball, table], clearance=0.01))
    save(box_figure(found.certificate), "clear")


def sheets_of_a_panda() -> None:
    """The fewest leaves that serve a large box before a Panda: some seconds."""
    box = hk.workspace(box=([0.6, 0, 0.5], [0.6, 0.6, 0.5]), tilt=np.radians(30))
    found = hk.sheets(hk.pose(hk.load("panda")), box, progress=print)
    print(found)
    save(sheets_figure(found), "sheets")


def paths() -> None:
    """Six kinds of path: seen from above, and over a surface."""
    figure = plt.figure(figsize=(9.4, 6.2))
    waypoints = np.array([[0, 0], [0.1, 0.06], [0.18, 0.02], [0.22, 0.1], [0.1, 0.14], [0.02, 0.1]])
    corners = np.array([[0, 0], [0.2, 0], [0.2, 0.14], [0.08, 0.14], [0.08, 0.07], [0, 0.07]])
    flat = {
        "spline through waypoints": (hk.spline(waypoints, closed=True), waypoints),
        "figure eight": (hk.path.figure_eight([0.11, 0.07], 0.22, 0.14), np.array([[0.11, 0.07]])),
        "corners blended within 12 mm": (hk.path.blended(hk.polyline(corners, closed=True), 0.012), corners),
        "leads and three passes": (
            hk.path.with_leads(
                hk.path.passes(hk.path.arc([0, 0], [0.1, -0.1], -np.pi / 2), 3, offset=[0, 0.04, 0]), 0.03
            ),
            None,
        ),
    }
    for place, (title, (path, marks)) in zip((1, 2, 4, 5), flat.items(), strict=True):
        axes = figure.add_subplot(2, 3, place)
        if title.startswith("corners"):
            axes.plot(*np.vstack([marks, marks[:1]]).T, "--", color="0.6", linewidth=1)
        axes.plot(*path.at(np.linspace(0, path.duration, 1500)).position[:, :2].T, color=BLUE, linewidth=1.8)
        if marks is not None:
            axes.plot(*marks.T, "o", color=RED, markersize=4)
        axes.plot(*path.start[:2], "o", markersize=9, markerfacecolor="none", markeredgecolor="k")
        axes.set(aspect="equal", title=title, xlabel="x [m]", ylabel="y [m]")
        axes.margins(0.1)

    def hill(u: float, v: float) -> float:
        return 0.05 * np.cos(9 * (u - 0.1)) * np.cos(9 * (v - 0.1))

    def bowl(u: float, v: float) -> float:
        return 3 * (u * u + v * v)

    over = {
        3: (
            "raster over a surface",
            hk.path.raster([0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], 0.025, surface=hill),
            hill,
            0.0,
        ),
        6: ("spiral over a surface", hk.path.spiral([0.1, 0.1, 0], 0.1, 0.025, surface=bowl), bowl, 0.1),
    }
    grid = np.linspace(0, 0.2, 30)
    for place, (title, path, surface, shift) in over.items():
        axes = figure.add_subplot(2, 3, place, projection="3d", computed_zorder=False)
        x, y = np.meshgrid(grid, grid)
        if shift:  # a disc
            r, angle = np.meshgrid(np.linspace(0, 0.104, 12), np.linspace(0, 2 * np.pi, 60))
            x, y = shift + r * np.cos(angle), shift + r * np.sin(angle)
        z = np.vectorize(surface)(x - shift, y - shift)
        axes.plot_surface(x, y, z, color=SKY, alpha=0.3, linewidth=0, zorder=1)
        at = path.at(np.linspace(0, path.duration, 1500))
        axes.plot(*at.position.T, color=BLUE, linewidth=1.6, zorder=3)
        tool = (path.at(np.linspace(0, path.duration, 40)).rotation @ path.rotation)[:, :, 2]
        points = path.at(np.linspace(0, path.duration, 40)).position
        for p, axis in zip(points, tool, strict=True):
            axes.plot(*np.array([p, p - 0.03 * axis]).T, color=RED, linewidth=0.9, zorder=4)
        axes.set(title=title, xticks=[0, 0.1, 0.2], yticks=[0, 0.1, 0.2], zticks=[])
        axes.view_init(32, -58)
        axes.set_box_aspect((1, 1, 0.5), zoom=1.25)
    figure.tight_layout()
    save(figure, "paths")


def jobs() -> None:
    """Pictures of two packaged jobs, and of the jobs of pages."""
    save(cycles_figure(run_job(*open_job("ppr-cycle"))), "job-ppr-cycle")
    save(robot_figure(run_job(*open_job("panda-circle"))), "job-panda-circle", dpi=88)
    for page, job, model, robot, name, dpi in (
        ("start", "glue", "arm7", "my-arm", "start-glue", 88),
        ("cells", "weld", "kr6", "kr6", "cells-weld", 70),
    ):
        save(robot_figure(job_of_page(page, job, model, robot)), name, dpi=dpi)


def job_of_page(page: str, job: str, model: str, robot: str) -> JobResult:
    """A job that a page shows, with the files that it shows beside it and a model of this folder as ROBOT.urdf."""
    with tempfile.TemporaryDirectory() as folder:
        text = (HERE / f"{page}.md").read_text("utf-8")
        for title, block in re.findall(r'```\w+ title="(.+?)"\n(.*?)```', text, re.DOTALL):
            (Path(folder) / title).write_text(block, "utf-8")
        shutil.copy(HERE / f"{model}.urdf", Path(folder) / f"{robot}.urdf")
        return run_job(*open_job(f"{folder}/{job}.toml"))


def readme() -> None:
    """The moving picture of the README: eight circles of a Panda, the pseudo-inverse beside a holonomic law."""
    result = run_job(*open_job(str(HERE.parent / "examples" / "panda-eight-cycles.toml")))
    frames = list(cycles_frames(result, shown_strategies(result)))
    frames = [frame[: -CONTROLS + 8] for frame in frames[::2]]  # a GIF has no controls to leave room for
    small = [np.asarray(Image.fromarray(f).resize((2 * f.shape[1] // 3, 2 * f.shape[0] // 3))) for f in frames]
    write_film(small, HERE / "panda.gif", rate=12)
    print("panda.gif", (HERE / "panda.gif").stat().st_size // 1000, "kB")


if __name__ == "__main__":
    every = (
        self_motion, leaf_on_self_motions, planar_loops, leaves, swivel, cusp,
        cusps_of_orthogonal_arms, region, clear_of_a_ball, sheets_of_a_panda, edge_of_reach,
        paths, jobs, readme,
    )  # fmt: skip
    draws = {draw.__name__: draw for draw in every}
    with plt.rc_context(style()):
        for name in sys.argv[1:] or draws:
            draws[name]()
