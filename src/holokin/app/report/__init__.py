"""Reads results only: figures, reports, tables, animations.

Uses results of the folders below, and computes none. Read first: `section.py`, `job_result.py`, `job_report.py`.
"""
