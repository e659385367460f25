"""Self-motions: all postures of a tool pose as curves, what is least along them, and whether a pose is reached.

Uses `strategies` and `path`. Read first: `self_motions.py`, `stretches.py`, `pose_curves.py`.
"""
