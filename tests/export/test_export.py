"""C for a controller: the numbers of Python, in two precisions, on every posture; a status for what is wrong."""

from __future__ import annotations

import ctypes
import errno
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from benchmarks.kills import deadly, hidden

import holokin as hk
from chains import chain, shared_bend
from conftest import PANDA_START, PPR_START, Command, assert_refused, assert_untouched, sampled
from exported import LEAF, ON_ANYTHING, SANITIZE, STRICT, program, rates
from holokin.app.job import job_strategy, open_job, packaged_jobs
from holokin.base.errors import ArgumentError, ExportError, SingularityError, WriteError
from holokin.export import Exported, Program, c_name, check, export_c
from holokin.export.c.c_folder import WARNINGS
from holokin.symbolic.native import compiler

GOLDEN = Path(__file__).parents[1] / "golden"
compiled = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")


def sew() -> hk.Strategy:
    return hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle())


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    """The Panda with its arm angle held."""
    return export_c(sew(), tmp_path_factory.mktemp("panda"), q0=PANDA_START, name="panda_sew", vectors_count=4)


def every_packaged_strategy() -> list[tuple[str, str]]:
    """Each once: jobs share some."""
    jobs = [name for name in packaged_jobs() if name not in ("ppr-half-circle", "orientation")]
    return [(name, label) for name in jobs for label in open_job(name)[1].strategies] + [("orientation", "one-H")]


# --- the same numbers ---


@pytest.mark.campaign
@compiled
@pytest.mark.parametrize(("job", "label"), every_packaged_strategy())
def test_every_packaged_strategy_passes_its_self_test(
    job: str, label: str, holokin: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a warning, in both precisions; short code as users build it, optimized."""
    if label == "moore-penrose" or job.startswith("ppr"):
        monkeypatch.delenv("CFLAGS")
    folder = tmp_path / "c"
    outcome = holokin("export", "c", job, "--strategy", label, "--out", folder, "--check")
    assert outcome.code == 0
    assert outcome.out.count("passed") == 2
    assert {f.name for f in folder.iterdir()} >= {"CMakeLists.txt", "README.md"}
    assert "$name" not in "".join((folder / name).read_text() for name in ("README.md", "CMakeLists.txt"))


@pytest.mark.campaign
@compiled
def test_the_self_test_notices_a_wrong_digit(tmp_path: Path) -> None:
    _, job, file = open_job("ppr-cycle")
    _, strategy, start = job_strategy(job, file, "de-luca-oriolo")
    made = export_c(strategy, tmp_path, q0=start, name="ppr")
    assert len(check(made)) == 2
    code = (tmp_path / "ppr.c").read_text()
    before, name, after = code.partition("static void hk_gain_body")
    assert "y[0] = " in after
    (tmp_path / "ppr.c").write_text(before + name + after.replace("y[0] = ", "y[0] = HK_C(1e-11) + ", 1))
    with pytest.raises(ExportError, match="self-test in double failed"):
        check(made)


@pytest.mark.campaign
@compiled
@sampled(1, "orientation", ["zyz", "rotation-vector"])
def test_arguments_that_are_not_needed_must_be_finite_too(orientation: str, holokin: Command, tmp_path: Path) -> None:
    """ZYZ angles read five of the nine numbers of a rotation; the self-test spoils each argument in turn."""
    arguments = ("orientation", "--strategy", "one-H", "--orientation", orientation, "--out", tmp_path, "--check")
    assert holokin("export", "c", *arguments).code == 0


@compiled
def test_the_self_test_notices_what_is_not_a_number(tmp_path: Path) -> None:
    law = hk.moore_penrose(hk.position(hk.load("ppr")))
    made = export_c(law, tmp_path, q0=PPR_START, name="law", vectors_count=3)
    code = (tmp_path / "law.c").read_text()
    (tmp_path / "law.c").write_text(
        code.replace("out[i] = sound ? y[i] :", "out[i] = i == 0 ? HK_NAN : sound ? y[i] :")
    )
    with pytest.raises(ExportError, match="self-test in double failed"):
        check(made)


@compiled
def test_the_self_test_of_a_start_next_to_joint_limits_passes(tmp_path: Path) -> None:
    """Poses of its vectors have postures beyond a limit, too: there the C says LIMIT, so none of them is a vector."""
    robot = hk.load("planar-3r")
    law = hk.holonomic(hk.position(robot), hk.linear([[0.3, 0, 1]]))
    made = export_c(law, tmp_path, q0=robot.upper - 0.02, name="law", vectors_count=4)
    assert len(check(made)) == 2


@pytest.mark.campaign
@compiled
@sampled(1, "n", [7, 12])
def test_what_single_precision_finds_hard_is_tested_still(n: int, tmp_path: Path) -> None:
    """A badly scaled constraint, and twelve joints, whose det [J; J_g] is no number in single precision."""
    if n == 7:
        strategy, start = hk.holonomic(hk.pose(hk.load("panda")), hk.linear([50, 0, 50, 0, 0, 0, 0])), PANDA_START
    else:
        rows = 1e-5 * np.random.default_rng(0).normal(size=(n - 2, n))
        start = np.random.default_rng(1).uniform(-0.5, 0.5, n)
        strategy = hk.holonomic(hk.position(chain(n)), hk.linear(rows))
        assert np.float32(np.linalg.det(np.vstack([strategy.task.jacobian(start), rows]))) == 0
    double, single = check(export_c(strategy, tmp_path, q0=start, name="law", vectors_count=16))
    assert "16 test cases" in double
    assert " 0 test cases" not in single


@pytest.mark.campaign
@compiled
def test_250000_postures_agree(written: Exported, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Over the Panda's whole range: double to 1e-12; float to 1e-4 where it says OK, to 1e-2 where IMPRECISE.

    Optimized, and without a warning.
    """
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    strategy, count = sew(), 250_000
    robot = strategy.task.robot
    rng = np.random.default_rng(6)
    Q = rng.uniform(robot.lower, robot.upper, (count, 7)).astype(np.float32).astype(float)
    X = rng.uniform(-0.2, 0.2, (count, 6)).astype(np.float32).astype(float)
    expected, rcond, margin = strategy.rate.batch(Q, X)
    sound = (rcond > 1e-10) & (margin > 1e-6)
    size = np.maximum(1.0, np.abs(expected).max(axis=1))
    for flags, share, most in (((), 0.999, {0: 1e-12}), (("-DPANDA_SEW_FLOAT",), 0.68, {0: 1e-4, -1: 1e-2})):
        dq, status = rates(written, tmp_path, Q, X, *STRICT, *flags)
        error = np.abs(dq - expected).max(axis=1) / size
        assert (status == 0).mean() > share
        for value, bound in most.items():
            assert error[status == value].max() < bound
        assert not dq[status == 3].any()
        assert set(np.unique(status)) <= {-1, 0, 3}
        if not flags:
            assert np.array_equal(status == 0, sound)


@pytest.mark.campaign
@compiled
@pytest.mark.parametrize(
    ("kind", "flags"),
    [("arm", ()), ("held joint", ("-DLAW_FLOAT",)), ("position", ()), ("no leaf", ()), ("dense", ("-DLAW_FLOAT",))],
)
def test_sanitizers_find_nothing_whatever_comes(kind: str, flags: tuple[str, ...], tmp_path: Path) -> None:
    """Addresses and undefined behaviour, on 3,000 calls of everything, with bad input among them.

    Ten joints are the fewest of which [J; J_g] is solved in loops.
    """
    irb, pose = hk.load("irb140"), hk.pose(hk.load("panda"))
    cases = {
        "arm": (lambda: sew(), PANDA_START),
        "held joint": (lambda: hk.holonomic(pose, hk.lock(2)), PANDA_START),
        "position": (
            lambda: hk.holonomic(hk.position(irb), hk.lock(3, 4, 5)),
            np.deg2rad([10.0, 70.0, 10.0, 20.0, 50.0, 30.0]),
        ),
        "no leaf": (lambda: hk.moore_penrose(pose), PANDA_START),
        "dense": (lambda: hk.holonomic(hk.position(chain(10)), shared_bend(10)), np.full(10, 0.2)),
    }
    make, start = cases[kind]
    made = export_c(make(), tmp_path, q0=start, name="law", vectors_count=2)
    assert ("hk_solve(" in (tmp_path / "law.c").read_text()) == (kind == "dense")
    leaf = "" if kind == "no leaf" else LEAF
    run = subprocess.run(
        [str(program(made, ON_ANYTHING, tmp_path, *STRICT, *SANITIZE, *flags, "-DCALLS=3000", leaf=leaf))],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr
    counts = dict(zip(range(-1, 9), map(int, run.stdout.split()), strict=True))
    assert counts[0] + counts[1] + counts[-1] > 500
    assert counts[4] > 200
    assert counts[8] > 50
    assert (counts[7] > 150) is (kind in ("arm", "held joint", "no leaf"))  # matrices, whose last row is not 0 0 0 1


def test_the_text_is_the_golden_one(tmp_path: Path) -> None:
    """Rewritten on request only: HOLOKIN_GOLDEN=write pytest tests/export/test_export.py"""
    _, job, file = open_job("ppr-cycle")
    _, strategy, start = job_strategy(job, file, "de-luca-oriolo")
    made = export_c(strategy, tmp_path, q0=start, name="ppr", vectors_count=2, origin="a test")
    if os.environ.get("HOLOKIN_GOLDEN") == "write":
        GOLDEN.mkdir(exist_ok=True)
        for name in made.files:
            shutil.copy(tmp_path / name, GOLDEN / name)
    assert sorted(made.files) == sorted(f.name for f in GOLDEN.iterdir() if not f.name.startswith("lerobot"))
    for name in made.files:
        ours, golden = (folder / name for folder in (tmp_path, GOLDEN))
        if name == "ppr_vectors.h":  # its digits are the machine's mathematical library's
            assert ours.read_text().count("\n") == golden.read_text().count("\n")
        else:
            assert unstamped(ours.read_text()) == unstamped(golden.read_text()).replace("0.1.0", hk.__version__), name


def unstamped(text: str) -> str:
    """Without the number of the whole export, which depends on the machine's digits, too."""
    return re.sub(r"0x[0-9a-f]{16}U", "0x0U", text)


# --- in a controller ---


@pytest.fixture(scope="module")
def c_code(written: Exported, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The export as a library of Python; optimized it takes a compiler four times as long."""
    made, source = tmp_path_factory.mktemp("library") / "panda_sew.so", written.folder / "panda_sew.c"
    command = ["cc", *STRICT, "-O0", "-shared", "-fPIC", str(source), "-o", str(made), "-lm"]
    subprocess.run(command, check=True, timeout=300)
    return ctypes.CDLL(str(made))


def at(*arrays: np.ndarray) -> list[ctypes.c_void_p]:
    return [ctypes.c_void_p(a.ctypes.data) for a in arrays]


@pytest.mark.campaign
@compiled
def test_its_inverse_kinematics_comes_home_from_a_loop(c_code: ctypes.CDLL) -> None:
    strategy = sew()
    robot = strategy.task.robot
    q, leaf = PANDA_START.copy(), np.atleast_1d(strategy.constraint_value(PANDA_START))
    target, far = robot.pose(q), 0.0
    for angle in np.linspace(0, 2 * np.pi, 101)[1:]:
        target[:3, 3] = robot.pose(PANDA_START)[:3, 3] + 0.1 * np.array([np.cos(angle) - 1, np.sin(angle), 0])
        assert c_code.panda_sew_inverse(*at(q, target, leaf), 12) == 0
        assert robot.pose(q) == pytest.approx(target, abs=1e-12)
        far = max(far, float(np.abs(q - PANDA_START).max()))
    assert far > 0.1
    assert q == pytest.approx(PANDA_START, abs=1e-12)
    before = q.copy()
    target[0, 3] += 1.0
    assert c_code.panda_sew_inverse(*at(q, target, leaf), 12) == 5
    assert np.array_equal(q, before)
    end = strategy.task.robot.upper[6] - 0.01
    q[6], turn = end, np.eye(4)
    turn[:2, :2] = [[np.cos(0.05), -np.sin(0.05)], [np.sin(0.05), np.cos(0.05)]]
    target = robot.pose(q) @ turn  # about the last joint's axis
    assert c_code.panda_sew_inverse(*at(q, target, leaf), 12) == 2
    assert robot.pose(q) == pytest.approx(target, abs=1e-12)
    assert q[6] == pytest.approx(end + 0.05)


@compiled
def test_its_step_is_the_controllers(c_code: ctypes.CDLL, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its own defaults, slowed and at a limit; and the start it knows is the job's."""
    strategy = sew()
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    servo = hk.controller(strategy, dt=1e-3, q0=PANDA_START)
    parameters, q, dq, scale = np.zeros(7), np.zeros(7), np.zeros(7), np.zeros(1)
    c_code.panda_sew_defaults(*at(parameters))
    c_code.panda_sew_start(*at(q))
    assert np.array_equal(q, PANDA_START)
    assert parameters == pytest.approx([strategy.constraint_value(PANDA_START), 0.0, 1e-3, 100.0, 100.0, 0.1, 1e-3])
    edge = PANDA_START.copy()
    edge[3] = strategy.task.robot.upper[3]
    seen = set()
    for posture in (q, q + 0.01, edge):
        for v in (np.zeros(6), np.array([0.1, 0, 0.05, 0, 0.1, 0]), np.array([3.0, 0, 0, 0, 0, 0])):
            pose = strategy.task.robot.pose(q)
            status = c_code.panda_sew_step(*at(posture, pose, v, parameters, dq, scale))
            assert np.array_equal(dq, servo.step(posture, pose, v))
            assert (status, scale[0]) == (servo.status, servo.scale)
            seen.add(status)
    assert seen >= {0, 1}
    pose, still = strategy.task.robot.pose(q), np.zeros(6)
    for lost in ([1.0, 0, 0], 1e3 * pose[:3, 3]):  # a metre away, and in millimetres
        far = pose.copy()
        far[:3, 3] += lost
        status = c_code.panda_sew_step(*at(q, far, still, parameters, dq, scale))
        assert not servo.step(q, far, still).any() and not dq.any()
        assert status == servo.status == hk.motion.StepStatus.LOST
    for level, rate in ((parameters[0] + 1e-3, 0.0), (parameters[0], 0.2), (parameters[0] - 1e-3, -0.1)):
        moving = np.concatenate([[level, rate], parameters[2:]])
        status = c_code.panda_sew_step(*at(q, pose, still, moving, dq, scale))
        assert status == 0 and dq.any()
        assert np.array_equal(dq, servo.step(q, pose, still, level=level, level_rate=rate))
    for k, bad in ((2, 0.0), (2, -1e-3), (2, np.nan), (3, -1.0), (3, 2100.0), (4, np.inf), (5, 0.0), (6, 1.0)):
        odd = parameters.copy()
        odd[k] = bad
        assert c_code.panda_sew_step(*at(q, strategy.task.robot.pose(q), np.ones(6), odd, dq, scale)) == 6
        assert not dq.any()


@pytest.mark.campaign
@compiled
def test_two_exports_live_in_one_program(written: Exported, tmp_path: Path) -> None:
    other = export_c(hk.moore_penrose(hk.pose(hk.load("panda"))), tmp_path, q0=PANDA_START, name="other")
    code = tmp_path / "both.c"
    code.write_text('#include "panda_sew.h"\n#include "other.h"\nint main(void) { return PANDA_SEW_OK + OTHER_OK; }\n')
    sources = [code, tmp_path / "other.c", written.folder / "panda_sew.c"]
    command = ["cc", *STRICT, f"-I{tmp_path}", f"-I{written.folder}", *map(str, sources), "-o", str(tmp_path / "a")]
    subprocess.run([*command, "-lm"], check=True, timeout=300)
    subprocess.run([str(tmp_path / "a")], check=True, timeout=60)
    symbols = subprocess.run(["nm", str(tmp_path / "a")], capture_output=True, text=True, check=True, timeout=60).stdout
    assert " B hk_" not in symbols and " D hk_" not in symbols and " b hk_" not in symbols and " d hk_" not in symbols
    assert other.name == "other"


@pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="no arm-none-eabi-gcc here")
@pytest.mark.parametrize(
    "flags", [("-mcpu=cortex-m4",), ("-mcpu=cortex-m7", "-DPANDA_SEW_FLOAT")], ids=["m4", "m7 float"]
)
def test_it_compiles_for_a_microcontroller(written: Exported, flags: tuple[str, ...], tmp_path: Path) -> None:
    target = tmp_path / "arm.o"
    source = str(written.folder / "panda_sew.c")
    command = ["arm-none-eabi-gcc", "-mthumb", "-O1", *flags, *STRICT, "-c", source, "-o", str(target)]
    subprocess.run(command, check=True, timeout=300)
    sizes = subprocess.run(["arm-none-eabi-size", str(target)], capture_output=True, text=True, check=True, timeout=60)
    _, data, bss = map(int, sizes.stdout.splitlines()[1].split()[:3])
    assert data == bss == 0


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake here")
def test_cmake_builds_and_tests_it(tmp_path: Path) -> None:
    made = export_c(hk.holonomic(hk.position(hk.load("ppr")), hk.lock(2)), tmp_path / "c", q0=PPR_START)
    build = str(tmp_path / "build")
    for command in (["cmake", "-S", str(made.folder), "-B", build], ["cmake", "--build", build]):
        subprocess.run(command, check=True, capture_output=True, timeout=300)
    subprocess.run(["ctest", "--test-dir", build], check=True, capture_output=True, timeout=300)


@compiled
def test_the_documented_loop_comes_home(tmp_path: Path, holokin: Command) -> None:
    """The C of docs/programs.md, as it stands there, and what it prints, optimized or, as here, not."""
    page = (Path(__file__).parents[2] / "docs" / "programs.md").read_text("utf-8")
    code, printed = re.search(r"```c\n(.*?)```\n\n```text\n(.*?)```", page, re.DOTALL).groups()
    (tmp_path / "loop.c").write_text(code)
    folder = tmp_path / "panda-c"
    assert holokin("export", "c", "panda-circle", "--strategy", "lock-3", "--out", folder).code == 0
    sources = [str(tmp_path / "loop.c"), str(folder / "panda_lock_3.c")]
    loop = str(tmp_path / "loop")
    subprocess.run(["cc", "-std=c99", "-O0", f"-I{folder}", *sources, "-o", loop, "-lm"], check=True, timeout=300)
    done = subprocess.run([loop], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, printed.strip())


# --- what cannot be exported ---


def test_the_command_refuses_in_one_sentence(holokin: Command, out: Path) -> None:
    for arguments, words in (
        (("paper", "--strategy", "lock-3"), ("stands for several", "ppr-cycle")),
        (("panda-circle", "--strategy", "lock-4"), ("lock-4", "did you mean 'lock-3'")),
        (("nothing", "--strategy", "x"), ("nothing",)),
        (("panda-circle", "--strategy", "lock-3", "--name", "7-lock"), ("C name",)),
        (("panda-circle", "--strategy", "lock-3", "--name", "math"), ("C name",)),
        (("panda-circle", "--strategy", "lock-3", "--name", ""), ("C name",)),
        (("panda-circle", "--strategy", "lock-3", "--dt", "-1"), ("dt",)),
        (("panda-circle", "--strategy", "lock-3", "--dt", "1e-7"), ("dt",)),
        (("panda-circle", "--strategy", "lock-3", "--orientation", "zyz"), ("zyz", "twist")),
    ):
        assert_refused(holokin("export", "c", *arguments, "--out", out), *words)
        assert_untouched(out)
    (out / "README.md").write_text("# My own\n\nIt uses holokin.\n")
    assert_refused(holokin("export", "c", "panda-circle", "--strategy", "lock-3", "--out", out), "README.md", "choose")
    assert sorted(f.name for f in out.iterdir()) == ["README.md", "mine.txt"]


def test_an_export_over_an_older_one_replaces_it(tmp_path: Path) -> None:
    law = hk.moore_penrose(hk.position(hk.load("ppr")))
    first = export_c(law, tmp_path, q0=PPR_START, name="law", dt=0.002)
    again = export_c(law, tmp_path, q0=PPR_START, name="law", dt=0.004)
    assert first.files == again.files
    assert "parameters->dt = HK_C(0.004)" in (tmp_path / "law.c").read_text()
    assert sorted(f.name for f in tmp_path.iterdir()) == sorted(again.files)
    with pytest.raises(ArgumentError, match="another export"):
        export_c(law, tmp_path, q0=PPR_START, name="other")


def test_a_singular_start_and_odd_arguments_are_refused(tmp_path: Path) -> None:
    irb = hk.load("irb140")
    with pytest.raises(SingularityError):
        export_c(hk.holonomic(hk.position(irb), hk.lock(0, 3, 4)), tmp_path / "x", q0=0.1 * np.ones(6))
    for more, error in (
        ({"q0": PANDA_START, "vectors_count": 0}, ArgumentError),
        ({"q0": PANDA_START, "dt": np.nan}, ArgumentError),
        ({"q0": PANDA_START, "name": "Law"}, ArgumentError),
    ):
        with pytest.raises(error):
            export_c(hk.holonomic(hk.pose(hk.load("panda")), hk.lock(0)), tmp_path / "x", **more)
        assert not (tmp_path / "x").exists()
    assert c_name("Panda, arm angle (SEW)!") == "panda_arm_angle_sew"
    assert c_name("7 joints") == "strategy_7_joints"


def test_words_of_a_user_end_no_comment(tmp_path: Path) -> None:
    strategy = hk.holonomic(hk.position(hk.load("ppr")), hk.linear([1, 0, -1], name="odd */ int x;\n name"))
    made = export_c(strategy, tmp_path, q0=PPR_START, name="odd", vectors_count=1)
    assert "odd * / int x; name" in (tmp_path / "odd.h").read_text()
    if shutil.which("cc") is not None:
        check(made)


# --- Names in exported C: whatever a joint, a strategy or a job is called, the strictest build takes the code.


NASTY = [
    "??/", "*??/", "ends with ??/", "\\", "*\\", "*/ #error", "/*/", "// x \\", "a\nb", "\u202e } ; \u2066", "\u200f",
    "\x07\x1b[31m", "\u2028", "\ud800", "$name ${NAME}", "100 %s %n", "Gelenk \u00e4", "\u5173\u8282", "a|b",
]  # fmt: skip


@pytest.mark.campaign
@pytest.mark.skipif(compiler() is None, reason="needs a C compiler")
def test_no_name_of_a_users_breaks_the_strictest_build(tmp_path: Path) -> None:
    rows = [{"a": 0.4, "joint": f"{text}{k}" if k % 2 else f"{k}{text}"} for k, text in enumerate(NASTY)]
    robot = hk.from_dh(rows[:6], name=" ".join(NASTY[6:12]))
    strategy = hk.moore_penrose(hk.position(robot), name="".join(NASTY))
    for k, title in enumerate(("??/", "\\", strategy.name)):
        law = hk.moore_penrose(strategy.task, name=title)
        found = hk.export.export_c(law, tmp_path / str(k), q0=0.1 + 0.2 * np.arange(robot.n), name="law",
                            vectors_count=1, origin=title, limits=False)  # fmt: skip
        for file in found.files:
            text = (found.folder / file).read_text("utf-8")
            assert not re.search(r"[\u202a-\u202e\u2066-\u2069\u200e\u200f\x00-\x08\x0b-\x1f\x7f]", text), file
            assert "??/" not in text, file
        if k != 1:
            continue
        assert "-Wall" in WARNINGS and "-Werror" in WARNINGS
        check(found)
    check(found)


@pytest.mark.parametrize("name", ["features", "stdint", "newlib", "reent", "corecrt", "endian", "volatile"])
def test_a_header_that_would_hide_one_of_the_c_library_is_refused(ppr: hk.Robot, tmp_path: Path, name: str) -> None:
    strategy = hk.moore_penrose(hk.position(ppr))
    with pytest.raises(ArgumentError, match="no word or header of C"):
        hk.export.export_c(strategy, tmp_path, q0=[0.9, -0.3, 0.8], name=name)
    assert list(tmp_path.iterdir()) == []


# --- An export over an older one: all files or none; killed midway, what is mixed does not compile.


STRATEGY = hk.moore_penrose(hk.position(hk.load("ppr")))
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


def export(folder: Path, dt: float) -> dict[str, str]:
    export_c(STRATEGY, folder, q0=PPR_START, name="law", vectors_count=2, dt=dt)
    return texts(folder)


def texts(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text() for file in folder.iterdir() if file.is_file()}


def refusal(folder: Path) -> str:
    """What the compiler says against the files of a folder; nothing if it takes them."""
    chosen = compiler()
    assert chosen is not None
    files = [str(folder / f"law{part}.c") for part in ("", "_selftest")]
    done = subprocess.run(
        [*chosen.command, "-std=c99", "-fsyntax-only", *files], capture_output=True, text=True, timeout=60
    )
    return done.stderr if done.returncode else ""


@needs_compiler
def test_files_of_two_exports_do_not_compile_together(tmp_path: Path) -> None:
    one, two = export(tmp_path / "a", 0.001), export(tmp_path / "b", 0.002)
    assert refusal(tmp_path / "a") == refusal(tmp_path / "b") == ""
    for name in ("law.h", "law.c", "law_vectors.h", "law_selftest.c"):
        (tmp_path / "a" / name).write_text(two[name])
        assert "of different exports" in refusal(tmp_path / "a")
        (tmp_path / "a" / name).write_text(one[name])


@pytest.mark.campaign
@needs_compiler
@sampled(1, "after", [False, True])
def test_an_export_killed_at_any_rename_is_old_or_new_or_does_not_compile(tmp_path: Path, after: bool) -> None:
    new = export(tmp_path / "new", 0.002)
    folder, mixed = tmp_path / "out", 0
    old = export(folder, 0.001)
    for k in range(1, 30):
        child = os.fork()
        if child == 0:
            deadly(k, after)
            try:
                export(folder, 0.002)
            finally:
                os._exit(0)
        if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0:
            break
        code = {name: text for name, text in texts(folder).items() if name.endswith((".c", ".h"))}
        if not (code.items() <= old.items() or code.items() <= new.items()):
            mixed += 1
            assert "of different exports" in refusal(folder)
        assert export(folder, 0.001) == old
        assert hidden(folder) == []
    assert k == 8  # seven files
    assert mixed == 4  # of the five of C and C++
    assert texts(folder) == new


def test_an_export_that_is_refused_midway_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old, replace = export(tmp_path, 0.001), os.replace

    def refused(source: Path, target: Path) -> None:
        if Path(target).name == "law_selftest.c" and "new" in Path(source).parts:
            raise OSError(errno.ENOSPC, "No space left on device")
        replace(source, target)

    monkeypatch.setattr(os, "replace", refused)
    with pytest.raises(WriteError):
        export(tmp_path, 0.002)
    assert texts(tmp_path) == old
    assert hidden(tmp_path) == []


def test_a_program_of_two_files_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    """KRL has its points in a file beside the program: those of another program move the arm elsewhere."""
    Program({"p.src": "old moves", "p.dat": "old points"}, 1, 0.0).save(tmp_path)
    before, replace = os.replace, []

    def refused(source: Path, target: Path) -> None:
        replace.append(target)
        if len(replace) == 2:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        before(source, target)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "replace", refused)
        with pytest.raises(WriteError):
            Program({"p.src": "new moves", "p.dat": "new points"}, 1, 0.0).save(tmp_path)
    assert texts(tmp_path) == {"p.src": "old moves", "p.dat": "old points"} and hidden(tmp_path) == []
