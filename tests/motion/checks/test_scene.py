"""`Scene`: one value for every verb that keeps clear, in Python, in jobs and on the command line."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from holokin.app.cli import check as command
from holokin.app.job.job_parts import build_tasks
from holokin.app.job.runner import open_job
from holokin.app.job.tables import ChecksTable
from holokin.base.errors import ArgumentError, CallError
from holokin.motion.checks import Clearances
from holokin.robot import Box, Capsule

VERBS: tuple[Callable[..., Any], ...] = (
    hk.check, hk.certify, hk.unique_region, hk.design, hk.advise, hk.sheets, hk.read_sheets,
)  # fmt: skip
WORDS = [field.name for field in fields(hk.Scene)]
BARS = hk.robot.with_capsules(hk.load("planar-3r"), 0.05)


@pytest.mark.parametrize("seed", range(12))
def test_a_part_of_a_scene_beside_it_is_answered_with_the_scene_written_out(seed: int) -> None:
    """Of random words, at a random verb."""
    draw = np.random.default_rng(seed)
    verb = VERBS[int(draw.integers(len(VERBS)))]
    given = draw.choice(WORDS, size=int(draw.integers(1, 3)), replace=False).tolist()
    required = sum(p.default is p.empty for p in inspect.signature(verb).parameters.values())
    with pytest.raises(CallError) as told:
        _called(verb, required, {word: [] for word in given})
    parts = ", ".join(f"{word}=[...]" for word in given)
    assert f"scene=hk.Scene({parts})" in str(told.value)


def _called(verb: Callable[..., Any], required: int, named: dict[str, Any]) -> Any:
    """The verb with good arguments, and some that it does not take."""
    task, q0 = hk.position(BARS), np.array([0.3, 0.9, 0.5])
    G = hk.holonomic(task, hk.lock(2))
    space = hk.workspace(box=(BARS.pose(q0)[:3, 3], [0.01, 0.01, 0.0]))
    given = {
        hk.check: (q0[None],), hk.certify: (G, space, q0), hk.unique_region: (G, q0), hk.advise: (task,),
        hk.design: (task, space, q0), hk.sheets: (task, space), hk.read_sheets: ("no.npz", task),
    }[verb]  # fmt: skip
    assert len(given) == required
    return verb(*given, **named)


def test_one_clearance_is_the_default_everywhere() -> None:
    assert ChecksTable().scene.clearance == hk.Scene().clearance
    assert inspect.signature(command.check).parameters["clearance"].default == hk.Scene().clearance
    for verb in VERBS:
        known = inspect.signature(verb).parameters
        assert "scene" in known and not {*WORDS, "shapes_of"} & {*known}


def test_a_scene_of_none_looks_at_nothing_and_that_of_a_check_at_the_links() -> None:
    folded = np.array([[0.0, 3.0, 3.0]])
    assert hk.check(folded, None, robot=BARS, limits=False).pairs == ()
    default, links = (hk.check(folded, *scene, robot=BARS, limits=False) for scene in ((), (hk.Scene(),)))
    assert default.pairs == links.pairs and not default.passed
    assert {name for one in default.pairs for name in one.pair} <= {shape.link for shape in BARS.shapes}


@pytest.mark.parametrize("seed", range(6))
def test_a_scene_is_the_same_after_it_was_pickled(seed: int) -> None:
    """Its pairs and distances are, at random postures among random things."""
    draw = np.random.default_rng(seed)
    things = [hk.obstacle(f"thing {k}", Capsule(0.1, 0.2), draw.uniform(-3, 3, 3)) for k in range(3)]
    scene = hk.Scene(things, float(draw.uniform(-3, -1)), 0.02, bool(draw.integers(2)), [("thing 1", "*")])
    Q = draw.uniform(-2, 2, (20, 3))
    one, other = (Clearances.of(BARS, each) for each in (scene, pickle.loads(pickle.dumps(scene))))
    assert one.names == other.names and np.array_equal(one.distances(Q), other.distances(Q))
    assert not any("thing 1" in pair for pair in one.names)


def test_the_shapes_of_checks_are_those_of_the_robot_of_a_job(tmp_path: Path) -> None:
    """Its capsules have the radius, and its tip carries the tool, in all that is made of its tasks."""
    _, _, file = open_job("panda-circle")
    tool = '{ name = "pin", on = "panda_hand_tcp", kind = "box", sides = [0.1, 0.1, 0.1] }'
    post = '{ name = "post", kind = "sphere", radius = 0.1, xyz = [0, 1, 0] }'
    checks = f'[checks]\nfloor = -0.1\nradius = 0.03\nallowed = [["pin", "*"]]\nobstacles = [{tool}, {post}]\n'
    (tmp_path / "app.job.toml").write_text(f"{file.read_text('utf-8')}\n{checks}", "utf-8")
    _, job, file = open_job(str(tmp_path / "app.job.toml"))
    robot, _, (task, *_) = build_tasks(job, file)
    assert task.robot == robot and job.scene is not None
    assert {s.shape.radius for s in robot.shapes if isinstance(s.shape, Capsule)} == {0.03}
    assert [s.link for s in robot.shapes if s.carried and isinstance(s.shape, Box)] == ["pin"]
    assert [thing.link for thing in job.scene.obstacles] == ["post"] and job.scene.floor == -0.1
    assert job.scene.allowed == (("pin", "*"),)


def test_a_motion_without_a_robot_needs_one_and_a_trajectory_has_its_own() -> None:
    task, q0 = hk.position(BARS), np.array([0.3, 0.9, 0.5])
    start = BARS.pose(q0)[:3, 3]
    walk = hk.follow(hk.holonomic(task, hk.lock(2)), hk.line(start, start + [0.05, 0, 0]), q0, samples=9)
    found = [hk.check(walk), hk.check(walk.q, robot=BARS), hk.check(walk.q, task=task)]
    least = [{one.pair: one.least for one in report.pairs} for report in found]
    assert least[0] == least[1] == least[2] and least[0]
    with pytest.raises(ArgumentError, match="give a Scene or None; robot= takes it"):
        hk.check(walk, BARS)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="robot="):
        hk.check(walk.q)
