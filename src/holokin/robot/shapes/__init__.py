"""Shapes of links: boxes, capsules, hulls, meshes, and what a page draws.

Uses `base`. Read first: `link_shapes.py`.
"""
