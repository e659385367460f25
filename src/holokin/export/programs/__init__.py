"""Timed motion as robot programs, a file a language.

Uses `motion`. Read first: `robot_program.py`, `languages.py`.
"""
