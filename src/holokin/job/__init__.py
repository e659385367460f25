"""Jobs: a TOML file says robot, task, path, strategies and expectations."""

from .export import export_job, job_strategy
from .read import read_job
from .runner import PAPER, expand, new_job, open_job, packaged_jobs, run_job
from .schema import Job, kinds_of_strategy

__all__ = [
    "PAPER",
    "Job",
    "expand",
    "export_job",
    "job_strategy",
    "kinds_of_strategy",
    "new_job",
    "open_job",
    "packaged_jobs",
    "read_job",
    "run_job",
]
