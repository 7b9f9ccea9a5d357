"""Checks of a caller's arguments; each error names the argument."""

from __future__ import annotations

import json
import math
import operator
import os
import re
import sys
from collections.abc import Callable, Collection, Mapping
from typing import Any, SupportsIndex, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.errors import refused
from taxel._base.messages import plain, warn
from taxel._core import ProblemError

T = TypeVar("T")
R = TypeVar("R")


#: The most characters of a value that an error shows.
_SHOWN = 60
#: Half of a surrogate pair, which UTF-8 cannot hold.
_HALF = re.compile("[\ud800-\udfff]")
#: A window up to there is more likely stated in another unit, us.
_SMALL_US = 10_000


def shown(value: object) -> str:
    """Return the representation of a value for an error: one line, at most 60 characters; a whole number as typed."""
    if isinstance(value, float) and value.is_integer():
        return plain(value)
    try:
        words = " ".join(repr(_beginning(value)).split())
    except Exception:  # a caller's class may raise any error
        return f"a {type(value).__name__} that cannot be shown"
    words = words.encode("ascii", "backslashreplace").decode() if _HALF.search(words) else words
    return words if len(words) <= _SHOWN else f"{words[: _SHOWN - 3]}..."


def short(name: str) -> str:
    """Return a name that an error states, or the beginning of a long one."""
    return name if len(name) <= _SHOWN else shown(name)


def _beginning(value: object, depth: int = 3) -> object:
    """Return the part of a long value that an error can show: each entry needs at least one character."""
    if type(value) in (str, bytes):
        return value[: _SHOWN + 1]  # type: ignore[index]
    if type(value) is list and depth:
        return [_beginning(entry, depth - 1) for entry in value[: _SHOWN + 1]]
    if type(value) is tuple and depth:
        return tuple(_beginning(entry, depth - 1) for entry in value[: _SHOWN + 1])
    return value


def instance(name: str, value: object, *kinds: type[T]) -> T:
    """Return a value of one of the given classes; refuse any other."""
    if not isinstance(value, kinds):
        raise refused(name, f" is {shown(value)}: must be a {' or '.join(map(public_name, kinds))}")
    return value


def public_name(kind: type[object]) -> str:
    """Return the name by which a class of taxel is imported: that of the outermost package that has it."""
    parts = kind.__module__.split(".")
    packages = [".".join(parts[: k + 1]) for k in range(len(parts))]
    found = (name for name in packages if getattr(sys.modules.get(name), kind.__name__, None) is kind)
    return f"{next(found, kind.__module__)}.{kind.__name__}"


def several(name: str, values: object) -> list[Any]:
    """Return the entries of an iterable as a list; refuse any other value."""
    try:
        return list(values)  # type: ignore[call-overload, no-any-return]
    except TypeError:
        raise refused(name, f" is {shown(values)}: must be a sequence") from None


def optional(check: Callable[[str, T], R], name: str, value: T | None) -> R | None:
    """Return what a check returns for a value; None for None."""
    return None if value is None else check(name, value)


def callback(name: str, value: T) -> T:
    """Return a callable; refuse any other value."""
    if not callable(value):
        raise refused(name, f" is {shown(value)}: must be a function")
    return value


def mapping(name: str, value: object) -> dict[str, Any]:
    """Return a mapping as a dict; refuse any other value."""
    if not isinstance(value, Mapping):
        raise refused(name, f" is {shown(value)}: must be a dict (names and values)")
    return {text(f"a name in {name}", key): entry for key, entry in value.items()}


#: Classes of which NumPy makes floats although they are no numbers.
_NO_NUMBERS = (str, bytes, type(None), np.timedelta64, np.datetime64)


def _refuse_units(name: str, values: object) -> None:
    """Refuse what NumPy would read without its unit or its mask: quantities, masked arrays, and a list of them."""
    kinds = {type(values), *(map(type, values) if isinstance(values, list | tuple) else ())}
    has_units = any(hasattr(kind, word) for kind in kinds for word in ("units", "unit", "dimensions"))
    if has_units or isinstance(values, np.ma.MaskedArray):
        raise refused(name, f" is {shown(values)}: must be plain numbers, without a unit or a mask")


def number(name: str, value: object) -> float:
    """Return a float, which may be infinite; refuse any other value, and NaN."""
    real = _real(name, value)
    if math.isnan(real):
        raise refused(name, " is nan: must be a number")
    return real


def _real(name: str, value: object) -> float:
    """Return a float, NaN too; refuse any other value. -0.0 becomes 0.0, as no argument means anything else by it."""
    if isinstance(value, bool | np.timedelta64) or not isinstance(value, int | float | np.integer | np.floating):
        raise refused(name, f" is {shown(value)}: must be a number")
    try:
        return float(value) + 0.0
    except OverflowError:
        raise refused(name, f" is {shown(value)}: must fit a float") from None


def finite(name: str, value: object, *, least: float = -math.inf, most: float = math.inf) -> float:
    """Return a finite float from `least` to `most`; refuse any other value."""
    real = _real(name, value)
    if not (math.isfinite(real) and least <= real <= most):
        low, high = math.isfinite(least), math.isfinite(most)
        right = f"{least:g} or more and finite" if low else f"at most {most:g} and finite" if high else "finite"
        right = f"from {least:g} to {most:g}" if low and high else right
        raise refused(name, f" is {shown(value)}: must be {right}")
    return real


def integer(name: str, value: object, least: int = -(2**63), most: int = 2**63 - 1) -> int:
    """Return a whole number within limits; a float with an integer value passes."""
    real = isinstance(value, float | np.floating) and float(value).is_integer()
    is_whole = real or (isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64))
    if not is_whole or not least <= value <= most:  # type: ignore[operator]
        low, high = ("-2^63" if least == -(2**63) else least), ("2^63 - 1" if most == 2**63 - 1 else most)
        raise refused(name, f" is {shown(value)}: must be a whole number from {low} to {high}")
    return int(value)  # type: ignore[call-overload, no-any-return]


def flag(name: str, value: object) -> bool:
    """Return a boolean; refuse any other value."""
    if not isinstance(value, bool | np.bool_):
        raise refused(name, f" is {shown(value)}: must be True or False")
    return bool(value)


def text(name: str, value: object, among: Collection[str] = ()) -> str:
    """Return a text; if `among` is given, one of its entries."""
    if not isinstance(value, str) or (among and value not in among):
        expected = f"one of {', '.join(map(repr, among))}" if among else "a text"
        raise refused(name, f" is {shown(value)}: must be {expected}")
    if _HALF.search(value):
        raise refused(name, f" is {shown(value)}: must be a text that UTF-8 can encode")
    return value


def checked_path(name: str, value: object) -> str:
    """Return a path; refuse any other value (Python would read a number as the descriptor of an open file)."""
    plain = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    try:
        encoded = os.fsencode(plain) if isinstance(plain, str) else b""
    except UnicodeEncodeError:  # half of a surrogate pair, which no file name can contain
        encoded = b""
    if not isinstance(plain, str) or not encoded or b"\0" in encoded:
        raise refused(name, f" is {shown(value)}: must be a path")
    return plain


def window(unit: str, start: object, stop: object) -> tuple[float, float]:
    """Return an interval of time whose start is not after its stop; either may be infinite."""
    first, last = number("start", start), number("stop", stop)
    if not first <= last:
        raise ProblemError(f"window {plain(first)} to {plain(last)} {unit}: start must not be after stop")
    return first, last


def say_if_missed(noun: str, t: NDArray[np.int64], start: float, stop: float) -> None:
    """Warn of a window (us) before or between all times, if it is as small as one that is stated in s or ms."""
    if len(t) and 0 <= start < stop <= _SMALL_US < t[-1] and not ((start <= t) & (t < stop)).any():
        there = f"the {noun}s are from {t.min()} to {t.max()} us"
        warn(f"between takes us: no {noun} is from {plain(start)} to {plain(stop)} us; {there}", stacklevel=3)


def numbers(name: str, values: ArrayLike, dtype: type[Any], unit: str = "") -> NDArray[Any]:
    """Return a contiguous array of any shape; refuse what is not numbers, or what the conversion would change.

    `unit`, of whole numbers, is said in the error: it is most often another one.
    """
    _refuse_units(name, values)
    try:
        received = np.asarray(values)
        if received.dtype == object:
            _refuse_others(name, received)
        if received.size == 0 and received.dtype.kind not in "biuf":
            received = received.astype(dtype)
        if received.dtype.kind not in "biufO":
            raise refused(name, f": contains {received.dtype}; must contain numbers")
        with np.errstate(invalid="ignore", over="ignore"):
            # A field of a single record is contiguous but may not be aligned.
            array = np.require(received, dtype, ["C", "A"]).reshape(received.shape)
    except (TypeError, ValueError, OverflowError) as error:
        raise refused(name, f": {error}") from None
    refuse_changed(name, received, array, unit)
    return array


def refuse_changed(name: str, received: NDArray[Any], array: NDArray[Any], unit: str = "") -> None:
    """Refuse values that a conversion of `received` to `array` changed."""
    if received.dtype == array.dtype:
        return
    index = _first_changed(np.atleast_1d(received), np.atleast_1d(array))
    if index is not None:
        where = f"[{', '.join(map(str, index))}]" if received.ndim else ""
        found = np.atleast_1d(received)[index]
        value = shown(found.item() if isinstance(found, np.generic) else found)
        expected = {"b": "True or False", "f": "a number that fits"}.get(array.dtype.kind, "a whole number that fits")
        fits = "" if array.dtype.kind == "b" else f" {array.dtype.name}"
        raise refused(f"{name}{where}", f" is {value}: must be {expected}{fits}" + f", in {unit}" * bool(unit))


def _first_changed(received: NDArray[Any], array: NDArray[Any]) -> tuple[int, ...] | None:
    """Return the place of the first value that a conversion changed; None if there is none.

    A float may be rounded (to float32) but must not become infinite.
    """
    to_float = array.dtype.kind == "f"
    # Whole numbers of 64 bits fit a float of 32.
    if not array.size or (to_float and received.dtype.kind in "biu"):
        return None
    changed = np.isinf(array) & ~np.isinf(received.astype(np.float64)) if to_float else received != array
    if not changed.any():
        return None
    return tuple(map(int, np.unravel_index(int(np.argmax(changed)), changed.shape)))


def _refuse_others(name: str, values: NDArray[Any]) -> None:
    """Refuse entries of an array of objects that NumPy converts although they are not numbers: texts, None, spans."""
    if any(issubclass(kind, _NO_NUMBERS) for kind in set(map(type, values.flat))):
        index, value = next((at, entry) for at, entry in np.ndenumerate(values) if isinstance(entry, _NO_NUMBERS))
        where = f"[{', '.join(map(str, index))}]" if index else ""
        raise refused(f"{name}{where}", f" is {shown(value)}: must be a number")


def finite_numbers(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return a contiguous float64 array of any shape; refuse other values, infinity and NaN."""
    array = numbers(name, values, np.float64)
    if not np.isfinite(array).all():
        index = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        where = f"[{', '.join(map(str, index))}]" if index else ""
        raise refused(f"{name}{where}", f" is {shown(array[index].item())}: must be finite")
    return array


def column(name: str, values: ArrayLike, dtype: type[Any], unit: str = "") -> NDArray[Any]:
    """Return a contiguous array of one dimension; refuse values that the conversion would change."""
    array = numbers(name, values, dtype, unit)
    if array.ndim != 1:
        raise refused(name, f" has {array.ndim} dimensions: must have one")
    return array


def floats(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return a contiguous float64 array of one dimension; refuse any other value."""
    return column(name, values, np.float64)


def rows(name: str, chosen: object, length: int) -> NDArray[Any]:
    """Return a mask over all rows, or row numbers, as an index; refuse any other value."""
    try:
        index = np.asarray(chosen)
    except ValueError:
        index = np.empty(0, object)
    if index.size == 0 and index.ndim == 1 and index.dtype.kind in "fi":
        return index.astype(np.int64)
    if index.ndim != 1 or index.dtype.kind not in "biu":
        raise refused(name, f"[{shown(chosen)}]: choose by a slice, a mask or whole numbers")
    if index.dtype.kind == "b" and len(index) != length:
        raise refused(name, f": the mask has {len(index)} entries; must have {length}")
    if index.dtype.kind != "b" and not (-length <= index.min() and index.max() < length):
        raise refused(
            name, f": rows {index.min()} to {index.max()} are asked for, but only rows 0 to {length - 1} exist"
        )
    return index


def nth(noun: str, chosen: SupportsIndex, length: int) -> int:
    """Return the index for a number, which counts from the end if it is negative.

    Raises
    ------
    IndexError : the number is out of range
    ProblemError : not a whole number, as a span of time
    """
    try:
        n = operator.index(chosen)
    except TypeError:
        raise ProblemError(f"{noun} {shown(chosen)}: must be a whole number") from None
    if not -length <= n < length:
        raise IndexError(f"{noun} {n}: there are only {length}")
    return n % length


def buffer_bytes(data: object) -> NDArray[np.uint8]:
    """Return the bytes of anything with a contiguous buffer, without a copy."""
    if isinstance(data, np.ndarray) and data.dtype != np.uint8:
        raise refused("data", f" is an array of {data.dtype}: must be bytes or uint8")
    try:
        view = memoryview(data)  # type: ignore[arg-type]
        return np.frombuffer(view.cast("B"), np.uint8) if view.nbytes else np.empty(0, np.uint8)
    except (TypeError, ValueError, BufferError):
        raise refused("data", f" is {shown(data)}: must be bytes, or an object with a contiguous buffer") from None


def fields(records: object, required: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of a record array's fields; refuse an array without a required field."""
    dtype = getattr(records, "dtype", None)
    # The attribute of a class or a module describes no records.
    names = (dtype.names if isinstance(dtype, np.dtype) else None) or ()
    missing = [name for name in required if name not in names]
    if missing:
        raise refused("records", f" have the fields {', '.join(names) or 'none'}: {missing[0]} is missing")
    return tuple(names)


def parameters(values: Mapping[str, object]) -> str:
    """Return parameters as JSON for the compiled part, which checks them; NaN is refused here, as JSON has none."""

    def plain(name: str, value: object) -> object:
        if isinstance(value, Mapping):
            return {text(f"a name in {name}", key): plain(f"{name}.{key}", entry) for key, entry in value.items()}
        if isinstance(value, list | tuple | np.ndarray):
            _refuse_units(name, value)
            entries = np.atleast_1d(value) if isinstance(value, np.ndarray) else value
            return [plain(f"{name}[{k}]", entry) for k, entry in enumerate(entries)]
        if value is None or isinstance(value, bool | np.bool_):
            return None if value is None else bool(value)
        if isinstance(value, str):
            return text(name, value)
        if isinstance(value, int | np.integer):
            return integer(name, value)
        return finite(name, value)

    named = {text("a parameter's name", name): value for name, value in values.items()}
    return json.dumps({name: plain(name, value) for name, value in named.items()})
