"""Reads arrays of a .npz, which may be damaged or malicious: sizes are checked before anything is unpacked."""

from __future__ import annotations

import io
import math
import os
import zipfile
from collections.abc import Callable, Collection, Iterable, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from taxel._base.arguments import refuse_changed
from taxel._base.errors import damaged
from taxel._base.files import open_file
from taxel._base.limits import UNPACKED, unpacked
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError

#: Bytes of the description of an array: NumPy writes at most 64 KiB where it needs no more.
_HEADER = 1 << 16
#: Bytes that are converted at once.
_PIECE = 1 << 20


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
            raise damaged(path, f"{Path(path).suffix} file", first_line(error)) from None


def fields_of(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the names of the fields of a .npy with records, and their second names; empty of any other file.

    Examples
    --------
    >>> import tempfile
    >>> place = Path(tempfile.mkdtemp()) / "a.npy"
    >>> np.save(place, np.zeros(3, [("t", "<i8"), ("x", "<i2")]))
    >>> fields_of(place)
    ('t', 'x')
    """
    try:
        with open_file(path) as file:
            dtype = _described(file)[2]
    # As in `stored_names`.
    except Exception:
        return ()
    return tuple(dtype.fields or ())


def read_array(path: str | os.PathLike[str], dtype: DTypeLike | None = None) -> NDArray[Any]:
    """Read the one array of a .npy.

    Parameters
    ----------
    path : path
    dtype : dtype, optional
        What numbers are converted to, piece by piece, as by `read_arrays`.

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
            shape, _, stored_as = _described(file)
            size, stored = math.prod(shape) * stored_as.itemsize, os.fstat(file.fileno()).st_size - file.tell()
            if stored_as.hasobject:
                raise FormatError(f"{path}: contains Python objects; must be a NumPy array of numbers")
            if dtype is not None and stored_as.kind not in "biuf":
                raise FormatError(f"{path}: contains {stored_as} of shape {shape}; must be a NumPy array of numbers")
            if size > stored:
                raise FormatError(f"{path}: {stored} bytes of values; must be {size}, for {stored_as} of shape {shape}")
            unpacked(str(path), _kept(shape, stored_as, dtype))
            file.seek(0)
            return _read(file, dtype, str(path))
        except (FormatError, MemoryError):
            raise
        # As in `read_arrays`.
        except Exception as error:
            raise FormatError(f"{path}: {first_line(error)}; must be a NumPy array of numbers") from None


def read_arrays(
    path: str | os.PathLike[str],
    names: Iterable[str],
    *,
    texts: Mapping[str, int] | None = None,
    dtypes: Mapping[str, DTypeLike] | None = None,
    chosen: Callable[[Mapping[str, tuple[int, ...]]], Collection[str]] = tuple,
) -> dict[str, NDArray[Any]]:
    """Read those of the wanted arrays that a .npz has.

    Parameters
    ----------
    path : path
    wanted : names of arrays; others are ignored
    texts : dict from the names of those that hold one text to how many characters it may have
    dtypes : dict from name to dtype
        What numbers are converted to, piece by piece as they are read. Values too large for a float become infinite.
    chosen : function of a dict from name to shape
        Which of those that there are are read; it may refuse them by their shapes before any is read.

    Returns
    -------
    dict from name to array

    Raises
    ------
    FormatError : not an archive, damage, Python objects, or more bytes than a file may hold (names the array)
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
            return _arrays(Path(path), file, tuple(names), texts or {}, dtypes or {}, chosen)
        except (FormatError, MemoryError):
            raise
        # NumPy and zipfile raise many kinds of errors on damage: zlib.error, NotImplementedError, TokenError,
        # struct.error, OSError for an archive with a negative offset ...
        except Exception as error:
            raise damaged(path, ".npz file", first_line(error)) from None


def _arrays(
    path: Path,
    file: IO[bytes],
    names: tuple[str, ...],
    texts: Mapping[str, int],
    dtypes: Mapping[str, DTypeLike],
    chosen: Callable[[Mapping[str, tuple[int, ...]]], Collection[str]],
) -> dict[str, NDArray[Any]]:
    """Read the arrays after the sizes of all of them have been checked."""
    columns = {}
    with zipfile.ZipFile(file) as archive:
        members = {name.removesuffix(".npy"): name for name in archive.namelist()}
        described = {}
        for name in (name for name in names if name in members):
            with archive.open(members[name]) as array:
                described[name] = (*_described(array), array.tell())
        there = chosen({name: shape for name, (shape, *_) in described.items()})
        total = 0
        for name in there:
            shape, _, dtype, begin = described[name]
            location = f"{path}, array {name}"
            if dtype.hasobject:
                raise FormatError(f"{location}: contains Python objects; must be numbers or text")
            if name in dtypes and dtype.kind not in "biuf":
                raise FormatError(f"{location}: contains {dtype}; must contain numbers")
            size = math.prod(shape) * dtype.itemsize
            kept = _kept(shape, dtype, dtypes.get(name))
            total += kept
            # NumPy stores a character in 4 bytes.
            unpacked(location, kept, 4 * texts[name] if name in texts else UNPACKED)
            unpacked(location, total)
            stored = archive.getinfo(members[name]).file_size - begin
            if size != stored:
                raise FormatError(f"{location}: {stored} bytes of values; must be {size}, for {dtype} of shape {shape}")
        for name in there:
            with archive.open(members[name]) as array:
                columns[name] = _read(array, dtypes.get(name), f"{path}: {name}")
    return columns


def _described(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Read the shape, whether its first axis is the fastest, and the dtype from the header of an array."""
    read = {1: (np.lib.format.read_array_header_1_0, 2), 2: (np.lib.format.read_array_header_2_0, 4)}
    version = np.lib.format.read_magic(file)
    if version[0] not in read:
        raise ValueError(f"the header has version {version[0]}; taxel reads versions 1 and 2")
    parse, width = read[version[0]]
    field = file.read(width)
    if (length := int.from_bytes(field, "little")) > _HEADER:
        raise ValueError(f"the header has {length} bytes; at most {_HEADER} are read")
    shape, fortran, dtype = parse(io.BytesIO(field + file.read(length)))
    if any(isinstance(n, bool) or n < 0 for n in shape):
        raise ValueError(f"shape {shape}")
    return shape, fortran, dtype


def _kept(shape: tuple[int, ...], stored: np.dtype[Any], dtype: DTypeLike | None) -> int:
    """Return the bytes that an array takes in memory, converted or as it is stored."""
    return math.prod(shape) * (np.dtype(dtype) if dtype is not None and stored.kind in "biuf" else stored).itemsize


def _read(file: IO[bytes], dtype: DTypeLike | None, location: str) -> NDArray[Any]:
    """Read an array whose size was checked; numbers are converted piece by piece, into the order of C.

    Raises
    ------
    FormatError : a number that another dtype than a float does not hold
    """
    begin = file.tell()
    shape, fortran, stored = _described(file)
    if dtype is None or stored.kind not in "biuf" or 0 in shape:
        file.seek(begin)
        return np.lib.format.read_array(file, allow_pickle=False)
    array = np.empty(shape, dtype)
    flat: Any = array.T.flat if fortran else array.reshape(-1)
    step = _PIECE // stored.itemsize
    for start in range(0, array.size, step):
        count = min(step, array.size - start)
        piece = np.frombuffer(file.read(count * stored.itemsize), stored)
        if len(piece) < count:
            raise ValueError(f"the data end after {start + len(piece)} of {array.size} values")
        with np.errstate(over="ignore", invalid="ignore"):
            flat[start : start + count] = converted = piece.astype(dtype)
        if converted.dtype.kind != "f":
            try:
                refuse_changed(location, piece, converted, begin=start)
            except ProblemError as error:
                raise FormatError(str(error)) from None
    return array
