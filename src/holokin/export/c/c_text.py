"""The C of a strategy: its functions, and the words of header, library and readme."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from string import Template
from typing import Any
from unicodedata import category

import numpy as np

from ...base.errors import ArgumentError, ExportError, NativeError
from ...base.tolerances import TOLERANCES
from ...base.types import ROTATION, Vector
from ...motion import has_leaf, step_function
from ...motion.control_step import AT_LIMIT, LEAST_RCOND, MOST_ERROR
from ...motion.ik import leaf_value
from ...motion.ik.branch import branch_code, extended_jacobian, rays_code
from ...motion.ik.closed_leaf import DOUBT, ClosedBranch, closed_branch, posture_of_signs
from ...motion.ik.edge import free_code
from ...motion.ik.leaf import ALMOST, DONE, NEWTONS, leaf_step, with_leaves
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.task import Task, poses_expression
from ...symbolic import SX, Function
from ...symbolic.native import LARGEST, code_file

SINGULAR_FLOAT, REPRESENTATION_FLOAT = 2e-3, 5e-3
"""rcond, and distance from a representation's singularity, below which single precision is called singular: at
them two digits are left."""

PRECISE_FLOAT, CLEAR_FLOAT = 0.04, 0.03
"""The same where it still has four digits; in between the status says that it has not. Measured on random postures."""

LEAST_FLOAT, BOTH_FLOAT = 5e-5, 0.01
"""Products of rcond and margin with the same meanings: near both singularities at once errors multiply."""

ALMOST_FLOAT, DONE_FLOAT = 1e-3, 1e-4
"""Corrections of which one more is the last, and after which none is needed, in single precision."""

DOUBT_FLOAT = 1e-4
"""How real an answer of the closed inverse is in single precision, from which it counts."""

_WORDS = """
auto break case char const continue default do double else enum extern float for goto if inline int long register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while main assert
complex ctype errno fenv inttypes iso646 limits locale math setjmp signal stdalign stdarg stdatomic stdbit stdbool
stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath threads time uchar wchar wctype aio aliases alloca ar
argp argz byteswap config corecrt cpio crtdefs dirent dlfcn elf endian envlock envz err error execinfo fastmath fcntl
features fmtmsg fnmatch fstab ftw getopt glob grp iconv ieeefp ifaddrs intrin io langinfo libgen libintl link machine
malloc memory mntent monetary mqueue netdb newlib nl_types paths poll printf process pthread pty pwd reent regex
regexp resolv sal sched search semaphore shadow share spawn stdfix stdio_ext strings stropts swprintf syscall sysexits
syslimits syslog tar termios ttyent ucontext ulimit unctrl unistd unwind utime utmp utmpx vadefs values varargs
vcruntime wait wordexp xlocale
"""

_WORDS_OF_CPP = """
alignas alignof and and_eq asm bitand bitor bool catch class compl concept consteval constexpr constinit const_cast
co_await co_return co_yield decltype delete dynamic_cast explicit export false friend mutable namespace new noexcept
not not_eq nullptr operator or or_eq private protected public reinterpret_cast requires static_assert static_cast std
template this thread_local throw true try typeid typename using virtual wchar_t xor xor_eq
"""

RESERVED = frozenset(_WORDS.split()) | frozenset(_WORDS_OF_CPP.split())
"""Words of C and C++, and headers of C, POSIX and the C libraries of Linux, of microcontrollers (newlib) and Windows. A
header of ours by such a name would hide theirs, which <math.h> and <stdio.h> may want."""

_FILES = {"prelude": "scalar.h", "posed": "posed.c", "step": "step.c"}

_LEAF_COPY = """  for (int i = 0; i < HK_R; i++) {
    values[i] = parameters->leaf[i];
    values[HK_R + i] = parameters->leaf_rate[i];
  }
"""

PARAMETERS = ("dt", "gain", "constraint_gain", "most_error", "least_rcond")
"""Of a control step, besides its leaf."""

SHORTEST, LONGEST = 1e-5, 1.0
"""Steps [s] for which the default gains make sense."""


@dataclass(frozen=True, eq=False)
class Source:
    """A strategy, the posture whose leaf it holds, the step [s] of its loop, and the name its C goes by."""

    strategy: Strategy
    q0: Vector
    dt: float
    name: str
    limits: bool = True

    def __post_init__(self) -> None:
        fits = re.fullmatch(r"[a-z][a-z0-9_]{0,39}", self.name) and not self.name.startswith("hk")
        if not fits or self.name in RESERVED:
            cure = (
                "give a C name of your own: up to 40 lower-case letters, digits, underscores, not beginning with hk, "
                "and no word or header of C"
            )
            raise ArgumentError("the name", self.name, cure)
        if not SHORTEST <= self.dt <= LONGEST:
            raise ArgumentError("dt", self.dt, f"give a step from {SHORTEST:g} to {LONGEST:g} s")
        longest = max(self.functions, key=lambda key: self.functions[key].program.instructions)
        if (size := self.functions[longest].program.instructions) > LARGEST:
            fact = f"{longest} of {self.strategy.name!r} is {size:,} operations long, {LARGEST:,} are the most"
            raise ExportError(
                fact, "take a shorter strategy; of one with leaves hk.strategies.fitted makes a polynomial"
            )

    @property
    def holonomic(self) -> HolonomicStrategy | None:
        """The strategy, where it has a leaf to hold."""
        return self.strategy if has_leaf(self.strategy) else None

    @cached_property
    def leaf(self) -> Vector:
        """The leaf c (r,) of the start; empty without a constraint."""
        return leaf_value(self.holonomic, self.q0) if self.holonomic else np.zeros(0)

    @property
    def parameters(self) -> Vector:
        """(c, c', dt, K, K_g, most error, least rcond) by default: errors fade by a tenth each step."""
        return np.concatenate(
            [self.leaf, np.zeros(len(self.leaf)), [self.dt, 0.1 / self.dt, 0.1 / self.dt, MOST_ERROR, LEAST_RCOND]]
        )

    @cached_property
    def functions(self) -> dict[str, Function]:
        """By the name of their C; results first, then rcond and margin."""
        s = self.strategy
        e = s.expressions
        T = poses_expression(e.kinematics)
        functions = {
            "pose": _checked("pose", {"q": e.q}, {"T": T}, SX(1)),
            "gain": s.gain,
            "rate": s.rate,
            "step": step_function(s, self.limits),
        }
        if holonomic := self.holonomic:
            functions["constraint"] = _checked(
                "constraint", {"q": e.q}, {"g": holonomic.constraint_expression}, s._margin_expression
            )
            functions["leaf"] = leaf_step(holonomic)
            functions["extended"] = extended_jacobian(holonomic)
        if (self.holonomic or s.task.n == s.task.m) and (
            one := posture_of_signs(with_leaves(s), self.limits)
        ) is not None:
            functions["posture"] = one
        return functions

    @property
    def closed(self) -> bool:
        """Whether all postures have a closed form."""
        return "posture" in self.functions

    @cached_property
    def branch(self) -> ClosedBranch | None:
        """The postures of the start's signs, where these alone tell the posture; None where paths are gone."""
        if self.holonomic is None or not self.closed:
            return None
        branch = closed_branch(self.holonomic, self.q0, self.leaf, self.limits)
        return branch if branch is not None and branch.single else None

    @cached_property
    def words(self) -> dict[str, Any]:
        """What the templates need."""
        s, task, robot = self.strategy, self.strategy.task, self.strategy.task.robot
        position, r, frames = task.orientation is None, len(self.leaf), task.frames
        constraint = self.holonomic.constraint if self.holonomic else None
        units = ", ".join(f"{unit}/s" for unit in task.units)
        t = TOLERANCES
        return {
            "name": self.name,
            "NAME": self.name.upper(),
            "title": line(f"{s.name}, {task.name}"),
            "strategy_words": line(f"The strategy's leaves are g(q) = c, {constraint.name}.")
            if constraint
            else "The strategy keeps no leaf; whether it is repeatable is for `holokin run` to tell.",
            "n": task.n, "m": task.m, "r": r, "nm": task.n * task.m, "target": task._point if position else 16 * frames,
            "twist": task._point if position else 6 * frames, "frames": frames, "matrices": int(not position),
            "poses": 16 * frames, **_pose_words(task),
            "joints": line(", ".join(robot.joint_names)), "rows": line(", ".join(task.row_names)), "rates": units,
            "pose_checked": _pose_checked(position, self.holonomic is not None),
            "singular_words": "J, [J; J_g] or H loses rank, the representation does, or a result overflows",
            "leaf_member": _leaf_members(self.name, r),
            "and_leaf": " and to the leaf" if r else "",
            "singular": _c(t.singular), "representation": _c(t.representation), "almost": _c(ALMOST),
            "done": _c(DONE), "newtons": NEWTONS,
            "rotation": _c(ROTATION),
            "singular_float": _c(SINGULAR_FLOAT), "representation_float": _c(REPRESENTATION_FLOAT),
            "both": _c(BOTH_FLOAT), "least_float": _c(LEAST_FLOAT),
            "precise": _c(PRECISE_FLOAT), "clear": _c(CLEAR_FLOAT), "almost_float": _c(ALMOST_FLOAT),
            "done_float": _c(DONE_FLOAT),
            "at_limit": _c(AT_LIMIT), "contraction": _c(t.contraction),
            "defaults": "".join(
                f"  parameters->leaf[{i}] = HK_C({_c(c)});\n  parameters->leaf_rate[{i}] = HK_C(0);\n"
                for i, c in enumerate(self.leaf)
            )
            + "".join(
                f"  parameters->{key} = HK_C({_c(value)});\n"
                for key, value in zip(PARAMETERS, self.parameters[2 * r :], strict=True)
            ),
            "start": "".join(f"  q[{i}] = HK_C({_c(value)});\n" for i, value in enumerate(self.q0)),
            "leaf_copy": _LEAF_COPY if r else "",
            "gather": _gather(task),
            "angular": ", ".join(str(int(flag)) for flag in (constraint.angular if constraint else ())),
            "beyond": _beyond(self) or "  (void)q;\n",
            "limit_words": "" if self.limits else "\n   Without limits: joints and their speeds are not watched.",
            "dt": f"{self.dt:g}",
            "leaf_words": "and the leaf of the start" if r else "no leaf",
            "c_given": f"const {self.name}_real c[{r}], " if r else "", "c_taken": "c" if r else "0",
            "on_leaf": " on the leaf c" if r else "", "leaf_given": ", const Leaf &c" if r else "",
            "leaf_data": "c.data(), " if r else "",
            "row": self.branch.row if self.branch else -1, "turned": _turned(self.branch),
            "doubt": _c(DOUBT), "doubt_float": _c(DOUBT_FLOAT), "n8": 8 * task.n,
            "postures_within": "postures beyond a joint limit are left out" if self.limits
            else "joint limits are not looked at",
        }  # fmt: skip


def _turned(branch: ClosedBranch | None) -> str:
    """C that is true where a wanted pose is turned so little from the start's that the closed form decides."""
    if branch is None or branch.turn == np.inf:
        return "1"
    terms = (f"HK_C({_c(x)}) * target[{4 * (i // 3) + i % 3}]" for i, x in enumerate(np.ravel(branch.rotation)))
    return f"{' + '.join(terms)} > HK_C({_c(branch.least_trace)})"


def _leaf_members(name: str, r: int) -> str:
    """Of the struct of parameters."""
    if not r:
        return ""
    rate = f"  {name}_real leaf_rate[{r}];    /* c' [per s]: takes it there in dt; 0 for a leaf that stays */\n"
    return f"  {name}_real leaf[{r}];         /* c = g(q) that is wanted at the end of the step */\n{rate}"


def _pose_checked(position: bool, holonomic: bool) -> str:
    """What is looked at of a wanted pose."""
    if position:
        return "Of a wanted position it is checked that it is finite."
    rotation = "inverse kinematics alone checks" if holonomic else "is not checked"
    return f"The last row of a wanted pose must be 0 0 0 1: is it transposed? That its rotation is one, {rotation}."


def _beyond(source: Source) -> str:
    """C that returns 1 where a joint is outside its limits."""
    lines = []
    for i, joint in enumerate(source.strategy.task.robot.coordinates if source.limits else ()):
        for bound, sign, slack in ((joint.upper, ">", TOLERANCES.limit), (joint.lower, "<", -TOLERANCES.limit)):
            if np.isfinite(bound):
                lines.append(f"  if (q[{i}] {sign} HK_C({_c(bound + slack)})) return 1;\n")
    return "".join(lines)


def _checked(name: str, inputs: Mapping[str, SX], outputs: Mapping[str, SX], margin: SX) -> Function:
    """A function whose results are followed by an rcond of 1 and a margin, as `hk_deliver` wants them."""
    return Function(name, inputs, {**outputs, "rcond": SX(1), "margin": margin})


def _gather(task: Task) -> str:
    """C that puts a wanted pose behind the joints: positions, then rotations."""
    if task.orientation is not None:
        return "  hk_unpack(target, x + HK_N);\n"
    coordinates = "  for (int i = 0; i < 3 * HK_FRAMES; i++) x[HK_N + i] = i < HK_POSE ? target[i] : HK_C(0);\n"
    return (
        coordinates + "  for (int i = 0; i < 9 * HK_FRAMES; i++) x[HK_N + 3 * HK_FRAMES + i] = HK_C(i % 9 % 4 == 0);\n"
    )


def _pose_words(task: Task) -> dict[str, str]:
    """What the texts call poses, targets and twists of a task."""
    frames, point, several = task.frames, task._point, task.frames > 1
    shown = {
        "pose_words": "The tool's pose" if not several else f"The poses of {frames} frames, one after the other,",
        "pose_kind": "4x4" if not several else f"{frames} of 4x4",
        "pose_of": "the tool in the base frame"
        if not several
        else f"{frames} frames in the base frame, one after the other",
    }
    if task.orientation is not None:
        return shown | {
            "pose_note": "",
            "target_words": "a 4x4 matrix by rows, the tool in the base frame, 16 numbers"
            if not several
            else f"{frames} matrices 4x4 by rows, the frames in the base frame, {16 * frames} numbers",
            "twist_words": f"{6 * frames} numbers, {'6 a frame, ' * several}linear first, "
            "in the base frame [m/s, rad/s]",
        }
    if task._spatial:
        places = "a position" if not several else f"{frames} positions"
        return shown | {
            "pose_note": f" A wanted pose is {places}, {point} numbers.",
            "target_words": f"{places} in the base frame, {point} numbers",
            "twist_words": f"{'a velocity' if not several else 'velocities'} in the base frame, {point} numbers [m/s]",
        }
    return shown | {
        "pose_note": f" A wanted pose is a point of the task's coordinates, {point} numbers.",
        "target_words": f"a point of the task's coordinates, {point} numbers",
        "twist_words": f"how fast that point moves, {point} numbers",
    }


def line(words: str) -> str:
    """Words of a user on one line that no C compiler takes for anything but words of a comment.

    Not its end, no line that goes on (\\ and ??/), no control or bidirectional characters, which show other code than
    there is.
    """
    plain = " ".join(words.split()).replace("\\", "/")
    plain = "".join(f"<U+{ord(c):04X}>" if category(c)[0] == "C" else c for c in plain)
    for pair in ("??", "*/", "/*"):
        while pair in plain:
            plain = plain.replace(pair, " ".join(pair))
    return plain


def _c(value: float) -> str:
    return repr(float(value))


def text(name: str, words: Mapping[str, Any], folder: str = "c") -> str:
    """A template of a folder of `export` with its words put in. Templates may hold templates."""
    template = files(f"holokin.export.{folder}").joinpath("text", name).read_text("utf-8")
    return Template(template).substitute(words)


def header(source: Source, words: Mapping[str, Any]) -> str:
    """NAME.h."""
    return text("interface.h", {**words, "leaf_interface": _leaf_text("leaf.h", "closed.h", source, words)})


def wrapper(source: Source, words: Mapping[str, Any]) -> str:
    """NAME.hpp."""
    return text("interface.hpp", {**words, "leaf_interface": _leaf_text("leaf.hpp", "closed.hpp", source, words)})


def _leaf_text(leaf: str, closed: str, source: Source, words: Mapping[str, Any]) -> str:
    """What a strategy with leaves has besides, and what one with a closed inverse has."""
    return (text(leaf, words) if source.holonomic else "") + (text(closed, words) if source.closed else "")


def library(source: Source, words: Mapping[str, Any]) -> str:
    """NAME.c."""
    try:
        bodies = "".join(
            function.c(f"hk_{key}_body") for key, function in source.functions.items() if key != "extended"
        )
        s = source.holonomic
        branch = branch_code(s) + rays_code(s) + free_code(s.task) if s else ""
    except NativeError as problem:
        raise ExportError(problem.fact, "write the strategy without it") from None
    transport = source.strategy.looped.transport
    if transport is not None:  # which comes with each of them, and is needed once
        bodies, branch = transport.c + bodies.replace(transport.c, ""), branch.replace(transport.c, "")
    drivers = {key: code_file(f"{key}.c") for key in ("branch", "newton", "line", "way", "fold", "ray", "inverse")}
    if "#define HK_RAYS" not in branch:
        drivers["ray"] = ""
    drivers["branch"] = branch + drivers["branch"]
    drivers["at_once"] = text("at_once.c", words) if source.branch else ""
    leaf = text("closed.c", words) if source.closed else ""
    leaf += text("leaf.c", {**words, **drivers}) if source.holonomic else ""
    parts = {key: code_file(file) for key, file in _FILES.items()} | {"leaf": leaf}
    solver = code_file("solve.c") if "hk_solve(" in bodies + branch else ""
    return text("interface.c", {**words, **parts, "bodies": solver + bodies})
