"""What every room uses: array types, checks of arguments, tolerances, whole files, progress.

Uses `errors`. Read first: `types.py`, `arguments.py`.
"""
