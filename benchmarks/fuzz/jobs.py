"""Job files: tables with wrong, huge, nested and odd values, and broken bytes, done as `holokin run` does them.

Only the figures are left out, and the samples cut down. The mutations serve the other kinds that are files, too.
"""

from __future__ import annotations

import copy
import io
import json
import random
import tomllib
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from holokin.app.job import Job, open_job, packaged_jobs, packaged_text, run_job
from holokin.app.report.job_report import print_result
from holokin.app.report.job_result import check_folder

_PATH = (
    '[path]\nkind = "circle"\ncenter = [-0.1, 0]\nrelative = true\nsamples = 8\ncycles = 2\n[verdict]\nsamples = 3\n'
)
_PPR = '[robot]\nname = "ppr"\n[start]\nq = [0.9, -0.3, 0.8]\n' + _PATH
_BARS = '[robot]\nname = "planar-3r"\n[start]\nq = [0.2, 0.8, 0.9]\n' + _PATH
_LAWS = """[strategies.mp]
kind = "moore-penrose"
[expect.mp]
holonomic = false
drift = { above = 0.001, below = 3 }
""", """[strategies.w]
kind = "weighted"
weight = [[1, 0, 0], [0, 2, 0], [0, 0, "1 + 0.1*cos(q2)"]]
invariant = ["q1 + q2"]
""", """[strategies.g]
kind = "custom"
g = ["q1 - sin(q3)"]
level = 0.1
""", """[strategies.l]
kind = "linear"
matrix = [[1, -1, 1]]
method = "velocity"
""", """[strategies.lock]
kind = "lock"
joints = ["q3"]
""", """[strategies.n]
kind = "null-basis"
N_G = [[1, 0], [0, 1], ["q1", "q2"]]
""", """[strategies.p]
kind = "pfaffian"
A = [["q2", 1, "-q1"]]
""", """[strategies.s]
kind = "stationary"
cost = "posture"
preferred = [0, 0.5, 0.5]
stiffness = [1, 2, 3]
""", """[strategies.h]
kind = "height"
joints = ["q2"]
""", """[strategies.i]
kind = "impedance"
preferred = [0, 0.5, 0.5]
stiffness = 2
""", """[strategies.r]
kind = "radial"
steps = 2
[strategies.f]
kind = "fitted"
of = "r"
radius = 0.05
degree = 2
samples = 40
"""  # fmt: skip
_FEW = "relative = true\nsamples = 8\n"
_OTHER_PATHS = (
    '[path]\nkind = "polyline"\npoints = [[0, 0], [0.05, 0], [0.05, 0.05]]\nclosed = true\n' + _FEW,
    '[path]\nkind = "arc"\ncenter = [-0.1, 0]\nangle_deg = 40\nclockwise = true\n' + _FEW,
    '[path]\nkind = "polyline"\npoints = [[0, 0], [0, 9]]\n' + _FEW,
)

NAMES = (
    "", ".", "..", "../..", "/", "x" * 300, "[/red]", "[tool A] of [b]", "\x00\x1b[31m\n", "\u202e", "日本語",
    "a.b", "$\\frac$", "x" * 300 + ".urdf", "nothing.toml", "\x00.toml", "_", "é" * 120, "q1", "path", "mp",
)  # fmt: skip
FORMULAS = (
    "(-8)**0.5", "1/0", "q1/0", "log(q1 - 50)", "sqrt(-q1)", "9**9**9", "q1**q1**q1", "tan(q1*1e9)", "1e400",
    "(" * 500 + "1" + ")" * 500, "-" * 5000 + "1", "+".join(["q1"] * 900), "sin(" * 90 + "q1" + ")" * 90,
    "9" * 5000, "lambda: 1", "__import__('os')", "q1.q2", "q1 if q2 else 1", "q1 q2", "\x00", "x" * 20_000,
    "atan2(q1)", "True", "q9", "0*q1", "q1", "exp(exp(exp(q1*9)))", "q1**-300", "1e-320*q1",
)  # fmt: skip
NUMBERS = (
    0, 1, -1, 2, 7, 1e-300, -1e200, 1e200, 1e308, float("nan"), float("inf"), 10**30, 10**400, 10**5000, 0.1,
    -0.5, 3, 1e6, 1e12, 100_000, 2**63, 1e-12,
)  # fmt: skip
OTHERS = (True, False, [], {}, [[]], [1] * 200, [[0.1]], {"a": 1}, [None], "1")


def hostile(chance: random.Random) -> Any:
    """A value that somebody may write by mistake, or on purpose."""
    kind = chance.random()
    if kind < 0.4:
        return chance.choice(NUMBERS)
    if kind < 0.6:
        return chance.choice(NAMES)
    if kind < 0.8:
        return chance.choice(FORMULAS)
    if kind < 0.84:
        value: Any = 1
        for _ in range(chance.choice((3, 40, 400, 3000))):
            value = [value] if chance.random() < 0.8 else {"a": value}
        return value
    return copy.deepcopy(chance.choice(OTHERS))


def places(table: Any) -> list[tuple[Any, Any]]:
    """(container, key) of every value in nested tables and lists."""
    found, waiting = [], [table]
    while waiting:
        here = waiting.pop()
        keys = list(here) if isinstance(here, dict) else range(len(here))
        found += [(here, key) for key in keys]
        waiting += [here[key] for key in keys if isinstance(here[key], dict | list)]
    return found


def copied(value: Any) -> Any:
    """A copy; 0 of what is nested too deep for one."""
    try:
        return copy.deepcopy(value)
    except RecursionError:
        return 0


def mutated(table: Any, chance: random.Random) -> Any:
    """A copy with a few values deleted, doubled, moved, replaced or renamed."""
    out = copy.deepcopy(table)
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        spots = places(out)
        if not spots:
            break
        here, key = chance.choice(spots)
        match chance.randrange(9):
            case 0:
                del here[key]
            case 1 if isinstance(here, list):
                here.extend([copied(here[key])] * chance.choice((1, 5, 200)))
            case 1 | 2 if isinstance(here, dict):
                word = chance.choice((*NAMES, *here, f"{key}s"))
                here[word] = here.pop(key)
            case 3:
                there, other = chance.choice(spots)
                here[key] = copied(there[other]) if isinstance(there, dict) and other in there else 0
            case 4 | 5:
                here[key] = hostile(chance)
            case _ if isinstance(here[key], int | float) and not isinstance(here[key], bool):
                with suppress(OverflowError):  # a whole number beyond all floats stays
                    here[key] *= chance.choice((2, 3, -1, -0.5, 0.1, 1.5, 10))
    return out


def toml(value: Any, top: bool = True) -> str:
    """TOML of nested tables, without recursion: some are nested deep."""
    parts, waiting = [], [(value, top)]
    while waiting:
        item, outermost = waiting.pop()
        if outermost is None:
            parts.append(item)
        elif isinstance(item, dict):
            inner: list[tuple[Any, bool | None]] = []
            for key, part in item.items():
                inner += [(f"{json.dumps(str(key))} = ", None), (part, False), ("\n" if outermost else ", ", None)]
            inner = inner if outermost else [("{", None), *inner[:-1], ("}", None)]
            waiting += reversed(inner)
        elif isinstance(item, list):
            inner = [("[", None)]
            for part in item:
                inner += [(part, False), (", ", None)]
            waiting += reversed([*inner, ("]", None)])
        elif isinstance(item, str):
            parts.append(json.dumps(item, ensure_ascii=False).replace("\x7f", "\\u007f"))
        elif isinstance(item, bool):
            parts.append(str(item).lower())
        elif isinstance(item, int) and abs(item) > 10**4000:
            parts.append("9" * 5000)
        elif isinstance(item, int | float):
            parts.append(repr(item))
        else:
            parts.append("1979-05-27T07:32:00Z")
    return "".join(parts)


def broken(data: bytes, chance: random.Random) -> bytes:
    """Some bytes changed, cut out, doubled, or put in."""
    out = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 5))):
        at = chance.randrange(len(out) + 1)
        match chance.randrange(6):
            case 0:
                out[at : at + 1] = bytes([chance.randrange(256)])
            case 1:
                del out[at : at + chance.choice((1, 3, 30))]
            case 2:
                out[at:at] = out[at : at + chance.choice((5, 50, 500))]
            case 3:
                out[at:at] = chance.choice((b"\xff\xfe", b"\xc3", b"\xed\xa0\x80", b"\x00", b"\xef\xbb\xbf", b"\r"))
            case 4:
                out[at:at] = bytes(chance.choice(b'"[]{}=.,\n#<>/&-0123456789e') for _ in range(chance.choice((1, 4))))
            case _:
                del out[at:]
    return bytes(out)


@cache
def _seeds() -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """(small jobs, of planar arms; the packaged ones)."""
    texts = [f'title = "t"\n{base}{law}' for base in (_PPR, _BARS) for law in _LAWS]
    small = [tomllib.loads(text) for text in texts]
    for i, text in enumerate(_OTHER_PATHS):
        small += [{**small[i], **tomllib.loads(text)}, {**small[-1 - i], **tomllib.loads(text)}]
    return small, [tomllib.loads(packaged_text(name)) for name in packaged_jobs()]


def short(job: Job) -> Job:
    """The job with few samples, so that a mutant takes little time."""
    path = job.path.model_copy(update={"samples": min(job.path.samples, 8), "cycles": min(job.path.cycles, 2)})
    verdict = job.verdict.model_copy(update={"samples": min(job.verdict.samples, 3)})
    return job.model_copy(update={"path": path, "verdict": verdict})


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed: written, read, done and printed."""
    from rich.console import Console

    chance = random.Random(seed)
    small, packaged = _seeds()
    whole = chance.random() < 0.1
    table = chance.choice(packaged if whole else small)
    kind = chance.random()
    data = toml(mutated(table, chance) if kind < 0.75 else table).encode("utf-8", "replace")
    if kind > 0.7:
        data = broken(data, chance)
    stem = chance.choice(("job", "job", "job", "..", ".", "", "x" * 240, "x" * 300, "[b]", "é"))
    file = folder / f"{stem}.toml"
    with suppress(OSError):  # a name too long for the disk: holokin has to say so
        file.write_bytes(data)
    name, job, file = open_job(str(file))
    check_folder(folder / "out", name)
    if chance.random() < (0.95 if whole else 0.4):  # reading them is cheap, doing them is not
        return
    result = run_job(name, short(job), file)
    print_result(result, Console(file=io.StringIO(), width=120))
    json.dumps([strategy.to_dict() for strategy in result.strategies], allow_nan=False)
    if any(len(stem.encode()) > 120 for stem in result.stems.values()):
        raise ValueError("a file name that is too long")
