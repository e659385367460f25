"""Test vectors of exported C, postures and what the virtual machine computes for them, and the self-test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, HolokinError
from ...base.tolerances import TOLERANCES
from ...base.types import Matrix, Vector
from ...motion.ik.branch import extended_jacobian, on_ray
from ...motion.ik.leaf import leaf_follower, leaf_step, straight_path
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task
from .c_text import BOTH_FLOAT, CLEAR_FLOAT, PRECISE_FLOAT, Source, text

REACH = 0.5
"""How far from the start [joint units] the postures of the vectors are drawn."""

NEAR = 0.02
"""How far from a posture the wanted pose of its step lies, at most."""

PIECES = 200
"""Pieces of the path to a wanted pose that the self-test allows; the vectors need at most half of them."""

NEAR_LIMIT = 1e-3
"""How near a joint may come to its limit [joint units] in a vector of inverse kinematics."""

TRIES = 100
"""Draws for one vector before its start is called too close to a singularity."""


@dataclass(frozen=True, eq=False)
class TestVector:
    """One test vector: inputs, and the results by the name of their C member."""

    values: dict[str, Vector]
    status: int
    precise: bool
    """True where single precision is expected to have four digits, too, here and where the inverse leads."""
    loss: float
    """Factor by which round-off may grow: 1, or more near a singularity."""
    terms: float
    """In single precision: the terms that add up to a step of control or of Newton, over the larger of the step and 1.
    They may cancel, and feedback multiplies the last digit of a long arm's reach."""


def vectors(source: Source, count: int) -> list[TestVector]:
    """Vectors around the start, where there are any at postures fit for single precision; the same at every call.

    Raises:
        ArgumentError: near the start there is no posture to test at.
    """
    rng = np.random.default_rng(0)
    listed: list[TestVector] = []
    tries = TRIES  # how long to look for a precise one
    for _ in range(count):
        best: TestVector | None = None
        for attempt in range(TRIES):
            best = _draw(source, rng, best is not None) or best
            if best is not None and (best.precise or attempt >= tries):
                break
        if best is None:
            cure = (
                f"near it, no test was found: nothing is regular and within the limits, or the leaf is not followed in "
                f"{PIECES // 2} pieces; choose another start, or a rule that is less curved"
            )
            raise ArgumentError("the start posture", source.q0.tolist(), cure)
        tries = TRIES if best.precise else 0  # where none is precise it is not asked for again
        listed.append(best)
    return listed


def _draw(source: Source, rng: np.random.Generator, only_precise: bool) -> TestVector | None:
    # A posture and a wanted pose near it, in single precision, away from singular ones.
    s, robot = source.strategy, source.strategy.task.robot
    lower, upper = np.maximum(robot.lower, source.q0 - REACH), np.minimum(robot.upper, source.q0 + REACH)
    q = _single(rng.uniform(lower, upper))
    near = NEAR * min(1.0, source.dt / 1e-3)  # its gain makes much of it
    there = rng.uniform(np.maximum(lower, q - near), np.minimum(upper, q + near))
    task, frames = s.task, s.task.frames
    twist = _single(rng.uniform(-0.2, 0.2, task._point if task.orientation is None else 6 * frames))
    G, rcond, margin = s.gain(q)
    if not (rcond > 1e3 * TOLERANCES.singular and margin > 1e3 * TOLERANCES.representation):
        return None
    precise = _is_precise(rcond, margin)
    if only_precise and not precise:
        return None
    pose = _single(s.task.pose(there))
    target, position, rotation = _wanted_pose(task, pose)
    dx = _single(_task_rates(s.task, pose, twist))
    if not np.isfinite(dx).all():
        return None
    # What the control step answers; none whose status hangs on the last digits.
    moving, level_rate = rng.uniform(-0.2, 0.2, len(q)), np.zeros(0)
    if source.holonomic:
        level_rate = _single(source.holonomic.rows(q) @ moving)
    dq, scale, *_ = source.functions["step"](q, target, twist, _moving(source, level_rate))
    if 0.99 < scale < 1.0 or scale < 1e-3 or (scale >= 1.0 and source.limits and _load(source, q, dq) > 0.99):
        return None  # whose status hangs on the last digits
    values = {"q": q, "target": np.ravel(target), "dx": dx, "twist": twist, "pose": s.task.pose(q).ravel()}
    values |= {"gain": np.ravel(G), "rate": s.rate(q, dx)[0]}
    values |= {"step": np.atleast_1d(dq), "scale": np.atleast_1d(scale)}
    # On a leaf: the Newton step, the posture that the leaf leads to, and one solved from the start.
    if holonomic := source.holonomic:
        values["leaf_rate"] = level_rate
        c = _single(np.atleast_1d(holonomic.constraint_value(there)))
        try:
            level_now = np.atleast_1d(holonomic.constraint_value(q))
            levels = level_now, level_now + holonomic.constraint.nearest(c - level_now)
            reached = leaf_follower(holonomic, q, PIECES // 2)(
                q, straight_path(task, task._place(q), task.target(pose), levels)
            )
        except HolokinError:
            return None
        away = _solved(source, holonomic, rng)
        if away is None:
            return None
        step = leaf_step(holonomic)(q, position, rotation, c)[0]
        precise = precise and _is_precise(*s.gain(reached)[1:]) and _is_precise(*s.gain(away[1])[1:])
        values |= {"c": c, "g": np.atleast_1d(holonomic.constraint_value(q)), "leaf": np.atleast_1d(step)}
        values |= {"inverse": reached, "away": away[0], "solved": away[1]}
    loss = max(1.0, 0.01 / rcond, 0.01 / margin)
    return TestVector(values, 0 if scale >= 1.0 else 1, precise, float(loss), _terms(source, values, pose, rng))


def _moving(source: Source, level_rate: Vector) -> Vector:
    """The parameters of a step whose level moves."""
    parameters, r = source.parameters, len(level_rate)
    parameters[r : 2 * r] = level_rate
    return parameters


def _solved(source: Source, strategy: HolonomicStrategy, rng: np.random.Generator) -> tuple[Vector, Vector] | None:
    """(target, posture) of inverse kinematics from the start; None where the leaf, or the range of a joint, ends before
    or so soon behind it that the status hangs on the last digits."""
    task, start = strategy.task, source.q0
    pose = _single(task.pose(start + 0.7 / len(start) * rng.uniform(-1, 1, len(start))))
    path = straight_path(task, task._place(start), task.target(pose), (source.leaf, source.leaf))
    try:
        posture = leaf_follower(strategy, start, PIECES // 2, on_ray(strategy, start))(start, path)
    except HolokinError:
        return None
    if source.limits and np.minimum(posture - task.robot.lower, task.robot.upper - posture).min() < NEAR_LIMIT:
        return None
    return np.ravel(_wanted_pose(task, pose)[0]), posture


def _task_rates(task: Task, pose: Matrix, twist: Vector) -> Vector:
    """x' (m,) of frames at poses that move with twists (6F,), or with the velocity of a point."""
    v, w = np.zeros(3 * task.frames), np.zeros(3 * task.frames)
    if task.orientation is None:
        v[: task._point] = twist
    else:
        v, w = (part.ravel() for part in twist.reshape(-1, 2, 3).swapaxes(0, 1))
    return task._tool_rates(task.target(pose)[1][None], v[None], w[None])[0][0]


def _wanted_pose(task: Task, pose: Matrix) -> tuple[Matrix, Vector, Matrix]:
    """(target as the step takes it, positions (3F,), rotations (3F, 3)) of wanted poses (4, 4) or (F, 4, 4)."""
    p, R = task.target(pose)
    if task.orientation is not None:
        return pose.reshape(-1, 4), p, R
    known = p.copy()
    known[task._point :] = 0.0
    return p[: task._point], known, np.tile(np.eye(3), (task.frames, 1))


def _load(source: Source, q: Vector, dq: Vector) -> float:
    """How near rates come to where limits slow them, at 1."""
    robot = source.strategy.task.robot
    left = np.where(dq > 0, robot.upper - q, q - robot.lower)
    with np.errstate(divide="ignore", invalid="ignore"):
        loads = np.abs(dq) / robot.max_velocity, np.abs(dq) * source.dt / left
    return float(np.max(np.nan_to_num(loads, nan=0.0)))


def _is_precise(rcond: float, margin: float) -> bool:
    """Clear of where the status says that single precision has no four digits."""
    clear = margin > 1.5 * CLEAR_FLOAT and rcond * margin > 1.5 * BOTH_FLOAT
    return bool(rcond > 1.5 * PRECISE_FLOAT and clear)


def _terms(source: Source, values: Mapping[str, Vector], pose: Matrix, rng: np.random.Generator) -> float:
    """By what factor errors of the control step and of the Newton step may pass four digits of the result.

    The four digits are those of the terms that add up to dq, G u and the feedback of the leaf. Besides, rounding the
    inputs moves the result by what nudges of them show.
    """
    s, task = source.strategy, source.strategy.task
    q, G = values["q"], np.abs(values["gain"].reshape(s.task.n, -1))
    dt, gain, constraint_gain = source.parameters[-5:-2]
    error = np.abs(task.error(q, *_wanted_pose(task, pose)[1:]))
    terms = {"step": G @ (np.abs(values["dx"]) * (1 + gain * dt) + gain * error)}
    if holonomic := source.holonomic:
        L, level_now = np.abs(extended_jacobian(holonomic)(q)[1][:, s.task.m :]), values["g"]
        nearest = holonomic.constraint.nearest
        rate = np.abs(values["leaf_rate"])
        terms["step"] += L @ (
            rate * (1 + constraint_gain * dt) + constraint_gain * np.abs(nearest(source.leaf - level_now))
        )
        terms["leaf"] = G @ error + L @ np.abs(nearest(values["c"] - level_now))
    terms["step"] *= values["scale"]
    moved = dict.fromkeys(terms, 0.0)
    # Four copies of the vector with all inputs moved by single precision's rounding show what it does to the results.
    for _ in range(4):
        near, to, parameters = _nudged(q, rng), pose.copy(), _moving(source, values.get("leaf_rate", np.zeros(0)))
        to[..., :3, 3], to[..., :3, :3] = _nudged(pose[..., :3, 3], rng, 0.0), _nudged(pose[..., :3, :3], rng)
        parameters[:-5] = _nudged(parameters[:-5], rng)
        target, place, turned = _wanted_pose(task, to)
        results = {"step": source.functions["step"](near, target, values["twist"], parameters)[0]}
        if holonomic:
            level = _nudged(values["c"], rng)
            results["leaf"] = leaf_step(holonomic)(near, place, turned, level)[0]
        for key, value in results.items():
            moved[key] = max(moved[key], float(np.abs(np.atleast_1d(value) - values[key]).max()))
    sizes = {key: max(1.0, float(np.abs(values[key]).max())) for key in terms}
    # Rounding inside the code is at most 3.7 times as bad as nudges of its inputs, where these dominate; taken for 8.
    # The self-test allows 1e-4.
    return float(max((max(sizes[k], terms[k].max()) + 8.0 * moved[k] / 1e-4) / sizes[k] for k in terms))


def _nudged(values: Matrix, rng: np.random.Generator, smallest: float = 1.0) -> Matrix:
    """Values moved, up or down, by single precision's rounding of the largest of them, or of `smallest`."""
    size = max(smallest, float(np.abs(values).max(initial=0.0)))
    return values + np.finfo(np.float32).eps / 2 * size * rng.choice([-1.0, 1.0], values.shape)


def _singular_posture(source: Source) -> Vector | None:
    """A posture (n,) at which the strategy is singular, all joints but a few as at the start; None if none is met."""
    n, gain = len(source.q0), source.strategy.gain
    for keep in (0, n - 1, n - 2):
        for value in (0.0, np.pi / 2, -np.pi / 2):
            for first in range(n):
                q = source.q0.copy()
                q[(first + np.arange(n - keep)) % n] = value
                _, rcond, margin = gain(q)
                if np.isfinite(rcond) and min(rcond, margin) < 1e-13:
                    return q
    return None


def _single(values: Matrix) -> Matrix:
    """The nearest numbers that single precision has, so that both precisions start alike."""
    return np.asarray(values, dtype=np.float32).astype(float)


def vectors_header(source: Source, listed: list[TestVector], words: Mapping[str, Any]) -> str:
    """NAME_vectors.h."""
    sizes = {key: len(value) for key, value in listed[0].values.items()}
    members = "".join(f"  double {key}[{size}];\n" for key, size in sizes.items()).replace("scale[1]", "scale")
    rows = []
    for vector in listed:
        parts = [_row(value) if key != "scale" else repr(float(value[0])) for key, value in vector.values.items()]
        parts += [str(vector.status), str(int(vector.precise)), repr(vector.loss), repr(vector.terms)]
        rows.append("  {" + ",\n   ".join(parts) + "},\n")
    return (
        f"/* Test vectors of {words['name']}, in double precision. Written by holokin {words['version']}. */\n"
        f"#define {words['NAME']}_VECTORS 0x0123456789abcdefU\n\n"
        f"typedef struct {{\n{members}  int status, precise;\n  double loss, terms;\n}} vector;\n\n"
        f"static const vector vectors[] = {{\n{''.join(rows)}}};\n"
    )


def _row(values: Vector) -> str:
    return "{" + ", ".join(repr(float(v)) for v in np.ravel(values)) + "}"


def selftest(source: Source, words: Mapping[str, Any]) -> str:
    """selftest.c."""
    # What is refused: a transposed pose; on a leaf numbers that are not finite; a singular posture.
    name, n, r = source.name, words["n"], words["r"]
    leaf_tests = bad = declare = turned = moving = ""
    if words["matrices"]:
        status, step = words["NAME"] + "_NOT_A_ROTATION", f"{name}_step(q, target, twist, &parameters, dq, &scale)"
        turned = (
            f"  for (int i = 0; i < {words['target']}; i++)\n"
            "    target[i] = (real)vectors[0].target[i / 16 * 16 + 4 * (i % 4) + i / 4 % 4];\n"
            f'  expect("step to a transposed target", {step}, {status}, dq, {n});\n'
        )
        if source.holonomic:
            solve = f"{name}_solve(q, target, {PIECES})"
            turned += f'  expect("solve for a transposed target", {solve}, {status}, dq, 0);\n'
    if source.holonomic:
        declare = f"  real c[{r}], g[{r}];\n"
        moving = f"    copy(v->leaf_rate, parameters.leaf_rate, {r});\n"
        leaf_tests = (
            f"    copy(v->c, c, {r});\n"
            f'    if (accept("constraint", k, {name}_constraint(q, g), rough))\n'
            f'      worst[4] = compare("constraint", k, g, v->g, {r}, most, worst[4]);\n'
            f'    if (accept("leaf step", k, {name}_leaf_step(q, target, c, dq), rough))\n'
            f'      worst[5] = compare("leaf step", k, dq, v->leaf, {n}, fed_back, worst[5]);\n'
            f'    if (accept("inverse", k, {name}_inverse(q, target, c, {PIECES}), rough))\n'
            f'      worst[6] = compare("inverse", k, q, v->inverse, {n}, 10 * most, worst[6]);\n'
            f"    copy(v->away, target, {words['target']});\n"
            f'    if (accept("solve", k, {name}_solve(q, target, {PIECES}), rough))\n'
            f'      worst[6] = compare("solve", k, q, v->solved, {n}, 10 * most, worst[6]);\n'
        )
        refused = words["NAME"] + "_NOT_FINITE"
        bad = (
            f"      copy(vectors[0].c, c, {r});\n"
            f'      expect("leaf step to a bad target", {name}_leaf_step(q, target, c, dq), {refused}, dq, {n});\n'
            f'      expect("inverse of a bad target", {name}_inverse(q, target, c, {PIECES}), {refused}, dq, 0);\n'
            f'      expect("solve for a bad target", {name}_solve(q, target, {PIECES}), {refused}, dq, 0);\n'
        )
    if source.closed:
        declare += f"  real found[{words['n8']}];\n  int signs[8];\n"
        level, c = (f"    copy(v->g, c, {r});\n", "c, ") if r else ("", "")
        on_leaf = (
            f'      if (accept("leaf of postures", k, {name}_constraint(found + {n} * i, g), 1))\n'
            f'        compare("leaf of postures", k, g, v->g, {r}, exact, 0.0);\n'
        )
        more = {"copy_level": level, "c_call": c, "leaf_of_postures": on_leaf if r else ""}
        leaf_tests += text("selftest_closed.c", {**words, **more})
        call = f"{name}_postures(target, {c}found, signs)"
        bad += f'      expect("postures for a bad target", -{call}, {words["NAME"]}_NOT_FINITE, dq, 0);\n'
    singular = _singular_posture(source)
    at_singular = ""
    if singular is not None:
        failed = words["NAME"] + "_SINGULAR"
        step = f"{name}_step(q, target, twist, &parameters, dq, &scale)"
        values = "".join(f"  q[{i}] = (real){float(v)!r};\n" for i, v in enumerate(singular))
        at_singular = (
            f"{values}  copy(vectors[0].target, target, {words['target']});\n"
            f'  expect("gain where it is singular", {name}_gain(q, G), {failed}, G, {words["nm"]});\n'
            f'  expect("step where it is singular", {step}, {failed}, dq, {n});\n'
        )
    more = {
        "declare_leaf": declare,
        "moving_leaf": moving,
        "leaf_tests": leaf_tests,
        "bad_leaf": bad,
        "singular_test": turned + at_singular,
        "leaf_words": ", constraint %.1e, leaf step %.1e, inverse %.1e" if source.holonomic else "",
        "leaf_worst": ", worst[4], worst[5], worst[6]" if source.holonomic else "",
    }
    return text("selftest.c", {**words, **more})
