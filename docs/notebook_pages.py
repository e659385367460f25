"""Notebooks as pages of the site. As a hook of MkDocs this file makes a page of each docs/notebooks/*.ipynb.

Cells become Markdown, what they showed (pictures, text) stands below them, and the notebook can be downloaded.
`python docs/notebook_pages.py [NAME...]` runs the notebooks, without Jupyter, and stores what their cells show.
"""

from __future__ import annotations

import ast
import base64
import io
import json
import os
import re
import sys
from contextlib import redirect_stdout
from pathlib import Path
from textwrap import fill
from typing import Any

FOLDER = Path(__file__).parent / "notebooks"
COLORS, WIDE = 256, 96
"""Of a stored picture, and letters in a line of a page."""


# --- Pages.


def page_of(notebook: Path) -> str:
    """The Markdown of a notebook."""
    parts = []
    for cell in json.loads(notebook.read_text("utf-8"))["cells"]:
        source = "".join(cell["source"])
        parts += [linked(source)] if cell["cell_type"] == "markdown" else [f"```python\n{source}\n```"]
        parts += [_shown(output.get("data", {}) | _printed(output)) for output in cell.get("outputs", [])]
    return "\n\n".join(part for part in [*parts, f"[Download this notebook]({notebook.name})"] if part) + "\n"


def linked(markdown: str) -> str:
    """Text in which links to notebooks lead to their pages."""
    names = "|".join(notebook.stem for notebook in FOLDER.glob("*.ipynb"))
    return re.sub(rf"(\]\((?:[\w./-]*/)?(?:{names}))\.ipynb\)", r"\1.md)", markdown)


def _printed(output: dict[str, Any]) -> dict[str, Any]:
    return {"text/plain": output["text"]} if output.get("name") == "stdout" else {}


def _shown(data: dict[str, Any]) -> str:
    """What a cell showed, in the best form that there is."""
    if "image/png" in data:
        picture = "".join(data["image/png"]).replace("\n", "")
        return f'<img alt="what the cell above draws" src="data:image/png;base64,{picture}">'
    lines = "".join(data.get("text/plain", "")).splitlines()
    return "\n".join(["```text", *(fill(line, WIDE) for line in lines), "```"]) if lines else ""


def on_files(files: Any, *, config: Any, **_: Any) -> Any:
    """MkDocs calls this before it looks for pages."""
    from mkdocs.structure.files import File, InclusionLevel

    for notebook in sorted(FOLDER.glob("*.ipynb")):
        uri = f"notebooks/{notebook.stem}.md"
        files.append(File.generated(config, uri, content=page_of(notebook), inclusion=InclusionLevel.NOT_IN_NAV))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """MkDocs calls this with the text of each page."""
    return markdown if page.file.src_uri.startswith("notebooks/") else linked(markdown)


# --- Runs.


def ran(source: str, scope: dict[str, Any]) -> list[dict[str, Any]]:
    """The outputs of a cell that is run in `scope`: what it prints, its last value, and its figures of pyplot."""
    body = ast.parse(source).body
    last = body.pop() if isinstance(body[-1], ast.Expr) and not source.endswith(";") else None
    with redirect_stdout(io.StringIO()) as printed:
        exec(compile(ast.Module(body, []), "cell", "exec"), scope)
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), scope) if isinstance(last, ast.Expr) else None
    outputs: list[dict[str, Any]] = []
    if text := printed.getvalue():
        outputs.append({"name": "stdout", "output_type": "stream", "text": text.splitlines(keepends=True)})
    pictures = [value._repr_png_()] if hasattr(value, "_repr_png_") else []
    if (pyplot := sys.modules.get("matplotlib.pyplot")) is not None:
        for number in pyplot.get_fignums():
            stream = io.BytesIO()
            pyplot.figure(number).savefig(stream, format="png", bbox_inches="tight")
            pyplot.close(number)
            pictures.append(stream.getvalue())
    if value is not None and not pictures:
        raise SystemExit(f"the cell's last value is {value!r}: print it, or end the line with a semicolon")
    for picture in pictures:
        data = {"image/png": base64.b64encode(_small(picture)).decode(), "text/plain": ["a picture"]}
        outputs.append({"data": data, "metadata": {}, "output_type": "display_data"})
    return outputs


def _small(picture: bytes) -> bytes:
    """A PNG with fewer colours."""
    from PIL import Image

    stream = io.BytesIO()
    few = Image.open(io.BytesIO(picture)).convert("RGB").quantize(COLORS, Image.Quantize.FASTOCTREE)
    few.save(stream, "png", optimize=True)
    return stream.getvalue()


def run(notebook: Path) -> None:
    """Run a notebook, in its folder, and store what its cells show."""
    book, scope = json.loads(notebook.read_text("utf-8")), {}
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            cell["outputs"] = ran("".join(cell["source"]), scope)
    notebook.write_text(json.dumps(book, indent=1, ensure_ascii=False) + "\n", "utf-8")


if __name__ == "__main__":
    os.environ["MPLBACKEND"] = "Agg"
    os.chdir(FOLDER)
    for name in sys.argv[1:] or sorted(file.stem for file in FOLDER.glob("*.ipynb")):
        run(FOLDER / f"{name}.ipynb")
