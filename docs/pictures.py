"""The pictures of the site, from the library itself: `python docs/pictures.py` writes docs/pictures/*.png again."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import casadi as ca
import matplotlib.pyplot as plt
import numpy as np

import holokin as hk
from holokin.job import open_job, run_job
from holokin.output.coverage_plots import coverage_figure
from holokin.output.figures import cycles_figure, robot_figure, ways_figure
from holokin.output.plots import PALETTE, style

HERE = Path(__file__).parent
OUT = HERE / "pictures"
BLUE, RED = PALETTE[0], PALETTE[1]
PANDA = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]


def save(figure: plt.Figure, name: str) -> None:
    """As a PNG of 8 bits, small enough for a repository."""
    OUT.mkdir(exist_ok=True)
    figure.savefig(OUT / f"{name}.png", dpi=110, bbox_inches="tight", facecolor="white")
    plt.close(figure)
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
    postures = hk.strategies.self_motion(hk.position(robot, rows=[0, 1]), q0, limits=False).q
    figure, axes = plt.subplots(figsize=(4.6, 4.0))
    colours = plt.get_cmap("viridis")(np.linspace(0, 0.95, 9))
    for q, colour in zip(postures[:: len(postures) // 9], colours, strict=False):
        arm(axes, robot, q, color=colour, linewidth=1.6, alpha=0.75)
    tool = robot.pose(q0)[:2, 3]
    axes.plot(*tool, "o", markersize=11, markerfacecolor="none", markeredgecolor="k", markeredgewidth=1.6)
    axes.annotate("tool", tool, (8, 8), textcoords="offset points")
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="Self-motion: one tool position, many postures")
    save(figure, "self-motion")


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
        ik = hk.inverse(g, on_tool(0.0, 0.0, angle))
        height = np.array([ik([a, b, 0.0])[2] for a, b in zip(x.flat, y.flat, strict=True)]).reshape(x.shape)
        axes.plot_surface(x, y, height, color="#7aa6d8", alpha=alpha, linewidth=0, zorder=1)
        axes.plot_wireframe(x, y, height, color="#4f7fb5", linewidth=0.4, alpha=0.6, zorder=2)
    start = hk.inverse(g, on_tool(0.0, 0.0, 0.85))([0.5, 0.0, 0.0])
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
    axes.text(-0.1, -0.75, 0.2, "path of the tool", fontsize=8, color="0.35")
    axes.set(xlabel="tool x [m]", ylabel="tool y [m]", zlabel="q3 [rad]", zlim=(0.2, 2.2))
    axes.set(xticks=[-0.5, 0, 0.5], yticks=[-0.5, 0, 0.5], zticks=[0.5, 1.0, 1.5, 2.0])
    axes.view_init(18, -58)
    axes.legend(fontsize=8, loc="upper left")
    save(figure, "leaves")


def on_tool(x: float, y: float, angle: float) -> np.ndarray:
    """The posture of the PPR arm with its tool at (x, y) and its hinge at an angle."""
    link = np.array([hk.load("ppr").pose([0, 0, angle])[0, 3], hk.load("ppr").pose([0, 0, angle])[1, 3]])
    return np.array([x - link[0], y - link[1], angle])


def joints_over_cycles() -> None:
    """A Panda draws eight circles; its largest joint error after each, by six laws."""
    robot = hk.load("panda")
    task, start = hk.pose(robot), robot.pose(PANDA)[:3, 3]
    path = hk.circle(start, center=start - [0.1, 0, 0])
    laws = {
        "pseudo-inverse": hk.moore_penrose(task),
        "joint 3 locked": hk.holonomic(task, hk.lock("panda_joint3")),
        "arm angle held": hk.holonomic(task, hk.arm_angle()),
    }
    figure, axes = plt.subplots(figsize=(6.4, 3.4))
    for (name, law), colour in zip(laws.items(), PALETTE, strict=False):
        drift = hk.drift(law, path, PANDA, cycles=8, samples=200, limits=False).largest
        axes.semilogy(np.arange(1, 9), np.maximum(drift, 1e-17), "-o", color=colour, label=name)
    axes.set(xlabel="circles of 0.1 m radius", ylabel="largest joint error [rad]", title="Panda, after each circle")
    axes.legend(loc="center right")
    save(figure, "panda-drift")


def coverage_of_a_box() -> None:
    """What a Panda with its arm angle kept reaches of a box of tool poses."""
    law = hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle(), name="the arm angle")
    ready = [0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4]
    box = hk.workspace(box=([0.5, 0, 0.3], [0.25, 0.4, 0.3]), tilt=np.radians(40), spin=np.radians(90))
    slices = hk.designing.coverage_slices(law, ready, box, steps=60)
    save(coverage_figure(hk.coverage(law, ready, box, samples=512), slices), "coverage-arm-angle")


def jobs() -> None:
    """One picture of each packaged job and each job of examples/."""
    for name in ("ppr-half-circle", "ppr-cycle", "irb140-half-square", "orientation", "panda-circle"):
        result = run_job(*open_job(name))
        if name == "ppr-cycle":
            save(cycles_figure(result), f"job-{name}")
        elif name == "panda-circle":
            save(robot_figure(result), f"job-{name}")
        else:
            save(ways_figure(result.drawn[0]), f"job-{name}")
    result = run_job(*open_job(str(HERE.parent / "examples" / "panda-strategies.toml")))
    save(robot_figure(result), "job-panda-strategies")


if __name__ == "__main__":
    every = (self_motion, planar_loops, leaves, joints_over_cycles, coverage_of_a_box, jobs)
    draws = {draw.__name__: draw for draw in every}
    with plt.rc_context(style()):
        for name in sys.argv[1:] or draws:
            draws[name]()
