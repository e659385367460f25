"""What a survey costs beside its cases: on one worker and two, by processes and by Dask; rows kept, bytes, memory.

    python -m benchmarks.surveys                    # rates, overheads, rows kept in a second: two minutes
    python -m benchmarks.surveys --memory 100000    # memory of the coordinator and of a worker over so many cases

Planar cases, the cheapest there are, so that what stands beside them shows. Runs that are compared take turns. Rates
are of the middle of a run, by the clock; "CPU" is the processors' time of a case, of all processes of a run, which
other work on the machine changes less. Dask's processes take some of it while they wait, too. "Beside" is the time of
the workers that is not of their cases, which each measures itself, as a share of these: a machine that is slower for
a while is so for both. "Over loop" is how much more that makes of a case than in the bare loop.
"""

from __future__ import annotations

import argparse
import pickle
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from holokin.app.survey import Store, SurveyTable, run_survey, survey_of
from holokin.app.survey.cases import Cases
from holokin.app.survey.engine import AHEAD, SECONDS, Batches, Cluster, Guarded, Here, Pool, reached, run_guarded
from holokin.app.survey.one_case import Row, prepare, run_case
from holokin.base.errors import MissingExtraError

MIDDLE = (0.2, 0.9)
"""Of the rows of a run: from the first of these shares to the second its rate is measured."""

MB = 2**20

Run = Callable[[Batches], Generator[list[Row], None, None]]


def planar(count: int) -> SurveyTable:
    """Circles of a planar arm with three joints, two laws: 2 cycles of 20 samples."""
    content = {
        "title": "planar", "robots": ["planar-3r"], "cycles": 2, "samples": 20,
        "loops": {"circle": {"kind": "circle", "size": [0.05, 0.2], "count": max(1, count // 2)}},
        "laws": {"pseudo-inverse": {"kind": "moore-penrose"}, "lock": {"kind": "best-lock"}},
    }  # fmt: skip
    return survey_of(content, "planar")


@dataclass(frozen=True)
class Found:
    """Of one run: cases in a second, the processors' time of a case [s], this process's own [s], cases at a time.

    `beside`: what a worker's time is more than that of its cases, as a share.
    """

    rate: float
    cpu: float
    own: float
    size: float
    beside: float


def _cpu() -> dict[int, float]:
    """The processors' time of this process and of all below it [s]."""
    import psutil

    found: dict[int, float] = {}
    for process in [psutil.Process(), *psutil.Process().children(recursive=True)]:
        try:
            used = process.cpu_times()
        except psutil.Error:
            continue
        found[process.pid] = used.user + used.system
    return found


def measured(run: Run, count: int, workers: int) -> Found:
    """The middle of a run of so many cases; rows are thrown away."""
    marks: list[tuple[int, float, float, float, dict[int, float]]] = []
    done, batches, busy = 0, 0, 0.0
    with closing(run(Batches(range(count), count, 2))) as stream:
        for rows in stream:
            done, batches, busy = done + len(rows), batches + 1, busy + sum(row.seconds for row in rows)
            if done >= MIDDLE[len(marks)] * count:
                marks.append((done, busy, time.perf_counter(), time.process_time(), _cpu()))
                if len(marks) == len(MIDDLE):
                    break
    (first, idle, began, own, before), (last, worked, ended, owned, after) = marks
    used = sum(seconds - before.get(pid, 0.0) for pid, seconds in after.items())
    cases = last - first
    beside = workers * (ended - began) / (worked - idle) - 1
    return Found(cases / (ended - began), used / cases, (owned - own) / cases, done / batches, beside)


def compared(runs: dict[str, tuple[int, Run]], count: int, turns: int) -> dict[str, Found]:
    """Each of the runs, by so many workers, in turns; the best rate and the least times, since other work adds to them.

    What stands beside the cases is the median.
    """
    found: dict[str, list[Found]] = {name: [] for name in runs}
    for _ in range(turns):
        for name, (workers, run) in runs.items():
            found[name].append(measured(run, count, workers))
    return {
        name: Found(
            max(f.rate for f in of), min(f.cpu for f in of), min(f.own for f in of), max(f.size for f in of),
            statistics.median(f.beside for f in of),
        )
        for name, of in found.items()
    }  # fmt: skip


def told(found: dict[str, Found], bare: Found) -> None:
    """Print the runs, against the bare loop."""
    head = f"{'cases/s':>8} {'CPU ms/case':>12} {'here ms/case':>13} {'beside':>8} {'over loop':>10} {'batch':>6}"
    print(f"{'run':20} {head}")
    for name, f in found.items():
        more, over = f"{f.beside:.1%}", f"{(1 + f.beside) / (1 + bare.beside) - 1:.1%}"
        numbers = f"{f.rate:8.1f} {1e3 * f.cpu:12.2f} {1e3 * f.own:13.3f} {more:>8} {over:>10} {f.size:6.0f}"
        print(f"{name:20} {numbers}", flush=True)


def efficiency(name: str, one: Found, two: Found) -> None:
    """Print what the second worker is worth."""
    print(
        f"{name}, from 1 to 2 workers: {100 * two.rate / (2 * one.rate):.0f} % by the clock, "
        f"{100 * one.cpu / two.cpu:.0f} % by the processors' time of a case",
        flush=True,
    )


def rates(count: int, turns: int, *, cluster: bool) -> None:
    """The bare loop, one and two processes, one and two workers of a Dask cluster."""
    table, folder = planar(count), Path()
    cases = Cases(table, folder)
    for number in range(4):
        run_case(cases.case(number), cases)

    def loop(batches: Batches) -> Generator[list[Row], None, None]:
        while batch := batches.take(1):
            asked = [cases.case(number) for number in batch]
            rows = [run_case(case, cases, prepare(case, cases)) for case in asked]
            batches.came(batch, rows)
            yield rows

    runs: dict[str, tuple[int, Run]] = {
        "bare loop": (1, loop), "this process": (1, Here(table, folder).run),
        "1 process": (1, Pool(table, folder, 1).run), "2 processes": (2, Pool(table, folder, 2).run),
    }  # fmt: skip
    found = compared(runs, count, turns)
    told(found, found["bare loop"])
    efficiency("processes", found["1 process"], found["2 processes"])
    if not cluster:
        return
    try:
        import distributed
    except ImportError:
        raise MissingExtraError("distributed", "cluster") from None
    tasks: list[float] = []

    def dask(workers: int) -> tuple[int, Run]:
        def run(batches: Batches) -> Generator[list[Row], None, None]:
            with distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
            ) as found:
                tasks.append(task_of_dask(distributed, found.scheduler_address, table.model_dump_json()))
                address = found.scheduler_address
                with reached(address) as client, closing(Cluster(table, folder, address, client).run(batches)) as rows:
                    yield from rows

        return workers, run

    found = compared({"bare loop": (1, loop), "Dask, 1 worker": dask(1), "Dask, 2 workers": dask(2)}, count, turns)
    told(found, found["bare loop"])
    efficiency("Dask", found["Dask, 1 worker"], found["Dask, 2 workers"])
    print(f"a task of Dask: {1e3 * min(tasks):.2f} ms; {SECONDS:g} s of cases are sent together", flush=True)


def task_of_dask(distributed: Any, scheduler: str, table: str, count: int = 500) -> float:
    """Seconds of a task without cases, of many that wait, as those of a survey do."""
    with distributed.Client(scheduler, set_as_default=False) as client:
        began, flow, sent = 0.0, distributed.as_completed(loop=client.loop), 0
        for _ in range(AHEAD):
            flow.add(client.submit(run_guarded, table, "", (), pure=False))
        for done, _future in enumerate(flow, start=1):
            if done == count // 5:
                began = time.perf_counter()
            if sent < count:
                flow.add(client.submit(run_guarded, table, "", (), pure=False))
                sent += 1
        return (time.perf_counter() - began) / (count + AHEAD - count // 5)


def sent_and_kept(count: int) -> None:
    """What a batch costs on its way to a process, bytes on their way, rows kept in a second."""
    table = planar(count)
    cases, text = Cases(table, Path()), table.model_dump_json(exclude_unset=True)
    guarded = Guarded()
    try:
        guarded.rows(text, "", (0, 1))
        waits = []
        for number in range(2, count):
            began = time.perf_counter()
            (row,) = guarded.rows(text, "", (number,))
            waits.append(time.perf_counter() - began - row.seconds)
    finally:
        guarded.close()
    print(f"a batch to a process and back: {1e3 * statistics.median(waits):.2f} ms")
    row = run_case(cases.case(0), cases)
    rows = [
        replace(row, id=f"{k:016x}", names=dict(row.names), metrics={m: v + k for m, v in row.metrics.items()})
        for k in range(20_000)
    ]
    print(f"bytes: {len(pickle.dumps(rows[:100])) / 100:.0f} a row in a batch of 100, {len(text)} the survey")
    for size in (1, 10, 100, 1000):
        some = rows[: min(len(rows), 100 * size)]
        with tempfile.TemporaryDirectory() as name, Store.opened(Path(name) / "s.sqlite", table) as store:
            began = time.perf_counter()
            for k in range(0, len(some), size):
                store.add(some[k : k + size])
            print(f"kept, {size} rows at a time: {len(some) / (time.perf_counter() - began):,.0f} rows/s", flush=True)
    began = time.perf_counter()
    for number in range(1000):
        _ = cases.case(number % count).id
    print(f"the id of a case: {1e3 * (time.perf_counter() - began):.0f} us")


def memory(count: int) -> None:
    """Memory of the coordinator and of its one worker, over so many cases of a whole survey."""
    import psutil

    def resident() -> tuple[float, float]:
        below = psutil.Process().children(recursive=True)
        sizes = [process.memory_info().rss for process in below if process.is_running()]
        return psutil.Process().memory_info().rss / MB, max(sizes, default=0) / MB

    points = [count * k // 10 for k in range(1, 11)]
    print(f"{'rows':>9} {'coordinator MB':>15} {'worker MB':>10} {'seconds':>8}")

    def say(found: Any) -> None:
        while points and found.done >= points[0]:
            own, worker = resident()
            print(f"{found.done:9,} {own:15.0f} {worker:10.0f} {found.seconds:8.0f}", flush=True)
            points.pop(0)

    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "s.sqlite"
        run_survey(planar(count), Path(), file, workers=1, progress=say)
        own, _ = resident()
        run_survey(planar(count), Path(), file, workers=1, resume=True)
        print(f"{file.stat().st_size / MB:.1f} MB of results; looked through again: {resident()[0] - own:+.0f} MB")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.surveys", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few cases, without a cluster")
    parser.add_argument("--cases", type=int, default=1200)
    parser.add_argument("--turns", type=int, default=2)
    parser.add_argument("--memory", type=int, metavar="CASES", help="measure memory over so many cases instead")
    args = parser.parse_args(arguments)
    if args.memory is not None:
        memory(args.memory)
        return 0
    if args.quick:
        args.cases, args.turns = 80, 1
    sent_and_kept(20 if args.quick else 200)
    rates(args.cases, args.turns, cluster=not args.quick)
    return 0


if __name__ == "__main__":
    sys.exit(main())
