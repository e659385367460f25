"""Packaged jobs that take little time."""

from __future__ import annotations

from holokin.app.job import open_job, run_job
from holokin.app.report.job_result import JobResult


def shortened(name: str = "ppr-cycle", *, strategies: dict | None = None, **path: object) -> JobResult:
    """A packaged job with fewer samples and cycles, other strategies, and nothing expected."""
    short, job, file = open_job(name)
    table = job.model_copy(
        update={
            "path": job.path.model_copy(update={"samples": 60, "cycles": 2} | path),
            "strategies": strategies or job.strategies,
            "expect": {},
        }
    )
    return run_job(short, table, file)
