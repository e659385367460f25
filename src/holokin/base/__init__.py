"""What every room uses: array types, checks of arguments, tolerances, files, tables of numbers, progress.

Uses nothing. Read first: `types.py`, `arguments.py`.
"""
