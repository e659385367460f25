"""What a verdict establishes: no law is accused by round-off, none acquitted beyond the postures that were judged."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import subspace_angles

import holokin as hk
from conftest import IRB_START, PANDA_START, PPR_START, campaign, fails, sampled
from drift_free import drift_free
from holokin.analysis import curvature
from holokin.analysis.curvature import Evidence
from holokin.analysis.curvature.curvature_of_planes import curvature_function, transport
from holokin.analysis.curvature.involutive import is_shown, measured, noise
from holokin.base.errors import ArgumentError, NotHolonomicError, SingularityError, UndecidedError
from holokin.robot import hessian_expression
from holokin.symbolic import Function, symbol
from papers_arm import de_luca_frame, paper_frame

R3_START = np.array([0.3, 0.9, 0.7])


def whole_range(robot: hk.Robot) -> curvature.Region:
    return curvature.box(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi))


def anywhere(robot: hk.Robot, count: int) -> np.ndarray:
    region = whole_range(robot)
    return np.random.default_rng(1).uniform(region.lower, region.upper, (count, robot.n))


def spoilt(strategy: hk.Strategy, rows) -> hk.Strategy:
    """The strategy with something added to the rows that hold its planes."""
    e = strategy.expressions
    base = ca.Function("base", [e.q], [e.planes])
    return hk.strategies.pfaffian(strategy.task, lambda q: base(q) + ca.horzcat(*rows(q)), name="spoilt")


# --- round-off is measured ---


@pytest.mark.campaign
@sampled(1, "start", [[0.3, 0.8, 0.5], [0.5, 0.5, 0.5]])
def test_a_twin_is_holonomic_over_the_whole_joint_range(planar_3r: hk.Robot, start: list[float]) -> None:
    """It goes through singularities on the way back to its centre; these amplify round-off without bound."""
    twin = hk.radial(hk.moore_penrose(hk.position(planar_3r)), start)
    region = whole_range(planar_3r)
    for seed in range(8):
        assert hk.involutivity(twin, region, samples=512, seed=seed).holonomic
    assert hk.involutivity(twin, region, samples=4096).holonomic


@sampled(1, "size", [1e-3, 1e-6, 1e-8])
def test_a_weak_defect_is_found_amid_that_round_off(planar_3r: hk.Robot, size: float) -> None:
    twin = hk.radial(hk.moore_penrose(hk.position(planar_3r)), R3_START)
    law = spoilt(twin, lambda q: (0, 0, size * ca.sin(q[0])))
    for seed in range(3):
        verdict = hk.involutivity(law, whole_range(planar_3r), seed=seed)
        assert not verdict.holonomic
    near = hk.involutivity(law, hk.around(R3_START, 0.1))
    assert 0.01 * size < near.relative < 10 * size


def test_measured_round_off_covers_the_error_against_the_closed_form_T7(planar_3r: hk.Robot) -> None:
    """[G_1, G_2] = -(n . curl n)/|n|^4 n of the planar 3R, from arms nearly stretched to arms well bent."""
    rng = np.random.default_rng(0)
    bend = 10 ** -rng.uniform(0, 5, (200, 1)) * rng.uniform(0.3, 1.0, (200, 2))
    Q = np.hstack([rng.uniform(-1, 1, (200, 1)), bend])
    s2, s3, s23 = np.sin(Q[:, 1]), np.sin(Q[:, 2]), np.sin(Q[:, 1] + Q[:, 2])
    c2, c3, c23 = np.cos(Q[:, 1]), np.cos(Q[:, 2]), np.cos(Q[:, 1] + Q[:, 2])
    n = np.stack([s3, -(s23 + s3), s2 + s23], axis=1)
    curl = s3 * c2 + 2 * s3 * c23 - s23 * c3
    exact = -(curl / (n**2).sum(axis=1) ** 2)[:, None] * n
    function = curvature_function(hk.moore_penrose(hk.position(planar_3r)))

    def field(points: np.ndarray) -> np.ndarray:
        return function.batch(points)[0].reshape(len(points), 3, 1)

    mean, scatter = measured(field, Q)
    error = np.linalg.norm(field(Q)[:, :, 0] - exact, axis=1)
    assert (error <= noise(scatter)[:, 0]).mean() > 0.98
    assert np.median(scatter[:, 0] / np.linalg.norm(exact, axis=1)) < 1e-3
    assert is_shown(np.linalg.norm(mean, axis=1), scatter).all()


def test_postures_where_round_off_hides_the_curvature_are_left_out_and_counted(iiwa14: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(iiwa14), hk.stationary(hk.strategies.constraints.centring_cost()))
    stretched = np.array([0.1, 0.6, 0.2, 0.0, 0.1, 0.6, 0.1])
    region = curvature.box(stretched - 1e-9, stretched + [1e-9, 1e-9, 1e-9, 0.02, 1e-9, 1e-9, 1e-9])
    verdict = hk.involutivity(strategy, region, samples=256)
    assert verdict.holonomic
    assert verdict.undecided > 0 and verdict.samples > 0
    assert verdict.samples + verdict.singular + verdict.undecided == 256
    assert f"{verdict.undecided} whose curvature round-off hides left out" in verdict.details


@pytest.mark.parametrize("scale", [1e-5, 1e5])
def test_the_scale_of_a_constraint_does_not_change_its_verdict(iiwa14: hk.Robot, scale: float) -> None:
    strategy = hk.holonomic(hk.pose(iiwa14), hk.linear([0, 0, scale, 0, 0, 0, 0]))
    verdict = hk.involutivity(strategy, hk.around([0.1, 0.6, 0.2, -1.4, 0.3, 1.1, 0.2], 0.1))
    assert verdict.holonomic and verdict.samples == 64


def test_the_scale_of_a_distributions_fields_does_not_change_its_verdict() -> None:
    for scale in (1e-9, 1.0, 1e9):
        flat = curvature.involutivity_of(lambda q, s=scale: [[s, 0], [0, 1], [s * ca.cos(q[0]), 0]], 3)
        contact = curvature.involutivity_of(lambda q, s=scale: [[s, 0], [0, 1], [s * q[1], 0]], 3)
        assert flat.holonomic and flat.samples == 64
        assert not contact.holonomic
        assert contact.relative == pytest.approx(
            curvature.involutivity_of(lambda q: [[1, 0], [0, 1], [q[1], 0]], 3).relative
        )


# --- filtration ---


some = pytest.mark.parametrize("share", [0.25, campaign("share", 1.0)])


@some
def test_filtration_never_calls_a_holonomic_law_nonholonomic(
    panda: hk.Robot, planar_3r: hk.Robot, iiwa14: hk.Robot, share: float
) -> None:
    laws = [
        (hk.holonomic(hk.pose(panda), hk.strategies.constraints.height("panda_joint4")), 30),
        (hk.holonomic(hk.pose(iiwa14), hk.stationary(hk.strategies.constraints.centring_cost())), 10),
        (hk.holonomic(hk.position(planar_3r), hk.stationary(hk.strategies.constraints.manipulability_cost())), 30),
        (hk.radial(hk.moore_penrose(hk.position(planar_3r)), R3_START), 80),
    ]
    for strategy, most in laws:
        looked, count = 0, round(share * most)
        for q in anywhere(strategy.task.robot, count):
            try:
                strategy(q)
            except SingularityError:  # a radial twin ends where its transport does
                continue
            assert curvature.filtration(strategy, q).integrability is curvature.Integrability.HOLONOMIC
            looked += 1
        assert looked > count / 3


@some
def test_filtration_never_calls_a_nonholonomic_law_holonomic(
    panda: hk.Robot, planar_3r: hk.Robot, irb140: hk.Robot, share: float
) -> None:
    """The weak one is the paper's coupling with a geometric Jacobian: curvature is the gain squared, 1e-4 (E3)."""
    weak = hk.strategies.coupled_twist(hk.position(irb140), 1e-2)
    laws = [(hk.moore_penrose(hk.pose(panda)), 15), (hk.moore_penrose(hk.position(planar_3r)), 60), (weak, 60)]
    for strategy, most in laws:
        for q in anywhere(strategy.task.robot, round(share * most)):
            assert curvature.filtration(strategy, q).integrability is curvature.Integrability.COMPLETELY


def test_filtration_is_not_deceived_by_a_posture_where_small_loops_do_not_drift(planar_3r: hk.Robot) -> None:
    pseudo_inverse = hk.moore_penrose(hk.position(planar_3r))
    for q, _ in drift_free(pseudo_inverse, R3_START):
        assert curvature.filtration(pseudo_inverse, q).integrability is curvature.Integrability.COMPLETELY


def test_filtration_says_when_round_off_hides_the_answer(iiwa14: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(iiwa14), hk.arm_angle())
    with pytest.raises(UndecidedError, match="farther from singularities") as caught:
        curvature.filtration(strategy, [0.1, 0.6, 0.2, 5e-6, 0.1, 0.6, 0.1])
    assert caught.value.noise > 1e-6


# --- what lies between the samples ---


@pytest.mark.campaign
def test_a_narrow_bump_of_curvature_is_missed_by_64_postures_and_found_by_thorough(panda: hk.Robot) -> None:
    """A lock of joint 3 that gives way to joint 1 in a place 0.02 wide; there a 2 cm circle drifts."""
    task, width = hk.pose(panda), 0.02
    place = PANDA_START + np.array([0.07, -0.11, 0.13, 0.05, -0.12, 0.09, -0.06])

    def rows(q: ca.SX) -> list[list]:
        return [[ca.exp(-ca.sumsqr(q - place) / width**2), 0, 1, 0, 0, 0, 0]]

    law = hk.strategies.pfaffian(task, rows, name="bump")
    region = hk.around(PANDA_START, 0.2)
    few = hk.involutivity(law, region)
    assert few.holonomic and few.samples == 64
    assert few.evidence is Evidence.SAMPLED and few.others == ("exp",)
    assert "nothing is known of the postures between" in few.details and "exp" in few.details
    found = hk.involutivity(law, region, thorough=True)
    assert not found.holonomic
    assert np.linalg.norm(found.witness - place) < 2 * width
    assert (np.abs(found.witness - PANDA_START) <= 0.2 + 1e-12).all()
    point = panda.pose(place)[:3, 3]
    assert hk.drift(law, hk.circle(point, point - [0.02, 0, 0]), place, samples=200).largest[0] > 1e-3


@pytest.mark.campaign
def test_thorough_leaves_a_holonomic_law_holonomic(panda: hk.Robot, planar_3r: hk.Robot) -> None:
    height = hk.holonomic(hk.pose(panda), hk.strategies.constraints.height("panda_joint4"))
    assert hk.involutivity(height, hk.around(PANDA_START, 0.3), thorough=5000).samples >= 5000
    twin = hk.radial(hk.moore_penrose(hk.position(planar_3r)), R3_START)
    assert hk.involutivity(twin, whole_range(planar_3r), thorough=4000).holonomic
    for count in (0, -1, 2.5):
        with pytest.raises(ArgumentError, match="thorough"):
            hk.involutivity(height, hk.around(PANDA_START, 0.3), thorough=count)  # type: ignore[arg-type]


def test_a_verdict_says_on_which_grounds_it_reaches_beyond_its_postures(ppr: hk.Robot) -> None:
    task, region = hk.position(ppr), hk.around(PPR_START, 0.2)

    def judged(entry) -> curvature.Verdict:
        return hk.involutivity(hk.strategies.pfaffian(task, lambda q: [[0, 0, entry(q[2])]]), region)

    assert hk.involutivity(hk.holonomic(task, hk.lock(2)), region).evidence is Evidence.CONSTRAINT
    for plain in (lambda z: 2 + ca.sin(z) ** 3, lambda z: (2 + ca.cos(z)) / (3 + ca.sin(z))):
        assert judged(plain).evidence is Evidence.TRIGONOMETRIC
    named = {
        "exp": ca.exp,
        "sqrt": lambda z: ca.sqrt(2 + ca.cos(z)),
        "atan2": lambda z: 2 + ca.atan2(z, 2),
        "tanh": lambda z: 2 + ca.tanh(z),
        "if_else": lambda z: ca.if_else(z > 0.7, 1, 2),
        "fabs": lambda z: 1 + ca.fabs(z),
        "pow": lambda z: (2 + z) ** z,
        "fmax": lambda z: ca.fmax(z, 0.7),
    }
    for name, entry in named.items():
        verdict = judged(entry)
        assert verdict.holonomic and verdict.evidence is Evidence.SAMPLED
        assert verdict.others == (name,)
    bare = curvature.involutivity_of(lambda q: [[1, 0], [0, ca.exp(q[1])], [0, 0]], 3)
    assert bare.others == ("exp",) and "exp" in bare.details


def test_a_holonomic_law_may_end_elsewhere_after_a_round_of_a_place_where_it_is_not_defined(ppr: hk.Robot) -> None:
    """dq3 = d(atan2(y, x)) / 2 has no curvature; a round of the origin turns q3 by pi, one beside it does not."""
    task = hk.position(ppr)

    def rows(q: ca.SX) -> list[list]:
        x, y = q[0] + ca.cos(q[2]), q[1] + ca.sin(q[2])
        a, b = -y / (2 * (x**2 + y**2)), x / (2 * (x**2 + y**2))
        return [[-a, -b, 1 + a * ca.sin(q[2]) - b * ca.cos(q[2])]]

    law = hk.strategies.pfaffian(task, rows, name="half turn")
    verdict = hk.involutivity(law, hk.around(PPR_START, 0.5))
    assert verdict.holonomic
    point = ppr.pose(PPR_START)[:3, 3]
    around_it = hk.drift(law, hk.circle(point, [0, 0, 0]), PPR_START, samples=400, limits=False)
    assert abs(around_it.since_start[0][2]) == pytest.approx(np.pi, abs=1e-6)
    beside = hk.drift(law, hk.circle(point, point + [0.4, 0, 0]), PPR_START, samples=400, limits=False)
    assert beside.largest[0] < 1e-8
    assert "small closed paths" in verdict.sentence and "long closed path" in verdict.details


# --- leaves ---


@pytest.mark.parametrize("size", [1e-3, 1e-6, 1e-8])
def test_what_has_curvature_has_no_leaf_function_however_weak(ppr: hk.Robot, size: float) -> None:
    """The two paths back end 1e-2 * size apart, which is too little to be seen there."""
    law = hk.strategies.pfaffian(hk.position(ppr), lambda q: [[size * q[1], 0, 1]])
    assert not hk.involutivity(law, hk.around(PPR_START, 0.1)).holonomic
    fails(NotHolonomicError, "", lambda: curvature.leaf_function(law, PPR_START))
    fails(NotHolonomicError, "", lambda: curvature.general_form(law, PPR_START))


def test_a_small_radius_does_not_make_leaves(irb140: hk.Robot) -> None:
    law = hk.strategies.coupled_twist(hk.position(irb140), 0.1)
    with pytest.raises(NotHolonomicError) as caught:
        curvature.leaf_function(law, IRB_START, radius=1e-4)
    assert caught.value.gap is None and caught.value.curvature > 1e-9


def test_the_general_form_is_refused_where_curvature_lies_on_the_way_to_the_reference(ppr: hk.Robot) -> None:
    """Flat near the reference, curved where the posture is."""
    place = PPR_START + np.array([0.6, 0.5, 0.1])
    law = hk.strategies.pfaffian(hk.position(ppr), lambda q: [[ca.exp(-ca.sumsqr(q - place) / 0.05**2), 0, 1]])
    curvature.leaf_function(law, PPR_START)
    with pytest.raises(NotHolonomicError):
        curvature.general_form(law, place + np.array([0.0, 0.02, 0.0]), PPR_START)
    form = curvature.general_form(law, PPR_START + 0.05, PPR_START)
    assert form.residuals()["(10)"] < 1e-9


# --- Questions about strategies, against closed forms and against what loops really do: T7, theory 2a, 2c, 5.5.


@pytest.fixture(scope="module")
def r3(planar_3r: hk.Robot) -> hk.Strategy:
    return hk.moore_penrose(hk.position(planar_3r))


@pytest.fixture(scope="module")
def panda_given(panda: hk.Robot) -> hk.Strategy:
    return hk.moore_penrose(hk.pose(panda))


# --- curvature from Hessians ---


def hessian(robot: hk.Robot, q: np.ndarray) -> np.ndarray:
    s = symbol("q", robot.n)
    rows = Function("hessian", {"q": s}, {f"row{i}": H for i, H in enumerate(hessian_expression(robot, s))})(q)
    return np.stack([np.reshape(H, (robot.n, robot.n)) for H in rows])


@pytest.mark.parametrize("name", ["ppr", "planar-3r", "irb140", "panda", "iiwa14"])
def test_hessians_meet_finite_differences(name: str) -> None:
    robot, h = hk.load(name), 1e-6
    for q in np.random.default_rng(0).uniform(-1, 1, (3, robot.n)):
        slopes = [(robot.jacobian(q + e) - robot.jacobian(q - e)) / (2 * h) for e in np.eye(robot.n) * h]
        assert np.abs(hessian(robot, q) - np.stack(slopes, axis=2)).max() < 1e-8


GRIPPING = """<robot name="gripping"><link name="root"/><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
  <joint name="turn" type="revolute"><parent link="root"/><child link="a"/><origin xyz="0 0.1 0.3" rpy="0.2 0 1"/>
    <axis xyz="0 1 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0" rpy="0 0.4 0"/>
    <axis xyz="1 0 2"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="half" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0.3 0 0.1"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/>
    <mimic joint="turn" multiplier="-0.5" offset="0.2"/></joint>
  <joint name="other" type="revolute"><parent link="c"/><child link="d"/><origin xyz="0 0.2 0.4"/>
    <axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""


def test_hessians_of_mimic_joints_and_sliders_meet_finite_differences(tmp_path) -> None:
    """A revolute joint that follows another by -1/2, behind a slider: three joints of which one moves two axes."""
    file = tmp_path / "gripping.urdf"
    file.write_text(GRIPPING)
    robot = hk.from_urdf(file, tip="d")
    assert robot.joint_names == ("turn", "slide", "other")
    q, h = np.array([0.3, 0.2, -0.6]), 1e-6
    assert np.abs(robot.jacobian(q)[3:, 0]).max() > 0.1
    slopes = [(robot.jacobian(q + e) - robot.jacobian(q - e)) / (2 * h) for e in np.eye(robot.n) * h]
    assert np.abs(hessian(robot, q) - np.stack(slopes, axis=2)).max() < 1e-8


def test_curvature_from_hessians_is_that_of_automatic_differentiation(panda: hk.Robot, irb140: hk.Robot) -> None:
    W = np.diag([1.0, 2.0, 0.5, 1.0, 3.0, 1.0, 0.2]) + 0.1
    cases = [
        (hk.moore_penrose(hk.pose(panda)), PANDA_START),
        (hk.weighted(hk.pose(panda), np.linalg.inv(W)), PANDA_START),
        (hk.moore_penrose(hk.position(panda)), PANDA_START),
        (hk.moore_penrose(hk.position(irb140, rows=[0, 2])), IRB_START),
    ]
    for strategy, start in cases:
        for q in start + np.random.default_rng(1).uniform(-0.3, 0.3, (3, len(start))):
            a, b = (hk.curvature(strategy, q, method=method) for method in ("hessian", "ad"))
            assert np.abs(a - b).max() < 1e-12 * max(1, np.abs(b).max())
    with pytest.raises(ArgumentError, match="needs a constant weight"):
        hk.curvature(hk.moore_penrose(hk.pose(panda, "rpy")), PANDA_START, method="hessian")
    fails(ArgumentError, "auto", lambda: hk.curvature(cases[0][0], PANDA_START, method="guess"))


def test_the_brackets_of_the_planar_3r_have_their_closed_form_T7(r3: hk.Strategy) -> None:
    """[G_1, G_2] = -(n . curl n)/|n|^4 n with unit links."""
    for q in R3_START + np.random.default_rng(2).uniform(-0.5, 0.5, (10, 3)):
        s2, s3, s23 = np.sin(q[1]), np.sin(q[2]), np.sin(q[1] + q[2])
        c2, c3, c23 = np.cos(q[1]), np.cos(q[2]), np.cos(q[1] + q[2])
        n = np.array([s3, -(s23 + s3), s2 + s23])
        curl = s3 * c2 + 2 * s3 * c23 - s23 * c3
        assert np.abs(hk.curvature(r3, q)[:, 0, 1] + curl / (n @ n) ** 2 * n).max() < 1e-12


# --- drift of small loops ---


def test_the_area_law_holds_to_the_square_of_the_radius_T7(r3: hk.Strategy, planar_3r: hk.Robot) -> None:
    """Averaged over where the loop begins: 1 - measured/predicted falls by four as the radius is halved."""
    center = planar_3r.pose(R3_START)[:3, 3]
    F = hk.curvature(r3, R3_START)[:, 0, 1]
    short = []
    for radius in (0.1, 0.05):
        ratios = []
        for phase in np.arange(8) * np.pi / 4:
            rim = transport(r3, R3_START, radius * np.array([np.cos(phase), np.sin(phase)]))
            loop = hk.circle(planar_3r.pose(rim)[:3, 3], center)
            drift = hk.drift(r3, loop, rim, samples=150).since_start[0]
            ratios.append(drift @ F / (np.pi * radius**2 * F @ F))
        short.append(1 - np.mean(ratios))
    assert 1e-4 < short[0] < 2e-2
    assert short[0] / short[1] == pytest.approx(4, rel=0.1)


def test_loops_drift_towards_the_posture_that_attracts_their_direction(r3: hk.Strategy, planar_3r: hk.Robot) -> None:
    """Klein and Kee's stable posture; clockwise and counter-clockwise loops have different ones."""
    free = drift_free(r3, R3_START)
    assert {slope < 0 for _, slope in free} == {True, False}
    target = planar_3r.pose(R3_START)
    center = target[:3, 3]
    for q, slope in free:
        assert np.abs(planar_3r.pose(q)[:3, 3] - center).max() < 1e-12
        assert np.abs(hk.curvature(r3, q)).max() < 1e-10
        v = np.array([0.25, 0.0])
        curve = hk.strategies.self_motion_curve(r3.task, q, step=0.05, length=0.2)
        for beside in (curve.q[0], curve.q[-1]):
            rim = transport(r3, beside, v)
            loop = hk.circle(planar_3r.pose(rim)[:3, 3], center, clockwise=slope > 0)
            walk = hk.drift(r3, loop, rim, cycles=12, samples=40, limits=False).trajectory
            middles = [transport(r3, walk.q[k], -v) for k in walk.marks[::12]]
            near, far = (np.linalg.norm(middle - q) for middle in (middles[-1], middles[0]))
            assert near < 0.98 * far


def test_a_self_motion_holds_the_tool_and_is_closed_or_says_why_not(r3: hk.Strategy, panda: hk.Robot) -> None:
    curve = hk.strategies.self_motion_curve(r3.task, R3_START)
    assert curve.closed
    assert max(np.abs(r3.task(q) - r3.task(R3_START)).max() for q in curve.q) < 1e-12
    assert np.diff(curve.s) == pytest.approx(0.02, rel=0.1)
    arm = hk.strategies.self_motion_curve(hk.pose(panda), PANDA_START)
    assert arm.endings == ("limit", "limit")
    assert max(np.abs(panda.pose(q) - panda.pose(PANDA_START)).max() for q in arm.q) < 1e-12
    assert hk.strategies.self_motion_curve(hk.pose(panda), PANDA_START, length=0.3).endings == ("length", "length")
    fails(ArgumentError, "redundant", lambda: hk.strategies.self_motion_curve(hk.position(panda), PANDA_START))


# --- leaves from nothing but G ---


def test_leaf_functions_of_the_papers_strategies_have_their_closed_forms(ppr: hk.Robot) -> None:
    """(20): tan(g'/2) = tan(q3/2) e^(x - x0); (23): g' = q3 - (x + y) + (x0 + y0), g' the angle at the reference."""
    task = hk.position(ppr)
    x0 = task(PPR_START)
    forms = {
        paper_frame: lambda q, x: 2 * np.arctan(np.tan(q[2] / 2) * np.exp(x[0] - x0[0])),
        de_luca_frame: lambda q, x: q[2] - x.sum() + x0.sum(),
    }
    for frame, angle in forms.items():
        g = curvature.leaf_function(hk.null_basis(task, frame), PPR_START)
        Z = task.null_space(PPR_START)[:, 0] / np.linalg.norm(task.null_space(PPR_START))
        for q in PPR_START + np.random.default_rng(4).uniform(-0.3, 0.3, (5, 3)):
            back = angle(q, task(q))
            posture = np.array([x0[0] - np.cos(back), x0[1] - np.sin(back), back])
            assert abs(g(q)[0]) == pytest.approx(abs(Z @ (posture - PPR_START)), abs=1e-8)


def test_a_leaf_functions_gradient_annuls_G_and_meets_finite_differences(panda: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(panda), hk.arm_angle())
    g = curvature.leaf_function(strategy, PANDA_START)
    q, h = PANDA_START + np.array([0.05, -0.04, 0.03, 0.06, -0.02, 0.05, -0.03]), 1e-5
    gradient = g.gradient(q)
    slopes = [(g(q + e) - g(q - e)) / (2 * h) for e in np.eye(7) * h]
    assert np.abs(gradient - np.array(slopes).T).max() < 1e-8
    assert np.abs(gradient @ strategy(q)).max() < 1e-7
    assert abs(np.linalg.det(np.vstack([panda.jacobian(q), gradient]))) > 1e-3
    angle = strategy.rows(q)[0]  # both are functions with the same leaves: parallel gradients
    cosine = gradient[0] @ angle / np.linalg.norm(gradient) / np.linalg.norm(angle)
    assert abs(cosine) == pytest.approx(1, abs=1e-7)


def test_what_has_no_leaves_is_told_with_a_witness(panda_given: hk.Strategy, r3: hk.Strategy) -> None:
    for strategy, start in ((panda_given, PANDA_START), (r3, R3_START)):
        with pytest.raises(NotHolonomicError, match="two paths") as caught:
            curvature.leaf_function(strategy, start)
        assert caught.value.gap > 1e-5
        assert len(caught.value.witness) == len(start)


def test_the_filtration_tells_holonomic_partly_and_completely_nonholonomic(
    ppr: hk.Robot, panda_given: hk.Strategy
) -> None:
    task = hk.position(ppr)
    assert curvature.filtration(hk.moore_penrose(task), PPR_START).integrability is curvature.Integrability.COMPLETELY
    assert curvature.filtration(hk.null_basis(task, paper_frame), PPR_START).dimensions == (2,)
    assert curvature.filtration(panda_given, PANDA_START).dimensions == (6, 7)
    locked = hk.holonomic(panda_given.task, hk.lock(2))
    assert curvature.filtration(locked, PANDA_START).integrability is curvature.Integrability.HOLONOMIC
    four = hk.position(hk.from_dh([{"a": 1.0}] * 4))
    # joint 4 held, joints 1 to 3 by a form that is not integrable: loops move q inside q4 = const only
    partly = hk.strategies.pfaffian(four, lambda q: [[ca.sin(q[1]), 1, q[0], 0], [0, 0, 0, 1]])
    found = curvature.filtration(partly, [0.3, 0.7, 0.5, 0.4])
    assert found.dimensions == (2, 3)
    assert found.integrability is curvature.Integrability.PARTLY
    assert "partly" in str(found)


# --- the general form ---


@sampled(2, "case", ["paper", "coupled", "arm angle", "radial"])
def test_theorem_III_2_gives_the_general_form_of_any_holonomic_strategy(
    ppr: hk.Robot, irb140: hk.Robot, panda: hk.Robot, panda_given: hk.Strategy, case: str
) -> None:
    strategy, q, reference = {
        "paper": lambda: (hk.null_basis(hk.position(ppr), paper_frame), PPR_START, PPR_START + 0.1),
        "coupled": lambda: (hk.holonomic(hk.position(irb140), hk.coupled(1.0)), IRB_START, None),
        "arm angle": lambda: (hk.holonomic(hk.pose(panda), hk.arm_angle()), PANDA_START, None),
        "radial": lambda: (hk.radial(panda_given, PANDA_START), PANDA_START + 0.03, None),
    }[case]()
    form = curvature.general_form(strategy, q, reference)
    residuals = form.residuals()
    assert max(residuals[key] for key in ("(7)", "(8)", "(10)", "(13)", "(14)")) < 1e-9
    assert min(residuals[key] for key in ("(9)", "(11)", "(12)", "H")) > 1e-3
    assert residuals["(12)"] == pytest.approx(np.sin(subspace_angles(form.N, form.N_G).min()), rel=1e-9)
    assert form.H.shape == (strategy.task.n, strategy.task.n)


def test_theorem_III_2_is_refused_to_a_strategy_that_has_none(r3: hk.Strategy) -> None:
    fails(NotHolonomicError, "", lambda: curvature.general_form(r3, R3_START, R3_START))


def test_twelve_is_the_angle_between_the_kernels_and_not_the_size_of_H(planar_3r: hk.Robot) -> None:
    """Near an algorithmic singularity of q1 = const both fade; where links are long H grows, and the angle does not."""
    near, far = (
        curvature.general_form(hk.holonomic(hk.position(planar_3r), hk.lock("q1")), [0.4, 0.9, q3]).residuals()
        for q3 in (1e-4, 1.2)
    )
    assert near["(12)"] < 1e-3 < 0.1 < far["(12)"]
    long = hk.from_dh([{"a": 10.0}] * 3)
    grown = curvature.general_form(hk.holonomic(hk.position(long), hk.lock("q1")), [0.4, 0.9, 1.2]).residuals()
    assert grown["(12)"] == pytest.approx(far["(12)"], rel=1e-9)
    assert grown["H"] != pytest.approx(far["H"], rel=1e-2)
