"""The recordings of the gallery. `python docs/recordings.py [NAME...]` makes those that are missing or out of date.

Each section of docs/gallery.md with a picture of docs/gallery/ names an example, whose `motions` of its `robot`, among
its `obstacles`, are recorded; the text of the picture is the caption. As a hook of MkDocs this file puts the recordings
that there are into the site: a click on a picture plays its own. Without them (they need the extra `studio`) the site
has the pictures only.
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
from typing import Any, NamedTuple

HERE = Path(__file__).parent
PAGE = HERE / "gallery.md"
MADE = HERE.parent / "build" / "recordings"
MAKERS = tuple(
    f"src/holokin/{file}.py" for file in ("app/studio/playback", "app/studio/page_scene", "app/report/robot_view")
)
"""What a recording depends on, beside its section and its example."""

EXAMPLE = re.compile(r"^\[`(examples/\w+\.py)`\]\(\.\./\1\)$", re.MULTILINE)
"""A link to the example, for who reads the page as it is; the site has the code in its place."""
CODE = '??? example "\\1"\n    ``` py\n    --8<-- "\\1"\n    ```'
PICTURE = re.compile(r"^!\[(?P<text>[^\]]+)\]\(gallery/(?P<name>[\w-]+)\.png\)$", re.MULTILINE)
FRAME = """<figure class="recording" markdown="0">
<a href="{folder}recordings/player.html?playbackPath={name}.viser" title="{text}" onclick="{play}">
<img alt="{text}" src="{folder}{name}.png"></a>
<figcaption>{text} Click to play; then drag to turn it, scroll to come nearer.</figcaption>
</figure>"""
PLAY = (
    "const player = document.createElement('iframe'); player.src = this.href; player.title = this.title;"
    " this.replaceWith(player); return false"
)


class Shown(NamedTuple):
    """A recording of the page: its title, its caption, and the example that it is made of."""

    title: str
    text: str
    example: Path


def sections() -> dict[str, Shown]:
    """Name -> what the page says of each recording."""
    found = {}
    for section in PAGE.read_text("utf-8").split("\n## ")[1:]:
        if picture := PICTURE.search(section):
            example = EXAMPLE.search(section)
            if not example:
                raise SystemExit(f"{PAGE}: below {picture['name']}.png the link to its example is missing")
            found[picture["name"]] = Shown(section.partition("\n")[0], picture["text"], HERE.parent / example[1])
    return found


def made_of(name: str) -> Path:
    """Where a recording is, if it is up to date: its name says of what it was made."""
    title, text, example = sections()[name]
    sources = b"".join((HERE.parent / file).read_bytes() for file in MAKERS) + example.read_bytes()
    return MADE / f"{name}-{hashlib.sha256(sources + f'{title}{text}'.encode()).hexdigest()[:12]}.viser"


def make(name: str) -> Path:
    """Run the example of a section and record what it did."""
    from holokin.app.studio import record

    title, text, example = sections()[name]
    file, back = made_of(name), Path.cwd()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        os.chdir(folder)
        try:
            shown = runpy.run_path(str(example))
        finally:
            os.chdir(back)
    recording = record(shown["robot"], shown["motions"], title=title, text=text, obstacles=shown.get("obstacles", ()))
    MADE.mkdir(parents=True, exist_ok=True)
    for old in MADE.glob(f"{name}-????????????.*"):
        old.unlink()
    file.with_suffix(".json").write_text(json.dumps(recording.caption), "utf-8")
    file.write_bytes(recording.scene)
    return file


def on_files(files: Any, *, config: Any) -> Any:
    """MkDocs calls this with all files of the site: the recordings come in, and the page that plays them."""
    from mkdocs.structure.files import File

    names = sections()
    found = {name: file for name in names if (file := made_of(name)).is_file()}
    missing = len(names) - len(found)
    if missing:
        said = "%d recordings of the gallery are not made: the page shows pictures. `python docs/recordings.py`"
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
    """MkDocs calls this for each page: the code in place of its link, the recording behind its picture."""
    if page.file.src_uri != PAGE.name:
        return markdown
    folder = "" if page.file.use_directory_urls else "gallery/"

    def framed(picture: re.Match[str]) -> str:
        name = picture["name"]
        if not files.get_file_from_path(f"gallery/recordings/{name}.viser"):
            return picture[0]
        return FRAME.format(text=escape(picture["text"]), folder=folder, name=name, play=PLAY)

    return PICTURE.sub(framed, EXAMPLE.sub(CODE, markdown))


if __name__ == "__main__":
    for name in sys.argv[1:]:
        if name not in sections():
            sys.exit(f"there is no recording {name!r}; known: {', '.join(sections())}")
    for name in sys.argv[1:] or sections():
        file = made_of(name)
        file = file if file.is_file() else make(name)
        print(f"{file.relative_to(HERE.parent)}: {file.stat().st_size / 1000:.0f} kB", flush=True)
