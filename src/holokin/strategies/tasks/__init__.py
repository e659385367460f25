"""What the tool must do, x = f(q): one frame or several, position, orientation, or an expression of your own.

Uses `robot`. Read first: `task.py`, `task_kinds.py`.
"""
