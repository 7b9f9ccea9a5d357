"""Reads arrays of a .npz, which may be damaged or malicious: sizes are checked before anything is unpacked."""

from __future__ import annotations

import math
import os
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.files import open_file
from taxel._base.limits import DESCRIPTION, UNPACKED, unpacked
from taxel._base.messages import first_line
from taxel._core import FormatError

__all__ = ["read_array", "read_arrays", "shapes", "stored_names"]


def stored_names(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the names of the arrays of a .npz; empty if the file is not an archive or cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> place = Path(tempfile.mkdtemp()) / "two.npz"
    >>> np.savez(place, t=[1, 2], x=[3, 4])
    >>> stored_names(place)
    ('t', 'x')
    """
    try:
        with open_file(path) as file, zipfile.ZipFile(file) as archive:
            return tuple(name.removesuffix(".npy") for name in archive.namelist())
    # The errors that zipfile raises on damage are not documented; reading the arrays reports what is wrong.
    except Exception:
        return ()


def shapes(path: str | os.PathLike[str]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the arrays of a .npz, or of the one array of a .npy, whose name is "".

    Raises
    ------
    FormatError : damage
    OSError : the file is not there, or cannot be read

    Examples
    --------
    >>> import tempfile
    >>> place = Path(tempfile.mkdtemp()) / "two.npz"
    >>> np.savez(place, t=[1, 2], x=[[3], [4]])
    >>> shapes(place)
    {'t': (2,), 'x': (2, 1)}
    """
    with open_file(path) as file:
        try:
            if not zipfile.is_zipfile(file):
                file.seek(0)
                return {"": _described(file)[0]}
            found = {}
            with zipfile.ZipFile(file) as archive:
                for name in archive.namelist():
                    if name.endswith(".npy"):
                        with archive.open(name) as array:
                            found[name.removesuffix(".npy")] = _described(array)[0]
            return found
        # As in `read_arrays`.
        except Exception as error:
            raise FormatError(f"{path}: no whole {Path(path).suffix} ({first_line(error)}); write it again") from None


def read_array(path: str | os.PathLike[str]) -> NDArray[Any]:
    """Read the one array of a .npy.

    Raises
    ------
    FormatError : damage, Python objects, or more bytes than the file holds
    OSError : the file is not there, or cannot be read
    MemoryError : as `read_arrays`

    Examples
    --------
    >>> import tempfile
    >>> place = Path(tempfile.mkdtemp()) / "two.npy"
    >>> np.save(place, [1, 2])
    >>> read_array(place)
    array([1, 2])
    """
    with open_file(path) as file:
        try:
            shape, dtype = _described(file)
            size, stored = math.prod(shape) * dtype.itemsize, os.fstat(file.fileno()).st_size - file.tell()
            if dtype.hasobject:
                raise FormatError(f"{path}: holds Python objects; must be a NumPy array of numbers")
            if size > stored:
                raise FormatError(f"{path}: says that it holds {size} bytes ({shape}, {dtype}); there are {stored}")
            unpacked(str(path), size)
            file.seek(0)
            return np.lib.format.read_array(file, allow_pickle=False)
        except (FormatError, MemoryError):
            raise
        # As in `read_arrays`.
        except Exception as error:
            raise FormatError(f"{path}: {first_line(error)}; must be a NumPy array of numbers") from None


def read_arrays(
    path: str | os.PathLike[str], names: Iterable[str], *, texts: Iterable[str] = ()
) -> dict[str, NDArray[Any]]:
    """Read those of the wanted arrays that a .npz has.

    Parameters
    ----------
    path : path
    wanted : names of arrays; others are ignored
    texts : names of those that hold one text: at most 64 Mi characters each

    Returns
    -------
    dict from name to array

    Raises
    ------
    FormatError : no archive, damage, Python objects, or more bytes than a file may hold (names the array)
    OSError : the file is not there, or cannot be read
    MemoryError : within the limits, but not within the memory that there is

    Examples
    --------
    >>> import tempfile
    >>> place = Path(tempfile.mkdtemp()) / "two.npz"
    >>> np.savez(place, t=[1, 2], x=[3, 4])
    >>> read_arrays(place, ["t", "y"])
    {'t': array([1, 2])}
    """
    with open_file(path) as file:
        try:
            return _arrays(Path(path), file, tuple(names), frozenset(texts))
        except (FormatError, MemoryError):
            raise
        # NumPy and zipfile raise many kinds of errors on damage: zlib.error, NotImplementedError, TokenError,
        # struct.error, OSError for an archive with a negative offset ...
        except Exception as error:
            raise FormatError(f"{path}: a .npz that cannot be unpacked ({first_line(error)}); write it again") from None


def _arrays(path: Path, file: IO[bytes], names: tuple[str, ...], texts: frozenset[str]) -> dict[str, NDArray[Any]]:
    """Read the arrays after the sizes of all of them have been checked."""
    columns = {}
    with zipfile.ZipFile(file) as archive:
        members = {name.removesuffix(".npy"): name for name in archive.namelist()}
        there = [name for name in names if name in members]
        total = 0
        for name in there:
            with archive.open(members[name]) as array:
                shape, dtype = _described(array)
                begin = array.tell()
            place = f"{path}, array {name}"
            if dtype.hasobject:
                raise FormatError(f"{place}: holds Python objects; must be numbers or text")
            size = math.prod(shape) * dtype.itemsize
            total += size
            # Python stores a character in up to 4 bytes.
            unpacked(place, size, 4 * DESCRIPTION if name in texts else UNPACKED)
            unpacked(place, total)
            stored = archive.getinfo(members[name]).file_size - begin
            if size != stored:
                raise FormatError(f"{place}: says that it holds {size} bytes ({shape}, {dtype}); there are {stored}")
        for name in there:
            with archive.open(members[name]) as array:
                columns[name] = np.lib.format.read_array(array, allow_pickle=False)
    return columns


def _described(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read the shape and the dtype from the header of an array."""
    read = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}
    version = np.lib.format.read_magic(file)
    if version[0] not in read:
        raise ValueError(f"version {version[0]} of the description; there are 1 and 2")
    shape, _, dtype = read[version[0]](file)
    if any(isinstance(n, bool) or n < 0 for n in shape):
        raise ValueError(f"shape {shape}")
    return shape, dtype
