"""Tables of labels that several windows and any other program write: nothing that was acknowledged is lost.

A write takes a lock on a file beside the table, reads the table again, joins (`_label_join`), and exchanges the new
file for the old one in one step. Where the file that comes out is not the one that was read, it is put back, and the
join is made again.

The acknowledged labels are saved beside the table, in ``.NAME.acknowledged``: its state before and after a write, with
digests of both texts, before the table is exchanged, and the state after it alone, afterwards. A process that is killed
in between leaves a state that the text of the table decides.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import functools
import hashlib
import itertools
import json
import os
import re
import secrets
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from taxel._base.arguments import shown
from taxel._base.documents import decoded
from taxel._base.encodings import mark_of
from taxel._base.files import check_writable, create
from taxel._base.header_table import lines_of, separator_of
from taxel._core import FormatError, ProblemError, open_regular
from taxel.labels import Note, rows_of, text_with
from taxel.live._label_join import Acknowledged, Conflict, Edit, Joined, conflict_of, fold, join, minus, settled
from taxel.live._label_lock import LOCK, locked, locked_at_once
from taxel.live._label_state import (
    MOST_SAVED,
    NOT_SAVED,
    bytes_of,
    from_json,
    integer,
    newest_of,
    not_saved,
    saved_of,
    state_path,
    to_json,
)

#: A table that does not end, or cannot be read, and was written within this time is being written, s.
_WRITTEN_S = 2.0

#: How long a table that is being written is waited for, s.
_WHOLE_WITHIN_S = 6.0

#: How many changes of tables can be taken back.
_MOST_CHANGES = 1000

#: How many replaced tables are watched for programs that still write to them, and how many bytes of text.
_MOST_WATCHED, _MOST_WATCHED_BYTES = 16, 1 << 20

#: What an operating system answers that has no more space or descriptors, which the watched tables take.
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE)

#: Length of the beginning of a recording by which it is distinguished from another recording of the same name, bytes.
_BEGINNING = 1 << 16

#: RENAME_EXCHANGE of Linux (renameat2(2)), AT_FDCWD, and the answers of file systems that cannot exchange.
_EXCHANGE, _HERE = 2, -100
_NO_EXCHANGE = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)


if sys.platform == "win32":
    _replace_file = ctypes.WinDLL("kernel32", use_last_error=True).ReplaceFileW


class _BeingWritten(Exception):  # noqa: N818  no error
    """Another program writes the table now, as far as its text tells."""

    def __init__(self, reason: FormatError | None) -> None:
        super().__init__()
        self.reason = reason


@dataclass(frozen=True)
class TableRead:
    """Hold a table as it was read.

    Parameters
    ----------
    rows : tuple of Note
        Those of the recording itself have no name of a recording.
    conflict : Conflict
    changes : tuple of int or None
        Of a table as it was written: the number of each request, by which `LabelTables.undo` takes it back; None where
        it changed nothing.
    """

    rows: tuple[Note, ...]
    conflict: Conflict
    changes: tuple[int | None, ...] = ()


@dataclass(frozen=True, eq=False)
class _File:
    """Hold an open file of a table, without a descriptor if there is none; `link` is its name where that is a link."""

    path: Path
    link: Path | None
    names: frozenset[str]
    recording: Path | None
    descriptor: int | None
    text: bytes | None
    rows: tuple[Note, ...]
    columns: tuple[str, ...]

    @classmethod
    def read(cls, table: Path, names: frozenset[str], *, final: bool) -> _File:
        """Read a table; `final` if it is not waited for any longer."""
        path, link = _paths(table)
        recording = _recording_of(table, names)
        try:
            descriptor = open_regular(path)
        except FileNotFoundError:
            return cls(path, link, names, recording, None, None, (), ())
        try:
            return cls(path, link, names, recording, descriptor, None, (), ()).again(final=final)
        except BaseException:
            os.close(descriptor)
            raise

    def again(self, *, final: bool) -> _File:
        """Read the same file again, which may have been replaced by another."""
        assert self.descriptor is not None
        text = bytes_of(self.descriptor)
        # A time in the future is none at which it was written.
        is_new = 0 <= time.time() - os.fstat(self.descriptor).st_mtime <= _WRITTEN_S
        try:
            rows, columns = _parsed(self.path, self.names, text)
        except FormatError as error:
            if final or not is_new:
                raise
            raise _BeingWritten(error) from None
        mark, encoding = mark_of(text)
        if not text[len(mark) :].endswith(("\n".encode(encoding), "\r".encode(encoding))) and not final and is_new:
            raise _BeingWritten(None)
        return replace(self, text=text, rows=rows, columns=columns)

    @property
    def table(self) -> Path:
        """The name by which the table was read."""
        return self.link or self.path

    def text_with(self, rows: Sequence[Note]) -> bytes:
        """Return the text of a table with these rows; its columns, separator, line ends and encoding stay."""
        text = self.text or b""
        lines = lines_of(decoded(self.path, text))
        end = next((end for end in ("\r\n", "\r") if lines and lines[0].endswith(end)), "\n")
        separator = separator_of(next((line for line in lines if line.strip()), ""))
        mark, encoding = mark_of(text)
        return mark + text_with(rows, self.columns, end, separator).encode(encoding)

    def is_current(self) -> bool:
        """Return whether the table is still the file that was read, with the same text."""
        try:
            there = os.stat(self.path)
        except FileNotFoundError:
            return self.descriptor is None
        if self.descriptor is None:
            return False
        opened = os.fstat(self.descriptor)
        same = (opened.st_dev, opened.st_ino) == (there.st_dev, there.st_ino)
        return same and bytes_of(self.descriptor) == self.text

    def close(self) -> None:
        if self.descriptor is not None:
            os.close(self.descriptor)


def _paths(table: Path) -> tuple[Path, Path | None]:
    """Return the file of a table, and its own name where that is a link to the file."""
    path, named = Path(os.path.realpath(table)), Path(os.path.realpath(table.parent), table.name)
    return path, None if named == path else named


def _parsed(path: Path, names: frozenset[str], text: bytes) -> tuple[tuple[Note, ...], tuple[str, ...]]:
    rows, columns = rows_of(path, lines_of(decoded(path, text)))
    return tuple(replace(row, recording="") if row.recording in names else row for row in rows), columns


def _recording_of(table: Path, names: frozenset[str]) -> Path | None:
    """Return the recording beside a table, where it is a file."""
    candidates = (table.with_name(name) for name in sorted(names, key=len, reverse=True) if name)
    return next((path for path in candidates if path.is_file()), None)


def _digest(text: bytes | None) -> str:
    return "" if text is None else hashlib.sha256(text).hexdigest()


def _sync_folder(folder: Path) -> None:
    if sys.platform == "win32":
        # A folder is no file there, and a rename waits for the disk.
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _exchange(first: str, second: Path) -> bool:
    """Exchange two files in one step; return False where the file system cannot."""
    if sys.platform == "win32":
        out = _new_name(second)
        if not _replace_file(str(second), first, out, 0, None, None):
            raise ctypes.WinError(ctypes.get_last_error())
        os.rename(out, first)
        return True
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except AttributeError:
        return False
    if not rename(_HERE, os.fsencode(first), _HERE, os.fsencode(second), ctypes.c_uint(_EXCHANGE)):
        return True
    code = ctypes.get_errno()
    if code in _NO_EXCHANGE:
        return False
    raise OSError(code, os.strerror(code), str(second))


# ---------------------------------------------------------------------------------------------- what was acknowledged


def _clean(path: Path) -> None:
    """Remove the new files of a writer that was killed. Only who holds the lock makes such files.

    What came out of the table for a new one may be the text of another program, which is put back.
    """
    beside = state_path(path)
    names = re.compile(f"\\.({re.escape(beside.name)}|{re.escape(path.name)})\\.[0-9a-f]{{8}}\\.new")
    for left, found in [(name, found) for name in os.listdir(path.parent) if (found := names.fullmatch(name))]:
        left_over = path.with_name(left)
        if found[1] == path.name:
            saved = saved_of(path) or {}
            now, out = _digest_at(path), _digest_at(left_over)
            if now == saved.get("after") and out != saved.get("before"):
                _exchange(str(left_over), path)
            elif now not in (saved.get("before"), out) and out not in (saved.get("before"), saved.get("after")):
                # Nothing tells whose text it is: a person may look at it.
                continue
        left_over.unlink(missing_ok=True)


def _digest_at(path: Path) -> str:
    try:
        descriptor = open_regular(path)
    except FileNotFoundError:
        return ""
    try:
        return _digest(bytes_of(descriptor))
    finally:
        os.close(descriptor)


def _acknowledged(file: _File) -> Acknowledged:
    """Return what was acknowledged of a table, as it was saved beside it.

    Where a link stands for a table that was a file, as git-annex makes them, it was saved beside the link.

    Raises
    ------
    FormatError : what was saved cannot be read
    """
    path = newest_of(file.path, file.link)
    saved = saved_of(path)
    if saved is None:
        return Acknowledged()
    try:
        known = from_json(saved["acknowledged"])
        recording = saved.get("recording")
        # Where the table and its recording were deleted, another recording of that file name has none of its labels. A
        # recording that runs keeps its beginning, and so does a copy, whatever its times. One with the same stem and
        # another ending shares the table.
        same = file.recording is not None and file.recording.name == saved.get("file")
        if file.descriptor is None and recording is not None and same:
            now = _beginning(file.recording, integer(recording[0], 0, _BEGINNING))
            if now not in (None, recording):
                return Acknowledged()
        if saved["next"] is None or _digest(file.text) == saved["before"]:
            return known
        after = from_json(saved["next"])
    except NOT_SAVED as error:
        raise not_saved(path, error) from None
    if _digest(file.text) == saved["after"]:
        return after
    # The writer was killed, and another program has written the table since: what either text may lack is in conflict,
    # except rows that were to be deleted and are gone.
    gone = minus(known.labels, after.labels)
    return replace(after, labels=(*after.labels, *minus(gone, minus(gone, file.rows))), deleted=known.deleted)


def _save(file: _File, saved: dict[str, Any]) -> None:
    about = {
        "about": "labels that taxel has acknowledged (docs/files.md)",
        "recording": _beginning(file.recording),
        "file": None if file.recording is None else file.recording.name,
    }
    text = json.dumps({**about, **saved}, ensure_ascii=False).encode()
    if len(text) > MOST_SAVED:
        raise ProblemError(
            f"{file.path}: too many labels: the file with their confirmed state would have more than {MOST_SAVED} bytes"
        )
    state = state_path(file.path)
    with _new_file(state, _about(file), text) as name:
        os.replace(name, state)
    if file.link is None:
        return
    # The link may become a file again.
    with contextlib.suppress(OSError), _new_file(state := state_path(file.link), _about(file), text) as name:
        os.replace(name, state)


def _about(file: _File) -> os.stat_result | None:
    """Return who may read a table, which holds for what is saved beside it too; None where neither is there."""
    for path in (file.path, state_path(file.path)):
        with contextlib.suppress(FileNotFoundError):
            return os.stat(path)
    return None


def _beginning(recording: Path | None, size: int = _BEGINNING) -> list[Any] | None:
    """Return how many bytes at the beginning of a recording have which digest; None where there is no file."""
    if recording is None:
        return None
    try:
        with open(open_regular(recording), "rb") as file:
            part = file.read(size)
    except (FormatError, OSError):
        return None
    return [len(part), hashlib.sha256(part).hexdigest()]


# ---------------------------------------------------------------------------------------------- reading and writing

#: What is made of what was acknowledged and a table's rows.
_Action = Callable[[Acknowledged, tuple[Note, ...]], Joined]


@dataclass(frozen=True, eq=False)
class _Watched:
    """Hold a table that was replaced, to which a program may still write; its rows are not held."""

    file: _File
    seen: tuple[int, int]

    def is_written(self) -> bool:
        """Return whether it has another text than was taken in."""
        assert self.file.descriptor is not None
        return bytes_of(self.file.descriptor) != self.file.text


class LabelTables:
    """Read and write tables of labels; methods may be called from several threads at a time."""

    def __init__(self) -> None:
        self._watched: list[_Watched] = []
        self._watched_lock = threading.Lock()
        #: What takes the newest changes back, by their numbers.
        self._inverses: dict[int, tuple[Edit, ...]] = {}
        self._numbers = itertools.count(1)

    def close(self) -> None:
        """Take in what other programs wrote to replaced tables, and close them."""
        self._merge_written()
        with self._watched_lock:
            watched_files, self._watched = self._watched, []
        for watched in watched_files:
            watched.file.close()

    def stamp(self, table: Path) -> str:
        """Return a text that changes when a table, or what was acknowledged of it, may have changed."""
        path, link = _paths(table)
        self._merge_written(link or path)
        while self._close_oldest():
            pass
        parts = []
        for file in (path, state_path(path), state_path(link or path)):
            try:
                about = os.stat(file)
                parts.append(f"{about.st_ino}.{about.st_size}.{about.st_mtime_ns}.{about.st_ctime_ns}")
            except FileNotFoundError:
                parts.append("-")
        return " ".join(parts)

    def read(self, table: Path, names: frozenset[str]) -> TableRead:
        """Read a table, which need not exist.

        Parameters
        ----------
        table : Path
        names : set of str
            Names of the recording in the table.

        Raises
        ------
        FormatError : no table of labels (names the line)
        OSError : it cannot be read
        """
        path, _ = _paths(table)
        for final in _attempts():
            # Where there is no lock, no window has written; a folder that is only looked at gets none.
            if (path.parent / LOCK).exists():
                with contextlib.suppress(OSError), locked_at_once(path.parent) as is_mine:
                    if is_mine:
                        _clean(path)
            try:
                file = _File.read(table, names, final=final)
            except _BeingWritten:
                continue
            try:
                known = _acknowledged(file)
                # Where a window wrote the table since it was read, what was acknowledged may be of the new one.
                if final or file.is_current():
                    return TableRead(file.rows, conflict_of(known, file.rows))
            finally:
                file.close()
        raise AssertionError

    def change(
        self, table: Path, names: frozenset[str], requests: Sequence[Sequence[Edit]]
    ) -> tuple[tuple[tuple[Note | None, ...] | str, ...], TableRead]:
        """Carry out requests in one write; return what became of each, and the table.

        The table and its folder are on the disk then.

        Raises
        ------
        ProblemError : the table is not a table of labels or cannot be written, or another program holds the lock
        """
        joined = self._write(table, names, lambda known, file_rows: join(known, file_rows, requests))
        return joined.outcomes, self._written(joined)

    def undo(self, table: Path, names: frozenset[str], change: int) -> TableRead:
        """Take back a change, whole or not at all.

        Raises
        ------
        ProblemError : as of `change`, or a label that it made was changed since; nothing is taken back then
        """
        inverse = self._inverses.pop(change, None)
        if inverse is None:
            raise ProblemError("undo: this change is too long ago")
        joined = self._write(table, names, lambda known, file_rows: join(known, file_rows, [inverse]))
        (outcome,) = joined.outcomes
        if isinstance(outcome, str):
            raise ProblemError(f"undo: {outcome}")
        return self._written(joined)

    def _written(self, joined: Joined) -> TableRead:
        """Return a table as it was written, and remember what takes its changes back."""
        changes = tuple(next(self._numbers) if inverse else None for inverse in joined.inverses)
        self._inverses |= {k: inverse for k, inverse in zip(changes, joined.inverses, strict=True) if k is not None}
        for oldest in sorted(self._inverses)[:-_MOST_CHANGES]:
            self._inverses.pop(oldest, None)
        return TableRead(joined.rows, conflict_of(joined.acknowledged, joined.rows), changes)

    def settle(self, table: Path, names: frozenset[str], conflict: Conflict, *, restore: bool) -> TableRead:
        """End a conflict: restore what was acknowledged, or accept the table as it is.

        Raises
        ------
        ProblemError : as of `change`, or nothing is left of the conflict
        """
        return self._written(
            self._write(table, names, lambda known, file_rows: settled(known, file_rows, conflict, restore=restore))
        )

    def _write(self, table: Path, names: frozenset[str], action: _Action) -> Joined:
        while True:
            try:
                joined = self._try_write(table, names, action)
            except OSError as error:
                if error.errno in _FULL and self._close_oldest(most=0):
                    continue
                path, _ = _paths(table)
                reason = (error.strerror or str(error)).removeprefix("is ").lower()
                beside = state_path(path)
                where = f"{beside.name}: " if error.filename == str(beside) else ""
                raise ProblemError(f"{path.name} cannot be saved: {where}{reason}") from error
            while self._close_oldest():
                pass
            return joined

    def _try_write(self, table: Path, names: frozenset[str], action: _Action) -> Joined:
        for final in _attempts():
            path, _ = _paths(table)
            with locked(path.parent):
                _clean(path)
                try:
                    file = _File.read(table, names, final=final)
                except _BeingWritten:
                    continue
                except FormatError as error:
                    raise ProblemError(f"{error}; nothing was saved: correct the table, then try again") from None
                kept = False
                try:
                    if file.path != path:
                        # A link that leads elsewhere by now.
                        continue
                    known = _acknowledged(file)
                    joined = action(known, file.rows)
                    if minus(joined.rows, file.rows) or minus(file.rows, joined.rows):
                        kept = self._replace(file, known, joined)
                        if not kept:
                            continue
                    elif file.descriptor is not None:
                        os.fsync(file.descriptor)
                    if joined.acknowledged != known or kept:
                        # The state that was saved before holds for a table that was replaced, too.
                        with contextlib.suppress(OSError) if kept else contextlib.nullcontext():
                            _save(file, {"acknowledged": to_json(joined.acknowledged), "next": None})
                    _sync_folder(path.parent)
                    return joined
                finally:
                    if not kept:
                        file.close()
        raise AssertionError

    def _replace(self, file: _File, known: Acknowledged, joined: Joined) -> bool:
        """Replace a table; return False if another program has written it since it was read."""
        path = file.path
        check_writable(path, overwrite=True)
        text = file.text_with(joined.rows)
        try:
            again, _ = _parsed(path, file.names, text)
        except FormatError as error:
            raise ProblemError(f"{error}; nothing was saved") from None
        if unlike := minus(joined.rows, again):
            raise ProblemError(f"{path}: a table cannot contain {shown(unlike[0].text)} unchanged; nothing was saved")
        states = {"acknowledged": to_json(known), "next": to_json(joined.acknowledged)}
        _save(file, {**states, "before": _digest(file.text), "after": _digest(text)})
        replaced = False
        try:
            with _new_file(path, None if file.descriptor is None else _about(file), text) as name:
                replaced = file.is_current() and _put(name, file)
                if replaced and not _is_old(name, file):
                    # Another program was quicker: its file comes back. It may have written to ours in the meantime.
                    _exchange(name, path)
                    self._watch(replace(file, descriptor=open_regular(name), text=text, rows=joined.rows))
                    replaced = False
        finally:
            if not replaced:
                with contextlib.suppress(OSError):
                    _save(file, {**states, "next": None})
        if replaced and file.descriptor is not None:
            self._watch(file)
        return replaced

    def _watch(self, file: _File) -> None:
        watched = _Watched(replace(file, rows=()), (-1, 0))
        with self._watched_lock:
            self._watched.append(watched)

    def _close_oldest(self, most: int = _MOST_WATCHED) -> bool:
        """Close the table that was replaced or written to longest ago, if they are too many or too large; say whether.

        What was written to it is read. The last file stays, as a program may write to it this moment, except for `most`
        0, where the disk is full: then the files stay whose changes cannot be read.
        """
        with self._watched_lock:
            count, size = len(self._watched), sum(len(watched.file.text or b"") for watched in self._watched)
            if count <= most and (count <= 1 or size <= _MOST_WATCHED_BYTES):
                return False
            oldest = next((watched for watched in self._watched if most or not watched.is_written()), None)
            if oldest is None:
                return False
            self._watched.remove(oldest)
        now = self._merge_watched(oldest)
        if most and now.file is not oldest.file:
            with self._watched_lock:
                self._watched.append(now)
        else:
            now.file.close()
        return True

    def _merge_written(self, table: Path | None = None) -> None:
        """Take in what programs wrote to a table that they had opened before it was replaced; `None`: to any table."""
        with self._watched_lock:
            of_table = [watched for watched in self._watched if table in (None, watched.file.table)]
            self._watched = [watched for watched in self._watched if watched not in of_table]
        found = [(watched.file, self._merge_watched(watched)) for watched in of_table]
        written = [now for file, now in found if now.file is not file]
        with self._watched_lock:
            # That of a program that holds its table open stays the newest.
            self._watched = [*(now for file, now in found if now.file is file), *self._watched, *written]

    def _merge_watched(self, watched: _Watched) -> _Watched:
        file = watched.file
        assert file.descriptor is not None
        about = os.fstat(file.descriptor)
        seen = about.st_size, about.st_mtime_ns
        if seen == watched.seen:
            return watched
        try:
            now = file if bytes_of(file.descriptor) == file.text else file.again(final=False)
        except _BeingWritten:
            return watched
        except FormatError:
            # A text that is being written becomes one that can be read.
            return replace(watched, seen=seen)
        if now is file:
            return replace(watched, seen=seen)
        try:
            before, _ = _parsed(file.path, file.names, file.text or b"")
            action = functools.partial(fold, before=before, after=now.rows)
            self._try_write(file.table, file.names, action)
        except (FormatError, ProblemError, OSError):
            return watched
        return _Watched(replace(now, rows=()), seen)


def _attempts() -> Iterator[bool]:
    """Yield for each attempt whether it is the last, at which a table is not waited for any longer."""
    until = time.monotonic() + _WHOLE_WITHIN_S
    while time.monotonic() < until:
        yield False
        time.sleep(0.01)
    while True:
        yield True


def _is_old(name: str, file: _File) -> bool:
    """Return whether what came out for a new table is the file that was read, with the same text."""
    if file.descriptor is None:
        return True
    try:
        there = os.stat(name)
    except FileNotFoundError:
        # The file system could not exchange the two.
        return True
    return os.path.samestat(there, os.fstat(file.descriptor)) and bytes_of(file.descriptor) == file.text


def _new_name(path: Path) -> str:
    """Return the name of a new file beside another, as `_clean` finds it."""
    return str(path.with_name(f".{path.name}.{secrets.token_hex(4)}.new"))


@contextlib.contextmanager
def _new_file(path: Path, about: os.stat_result | None, text: bytes) -> Iterator[str]:
    """Write a new text to a file beside that which it will replace, on the disk; remove what is there afterwards."""
    name = _new_name(path)
    mode = 0o666 if about is None else stat.S_IMODE(about.st_mode)
    first = mode if about is None else mode & 0o600
    try:
        try:
            with open(name, "xb", opener=lambda path, flags: os.open(path, flags, first)) as part:
                if about is not None and sys.platform != "win32":
                    # A user cannot give a file to a group without being in it.
                    with contextlib.suppress(OSError):
                        os.fchown(part.fileno(), -1, about.st_gid)
                    os.fchmod(part.fileno(), mode)
                part.write(text)
                part.flush()
                os.fsync(part.fileno())
            yield name
        finally:
            Path(name).unlink(missing_ok=True)
    except OSError as error:
        error.filename, error.filename2 = None, None
        raise


def _put(name: str, file: _File) -> bool:
    """Exchange a table with a new file; return False if there is a table by now."""
    if file.descriptor is None:
        try:
            create(name, file.path)
        except FileExistsError:
            return False
    elif not _exchange(name, file.path):
        os.replace(name, file.path)
    return True
