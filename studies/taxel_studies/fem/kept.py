"""Courses of indentations stored in a folder, used again only by the code that computed them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from taxel_studies.commit import code_version
from taxel_studies.fem.indentation import Course, Indentation, press

__all__ = ["KeptCourses"]


class KeptCourses:
    """Store courses in a folder that the caller names.

    Parameters
    ----------
    folder : path
        Must be there.
    code : str, optional
        Which code runs: courses of other code are not found. As `code_version` returns it, also where this
        is not given; in a checkout with local changes each `KeptCourses` then has courses of its own.

    Raises
    ------
    FileNotFoundError : no such folder

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     kept = KeptCourses(folder)
    ...     small = Indentation(depth_mm=0.1, mesh_mm=0.5, step_um=100)
    ...     before, course, after = small in kept, kept.made(small), small in kept
    >>> before, after
    (False, True)
    """

    def __init__(self, folder: str | Path, code: str | None = None) -> None:
        self.folder = Path(folder)
        if not self.folder.is_dir():
            raise FileNotFoundError(2, "No such folder", str(self.folder))
        self.code = code_version("taxel", "taxel_studies") if code is None else code

    def path(self, asked: Indentation) -> Path:
        """Return the path of a course's file: its name has object and path, and a digest of the rest."""
        all_of_it = json.dumps([asked.to_dict(), self.code], sort_keys=True)
        digest = hashlib.sha256(all_of_it.encode()).hexdigest()[:16]
        return self.folder / f"{asked.diameter_mm:g}mm-{asked.modulus_kpa:g}kPa-{asked.angle_deg:g}deg-{digest}.npz"

    def __contains__(self, asked: Indentation) -> bool:
        return self.path(asked).exists()

    def __getitem__(self, asked: Indentation) -> Course:
        """Return a stored course.

        Raises
        ------
        FileNotFoundError : it is not
        FormatError : its file is damaged
        """
        return Course.load(self.path(asked))

    def add(self, course: Course) -> Path:
        """Write a course into the folder; one that is there already is left."""
        path = self.path(course.indentation)
        return path if path.exists() else course.save(path, made_by=self.code, overwrite=True)

    def made(self, asked: Indentation) -> Course:
        """Return a course; compute and store it where it is missing."""
        if asked not in self:
            self.add(press(asked))
        return self[asked]
