"""Reads arrays of numbers of a MATLAB file of level 5, before version 7.3; `scipy.io` crashes at some damaged ones.

Source: MathWorks, MAT-File Format, "Level 5 MAT-Files".
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.errors import damaged
from taxel._base.files import open_file
from taxel._base.limits import unpacked
from taxel._base.messages import first_line
from taxel._core import FormatError

#: How a file of version 7.3 begins, which is a HDF5 file.
_HDF5 = b"MATLAB 7.3"
#: Bytes of the header, whose last two are the byte order; bytes of the tag of an element.
_HEADER, _TAG = 128, 8
#: Kinds of elements; NumPy's names of those of numbers.
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
#: MATLAB's classes of arrays of numbers, full ones; the flag of complex ones.
_CLASSES, _COMPLEX = range(6, 16), 0x0800
#: Bytes of a matrix in which its class, shape and name are.
_BEGINNING = 1 << 12


def is_mat_in_hdf5(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is one that MATLAB saved with -v7.3."""
    with open_file(path) as file:
        return file.read(len(_HDF5)) == _HDF5


def mat_shapes(path: str | os.PathLike[str]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the arrays of real numbers of a MATLAB file by name.

    Raises
    ------
    FormatError : another file, or damage
    OSError : the file is not there, or cannot be read

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from scipy.io import savemat
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "two.mat"
    >>> savemat(place, {"pressure": np.zeros((2, 16, 9)), "t": np.zeros((9, 1)), "name": "walk"})
    >>> mat_shapes(place)
    {'pressure': (2, 16, 9), 't': (9, 1)}
    """
    return {matrix.name: matrix.shape for matrix in _matrices(path)}


def read_mat(path: str | os.PathLike[str], names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Return arrays of numbers of a MATLAB file.

    Raises
    ------
    FormatError : another file, damage, or more bytes than a file may hold
    OSError : the file is not there, or cannot be read
    """
    found = {matrix.name: matrix for matrix in _matrices(path)}
    unpacked(str(path), sum(_TAG * math.prod(found[name].shape) for name in names))
    try:
        return {name: found[name].values() for name in names}
    except (ValueError, struct.error, zlib.error, KeyError) as error:
        raise damaged(path, "MATLAB file", first_line(error)) from None


@dataclass(frozen=True)
class _Matrix:
    """Hold where a matrix is: the bytes of its element, which may be compressed, and where its numbers begin."""

    name: str
    shape: tuple[int, ...]
    order: str
    element: bytes
    is_compressed: bool
    begin: int

    def values(self) -> NDArray[Any]:
        """Return the numbers; MATLAB stores them column by column."""
        most = self.begin + 2 * _TAG + _TAG * math.prod(self.shape)
        data = zlib.decompressobj().decompress(self.element, most) if self.is_compressed else self.element
        kind, numbers, _ = _part(data, self.begin, self.order)
        return np.frombuffer(numbers, f"{self.order}{_NUMBERS[kind]}").reshape(self.shape, order="F")


def _matrices(path: str | os.PathLike[str]) -> Iterator[_Matrix]:
    """Yield the matrices of real numbers of a file."""
    with open_file(path) as file:
        unpacked(str(path), os.fstat(file.fileno()).st_size)
        data = file.read()
    order = {b"IM": "<", b"MI": ">"}.get(data[_HEADER - 2 : _HEADER])
    if order is None:
        raise FormatError(f"{path}: not a MATLAB file of version 5 to 7.3; save it in MATLAB with -v7")
    at = _HEADER
    try:
        while at < len(data):
            kind, count = struct.unpack_from(f"{order}II", data, at)
            element = data[at + _TAG : at + _TAG + count]
            if len(element) < count:
                raise ValueError(f"byte {at} begins a part of {count} bytes, but only {len(element)} follow")
            found = _matrix(element, kind, order)
            if found is not None:
                yield found
            at += _TAG + count
    except (ValueError, struct.error, zlib.error, KeyError) as error:
        raise damaged(path, "MATLAB file", first_line(error)) from None


def _matrix(element: bytes, kind: int, order: str) -> _Matrix | None:
    """Return the matrix of real numbers that an element is; None of any other."""
    if kind not in (_MATRIX, _COMPRESSED):
        return None
    head, begin = element[:_BEGINNING], 0
    if kind == _COMPRESSED:
        head, begin = zlib.decompressobj().decompress(element, _BEGINNING), _TAG
        if struct.unpack_from(f"{order}I", head)[0] != _MATRIX:
            return None
    _, flags, begin = _part(head, begin, order)
    (word,) = struct.unpack_from(f"{order}I", flags)
    if (word & 0xFF) not in _CLASSES or word & _COMPLEX:
        return None
    _, sizes, begin = _part(head, begin, order)
    shape = tuple(np.frombuffer(sizes, f"{order}i4").tolist())
    if min(shape, default=-1) < 0:
        raise ValueError(f"an array of shape {shape}")
    _, name, begin = _part(head, begin, order)
    return _Matrix(name.decode("ascii"), shape, order, element, kind == _COMPRESSED, begin)


def _part(data: bytes, at: int, order: str) -> tuple[int, bytes, int]:
    """Return the kind and the bytes of a part of a matrix, and where the next part begins."""
    (word,) = struct.unpack_from(f"{order}I", data, at)
    if count := word >> 16:
        # A small part has its bytes in its tag.
        kind, begin, end = word & 0xFFFF, at + 4, at + _TAG
    else:
        kind, (count,) = word, struct.unpack_from(f"{order}I", data, at + 4)
        begin, end = at + _TAG, at + _TAG + -(-count // _TAG) * _TAG
    part = data[begin : begin + count]
    if len(part) < count:
        raise ValueError(f"an array states {count} bytes, but only {len(part)} follow")
    return kind, part, end
