"""Reads arrays of numbers of .npy, .npz, HDF5 and MATLAB files by name, and writes HDF5 files.

No code of a file is run. A damaged HDF5 or MATLAB file may crash the library that reads it.
"""

from __future__ import annotations

import contextlib
import math
import os
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from taxel._base.arguments import refuse_changed
from taxel._base.errors import damaged, unreadable
from taxel._base.files import write_whole
from taxel._base.limits import check_memory
from taxel._base.messages import first_line
from taxel._core import Error, ProblemError

if TYPE_CHECKING:
    import h5py

#: The endings of files of arrays.
ARRAYS = (".npy", ".npz", ".h5", ".hdf5", ".mat")
#: NumPy's kinds of numbers, and of what else is read: texts and records of numbers.
_NUMBERS, _OTHERS = "biuf", "UV"
#: MATLAB's classes of arrays of numbers, as SciPy names them.
_MATLAB = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}


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
        with open(path, "rb") as file, zipfile.ZipFile(file) as archive:
            return tuple(name.removesuffix(".npy") for name in archive.namelist())
    # The errors that zipfile raises on damage are not documented; reading the arrays reports what is wrong.
    except Exception:
        return ()


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
        with open(path, "rb") as file:
            dtype = _header(file)[1]
    # As in `stored_names`.
    except Exception:
        return ()
    return tuple(dtype.fields or ())


def records_in(path: str | os.PathLike[str]) -> str | None:
    """Return the name of the array of records of a file that holds nothing else; None of any other file.

    Examples
    --------
    >>> import tempfile
    >>> place = Path(tempfile.mkdtemp()) / "a.npz"
    >>> np.savez(place, walk=np.zeros(3, [("t", "<i8"), ("heel", "<f4")]))
    >>> records_in(place)
    'walk'
    """
    try:
        with _stored(Path(path)) as found:
            only = [name for name, array in found.items() if array.dtype.names and len(found) == 1]
    except (Error, OSError):
        return None
    return only[0] if only else None


def columns_of(records: NDArray[Any], above: str = "") -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the columns of records with their names: those of fields, and the places within them.

    Examples
    --------
    >>> fields = [("t", "<i8"), ("palm", [("force", "<f4", 2)])]
    >>> [name for name, _ in columns_of(np.zeros(3, fields))]
    ['t', 'palm.force[0]', 'palm.force[1]']
    """
    for name in records.dtype.names or ():
        values = records[name]
        if values.dtype.names:
            yield from columns_of(values, f"{above}{name}.")
            continue
        for place in np.ndindex(values.shape[1:]):
            yield above + name + "".join(f"[{k}]" for k in place), values[:, *place]


def shapes(path: str | os.PathLike[str], *, with_texts: bool = False) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the arrays of numbers of a file by name; the one of a .npy has the name "".

    Parameters
    ----------
    path : path
    with_texts : bool
        Whether arrays of texts are included.

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
    kinds = _NUMBERS + "U" * with_texts
    with _stored(Path(path)) as found:
        return {name: array.shape for name, array in found.items() if array.dtype.kind in kinds}


def read_arrays(
    path: str | os.PathLike[str], names: Iterable[str], dtypes: Mapping[str, DTypeLike] | None = None
) -> dict[str, NDArray[Any]]:
    """Read those of the named arrays that a file has.

    Parameters
    ----------
    path : path
    names : names of arrays
    dtypes : dict from name to dtype
        What numbers are converted to. Values too large for a float become infinite.

    Returns
    -------
    dict from name to array

    Raises
    ------
    FormatError : damage, no numbers, a number that another dtype than a float does not hold, or an array larger than
        the memory that is available (names the array)
    OSError : the file is not there, or cannot be read

    Examples
    --------
    >>> import tempfile
    >>> place = Path(tempfile.mkdtemp()) / "two.npz"
    >>> np.savez(place, t=[1, 2], x=[3, 4])
    >>> read_arrays(place, ["t", "y"], {"t": np.float32})
    {'t': array([1., 2.], dtype=float32)}
    """
    read = {}
    with _stored(Path(path)) as found:
        for name in names:
            if name in found:
                subject, dtype = f"array {name}: " * bool(name), (dtypes or {}).get(name)
                kinds = _NUMBERS + _OTHERS * (dtype is None)
                read[name] = _read(path, subject, found[name], dtype, kinds)
    return read


@contextlib.contextmanager
def hdf5(path: str | os.PathLike[str]) -> Iterator[h5py.File]:
    """Open a HDF5 file to read it.

    Raises
    ------
    FormatError : a damaged file
    OSError : the file is not there, or cannot be read
    """
    import h5py  # noqa: PLC0415  loads slowly

    # Python's errors are clearer than those of the library.
    open(path, "rb").close()
    with _reading(path, "HDF5 file"), h5py.File(path) as file:
        yield file


def datasets(file: h5py.File) -> dict[str, h5py.Dataset]:
    """Return the data sets of a HDF5 file that have values, by their paths; soft and external links are left out.

    Raises
    ------
    FormatError : the values of a data set are in other files, which may be any that the user can read
    """
    import h5py  # noqa: PLC0415  `hdf5` has loaded it

    items: dict[str, object] = {}
    # What is raised within this call is lost.
    file.visititems(items.__setitem__)
    found = {name: item for name, item in items.items() if isinstance(item, h5py.Dataset) and item.shape is not None}
    for name, item in found.items():
        if item.external or item.is_virtual:
            raise unreadable(f"data set {name}: its values are in other files; save them in this file", file.filename)
    return found


def write_hdf5(path: str | os.PathLike[str], write: Callable[[h5py.File], object], *, overwrite: bool = False) -> None:
    """Write a HDF5 file as a whole, or nothing: it is complete in memory before the disk has any of it.

    Parameters
    ----------
    path : path
    write : function of an open HDF5 file
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    FileExistsError : the file is there already and `overwrite` is false
    OSError : the folder is missing, the disk is full ...
    """
    import h5py  # noqa: PLC0415  loads slowly

    # The library crashes some time after a write to a full disk.
    with h5py.File("in memory", "w", driver="core", backing_store=False) as file:
        write(file)
        file.flush()
        image = file.id.get_file_image()
    write_whole(path, lambda out: out.write(image), overwrite=overwrite)


@dataclass(frozen=True)
class _Stored:
    """Describe an array of a file, and hold how it is read."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    read: Callable[[], NDArray[Any]]


@contextlib.contextmanager
def _stored(path: Path) -> Iterator[dict[str, _Stored]]:
    """Yield the arrays of a file by name."""
    with open(path, "rb") as file:
        head = file.read(10)
    ending = path.suffix.lower()
    is_matlab = ending == ".mat"
    if head.startswith(b"\x89HDF") or head == b"MATLAB 7.3" or ending in (".h5", ".hdf5"):
        with hdf5(path) as opened:
            # An object of MATLAB is a number that points into others, which begin with "#".
            found = {name: data for name, data in datasets(opened).items() if not (is_matlab and name.startswith("#"))}
            own = {name: data for name, data in found.items() if "MATLAB_object_decode" not in data.attrs}
            if len(own) < len(found) and not own:
                raise _of_objects(path)
            yield {name: _of_dataset(data, is_matlab=is_matlab) for name, data in own.items()}
    elif is_matlab:
        yield _of_matlab(path)
    elif head.startswith(b"\x93NUMPY") or ending == ".npy":
        with _reading(path, ".npy file"):
            yield {"": _of_numpy(lambda: path.open("rb"))}
    else:
        with _reading(path, ".npz file"), zipfile.ZipFile(path) as archive:
            members = [name for name in archive.namelist() if name.endswith(".npy")]
            yield {name.removesuffix(".npy"): _of_numpy(partial(archive.open, name)) for name in members}


@contextlib.contextmanager
def _reading(path: str | os.PathLike[str], kind: str) -> Iterator[None]:
    """Name the file in the errors of a library; those that damage causes are not documented."""
    try:
        yield
    except (Error, MemoryError):
        raise
    except Exception as error:
        raise damaged(path, kind, first_line(error)) from None


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read the shape and the dtype from the header of an array."""
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    shape, _, dtype = readers[np.lib.format.read_magic(file)](file)
    return shape, dtype


def _of_numpy(opened: Callable[[], IO[bytes]]) -> _Stored:
    """Describe an array in NumPy's format: a file, or one within a .npz."""
    with opened() as file:
        shape, dtype = _header(file)

    def read() -> NDArray[Any]:
        with opened() as file:
            array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
            return array

    return _Stored(shape, dtype, read)


def _of_matlab(path: Path) -> dict[str, _Stored]:
    from scipy.io import loadmat, whosmat  # noqa: PLC0415  loads slowly

    def read(name: str) -> NDArray[Any]:
        with _reading(path, "MATLAB file"):
            values: NDArray[Any] = loadmat(path, variable_names=[name])[name]
            return values

    with _reading(path, "MATLAB file"):
        try:
            found = [(name, shape) for name, shape, kind in whosmat(path) if kind in _MATLAB]
        except TypeError:
            raise _of_objects(path) from None
    # The width of numbers that are stored in fewer bytes than their class has is known when they are read.
    return {name: _Stored(shape, np.dtype(np.float64), partial(read, name)) for name, shape in found}


def _of_objects(path: Path) -> Error:
    """Return the error of a file of objects of MATLAB, as its tables are."""
    right = "save its columns, for a table by writetable(T, 'FILE.csv')"
    return unreadable(f"contains an object of MATLAB, which taxel does not read; {right}", path)


def _of_dataset(data: h5py.Dataset, *, is_matlab: bool = False) -> _Stored:
    """Describe a data set; HDF5 has MATLAB's axes in reverse."""
    import h5py  # noqa: PLC0415  `hdf5` has loaded it

    try:
        dtype = data.dtype
    # Not every type of HDF5 is one of NumPy.
    except (TypeError, ValueError):
        dtype = np.dtype(object)
    if h5py.check_string_dtype(dtype) is not None:
        return _Stored(data.shape, np.dtype(np.str_), lambda: np.array(data.asstr()[()], np.str_))
    if is_matlab:
        return _Stored(data.shape[::-1], dtype, lambda: np.asarray(data[()]).T)
    return _Stored(data.shape, dtype, lambda: np.asarray(data[()]))


def _read(
    path: str | os.PathLike[str], subject: str, stored: _Stored, dtype: DTypeLike | None, kinds: str
) -> NDArray[Any]:
    """Read an array of some of NumPy's kinds, and convert it where a dtype is given; errors begin with `subject`."""
    kept = stored.dtype if dtype is None else np.dtype(dtype)
    if stored.dtype.hasobject or stored.dtype.kind not in kinds:
        right = "texts" if kinds == "U" else "numbers"
        raise unreadable(f"{subject}contains {stored.dtype}; must contain {right}", path)
    sizes = {stored.dtype: stored.dtype.itemsize, kept: kept.itemsize}
    check_memory(path, math.prod(stored.shape) * sum(sizes.values()), subject)
    values = stored.read()
    # MATLAB's files say only here whether numbers are complex.
    if values.dtype.kind not in kinds:
        raise unreadable(f"{subject}contains {values.dtype}; must contain numbers", path)
    if dtype is None:
        return values
    with np.errstate(over="ignore", invalid="ignore"):
        converted = np.asarray(values, kept, order="C")
    if kept.kind != "f":
        try:
            refuse_changed(subject.removeprefix("array ").removesuffix(": ") or "values", values, converted)
        except ProblemError as error:
            raise unreadable(str(error), path) from None
    return converted
