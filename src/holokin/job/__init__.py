"""Jobs: a TOML file says robot, task, path, strategies and expectations."""

from .certifying import certify_job
from .export import export_job, job_strategy
from .physics import simulate_job
from .programs import program_of_job
from .read import read_job
from .runner import PAPER, expand, open_job, open_one_job, packaged_jobs, run_job
from .schema import Job
from .strategies import KINDS, keys_of
from .template import new_job, new_job_for, packaged_text

__all__ = [
    "KINDS",
    "PAPER",
    "Job",
    "certify_job",
    "expand",
    "export_job",
    "job_strategy",
    "keys_of",
    "new_job",
    "new_job_for",
    "open_job",
    "open_one_job",
    "packaged_jobs",
    "packaged_text",
    "program_of_job",
    "read_job",
    "run_job",
    "simulate_job",
]
