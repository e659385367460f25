"""Jobs: a TOML file says robot, task, path, strategies and expectations."""

from .export import export_job, job_strategy
from .read import read_job
from .runner import PAPER, expand, new_job, open_job, packaged_jobs, run_job
from .schema import Job
from .strategies import KINDS, keys_of

__all__ = [
    "KINDS",
    "PAPER",
    "Job",
    "expand",
    "export_job",
    "job_strategy",
    "keys_of",
    "new_job",
    "open_job",
    "packaged_jobs",
    "read_job",
    "run_job",
]
