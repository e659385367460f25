"""Paths in files: tables, programs of CAM systems, and drawings.

Uses `path`. Read first: `path_file.py`.
"""
