"""Proofs by computation: a theorem about a leaf along a path, or over a workspace, and its certificate."""
