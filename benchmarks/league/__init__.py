"""The league: libraries that resolve redundancy, each in an environment of its own, on the same paths.

`league_entries.py` says who takes part, `environments.py` makes an environment for each, `courses.py` writes the robots
and the paths that all get. `workers/` asks each library, and runs without holokin; `played.py` runs it,
and `scores.py` measures what the joints did. `league_page.py`, `league_reading.py` and `league_figure.py` write
docs/league.md and docs/league.png.
"""
