"""No law covers all directions of the wrist: indices of fields whose poles are known, and of arms."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import IIWA_START, PANDA_START, PPR_CENTER, PPR_RADIUS, PPR_START, campaign, fails, sampled
from holokin.analysis import curvature
from holokin.analysis.curvature import Directions, obstruction
from holokin.analysis.curvature.sphere_index import TangentField, area, icosphere, poles, turn
from holokin.base.errors import ArgumentError, OpenPathError
from papers_arm import paper_frame

IIWA = np.array([0.1, 0.6, 0.3, -1.4, 0.2, 1.1, 0.0])
SHOULDER = np.array([0.0, 0.0, 0.36])
X, Y, Z = np.eye(3)


# --- fields on the sphere in closed form ---


class Given(TangentField):
    """The tangent part of a vector field of space."""

    def __init__(self, vectors: Callable[[np.ndarray], np.ndarray]) -> None:
        self.vectors = vectors

    def step(self, state: object, u: np.ndarray) -> tuple[object, np.ndarray] | None:
        v = self.vectors(u)
        v = v - (u @ v) * u
        size = np.linalg.norm(v)
        return (state, v / size) if size > 1e-12 else None


def cubic(u: np.ndarray) -> np.ndarray:
    """The gradient of x^3 - 3 x y^2: three summits and three dips round the equator, a saddle of three ways on top."""
    return np.array([3 * u[0] ** 2 - 3 * u[1] ** 2, -6 * u[0] * u[1], 0.0])


FIELDS = {
    "a rotation": (lambda u: np.cross(Z, u), [(Z, 1), (-Z, 1)]),
    "downhill": (lambda u: -Z, [(Z, 1), (-Z, 1)]),
    "one pole": (lambda u: np.cross(u, np.cross(u - X, Z)), [(X, 2)]),
    "the gradient of xyz": (
        lambda u: u[[1, 2, 0]] * u[[2, 0, 1]],
        [(s * a, -1) for s in (1, -1) for a in (X, Y, Z)]
        + [(np.array([a, b, c]) / 3**0.5, 1) for a in (1, -1) for b in (1, -1) for c in (1, -1)],
    ),
    "monkey saddles": (
        cubic,
        [(Z, -2), (-Z, -2)] + [(np.array([np.cos(k * np.pi / 3), np.sin(k * np.pi / 3), 0]), 1) for k in range(6)],
    ),
}


@sampled(2, "name", FIELDS)
def test_the_poles_of_a_known_field_are_found_with_their_indices(name: str) -> None:
    field, known = FIELDS[name]
    turned = Rotation.from_rotvec([0.3, -0.2, 0.5])
    found = poles(Given(lambda u: turned.apply(field(turned.inv().apply(u)))), None, Y, 0, 0.01)
    assert found.total == sum(index for _, index in known) == 2
    assert len(found.found) == len(known)
    for pole in found.found:
        at = [index for u, index in known if np.arccos(min(turned.apply(u) @ pole.direction, 1)) < pole.radius < 0.02]
        assert at == [pole.index]
    assert found.largest < np.pi / 2
    assert found.reached == found.directions


def test_a_pole_that_an_edge_passes_closely_is_not_missed() -> None:
    """A direction that makes a whole turn on a short piece of an edge looks as if it had made none."""
    points, triangles = icosphere(1)
    a, b, _ = points[triangles[7]]
    pole = a + 0.3 * (b - a) + 1e-3 * np.cross(a, b)
    pole /= np.linalg.norm(pole)
    V = np.cross(pole, X) / np.linalg.norm(np.cross(pole, X))
    found = poles(Given(lambda u: np.cross(u, np.cross(u - pole, V))), None, -pole, 1, 0.01)
    assert [p.index for p in found.found] == [2]
    assert found.found[0].direction @ pole > np.cos(0.01)


def test_the_triangles_cover_the_sphere_and_turning_round_one_is_its_area() -> None:
    points, triangles = icosphere(2)
    areas = [area(*points[t]) for t in triangles]
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(4 * np.pi)
    u, v, w = points[triangles[5]]
    e = np.cross(u, X) / np.linalg.norm(np.cross(u, X))
    carried = e
    for a, b in ((u, v), (v, w), (w, u)):
        carried = Rotation.from_rotvec(np.cross(a, b) / np.linalg.norm(np.cross(a, b)) * np.arccos(a @ b)).apply(
            carried
        )
    assert turn(u, e, u, carried) == pytest.approx(areas[5])


# --- arms ---


def places(found: curvature.Obstruction) -> list[tuple[list[float], int]]:
    return [(w.direction.round(2).tolist(), w.index) for w in found.witnesses]


def test_the_conventional_angle_has_two_poles_of_index_1_above_and_below_the_shoulder(iiwa14: hk.Robot) -> None:
    found = obstruction(
        hk.holonomic(hk.pose(iiwa14), hk.arm_angle(definition="conventional")), Directions(fineness=0), IIWA
    )
    assert (found.total, places(found)) == (2, [([0, 0, -1], 1), ([0, 0, 1], 1)])
    assert found.largest < np.pi / 2
    assert "none covers all directions" in found.sentence
    for witness in found.witnesses:  # the tool pose that brings the wrist there
        wrist = witness.pose[:3, 3] - 0.126 * witness.pose[:3, 2]
        assert wrist - SHOULDER == pytest.approx(np.linalg.norm(wrist - SHOULDER) * witness.direction, abs=1e-9)
        assert witness.pose[:3, :3] == pytest.approx(iiwa14.pose(IIWA)[:3, :3])


@pytest.mark.campaign
@pytest.mark.parametrize(("pole", "reference"), [((-1, 0, 0), (0, 0, 1)), ((0.48, 0.6, -0.64), (0.8, 0.0, 0.6))])
def test_a_stereographic_angle_has_one_pole_of_index_2_along_its_half_line(
    iiwa14: hk.Robot, pole: tuple[float, ...], reference: tuple[float, ...]
) -> None:
    law = hk.holonomic(hk.pose(iiwa14), hk.arm_angle(pole=pole, reference=reference))
    found = obstruction(law, Directions(fineness=0), IIWA)
    (witness,) = found.witnesses
    assert (found.total, witness.index) == (2, 2)
    assert witness.direction @ pole > np.cos(0.01)
    assert not witness.hole


@pytest.mark.campaign
def test_a_locked_joint_leaves_two_caps_out_of_reach_and_they_hold_the_indices(iiwa14: hk.Robot) -> None:
    """The wrist turns about joint 2 at a fixed distance from its axis's plane: no direction nearer to the vertical."""
    found = obstruction(hk.holonomic(hk.pose(iiwa14), hk.lock(2)), Directions(fineness=1), IIWA)
    assert (found.total, sorted(w.index for w in found.witnesses)) == (2, [1, 1])
    line = iiwa14.skeleton(IIWA)[0]
    W = line[6] - SHOULDER
    axis = iiwa14.jacobian(IIWA)[3:, 1]
    cap = np.arcsin(abs(W @ axis) / np.linalg.norm(W))
    assert cap > 0.15
    for witness in found.witnesses:
        assert witness.hole
        assert abs(witness.direction[2]) > 0.99
        assert cap < witness.radius < cap + 0.15  # triangles of 0.3 rad


@pytest.mark.campaign
def test_a_law_that_nobody_wrote_down_has_total_index_2_as_well(iiwa14: hk.Robot) -> None:
    law = hk.holonomic(hk.pose(iiwa14), hk.strategies.constraints.stationary(hk.strategies.constraints.centring_cost()))
    found = obstruction(law, Directions(fineness=0), hk.motion.ik.move_to_leaf(law, IIWA, 0.0))
    assert found.total == sum(w.index for w in found.witnesses) == 2
    assert all(w.hole for w in found.witnesses)


def test_no_law_of_an_iiwa_covers_all_directions_whichever_it_is(iiwa14: hk.Robot) -> None:
    """The elbow's circle is as wide as the triangle of upper arm, forearm and reach says."""
    found = obstruction(hk.pose(iiwa14), Directions(fineness=0), IIWA)
    line = iiwa14.skeleton(IIWA)[0]
    d = np.linalg.norm(line[6] - SHOULDER)
    height = np.sqrt(0.42**2 - ((0.42**2 - 0.40**2 + d**2) / (2 * d)) ** 2)
    assert found.total == 2
    assert found.total
    assert found.clearance == pytest.approx(height, abs=1e-9)
    assert (
        found.sentence.startswith("no strategy of iiwa14 covers all directions") and "without a jump." in found.sentence
    )


@pytest.mark.campaign
def test_a_panda_whose_wrist_stands_aside_is_not_said_to_be_like_that_beyond_what_was_traced(panda: hk.Robot) -> None:
    found = obstruction(hk.pose(panda), Directions(fineness=0), PANDA_START)
    assert found.total == 2
    assert "on the self-motions traced" in found.sentence
    law = obstruction(hk.holonomic(hk.pose(panda), hk.arm_angle()), Directions(fineness=0), PANDA_START)
    assert law.total == 2
    assert "unless the elbow gets onto the line" in law.sentence


def test_a_stretched_arm_is_undecided(iiwa14: hk.Robot) -> None:
    """Its elbow is on the line from shoulder to wrist and has no direction."""
    found = obstruction(hk.pose(iiwa14), Directions(fineness=0), IIWA * [1, 1, 1, 0, 1, 1, 1])
    assert found.total is None
    assert "undecided" in found.sentence
    assert found.reached == 0


def test_directions_want_a_shoulder_that_stands_and_a_tool_that_is_turned(panda: hk.Robot) -> None:
    with pytest.raises(ArgumentError, match="no joint moves"):
        obstruction(hk.pose(panda), Directions(joints=(3, 4, 6)), PANDA_START)
    fails(ArgumentError, "orientation", lambda: obstruction(hk.position(panda), Directions(), PANDA_START))
    for wrong in ({"fineness": 9}, {"fineness": -1}, {"accuracy": 0.0}):
        with pytest.raises(ArgumentError):
            Directions(**wrong)  # type: ignore[arg-type]


# --- loops ---


def loop(robot: hk.Robot, axis: np.ndarray, size: float, pole: np.ndarray) -> tuple[np.ndarray, hk.Path]:
    """(start, a circle of the wrist of an iiwa 14 round a direction from its shoulder, its tool down)."""
    side = np.cross(axis, [0.6, 0.8, 0.1])
    w = np.cos(size) * axis + np.sin(size) * side / np.linalg.norm(side)
    T = np.eye(4)
    T[:3, :3] = np.diag([1.0, -1.0, -1.0])
    T[:3, 3] = SHOULDER + 0.6 * w + 0.126 * T[:3, 2]
    leaf = hk.holonomic(hk.pose(robot), hk.arm_angle(pole=pole, reference=np.cross(pole, [0.3, 0.5, 0.7])))
    start = hk.motion.ik.all_postures(leaf, T, 0.4).q[0]
    center = SHOULDER + 0.6 * np.cos(size) * axis + 0.126 * T[:3, 2]
    return start, hk.circle(T[:3, 3], center, axis)


@pytest.mark.campaign
@sampled(
    1,
    ("definition", "axis", "size", "turns", "samples"),
    [("conventional", Z, 0.4, 1, 16), ("stereographic", -X, 0.7, 2, 24), ("stereographic", Z, 0.4, 0, 16)],
)
def test_round_a_pole_the_redundant_joint_makes_as_many_turns_as_its_index(
    iiwa14: hk.Robot, definition: str, axis: np.ndarray, size: float, turns: int, samples: int
) -> None:
    start, path = loop(iiwa14, axis, size, -Y)
    law = hk.holonomic(hk.pose(iiwa14), hk.arm_angle(definition=definition))
    found = obstruction(law, path, start, samples=samples)
    assert found.total is not None
    assert abs(found.total) == turns
    assert bool(found.total) == (turns > 0)
    assert found.largest < np.pi / 2
    assert ("any strategy with the same postures on the path has a jump" in found.sentence) == (turns > 0)
    sign = "+" if found.total > 0 else "-"
    often = {0: "no turn", 1: f"{sign}1 turn", 2: f"{sign}2 turns"}[turns]
    assert f" makes {often} along the self-motion" in found.sentence


@pytest.mark.campaign
def test_the_other_way_round_the_turns_are_the_other_way(iiwa14: hk.Robot) -> None:
    start, path = loop(iiwa14, Z, 0.4, -Y)
    law = hk.holonomic(hk.pose(iiwa14), hk.arm_angle(definition="conventional"))
    there, back = (obstruction(law, way, start, samples=12).total for way in (path, path.reversed()))
    assert there == -back != 0  # type: ignore[operator]


@pytest.mark.campaign
def test_a_self_motion_that_is_no_circle_is_undecided() -> None:
    """Two slides along one line: the self-motion never closes."""
    rows = [{"kind": "prismatic"}, {"kind": "prismatic", "alpha": np.pi / 2}, {"kind": "prismatic"}]
    robot = hk.from_dh(rows, name="slides")
    task = hk.position(robot, rows=[1, 2])
    law, q0 = hk.holonomic(task, hk.linear([1, -1, 0])), np.zeros(3)
    p = robot.pose(q0)[:3, 3]
    path = hk.polyline([p, p + [0, 0.1, 0], p + [0, 0.1, 0.1], p])
    found = obstruction(law, path, q0, samples=8)
    assert found.total is None
    assert "no closed curve" in found.sentence


def test_loops_want_a_law_with_leaves_and_an_end_at_the_start(panda: hk.Robot) -> None:
    p = panda.pose(PANDA_START)[:3, 3]
    fails(ArgumentError, "leaves", lambda: obstruction(hk.pose(panda), hk.circle(p, p - [0.1, 0, 0]), PANDA_START))
    law = hk.holonomic(hk.pose(panda), hk.arm_angle())
    fails(OpenPathError, "", lambda: obstruction(law, hk.polyline([p, p + [0.1, 0, 0]]), PANDA_START))
    with pytest.raises(ArgumentError, match="redundant"):
        two = hk.holonomic(hk.position(panda), hk.lock(0, 1, 2, 6))
        obstruction(two, hk.circle(p, p - [0.1, 0, 0]), PANDA_START)


# --- The price of repeatability: a bound that no regular holonomic law beats, and what it does not say (T11).


Z0 = 0.8
CENTER_START = np.array([PPR_CENTER[0] - np.cos(Z0), PPR_CENTER[1] - np.sin(Z0), Z0])
UNIT = np.sqrt(1.5) / np.sqrt(2)
"""|G| / |N| of the pseudo-inverse on the PPR arm: from shares of |G| to changes of the slope dq3/dx [rad/m]."""


@pytest.fixture(scope="module")
def ppr_given() -> hk.Strategy:
    return hk.moore_penrose(hk.position(hk.load("ppr")))


@pytest.fixture(scope="module")
def panda_given() -> hk.Strategy:
    return hk.moore_penrose(hk.pose(hk.load("panda")))


def test_the_bound_on_ppr_has_its_closed_form_T11(ppr_given: hk.Strategy) -> None:
    """Leaf of theory 5.3: the least of |dz/(rho dtheta) - cos(z - theta)/2| is 1/2 - (1 - e^{-R/2}) / R = 0.0471.

    First order: kappa R / (2 sqrt 2) = 0.035567; the twin's rms over all angles 0.035674 (rad/m).
    """
    found = curvature.distance_to_repeatable(
        ppr_given, curvature.ball(CENTER_START, PPR_RADIUS, along=np.pi * np.sqrt(2)), samples=600
    )
    assert found.bound * UNIT == pytest.approx(0.5 - (1 - np.exp(-PPR_RADIUS / 2)) / PPR_RADIUS, rel=1e-4)
    assert found.bound * UNIT == pytest.approx(0.0471, abs=1e-4)
    assert found.first_order * UNIT == pytest.approx(0.035567, rel=1e-4)
    assert found.radial.rms * UNIT == pytest.approx(0.035674, rel=0.05)  # a sample of the disc
    most = (np.exp(PPR_RADIUS / 2) - 1) / PPR_RADIUS - 0.5
    assert found.radial.largest * UNIT == pytest.approx(most, rel=1e-3)  # met on the circle, not inside it


def near_radial_laws(given: hk.Strategy, start: np.ndarray, times: int) -> list[hk.Strategy]:
    """Holonomic laws as near to the given one as we can make them: twins about other starts, tilted ones, others."""
    rng = np.random.default_rng(2)
    twin = hk.radial(given, start)
    out = [twin]
    for _ in range(times):
        out.append(hk.radial(given, start + 0.05 * rng.uniform(-1, 1, given.task.n)))
        a, B = 0.02 * rng.normal(size=2), 0.1 * rng.normal(size=(2, 2))
        center = given.task.robot.pose(start)[:2, 3]

        def rho(x: ca.SX, a=a, B=B, center=center) -> ca.SX:
            v = x[:2] - ca.DM(center)
            return ca.dot(ca.DM(a), v) + v.T @ ca.DM(B) @ v

        out.append(hk.holonomic(given.task, hk.strategies.constraints.tilted(twin.constraint, rho)))
    return out


@pytest.mark.parametrize(
    ("name", "times"), [("ppr", 1), *(campaign(("name", "times"), (name, 3)) for name in ("ppr", "panda"))]
)
def test_no_regular_law_beats_the_bound_and_the_twin_is_within_a_third_of_it(name: str, times: int) -> None:
    robot = hk.load(name)
    start, radius = (CENTER_START, PPR_RADIUS) if name == "ppr" else (PANDA_START, 0.1)
    given = hk.moore_penrose(hk.position(robot) if name == "ppr" else hk.pose(robot))
    found = curvature.distance_to_repeatable(given, curvature.ball(start, radius), samples=40)
    assert found.circle.shape == (found.points, robot.n)
    assert found.bound < found.radial.largest < 4 / 3 * found.bound
    for law in near_radial_laws(given, start, times):
        assert curvature.deviation(given, law, found.circle, columns=min(3, given.task.m)).largest >= found.bound


def cut_law(given: hk.Strategy, sharpness: float) -> hk.Strategy:
    """A holonomic law on PPR as near to the pseudo-inverse on the leaf z(rho, theta) through the start as it likes, but
    in a thin sector: g = u(theta) + lambda (q3 - z), grad u = lambda (grad z - A) outside of it, u back to 0 inside.
    """

    def g(q: ca.SX) -> ca.SX:
        x, y = q[0] + ca.cos(q[2]) - PPR_CENTER[0], q[1] + ca.sin(q[2]) - PPR_CENTER[1]
        rho, phi = ca.sqrt(x**2 + y**2 + 1e-8), ca.atan2(y, x)
        half, t = (Z0 - phi) / 2, ca.exp(-rho / 2)
        z = phi + 2 * ca.atan2(ca.sin(half) * t, ca.cos(half))
        c, s = ca.cosh(rho / 2), ca.sinh(rho / 2)
        cos_a = ca.cos(Z0 - phi)
        tangential = ((c + s * cos_a - 1) / rho - (c * cos_a + s) / 2) / (c + s * cos_a)  # z_theta / rho - A_theta
        u = 2 * ca.atan2((1 + sharpness) * ca.sin(phi / 2), (1 - sharpness) * ca.cos(phi / 2)) - phi
        back = (1 - sharpness**2) / (1 + sharpness**2 - 2 * sharpness * ca.cos(phi))  # du/dphi + 1
        gap = ca.sin(q[2] - z)  # z as an angle
        return u + (1 + back**2) / (rho * ca.fabs(tangential)) * gap

    return hk.holonomic(given.task, hk.custom(g, name="law with a cut"))


@pytest.mark.campaign
def test_a_law_with_a_cut_has_less_rms_than_the_twin_but_not_less_at_most(ppr_given: hk.Strategy) -> None:
    """On one leaf no rms deviation but 0 is the least; what must fall back once on every loop is the maximum."""
    before = np.inf
    for sharpness in (0.9, 0.99, 0.999):
        law = cut_law(ppr_given, sharpness)
        found = curvature.distance_to_repeatable(ppr_given, curvature.ball(CENTER_START, PPR_RADIUS), law, samples=300)
        assert found.ours is not None
        assert found.ours.rms < before
        assert found.bound <= found.ours.largest
        before = found.ours.rms
    assert before < 0.5 * found.first_order
    assert hk.involutivity(law, hk.around(CENTER_START + 0.1, 0.02), samples=4).holonomic


def test_the_bound_is_what_a_direct_search_along_the_circle_finds() -> None:
    """iiwa14: the curve by an adaptive integrator, its tangent by finite differences, min |Gamma' - G e| / |G|."""
    from scipy.integrate import solve_ivp

    robot = hk.load("iiwa14")
    given = hk.moore_penrose(hk.pose(robot))
    found = curvature.distance_to_repeatable(given, curvature.ball(IIWA_START, 0.1), samples=10)
    center = robot.pose(IIWA_START)[:3, 3]
    spokes = np.array([robot.pose(q)[:3, 3] - center for q in found.circle])
    assert np.linalg.norm(spokes, axis=1) == pytest.approx(0.1, abs=1e-7)
    assert np.linalg.svd(spokes)[1][2] < 1e-6  # in one plane
    u, v = spokes[0] / 0.1, spokes[found.points // 4] / 0.1

    def at(angle: float) -> np.ndarray:
        out = np.pad(0.1 * (np.cos(angle) * u + np.sin(angle) * v), (0, 3))
        return solve_ivp(lambda _t, q: given(q) @ out, (0, 1), IIWA_START, "DOP853", rtol=1e-9, atol=1e-11).y[:, -1]

    shares = []
    for angle in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        h, q = 1e-3, at(angle)
        tangent = (at(angle + h) - at(angle - h)) / (2 * h * 0.1)
        e = np.pad(-np.sin(angle) * u + np.cos(angle) * v, (0, 3))
        shares.append(np.linalg.norm(tangent - given(q) @ e) / np.linalg.norm(given(q)[:, :3]))
    assert found.bound == pytest.approx(min(shares), rel=0.01)


def test_a_price_says_of_what_set_and_norm_it_speaks(panda_given: hk.Strategy) -> None:
    lock = hk.holonomic(panda_given.task, hk.lock(2))
    text = str(curvature.distance_to_repeatable(panda_given, curvature.ball(PANDA_START, 0.1), lock, samples=20))
    for said in (
        "at least 3.9",
        "one or more postures",
        "by a theorem",
        "120 sampled points",
        "20 sampled postures",
        "at most",
        "rms",
    ):
        assert said in text
    assert "best" not in text


def test_what_costs_nothing_is_free_and_what_has_no_price_is_refused(ppr: hk.Robot, panda: hk.Robot) -> None:
    task = hk.position(ppr)
    free = curvature.distance_to_repeatable(
        hk.null_basis(task, paper_frame), curvature.ball(CENTER_START, 0.2), samples=30
    )
    assert free.bound < 1e-6
    assert free.first_order < 1e-9
    for strategy, region in (
        (hk.moore_penrose(hk.position(panda)), curvature.ball(PANDA_START, 0.1)),
        (hk.moore_penrose(hk.position(ppr, rows=[0])), curvature.ball(PPR_START, 0.1)),
    ):
        fails(ArgumentError, "redundant joints", lambda: curvature.distance_to_repeatable(strategy, region))
    for radius in (0.0, np.inf):
        fails(ArgumentError, "radius", lambda: curvature.ball(PPR_START, radius))


# --- How the error of a drift forecast falls with the size of the loop: measured, against closed form and integration.


SIZES = (0.08, 0.04, 0.02, 0.01)


def shares(given: hk.Strategy, start: np.ndarray, loops: list[hk.Path]) -> tuple[np.ndarray, np.ndarray]:
    """Relative errors (k,) of the forecast, and of area times curvature at the centre, not carried to the start."""
    out = []
    for loop in loops:
        drift = hk.drift(given, loop, start, samples=300).since_start[0]
        told = curvature.predicted_drift(given, loop, start)
        plain = np.einsum("ij,aij->a", told.area, told.curvature) / 2
        out.append([np.abs(one - drift).max() / np.abs(drift).max() for one in (told.drift, plain)])
    return np.array(out).T


@sampled(1, ("name", "start", "largest"), [("panda", PANDA_START, 0.02), ("iiwa14", IIWA_START, 0.04)])
def test_the_error_of_a_forecast_falls_with_the_second_power_of_the_circle(
    name: str, start: np.ndarray, largest: float
) -> None:
    """On the Panda 1.4, 0.33, 0.08, 0.02 %; area times curvature at the centre alone 16, 7.9, 3.9, 1.9 %, the first."""
    robot = hk.load(name)
    point = robot.pose(start)[:3, 3]
    loops = [hk.circle(point, point - [size, 0, 0]) for size in SIZES]
    carried, plain = shares(hk.moore_penrose(hk.pose(robot)), start, loops)
    assert carried[0] < largest
    assert carried[:-1] / carried[1:] == pytest.approx(4 * np.ones(3), rel=0.25)
    assert plain[:-1] / plain[1:] == pytest.approx(2 * np.ones(3), rel=0.25)


def test_the_error_falls_with_the_second_power_whatever_the_plane_loop(panda: hk.Robot) -> None:
    """A triangle, whose centre of area is neither its mean in time nor the middle of its box; and it is tilted."""
    point = panda.pose(PANDA_START)[:3, 3]
    corners = np.array([[0, 0, 0], [2, 0, 0.5], [0.3, 0.8, 0], [0, 0, 0]])
    given = hk.moore_penrose(hk.pose(panda))
    carried, plain = shares(given, PANDA_START, [hk.polyline(point + size * corners) for size in SIZES[:3]])
    assert carried[:-1] / carried[1:] == pytest.approx(4 * np.ones(2), rel=0.4)
    assert plain[:-1] / plain[1:] == pytest.approx(2 * np.ones(2), rel=0.3)
    told = curvature.predicted_drift(given, hk.polyline(point + 0.01 * corners), PANDA_START)
    middle = panda.pose(told.center)[:3, 3] - point
    assert middle == pytest.approx(0.01 * corners[:3].mean(axis=0), abs=1e-8)


def test_loops_out_of_one_plane_fall_with_the_first_power_at_least(panda: hk.Robot) -> None:
    """Two squares in planes at right angles, apart: no one centre is that of both."""
    point = panda.pose(PANDA_START)[:3, 3]
    flat = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]])
    away = np.array([2.0, 0, 0])
    upright = away + flat[:, [2, 0, 1]]
    corners = np.vstack([flat, upright, [[0, 0, 0]]])
    given = hk.moore_penrose(hk.pose(panda))
    carried, _ = shares(given, PANDA_START, [hk.polyline(point + size * corners) for size in SIZES[1:]])
    assert (carried[:-1] / carried[1:] > 1.8).all()


def turned_on_ppr(radius: float, phase: float, q3: float) -> float:
    """Drift of q3 [rad] over one counter-clockwise circle: psi' = k cos psi - 1, k = r/2, in closed form (theory 4)."""
    k = radius / 2
    a, w = np.sqrt((1 - k) / (1 + k)), np.sqrt(1 - k**2)
    C = np.arctan(-np.tan((q3 - phase) / 2) / a)  # tan(psi/2) = -a tan(w theta/2 + C)
    turned = w * np.pi + C
    folded = np.arctan2(a * np.sin(turned), np.cos(turned))
    after = -2 * (folded + 2 * np.pi * np.round((turned - folded) / (2 * np.pi)))
    return after + 2 * np.pi + 2 * np.arctan2(a * np.sin(C), np.cos(C))


def test_the_forecast_on_ppr_nears_the_planimeters_closed_form() -> None:
    """The worst of twelve starts round the circle falls with the second power of the radius."""
    given, errors = hk.moore_penrose(hk.position(hk.load("ppr"))), []
    for radius in (0.1, 0.05, 0.025):
        worst = 0.0
        for phase in np.arange(12) * np.pi / 6:
            point = PPR_CENTER + radius * np.array([np.cos(phase), np.sin(phase), 0])
            start = np.array([point[0] - np.cos(0.5), point[1] - np.sin(0.5), 0.5])
            told = curvature.predicted_drift(given, hk.circle(point, PPR_CENTER), start).drift[2]
            worst = max(worst, abs(told / turned_on_ppr(radius, phase, 0.5) - 1))
        errors.append(worst)
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)
