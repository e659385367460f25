"""The command line: a file a subcommand, of its name.

Uses everything; each command loads what it needs when it runs. Read first: `main.py`, `outcome.py`.
"""
