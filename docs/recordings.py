"""The recordings of the gallery. `python docs/recordings.py [PAGE...]` makes those that are missing or out of date.

Each page of docs/gallery/ names an example, whose `motions` of its `robot`, among its `obstacles`, are recorded, and
shows a picture, whose text is the caption. As a hook of MkDocs this file puts the recordings that there are into the
site, in place of the pictures; without them (they need the extra `studio`) the site has the pictures only.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import logging
import os
import re
import runpy
import sys
import tempfile
from html import escape
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
MADE = HERE.parent / "build" / "recordings"
MAKERS = tuple(
    f"src/holokin/{file}.py" for file in ("app/studio/playback", "app/studio/page_scene", "app/report/robot_view")
)
"""What a recording depends on, beside its page and its example."""

EXAMPLE = re.compile(r"^\[`(examples/\w+\.py)`\]\(\.\./\.\./\1\)$", re.MULTILINE)
"""A link to the example, for who reads the page as it is; the site has the code in its place."""
CODE = '``` { .py title="\\1" }\n--8<-- "\\1"\n```'
PICTURE = re.compile(r"^!\[(?P<text>[^\]]+)\]\((?P<name>[\w-]+)\.png\)$", re.MULTILINE)
FRAME = """<figure class="recording" markdown="0">
<iframe loading="lazy" title="{text}" src="{folder}player.html?playbackPath={name}.viser"></iframe>
<figcaption>Drag to turn it, scroll to come nearer; the bar below stops it and sets the time. {text}</figcaption>
</figure>"""


def pages() -> dict[str, Path]:
    """Name -> page of every recording."""
    return {page.stem: page for page in sorted((HERE / "gallery").glob("*.md"))}


def parts(page: Path) -> tuple[str, str, Path]:
    """(title, caption, example) of a page."""
    words = page.read_text("utf-8")
    title, picture, example = re.match(r"# (.+)\n", words), PICTURE.search(words), EXAMPLE.search(words)
    if not (title and picture and example):
        raise SystemExit(f"{page}: it needs a title, a picture in a line of its own, and an example as a snippet")
    return title[1], picture["text"], HERE.parent / example[1]


def made_of(page: Path) -> Path:
    """Where the recording of a page is, if it is up to date: its name says of what it was made."""
    title, text, example = parts(page)
    sources = b"".join((HERE.parent / file).read_bytes() for file in MAKERS) + example.read_bytes()
    return MADE / f"{page.stem}-{hashlib.sha256(sources + f'{title}{text}'.encode()).hexdigest()[:12]}.viser"


def make(page: Path) -> Path:
    """Run the example of a page and record what it did."""
    from holokin.app.studio import record

    title, text, example = parts(page)
    file, back = made_of(page), Path.cwd()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        os.chdir(folder)
        try:
            shown = runpy.run_path(str(example))
        finally:
            os.chdir(back)
    recording = record(shown["robot"], shown["motions"], title=title, text=text, obstacles=shown.get("obstacles", ()))
    MADE.mkdir(parents=True, exist_ok=True)
    for old in MADE.glob(f"{page.stem}-????????????.*"):
        old.unlink()
    file.with_suffix(".json").write_text(json.dumps(recording.caption), "utf-8")
    file.write_bytes(recording.scene)
    return file


def on_files(files: Any, *, config: Any) -> Any:
    """MkDocs calls this with all files of the site: the recordings come in, and the page that plays them."""
    from mkdocs.structure.files import File

    found = {name: file for name, page in pages().items() if (file := made_of(page)).is_file()}
    missing = len(pages()) - len(found)
    if missing:
        said = "%d recordings of the gallery are not made: their pages show pictures. `python docs/recordings.py`"
        logging.getLogger("mkdocs.hooks.recordings").info(said, missing)
    if found:
        from holokin.app.studio.playback import player

        files.append(File.generated(config, "gallery/recordings/player.html", content=player()))
    for name, file in found.items():
        for kind in (".viser", ".json"):
            source = file.with_suffix(kind)
            files.append(File.generated(config, f"gallery/recordings/{name}{kind}", abs_src_path=str(source)))
    return files


def on_page_markdown(markdown: str, *, page: Any, files: Any, **_: Any) -> str:
    """MkDocs calls this for each page: the code in place of its link, the recording in place of its picture."""
    name = Path(page.file.src_uri)
    if name.parts[:-1] != ("gallery",):
        return markdown
    markdown = EXAMPLE.sub(CODE, markdown)
    if not files.get_file_from_path(f"gallery/recordings/{name.stem}.viser"):
        return markdown
    folder = "../recordings/" if page.file.use_directory_urls else "recordings/"
    return PICTURE.sub(lambda m: FRAME.format(text=escape(m["text"]), folder=folder, name=m["name"]), markdown, count=1)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        if name not in pages():
            sys.exit(f"there is no page {name!r}; known: {', '.join(pages())}")
    for name in sys.argv[1:] or pages():
        file = made_of(pages()[name])
        file = file if file.is_file() else make(pages()[name])
        print(f"{file.relative_to(HERE.parent)}: {file.stat().st_size / 1000:.0f} kB", flush=True)
