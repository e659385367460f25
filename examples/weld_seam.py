"""Weld a curved plate with plain six-axis arms: 2 m of seam in 4 passes, with a torch that may spin about its wire.

The pseudo-inverse ends the seam with other joints than it began with; a law on a leaf ends with the same.
"""

import numpy as np

import holokin as hk

PASSES, PITCH, RADIUS, SWEEP = 4, 0.02, 0.625, 0.8  # the plate is a part of a cylinder: each pass is 0.5 m long
ALONG = np.array([1.0, 0.0, 0.0])  # its axis

torch = {"xyz": [0.08, 0, 0.25], "rpy": [0, np.deg2rad(35), 0]}
cells = {
    "irb140": (np.deg2rad([0, 40, -10, 20, -50, 10]), hk.linear([0, 0, 0, 1, 0, 1])),
    "ur5e": (np.deg2rad([10, -100, 110, -95, -80, 20]), hk.lock("wrist_3_joint")),
}


def seam(top: np.ndarray) -> hk.Path:
    """To and fro across the plate, a step aside between two passes, and back to its top; the torch turns with it."""
    axis = top - [0, 0, RADIUS]

    def edge(angle: float) -> np.ndarray:
        return axis + RADIUS * np.array([0, -np.sin(angle), np.cos(angle)])

    def across(start: float, sweep: float) -> hk.Path:
        return hk.arc(edge(start), axis, sweep, ALONG, turn=sweep * ALONG)

    side = -SWEEP / 2
    path = across(0.0, side)
    for k in range(PASSES):
        path += across(side, -2 * side)
        side = -side
        if k < PASSES - 1:
            path += hk.line(edge(side), edge(side) + PITCH * ALONG)
    return path + across(side, -side) + hk.line(top, top - (PASSES - 1) * PITCH * ALONG)


for name, (q0, rule) in cells.items():
    robot = hk.with_tool(hk.load(name), **torch)
    task, start = hk.pose(robot, "axis"), robot.pose(q0)
    path = seam(start[:3, 3])
    lost = hk.drift(hk.moore_penrose(task), path, q0)
    found = hk.follow(hk.holonomic(task, rule), path, q0, samples=800)
    motions = {"pseudo-inverse": lost.trajectory, rule.name: found}
    kept, length = np.abs(found.drift()).max(), PASSES * RADIUS * SWEEP
    print(f"{name}: pseudo-inverse {lost.largest[0]:.4f} rad off after a seam of {length:g} m; {rule.name} {kept:.0e} rad")

    spins = []
    for q, wanted in zip(found.q, path.at(found.t).rotation @ start[:3, :3], strict=True):
        turn = wanted.T @ robot.pose(q)[:3, :3]
        spins.append(np.rad2deg(np.arctan2(turn[1, 0], turn[0, 0])))
    print(f"  the torch spins from {min(spins):.0f} to {max(spins):.0f} degrees")
