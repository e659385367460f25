"""The command `holokin`, also as `python -m holokin`: the command line, if the extra `app` is installed."""

import sys
from importlib.util import find_spec

NEEDED = ("typer", "rich", "pydantic", "matplotlib")
"""What the extra `app` installs."""


def main() -> None:
    """Run the command line; without its packages say in one line how to install them, and exit with 2."""
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        print(
            f'error: the command holokin needs {", ".join(missing)}; run: pip install "holokin[app]"', file=sys.stderr
        )
        sys.exit(2)
    from .app.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
