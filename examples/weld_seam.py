"""Weld a curved plate with plain six-axis arms: 2 m of seam in 4 passes, with a torch that may spin about its wire.

The pseudo-inverse ends each seam with other joints than it began with; a law on a leaf ends with the same.
"""

import numpy as np

import holokin as hk
from holokin.robot import Box, Capsule, Cylinder, LinkShape

SEAMS, PASSES, PITCH, RADIUS, SWEEP = (
    3,
    4,
    0.02,
    0.625,
    0.8,
)  # the plate is a part of a cylinder: each pass is 0.5 m long
ALONG = np.array([1.0, 0.0, 0.0])  # its axis

torch = {"pose": [0.08, 0, 0.25], "rpy": [0, np.deg2rad(35), 0]}
cells = {
    "ur5e": (np.deg2rad([10, -100, 110, -95, -80, 20]), hk.lock("wrist_3_joint", name="wrist 3 held")),
    "irb140": (np.deg2rad([0, 40, -10, 20, -50, 10]), hk.linear([0, 0, 0, 1, 0, 1], name="joints 4 and 6 tied")),
}


def seam(top: np.ndarray) -> hk.Path:
    """To and fro across the plate, a step aside between two passes, and back to its top; the torch turns with it."""
    axis = top - [0, 0, RADIUS]

    def edge(angle: float) -> np.ndarray:
        return axis + RADIUS * np.array([0, -np.sin(angle), np.cos(angle)])

    def across(start: float, sweep: float) -> hk.Path:
        return hk.path.arc(edge(start), axis, sweep, ALONG, turn=sweep * ALONG)

    side = -SWEEP / 2
    path = across(0.0, side)
    for k in range(PASSES):
        path += across(side, -2 * side)
        side = -side
        if k < PASSES - 1:
            path += hk.line(edge(side), edge(side) + PITCH * ALONG)
    return path + across(side, -side) + hk.line(top, top - (PASSES - 1) * PITCH * ALONG)


def with_torch(arm: hk.Robot) -> hk.Robot:
    """The arm with a torch that is drawn, too: its nozzle along the wire, its handle from there to the flange."""
    robot = hk.with_tool(arm, **torch)
    robot = hk.robot.with_shape(robot, "nozzle", Cylinder(0.011, 0.1), xyz=[0, 0, -0.062])
    return hk.robot.with_shape(robot, "handle", Capsule(0.022, 0.15), xyz=[0.039, 0, -0.176], rpy=[0, -0.574, 0])


def plate(top: np.ndarray) -> list[LinkShape]:
    """The plate as strips that touch a cylinder from below, wider than the seams."""
    middle = top + (PASSES - 1) / 2 * PITCH * ALONG
    found = []
    for angle in np.linspace(-0.55, 0.55, 23):
        below = (RADIUS - 0.008) * np.array([0, -np.sin(angle), np.cos(angle)]) - [0, 0, RADIUS]
        found.append(hk.obstacle("plate", Box([0.24, 0.033, 0.008]), xyz=middle + below, rpy=[angle, 0, 0]))
    return found


for name, (q0, rule) in cells.items():
    robot = hk.with_base_pose(with_torch(hk.load(name)), [0, 0, 0.5])
    task, start = hk.pose(robot, "axis"), robot.pose(q0)
    path, motions, obstacles = seam(start[:3, 3]), {}, plate(start[:3, 3])
    for law in (hk.moore_penrose(task, name="pseudo-inverse"), hk.holonomic(task, rule)):
        found = hk.drift(law, path, q0, cycles=SEAMS, samples=600, method="velocity")
        motions[law.name] = walk = found.trajectory
        print(f"{name}: {law.name} {found} rad off after seams of {PASSES * RADIUS * SWEEP:g} m each")
        spins = []
        for q, wanted in zip(walk.q, path.at(walk.t % path.duration).rotation @ start[:3, :3], strict=True):
            turn = wanted.T @ robot.pose(q)[:3, :3]
            spins.append(np.rad2deg(np.arctan2(turn[1, 0], turn[0, 0])))
        print(f"  the torch spins from {min(spins):.0f} to {max(spins):.0f} degrees")
