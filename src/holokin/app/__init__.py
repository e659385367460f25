"""The applications over the library: `cli/` the command line, `job/` jobs in TOML files, `report/` their pages and
figures, `survey/` many cases, `studio/` the page in a browser.

Uses everything below it. Read first: `job/`, `cli/`.
"""
