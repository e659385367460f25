"""What every room uses: array types, checks of arguments, tolerances, files, tables of numbers, progress.

Uses `errors/`. Read first: `types.py`, `arguments.py`.
"""
