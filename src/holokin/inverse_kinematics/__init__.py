"""Pose in, joints out."""
