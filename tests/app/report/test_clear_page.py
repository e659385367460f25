"""The page and the picture of a proof that shapes keep apart: what is proven, refuted and undecided, and of what."""

from __future__ import annotations

import html
import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import holokin as hk
from conftest import Command
from holokin.app.report.plots import PROOF_COLORS, legible
from holokin.app.report.proof_picture import box_figure
from holokin.app.report.proof_report import save_with_page, write_page
from holokin.app.report.proof_words import nearest_of, refuted_by, size_words, stand_in_words
from holokin.proof import Certificate
from holokin.proof.proven_region import CAUSES, NEAR, region_of
from holokin.proof.recheck import Outcome, ask_checker
from holokin.robot import Box, Capsule, Cylinder, Ellipsoid, Hull, Mesh, with_capsules

pytest.importorskip("coal")
pin = pytest.importorskip("pinocchio")

Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
ARM = hk.load("panda")
TOOL, HALF, RADIUS, WANTED = ARM.pose(Q0), 0.02, 0.02, 0.002
BALL = TOOL[:3, 3] + [0.08, 0.08, 0.02]
TABLE = hk.obstacle("a table", Box(np.array([1.0, 0.9, 0.05])), (0.6, 0.0, -0.1))


@cache
def proof(part: bool) -> Certificate:
    """Of a cube of 4 cm: with a ball that one corner reaches, or without it."""
    strategy = hk.holonomic(hk.pose(ARM), hk.lock(2))
    space = hk.workspace(box=(TOOL[:3, 3], [HALF] * 3), rotation=TOOL[:3, :3])
    things = [TABLE, hk.obstacle("a ball", Capsule(RADIUS), tuple(BALL))][: 1 + part]
    more = {"self_collision": False} if part else {"floor": -0.3}
    scene = hk.Scene(things, clearance=WANTED, **more)
    return hk.unique_region(strategy, Q0, space, scene=scene, budget=4000).certificate


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the page that several statements are about is written once."""
    return tmp_path_factory.mktemp("pages")


@cache
def page(part: bool, folder: Path) -> tuple[str, list[list[str]]]:
    """(the text, the rows of its tables); what the page draws is looked at below."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("holokin.app.report.proof_report.box_figure", lambda _found: Figure(figsize=(1, 1)))
        text = save_with_page(proof(part), folder / "box.json", 0).read_text("utf-8")

    def plain(part: str) -> str:
        return html.unescape(re.sub(r"<[^>]*>", "", part))

    rows = [
        [plain(c) for c in re.findall(r"<t[dh].*?>(.*?)</t[dh]>", row)] for row in re.findall(r"<tr>.*?</tr>", text)
    ]
    return plain(re.sub(r"<style>.*?</style>", "", text, flags=re.S)), rows


def row(rows: list[list[str]], beginning: str) -> list[str]:
    return next(row for row in rows if row and row[0].startswith(beginning))


@cache
def pinocchio_arm() -> tuple[Any, Any, tuple[Any, ...]]:
    """The model, its data, and the capsules of its links."""
    model = pin.buildModelFromXML(hk.robot.to_urdf(ARM))
    return model, model.createData(), tuple(with_capsules(ARM).shapes)


def to_ball(q: np.ndarray) -> float:
    """By Pinocchio and a closed form."""
    (model, data, shapes), least = pinocchio_arm(), np.inf
    pin.forwardKinematics(model, data, q)
    for s in shapes:
        if s.joint >= 0:
            T = data.oMi[model.getJointId(ARM.joints[s.joint].name)].homogeneous @ s.placement
            a, b = (T[:3, 3] + sign * T[:3, 2] * s.shape.length / 2 for sign in (-1, 1))
            t = np.clip((BALL - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0, 1)
            least = min(least, np.linalg.norm(BALL - a - t * (b - a)) - s.shape.radius - RADIUS)
    return float(least)


@pytest.mark.campaign
def test_a_page_of_a_part_names_the_posture_that_refutes_the_rest(tmp_path: Path) -> None:
    text, rows = page(True, tmp_path)
    worst, region = refuted_by(proof(True)), region_of(proof(True))
    assert to_ball(worst.q) == pytest.approx(worst.distance, abs=1e-9) and worst.distance < 0
    assert "NOT ALL IS PROVEN: only" in text and f"a ball overlap by {-worst.distance:.3g} m" in text
    shares = {name: float(row(rows, name)[1].removesuffix(" %")) for name in ("refuted", "undecided")}
    assert shares["refuted"] == pytest.approx(100 * region.parts.shares[CAUSES[NEAR]], abs=0.006)
    assert sum(shares.values()) + 100 * region.share == pytest.approx(100, abs=0.02)


def test_a_page_lists_the_shapes_with_their_places_and_the_pairs_that_are_left_out(folder: Path) -> None:
    text, rows = page(False, folder)
    assert row(rows, "a table (obstacle)")[1:3] == [
        "box, 1 x 0.9 x 0.05 m",
        "[0.6, 0, -0.1] m, in the frame of the base",
    ]
    assert row(rows, "floor")[0].endswith("z = -0.3 m in the frame of the base")
    for s in with_capsules(ARM).shapes:
        if s.joint >= 0:
            assert f"radius {s.shape.radius:.4g} m" in row(rows, f"{s.link} (link)")[1]
    clear = proof(False).demands.clear
    for one in clear.looked_at.left_out:
        assert row(rows, " and ".join(one.pair))[-1] in {other.reason for other in clear.looked_at.left_out}
    for word in (
        "bending",
        "braking distances",
        "The controller",
        "not named above",
        "lengths and axes of the model",
        "capsules about the lines from joint to joint",
    ):
        assert word in text, word


def test_the_least_distance_of_a_page_is_a_bound_of_that_at_the_posture_it_names(folder: Path) -> None:
    text, rows = page(False, folder)
    bound, near = nearest_of(proof(False))
    assert 0 < bound <= near.distance < bound + 0.03
    assert str(near) in text
    found = [float(r[2]) for r in rows if len(r) == 3 and r[1] in (f"{WANTED:g}", "no contact")]
    assert found == sorted(found) and len(found) == len({pair.names for pair in proof(False).demands.clear.pairs})
    assert bound * 0.99 <= found[0] <= bound or min(found) <= bound
    assert "PROVEN BUT NOT VERIFIED" in text and f"the bodies that are to keep {WANTED:g} m apart or more do so" in text


def test_joint_speeds_of_a_page_are_no_less_than_those_of_the_strategy(folder: Path) -> None:
    _, rows = page(False, folder)
    G = proof(False).equation.strategy.batch(Q0[None])[0]
    for name, speed in zip(ARM.joint_names, np.linalg.norm(G[:, :3], axis=1), strict=True):
        told = next(r for r in rows if r[0] == name and r[1].endswith("rad/s"))
        assert float(told[1].split()[0]) >= speed - 1e-12


def pixels(figure: Any, region: hk.proof.UniqueRegion) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of each slice the colours that are shown, and the tool poses of their middles."""
    found = []
    for axes in figure.axes[1:]:
        (image,) = axes.images
        shown = np.asarray(image.get_array())
        low, high, bottom, top = image.get_extent()
        pair = ["xyz".index(label[0]) for label in (axes.get_xlabel(), axes.get_ylabel())]
        at = float(axes.get_title(loc="left").split()[2])
        points = np.full((*shown.shape, 3), at)
        points[..., pair[0]] = low + (high - low) * (np.arange(shown.shape[1]) + 0.5) / shown.shape[1]
        points[..., pair[1]] = (bottom + (top - bottom) * (np.arange(shown.shape[0]) + 0.5) / shown.shape[0])[:, None]
        solid = region.workspace.solid
        inside = solid.center + np.clip(points.reshape(-1, 3) - solid.center, -0.999 * HALF, 0.999 * HALF)
        found.append((shown.ravel(), region.workspace.at(inside)))
    return found


@pytest.mark.campaign
def test_the_picture_shows_green_only_where_nothing_is_too_near_and_red_where_it_is() -> None:
    region = region_of(proof(True))
    figure = legible(box_figure(proof(True)))
    figure.canvas.draw()
    slices = pixels(figure, region)
    assert len(slices) == 3
    for shown, poses in slices:
        chosen = np.arange(0, len(shown), 97)
        apart = np.array([to_ball(q) for q in hk.ik(region.strategy, Q0).batch(poses[chosen]).q])
        assert (apart[shown[chosen] == 0] >= WANTED).all() and (shown == 0).any()
        assert (shown[chosen][apart < -0.001] != 0).all()
        assert (shown == 1 + NEAR).any(), "the slices go through the posture that is too near"
    names = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"proven", "refuted: too near"} <= names and len(PROOF_COLORS) == 1 + len(CAUSES)
    sizes = [t.get_fontsize() for t in figure.findobj(Text) if t.get_visible() and t.get_text().strip()]
    assert min(sizes) * min(1.0, 700 / 96 / figure.get_figwidth()) > 7.99


JOB = """
title = "a ball at a corner"
robot.name = "panda"
task = {{ kind = "pose", orientation = "twist" }}
start.q = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
path = {{ kind = "circle", center = [-0.1, 0, 0], relative = true }}
workspace = {{ kind = "box", center = {center}, half = [0.02, 0.02, 0.02], rotation = "start" }}
strategies.lock = {{ kind = "lock", joints = ["panda_joint3"] }}

[checks]
clearance = 0.002
obstacles = [{{ name = "a ball", kind = "sphere", radius = 0.02, xyz = {ball} }}]
"""


@pytest.mark.campaign
def test_the_command_tells_the_part_that_is_proven_and_the_posture_that_refutes_the_rest(
    holokin: Command, tmp_path: Path
) -> None:
    job = tmp_path / "ball.toml"
    job.write_text(JOB.format(center=TOOL[:3, 3].tolist(), ball=BALL.tolist()))
    found = holokin("certify", job, "--workspace", "--part", "--out", tmp_path / "out", "--check", 0)
    assert found.code == 1 and "refuted: panda_joint7 and ball overlap by" in " ".join(found.out.split())
    told = json.loads((tmp_path / "out" / "ball-proof" / "result.json").read_text())["strategies"]["lock"]
    assert to_ball(np.array(told["refuted"]["q"])) == pytest.approx(told["refuted"]["distance"], abs=1e-9)
    assert sum(told["shares"].values()) == pytest.approx(1, abs=1e-9) and told["shares"]["proven"] > 0.5
    assert not list((tmp_path / "out").glob("*.cells"))


@pytest.mark.campaign
def test_a_page_says_that_a_sample_alone_was_checked(tmp_path: Path) -> None:
    pytest.importorskip("flint")
    found = proof(False)
    word = ask_checker(found, sample=0.05)
    assert word.outcome is Outcome.SAMPLED
    page = write_page(found, found.save(tmp_path / "box.json"), word).read_text("utf-8")
    assert (
        "PROVEN BUT NOT VERIFIED" in page and "NOT verified as a whole" in page and "class='verdict good'" not in page
    )
    told = int(re.findall(r"cells, ([\d,]+) were checked", page)[0].replace(",", ""))
    assert 0.05 * len(found) <= told <= 0.05 * len(found) + 2
    false = replace(found, determinant=1e3 * found.determinant)
    assert ask_checker(false, sample=0.05).outcome is Outcome.REJECTED


def test_a_mesh_that_is_not_convex_is_named_as_such(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    for name, mesh, words in (
        ("pipe", trimesh.creation.annulus(0.01, 0.02, 0.03), "the mesh is NOT convex"),
        ("block", trimesh.creation.box((0.1, 0.1, 0.1)), "its convex hull"),
    ):
        mesh.export(tmp_path / f"{name}.stl")
        said = stand_in_words(Mesh(tmp_path / f"{name}.stl"))
        assert words in said and ("NOT" in said) is (name == "pipe")
        assert size_words(Mesh(tmp_path / f"{name}.stl")).startswith(f"mesh {name}.stl, ")


@pytest.mark.campaign
def test_a_box_of_which_nothing_is_proven_has_a_page(tmp_path: Path) -> None:
    arm, q0 = hk.load("planar-3r"), np.array([0.3, 0.9, 0.7])
    strategy = hk.holonomic(hk.position(arm), hk.linear([[0.3, 0, 1]]))
    ball = hk.obstacle("a ball", Capsule(0.1), (-1.5, 0.0, 0.0))
    space = hk.workspace(box=(arm.pose(q0)[:2, 3], [1.4, 1.4]))
    none = hk.certify(strategy, space, q0, scene=hk.Scene(obstacles=[ball], self_collision=False), budget=1)
    assert len(none) == 0 and region_of(none).share == 0
    assert sum(region_of(none).parts.shares.values()) == pytest.approx(1.0)
    assert "NOTHING IS PROVEN" in save_with_page(none, tmp_path / "none.json", 0).read_text("utf-8")


def test_the_words_for_shapes_have_their_kind_and_sizes() -> None:
    ball = np.random.default_rng(0).normal(size=(900, 3))
    for shape, words, stand_in in (
        (Capsule(0.1), "sphere, radius 0.1 m", "as it is"),
        (Capsule(0.1, 0.5), "capsule, radius 0.1 m, length 0.5 m without its round ends", "as it is"),
        (Cylinder(0.1, 0.5), "cylinder, radius 0.1 m, length 0.5 m", "a prism of 16 sides that holds it"),
        (Ellipsoid(np.array([0.1, 0.2, 0.3])), "ellipsoid, half axes 0.1, 0.2, 0.3 m", "a box with round edges"),
        (Hull(ball / np.linalg.norm(ball, axis=1, keepdims=True)), "convex hull of points", "48 of its"),
    ):
        assert size_words(shape).startswith(words) and stand_in_words(shape).startswith(stand_in)
