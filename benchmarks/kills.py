"""Kills and interrupts at random moments of `holokin run`: is anything lost, half-written, or left behind?

    python -m benchmarks.kills --count 200

Each trial starts a run of a small job over an older result, in whose folder a user keeps files; sends SIGKILL, SIGINT
or SIGTERM at a random moment of its life; looks at the folder; lets holokin repair it as the next run does at its
beginning, in every tenth trial by a whole run; and looks again. Half of the moments lie in the time in which files are
written. Kills before and after each rename are in `tests/app/cli/test_faults.py`.
"""

from __future__ import annotations

import argparse
import collections
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from holokin.app.report.job_result import check_folder

JOB = """title = "{title}"
[robot]
name = "ppr"
[start]
q = [0.9022932188134525, -0.3035067811865475, 0.7853981633974483]
[path]
kind = "circle"
center = [1.2070, 0.4036]
samples = 20
[strategies.moore-penrose]
kind = "moore-penrose"
"""

MINE = {"notes.txt": "mine", "photos/arm.jpg": "mine too"}
"""What the user keeps in the folder of results."""


def deadly(k: int, after: bool) -> None:
    """Let this process kill itself at its k-th rename (or link), before or after it."""
    calls = 0

    def wrapped(call: Any) -> Any:
        def renames(*arguments: Any, **options: Any) -> Any:
            nonlocal calls
            calls += 1
            if calls == k and not after:
                os.kill(os.getpid(), signal.SIGKILL)
            answer = call(*arguments, **options)
            if calls == k and after:
                os.kill(os.getpid(), signal.SIGKILL)
            return answer

        return renames

    for name in ("rename", "replace", "link"):
        setattr(os, name, wrapped(getattr(os, name)))


def hidden(out: Path) -> list[str]:
    """The hidden entries of a folder."""
    return sorted(name for name in os.listdir(out) if name.startswith("."))


def state(out: Path) -> dict[str, set[str]]:
    """The files of each folder in a folder of results, hidden ones too."""
    return {
        d.name: {str(f.relative_to(d)) for f in d.rglob("*") if not f.is_dir()} for d in out.iterdir() if d.is_dir()
    }


def whole(folder: Path) -> str:
    """The title of a result that has every file it names, all of one run; else what is wrong with it."""
    try:
        facts = json.loads((folder / "result.json").read_text("utf-8"))
        lacking = [name for name in facts["files"] if not (folder / name).is_file()]
        page = (folder / "report.html").read_text("utf-8")
    except (OSError, ValueError) as problem:
        return f"broken: {problem}"
    if lacking or f"<h1>{facts['title']}</h1>" not in page or not page.rstrip().endswith("</html>"):
        return f"broken: {lacking or 'the page is of another run'}"
    return facts["title"]


def _start(file: Path, out: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "holokin", "run", str(file), "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # shells ignore it in the background
    )


def trial(kind: signal.Signals, moment: tuple[bool, float], folder: Path, number: int) -> tuple[str, list[str]]:
    """One signal: how the process ended, and what is wrong.

    Args:
        moment: (True, s): s seconds after the first unfinished file appears; (False, s): after the start.
        number: of the trial, by which its result is known.
    """
    out = folder / "out"
    old, new = whole(out / "job"), f"trial {number}"
    process = _start(job(folder, new), out)
    writing, delay = moment
    while writing and process.poll() is None and not hidden(out):
        time.sleep(0.002)
    time.sleep(delay)
    sent = process.poll() is None
    process.send_signal(kind)
    _, said = process.communicate(timeout=120)
    code, faults = process.returncode, []
    ended = f"{kind.name} -> {code}" if sent else "had ended"
    if not sent and code != 0:
        faults.append(f"exit code {code} without a signal: {said[-300:]}")
    if sent and kind is not signal.SIGKILL:
        loading = code == -kind or (code == 1 and "holokin" not in said)  # Python itself, not yet holokin
        if code not in (128 + kind, 0) and not loading:
            faults.append(f"exit code {code} after {kind.name}: {said[-300:]}")
        elif code == 128 + kind and (not said.startswith("stopped") or said.count("\n") != 1):
            faults.append(f"said after {kind.name}: {said[-300:]}")
        elif not loading and hidden(out):
            faults.append(f"after {kind.name}: {hidden(out)}")
    found, wrong = looked_at(out, (old, new), gap=code == -signal.SIGKILL)
    if code == 0 and found != "new":
        faults.append("exit code 0 without the new result")
    return f"{ended}: {found} result", [*faults, *wrong, *repaired(folder, (old, new), number)]


def looked_at(out: Path, titles: tuple[str, str], *, gap: bool) -> tuple[str, list[str]]:
    """Which result stands there (old, new, or no), and what is wrong.

    Args:
        titles: of the old and of the new result.
        gap: it may have none, between two renames.
    """
    faults = [f"{name} is nowhere" for name in MINE if not any(out.rglob(Path(name).name))]
    if gap and not (out / "job").exists():
        return "no", faults
    title = whole(out / "job")
    if title not in titles:
        return "a broken", [*faults, f"the result: {title}"]
    return ("old", "new")[titles.index(title)], faults


def repaired(folder: Path, titles: tuple[str, str], number: int) -> list[str]:
    """What is wrong after the beginning of the next run, or in every tenth trial after its end."""
    out = folder / "out"
    check_folder(out, "job")
    _, faults = looked_at(out, titles, gap=False)
    if number % 10 == 0:
        again = _start(job(folder, "again"), out)
        _, said = again.communicate(timeout=120)
        if again.returncode != 0 or whole(out / "job") != "again":
            faults.append(f"the next run: {said[-300:]}, {whole(out / 'job')}")
    if hidden(out):
        faults.append(f"litter after the next run: {hidden(out)}")
    kept = {name: (out / "job" / name).read_text() if (out / "job" / name).exists() else "" for name in MINE}
    if kept != MINE:
        faults.append(f"the user's files after the next run: {kept}")
    return faults


def job(folder: Path, title: str) -> Path:
    """A job file."""
    (folder / "job.toml").write_text(JOB.format(title=title), "utf-8")
    return folder / "job.toml"


def prepare(folder: Path) -> float:
    """An older result, the user's files in it; returns how long that run took [s]."""
    out = folder / "out"
    out.mkdir(exist_ok=True)
    begin = time.perf_counter()
    process = _start(job(folder, "first"), out)
    _, said = process.communicate(timeout=120)
    if process.returncode != 0:
        raise RuntimeError(said)
    keep(out / "job")
    return time.perf_counter() - begin


def keep(folder: Path) -> None:
    """The user's files in a folder of results."""
    for name, text in MINE.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)


def run(count: int, kind: signal.Signals, seed: int) -> tuple[collections.Counter[str], list[str]]:
    """`count` signals that reached a process: how often which end, and all faults."""
    ends: collections.Counter[str] = collections.Counter()
    faults = []
    rng, k = random.Random(seed), 0
    with tempfile.TemporaryDirectory(prefix="kills-") as name:
        folder = Path(name)
        seconds = min(prepare(folder) for _ in range(3 if count > 1 else 1))  # the first warms the caches
        while ends.total() - ends["had ended: new result"] < count and k < 3 * count:
            k += 1
            moment = (k % 2 == 1, rng.uniform(0, 0.4 * seconds if k % 2 else seconds))
            ended, wrong = trial(kind, moment, folder, k)
            ends[ended] += 1
            faults += [f"{kind.name} {k} at {moment}: {fault}" for fault in wrong]
    return ends, faults


def main(arguments: list[str] | None = None) -> int:
    """Print how the processes ended, and each fault."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.kills", description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=["SIGKILL", "SIGINT", "SIGTERM"])
    parser.add_argument("--quick", action="store_true", help="one kill at a random moment")
    args = parser.parse_args(arguments)
    if args.quick:
        args.count, args.only = 1, "SIGKILL"
    faults = []
    for kind in (signal.SIGKILL, signal.SIGINT, signal.SIGTERM):
        if args.only in (None, kind.name):
            ends, found = run(args.count, kind, args.seed)
            print(f"{kind.name}: {ends.total()}, {len(found)} faults", flush=True)
            for ended, times in sorted(ends.items()):
                print(f"  {times:4} {ended}", flush=True)
            faults += found
    print("\n".join(faults[:40]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
