"""Closed-form inverses: which arms have one, and its steps.

Uses the robot's model. Read first: `arm_class.py`, `six_hinges.py`.
"""
