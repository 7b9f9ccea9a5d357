"""Writes files atomically, and overwrites existing files only on request."""

from __future__ import annotations

import errno
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from taxel._base.arguments import checked_path, flag

#: What file systems answer that have no hard links.
_NO_LINK = (errno.EPERM, errno.ENOTSUP, errno.EMLINK, errno.ENOSYS)


def beside(path: Path, name: str) -> Path:
    """Return the place of a file of this name in the folder of a file or folder.

    Examples
    --------
    >>> str(beside(Path("data/walk.mcap"), "walk.notes.csv"))
    'data/walk.notes.csv'
    """
    return named(path).parent / name


def named(path: Path) -> Path:
    """Return a path whose last part is a name: "." and ".." as the folder that they stand for."""
    return path if path.name not in ("", "..") else path.resolve()


def write_whole(path: str | os.PathLike[str], write: Callable[[BinaryIO], object], *, overwrite: bool = False) -> Path:
    """Write a temporary file in the same folder, then move it to `path`.

    Parameters
    ----------
    path : path
    write : function of a binary file
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path

    Raises
    ------
    FileExistsError : the file is there already and `overwrite` is false
    OSError : the folder is missing, the disk is full ...
    """
    with whole_file(path, overwrite=overwrite) as part, part.open("wb") as file:
        write(file)
        file.flush()
        os.fsync(file.fileno())
    return Path(path)


@contextmanager
def whole_file(path: str | os.PathLike[str], *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary path in the same folder; move the file to `path` if the block ends without an error.

    A file that is replaced keeps its permissions.

    Raises
    ------
    FileExistsError : the file is there already and `overwrite` is false
    PermissionError : the file is there already and write-protected
    OSError : a folder, a device or a pipe has that name, the folder is missing, the disk is full ...
    """
    target = Path(checked_path("path", path))
    overwrite = flag("overwrite", overwrite)
    if not overwrite and os.path.lexists(target):
        raise FileExistsError(errno.EEXIST, "exists already; give overwrite=True to replace it", str(target))
    # A rename would replace a device by a file: /dev/null for all programs, where a superuser asks for it.
    if target.exists() and not target.is_file():
        raise OSError(errno.EINVAL, "is not a regular file; taxel replaces only regular files", str(target))
    # A rename checks the permissions of the folder only; a write-protected file is refused here, also for the
    # superuser.
    if target.exists() and not (target.stat().st_mode & 0o222 and os.access(target, os.W_OK)):
        raise PermissionError(errno.EACCES, "is write-protected", str(target))
    if not target.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(target.parent))
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
    except OSError as error:
        error.filename = str(target)
        raise
    os.close(handle)
    try:
        yield Path(name)
        os.chmod(name, stat.S_IMODE(target.stat().st_mode) if target.exists() else 0o666 & ~_umask())
        if overwrite:
            os.replace(name, target)
        else:
            create(name, target)
    except BaseException as error:
        Path(name).unlink(missing_ok=True)
        if isinstance(error, OSError):
            error.filename = str(target)
            if sys.platform == "win32" and isinstance(error, PermissionError):
                error.strerror = "another program has it open, or the folder is write-protected"
            # Python shows a second name also where it is None.
            del error.filename2
        raise


def create(name: str | os.PathLike[str], target: str | os.PathLike[str]) -> None:
    """Give a new file its name in one step.

    Raises
    ------
    FileExistsError : another process has created a file of that name meanwhile
    """
    if sys.platform == "win32":
        # Fails if there is a file.
        os.rename(name, target)
        return
    try:
        # A link, unlike a rename, fails if there is a file.
        os.link(name, target)
    except OSError as error:
        if error.errno not in _NO_LINK:
            raise
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        os.replace(name, target)
    else:
        os.unlink(name)


class _Writable(Exception):  # noqa: N818  no error
    """Ends a test of whether a file can be written."""


def check_writable(path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Check that a file can be written, before the work whose result it will hold; leave no file behind.

    Raises
    ------
    As `whole_file`.
    """
    with suppress(_Writable), whole_file(path, overwrite=overwrite):
        raise _Writable


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
