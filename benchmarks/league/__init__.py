"""The league: libraries that resolve redundancy, each in an environment of its own, on the same paths.

`courses.py` writes the robots and the paths that all get. `workers/` asks each library, and runs without holokin.
`played.py` says who takes part, makes the environments and runs the workers, and `scores.py` measures what the joints
did. `league_page.py` writes its section of docs/measured.md and league.png.
"""
