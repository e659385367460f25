"""Paths in files: tables of poses and drawings.

Uses `path`. Read first: `pose_table.py`.
"""
