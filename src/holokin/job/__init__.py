"""Jobs: a TOML file says robot, task, path, strategies and expectations."""

from .runner import PAPER, expand, new_job, open_job, packaged_jobs, run_job
from .schema import Job, read_job

__all__ = ["PAPER", "Job", "expand", "new_job", "open_job", "packaged_jobs", "read_job", "run_job"]
