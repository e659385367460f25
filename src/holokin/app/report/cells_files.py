"""`CellsFiles`: where `holokin certify --workspace` keeps the cells of each strategy until certificates are written."""

from __future__ import annotations

from pathlib import Path as FilePath

from ...base.errors import ArgumentError
from ...base.files import writing
from ...proof.kept_cells import count_kept, remove_kept
from .result_folder import free_name

ENDING = ".cells"


class CellsFiles:
    """The files `<stem>-<strategy>.cells`, beside the folder of the certificates."""

    def __init__(self, stem: FilePath, resume: bool) -> None:
        self._stem, self._resume, self._files = stem, resume, dict[str, FilePath]()

    def of(self, title: str) -> FilePath:
        """That of a strategy. Raises: ArgumentError: it is there, and the run is not to go on with it."""
        taken = {file.name for file in self._files.values()}
        file = self._stem.with_name(free_name(title, ENDING, taken, prefix=f"{self._stem.name}-"))
        if file.exists() and not self._resume:
            cure = "a run that was stopped left it: say --resume to go on with its cells, or delete it"
            raise ArgumentError("the file of cells", str(file), cure)
        self._files[title] = file
        return file

    @property
    def count(self) -> int:
        """Cells that are kept in all of them."""
        return sum(count_kept(file) for file in self._files.values() if file.is_file())

    def remove(self) -> None:
        """Delete them: the certificates are written. Raises: WriteError."""
        for file in self._files.values():
            with writing(file):
                remove_kept(file)
