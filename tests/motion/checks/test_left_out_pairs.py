"""Which pairs of links are left out: parent and child, what the user allows, what always touches; and no others."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, sampled, write_job
from holokin.base.errors import ArgumentError, UnknownNameError
from holokin.motion.checks.clearance import ADJACENT, ALWAYS, ASKED
from holokin.robot import Box, Capsule

pin = pytest.importorskip("pinocchio")


def link(name: str, shape: str = "") -> str:
    return f'<link name="{name}">{shape}</link>'


def box(xyz: str, size: str) -> str:
    return f'<collision><origin xyz="{xyz}"/><geometry><box size="{size}"/></geometry></collision>'


def joint(name: str, parent: str, child: str, xyz: str, axis: str = "0 1 0", kind: str = "revolute") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    limit = '<limit lower="-2" upper="2" velocity="1" effort="1"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}</joint>'


@dataclass
class Grown:
    """A random tree: parents, kinds of joints and shapes of its links, and the URDF of it."""

    text: str = ""
    parent: dict[str, str] = field(default_factory=dict)
    kind: dict[str, str] = field(default_factory=dict)
    shaped: dict[str, bool] = field(default_factory=dict)

    def above(self, name: str) -> list[str]:
        """A link and those that it hangs on, to the root."""
        return [name, *(self.above(self.parent[name]) if name in self.parent else [])]

    def child_of(self, one: str, other: str) -> bool:
        """Whether one hangs on the other, with only links without shapes between."""
        above = self.above(one)
        return other in above and not any(self.shaped[x] for x in above[1 : above.index(other)])


def grown(rng: np.random.Generator) -> Grown:
    """Some ten links at random places, balls of 1 cm on most of them; hinges, slides and fixed joints."""
    tree = Grown(shaped={"L0": bool(rng.random() < 0.7)})
    ball = '<collision><geometry><sphere radius="0.01"/></geometry></collision>'
    parts = [link("L0", ball if tree.shaped["L0"] else "")]
    for i in range(1, 11):
        name, parent = f"L{i}", f"L{i - 1}" if rng.random() < 0.6 else f"L{rng.integers(i)}"
        tree.parent[name], tree.shaped[name] = parent, bool(rng.random() < 0.7)
        tree.kind[name] = str(rng.choice(["revolute", "prismatic", "fixed"], p=[0.6, 0.1, 0.3]))
        xyz, axis = (" ".join(map(str, v)) for v in (rng.uniform(-0.5, 0.5, 3), np.eye(3)[rng.integers(3)]))
        parts += [
            link(name, ball if tree.shaped[name] else ""),
            joint(f"j{i}", parent, name, xyz, axis, tree.kind[name]),
        ]
    tree.text = f'<robot name="tree">{"".join(parts)}</robot>'
    return tree


@sampled(12, "seed", range(300))
def test_every_pair_of_a_random_tree_is_looked_at_or_parent_and_child(seed: int, tmp_path: Path) -> None:
    """The chain leads to any link, on the ground or on a rail; Pinocchio says where all are, what is beside the chain
    at declared values.
    """
    rng = np.random.default_rng(seed)
    tree = grown(rng)
    moving = [name for name, kind in tree.kind.items() if kind != "fixed"]
    if not moving:
        return
    tip = str(rng.choice(moving))
    chain = {name for name in tree.above(tip) if tree.kind.get(name, "fixed") != "fixed"}
    declared = {
        f"j{name[1:]}": float(rng.uniform(-1, 1)) for name in moving if name not in chain and rng.random() < 0.7
    }
    (tmp_path / "tree.urdf").write_text(tree.text, "utf-8")
    robot = hk.load(tmp_path / "tree.urdf", tip=tip, locked=declared)
    q = rng.uniform(-1, 1, robot.n)
    on_rail = rng.random() < 0.3
    whole = hk.compose(hk.load("rail"), hk.robot.Part(robot, prefix="on ")) if on_rail else robot
    report = hk.check(np.r_[[0.5] * on_rail, q][None], hk.Scene(clearance=0.0), robot=whole)
    # the referee: the tree as it was written, and Pinocchio's places of the balls
    model = pin.buildModelFromXML(tree.text)
    data, full = model.createData(), pin.neutral(model)
    for name, value in {**declared, **dict(zip(robot.joint_names, q, strict=True))}.items():
        full[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, full)
    place = {name: data.oMf[model.getFrameId(name)].translation for name in tree.shaped}
    movers = {name: chain & set(tree.above(name)) for name in tree.shaped}
    names = [name for name in tree.shaped if tree.shaped[name]]
    looked = {frozenset(name.removeprefix("on ") for name in one.pair): one.least for one in report.pairs}
    left = {frozenset(name.removeprefix("on ") for name in one.pair): one.reason for one in report.left_out}
    for i, one in enumerate(names):
        for other in names[:i]:
            pair = frozenset((one, other))
            if movers[one] == movers[other]:
                assert pair not in looked and pair not in left  # they do not move against each other
            elif tree.child_of(one, other) or tree.child_of(other, one):
                assert left.pop(pair) == ADJACENT and pair not in looked
            elif pair in looked:
                assert looked.pop(pair) == pytest.approx(np.linalg.norm(place[one] - place[other]) - 0.02, abs=1e-9)
            else:
                assert left.pop(pair) == ALWAYS
    assert not looked and not left


def two_arms(base: bool = True, kind: str = "revolute") -> str:
    """An arm of three upright links; beside it a parked arm, whose forearm lies through the first of them."""
    upright = box("0 0 0.15", "0.1 0.1 0.3")
    links = [link(name, upright) for name in ("A1", "A2", "A3")]
    links += [link("base", box("0 0 0", "0.02 0.02 0.02") if base else ""), link("B1", upright)]
    links += [link("B2", box("-0.4 0 0", "0.8 0.1 0.1"))]
    joints = [
        joint("a1", "base", "A1", "0 0 0"),
        joint("a2", "A1", "A2", "0 0 0.3"),
        joint("a3", "A2", "A3", "0 0 0.3"),
    ]
    joints += [joint("b1", "base", "B1", "0.5 0 0", kind=kind), joint("b2", "B1", "B2", "0 0 0.2", kind=kind)]
    return f'<robot name="two">{"".join(links + joints)}</robot>'


@pytest.mark.parametrize("base", [True, False])
@pytest.mark.parametrize("kind", ["revolute", "fixed"])
def test_a_parked_arm_is_looked_at(base: bool, kind: str, tmp_path: Path) -> None:
    """By `check` and by `certify`, with and without a shape of the base, hung on it by any joints."""
    (tmp_path / "two.urdf").write_text(two_arms(base, kind), "utf-8")
    arm = hk.load(tmp_path / "two.urdf", tip="A3")
    report = hk.check(np.array([[0.0, 0.3, 0.3], [0.1, 0.3, 0.3]]), hk.Scene(clearance=0.01), robot=arm)
    assert not report.passed and ("B2", "A1") in [found.what for found in report.findings]
    q0, task = np.array([0, 0.3, 0.3]), hk.position(arm)[[0, 2]]
    start = arm.pose(q0)[:3, 3]
    with pytest.raises(ArgumentError, match="B2 and A1 overlap"):
        hk.certify(hk.holonomic(task, hk.lock("a3")), hk.line(start, start + [0.02, 0, 0]), q0, scene=hk.Scene())
    if kind == "revolute":
        mujoco = pytest.importorskip("mujoco")
        same = hk.robot.from_mjcf(mujoco.MjModel.from_xml_string(two_arms(base, kind)), tip="A3")
        assert ("B2", "A1") in [found.what for found in hk.check(np.array([[0.0, 0.3, 0.3]]), robot=same).findings]
        # put up by its declared posture
        away = hk.load(tmp_path / "two.urdf", tip="A3", locked={"b2": 1.5})
        assert hk.check(np.array([[0.0, 0.3, 0.3]]), robot=away).passed


def test_a_certificate_names_each_pair_that_is_left_out_with_its_kind(tmp_path: Path) -> None:
    (tmp_path / "two.urdf").write_text(two_arms(), "utf-8")
    arm = hk.load(tmp_path / "two.urdf", tip="A3", locked={"b2": 1.5})
    q0, task = np.array([0, 0.3, 0.3]), hk.position(arm)[[0, 2]]
    start = arm.pose(q0)[:3, 3]
    strategy, path = hk.holonomic(task, hk.lock("a3")), hk.line(start, start + [0.02, 0, 0])
    proof = hk.certify(strategy, path, q0, scene=hk.Scene(clearance=0.01, allowed=[("B1", "A2")]))
    report = hk.check(q0[None], hk.Scene(allowed=[("B1", "A2")]), robot=arm)
    assert proof.demands.clear.looked_at.left_out == report.left_out
    for text in (str(proof), report.table()):
        assert "parent and child: base and A1, A1 and A2, A2 and A3" in text
        assert "allowed to touch: B1 and A2" in text


def test_a_tool_is_no_neighbour_of_the_link_before_the_one_that_carries_it() -> None:
    """A pin that stands back from the last joint is in the first bar; a wrist without a shape is counted out."""
    row = {"a": 0.5, "lower": -2.9, "upper": 2.9}
    arm = hk.robot.with_capsules(hk.from_dh([row, row], name="two bars"), 0.03)
    pin_back = hk.robot.with_shape(arm, "pin", Capsule(0.01, 0.1), [-0.62, 0, 0], [0, np.pi / 2, 0])
    (found,) = hk.check(np.array([[0.0, 0.3]]), robot=pin_back).findings
    assert found.what == ("q1", "pin")
    wrist = hk.from_dh([row, {**row, "a": 0.0}], name="a wrist")
    held = hk.robot.with_shape(wrist, "tool", Capsule(0.05), [0.02, 0, 0])
    assert [(one.pair, one.reason) for one in hk.check(np.zeros((1, 2)), robot=held).left_out] == [
        (("q1", "tool"), ADJACENT)
    ]


# --- what the user allows ---


def test_the_floor_and_any_obstacle_may_be_allowed_for_one_link() -> None:
    """A sledge on the floor pushes a box; an arm on it touches neither: each pair alone, misspelt ones are refused."""
    sledge = hk.compose(hk.load("rail"), hk.robot.Part(hk.load("ur5e"), pose=[0, 0, 0.02]))
    q, crate = (
        np.array([[0.5, 0, -1.2, 1.3, -1.6, -1.5, 0]]),
        hk.obstacle("crate", Box([0.05, 0.05, 0.05]), [0.5, 0.07, 0.03]),
    )
    scene = hk.Scene([crate], floor=0.0)
    found = {found.what for found in hk.check(q, scene, robot=sledge).findings}
    assert found == {("rail_joint", "floor"), ("rail_joint", "crate")}
    may = [("rail_joint", "floor"), ("crate", "rail_joint")]
    allowed = replace(scene, allowed=may)
    report = hk.check(q, allowed, robot=sledge)
    assert report.passed and [one.pair for one in report.left_out if one.reason == ASKED] == [
        ("rail_joint", "crate"), ("rail_joint", "floor"),
    ]  # fmt: skip
    assert ("elbow_joint", "floor") in [one.pair for one in report.pairs]
    for pair, names in ((("rail_joint", "flor"), "rail_joint.*crate, floor"), (("crat", "rail_joint"), "crate")):
        with pytest.raises(UnknownNameError, match=names):
            hk.check(q, replace(scene, allowed=[pair]), robot=sledge)
    with pytest.raises(UnknownNameError, match="floor"):
        hk.check(q, hk.Scene(allowed=may[:1]), robot=sledge)  # there is no floor
    assert hk.motion.checks.Clearances.of(sledge, allowed).clear(q).all()


def test_a_certificate_may_leave_the_floor_out_for_one_link() -> None:
    bars = hk.robot.with_capsules(hk.load("planar-3r"), 0.05)
    q0 = np.array([0.3, 0.9, 0.9])
    G = hk.holonomic(hk.position(bars), hk.linear([[0, 1, -1]]))
    space = hk.workspace(box=(bars.pose(q0)[:3, 3], [0.01, 0.01, 0.0]))
    scene = hk.Scene(floor=-0.05)
    with pytest.raises(ArgumentError, match="floor"):
        hk.certify(G, space, q0, scene=scene)
    may = [(name, "floor") for name in bars.joint_names]
    proof = hk.certify(G, space, q0, scene=replace(scene, allowed=may))
    assert proof.whole and all(f"{name} and floor" in str(proof) for name in bars.joint_names)


JOB = {
    "robot": '[robot]\n[[robot.parts]]\nname = "rail"\n[[robot.parts]]\nname = "ur5e"\nxyz = [0, 0, 0.02]\n',
    "task": '[task]\nkind = "pose"\n',
    "start": "[start]\nq = [0.5, 0, -1.2, 1.3, -1.6, -1.5, 0]\n",
    "path": '[path]\nkind = "polyline"\npoints = [[0, 0, 0], [0, 0, 0.02]]\nrelative = true\nsamples = 8\n',
}


@pytest.mark.usefixtures("sketched")
def test_a_job_allows_the_floor_for_one_link(holokin: Command, tmp_path: Path, out: Path) -> None:
    checks = "[checks]\nfloor = 0.0\n"
    may = write_job(tmp_path, "may.toml", **JOB, checks=checks + 'allowed = [["rail_joint", "floor"]]\n')
    outcome = holokin("run", may, "--out", out)
    assert outcome.code == 0 and "allowed to touch: rail_joint and floor" in " ".join(outcome.out.split())
    wrong = write_job(tmp_path, "wrong.toml", **JOB, checks=checks + 'allowed = [["rail_joint", "flor"]]\n')
    outcome = holokin("run", wrong, "--out", out)
    assert outcome.code == 2 and "flor" in outcome.err and "floor" in outcome.err
