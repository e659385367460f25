"""Notebooks as pages of the site. As a hook of MkDocs this file makes a page of each docs/notebooks/*.ipynb.

Cells become Markdown, what they showed (tables, pictures, text) stands below them, and the notebook can be loaded.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent / "notebooks"
STYLE = re.compile(r"<style.*?</style>", re.DOTALL)


def page_of(notebook: Path) -> str:
    """The Markdown of a notebook."""
    parts = []
    for cell in json.loads(notebook.read_text("utf-8"))["cells"]:
        source = "".join(cell["source"])
        parts += [source] if cell["cell_type"] == "markdown" else [f"```python\n{source}\n```"]
        parts += [_shown(output.get("data", {}) | _printed(output)) for output in cell.get("outputs", [])]
    return "\n\n".join(part for part in [*parts, f"[Load this notebook]({notebook.name})"] if part) + "\n"


def _printed(output: dict[str, Any]) -> dict[str, Any]:
    return {"text/plain": output["text"]} if output.get("name") == "stdout" else {}


def _shown(data: dict[str, Any]) -> str:
    """What a cell showed, in the best form that there is."""
    if "image/png" in data:
        picture = "".join(data["image/png"]).replace("\n", "")
        return f'<img alt="what the cell above draws" src="data:image/png;base64,{picture}">'
    if "text/html" in data:
        return " ".join(STYLE.sub("", "".join(data["text/html"])).split())
    return f"```text\n{''.join(data['text/plain'])}\n```" if "text/plain" in data else ""


def on_files(files: Any, *, config: Any, **_: Any) -> Any:
    """MkDocs calls this before it looks for pages."""
    from mkdocs.structure.files import File

    for notebook in sorted(FOLDER.glob("*.ipynb")):
        uri = f"notebooks/{notebook.stem}.md"
        files.append(File.generated(config, uri, content=page_of(notebook)))
    return files
