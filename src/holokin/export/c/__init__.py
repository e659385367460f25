"""A strategy or a map of sheets as plain C with a self-test.

Uses `motion`. Read first: `c_folder.py`.
"""
