"""Jobs: a TOML file says robot, task, path, strategies and expectations.

Uses all that a job may name. Read first: `schema.py`, `runner.py`.
"""

from .advice_job import axis_of
from .paths_job import run_paths
from .runner import PAPER, alone_says, expand, is_job, open_job, open_one_job, packaged_jobs, robot_of_file, run_job
from .schema import Job, read_job
from .strategy_tables import KINDS, keys_of
from .templates import new_job, new_job_for, packaged_text
from .uses import (
    certify_job,
    default_strategy,
    exported_strategy,
    job_strategy,
    program_of_job,
    program_of_paths,
    program_of_sheets,
)

__all__ = [
    "KINDS",
    "PAPER",
    "Job",
    "alone_says",
    "axis_of",
    "certify_job",
    "default_strategy",
    "expand",
    "exported_strategy",
    "is_job",
    "job_strategy",
    "keys_of",
    "new_job",
    "new_job_for",
    "open_job",
    "open_one_job",
    "packaged_jobs",
    "packaged_text",
    "program_of_job",
    "program_of_paths",
    "program_of_sheets",
    "read_job",
    "robot_of_file",
    "run_job",
    "run_paths",
]
