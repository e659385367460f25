"""Readers and writers of robot models: URDF, MJCF, xacro, DH tables, other libraries, the catalogue.

Uses `robot`. Read first: `urdf.py`, `loading.py`.
"""
