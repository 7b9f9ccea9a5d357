"""The lock of the tables of labels in a folder: a file that processes lock; threads of one process queue for it."""

from __future__ import annotations

import contextlib
import os
import random
import stat
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from taxel._core import ProblemError

#: The lock of all tables of a folder.
LOCK = ".taxel-labels.lock"

#: How long another process may hold the lock, s.
_WITHIN_S = 20.0

#: How long at most another process sleeps before it tries again, s.
_TRIES_S = 0.004


if sys.platform == "win32":
    import msvcrt

    _HOW = 0

    def _lock(descriptor: int) -> bool:
        """Lock a file until it is closed; return False where another process has locked it."""
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
        return True

else:
    import fcntl

    #: A named pipe would be waited for.
    _HOW = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY

    def _lock(descriptor: int) -> bool:
        """Lock a file until it is closed; return False where another process has locked it."""
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


class _Turn:
    """Let one thread at a time lock a folder, which waits for other processes only."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self._ended = -1.0

    def __enter__(self) -> None:
        self.lock.acquire()
        # Another process, which polls, finds the file free before this one locks it again.
        time.sleep(max(0.0, self._ended + 2 * _TRIES_S - time.monotonic()))

    def __exit__(self, *_: object) -> None:
        self._ended = time.monotonic()
        self.lock.release()


_TURNS: dict[Path, _Turn] = {}


def _turn(folder: Path) -> _Turn:
    return _TURNS.setdefault(folder, _Turn())


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder's tables, which is made where there is none.

    Raises
    ------
    ProblemError : another process holds it for too long
    OSError : the folder cannot be written, or its file system has no locks
    """
    with _turn(folder):
        until = time.monotonic() + _WITHIN_S
        while True:
            with _file(folder / LOCK) as is_mine:
                if is_mine:
                    yield
                    return
            if time.monotonic() > until:
                raise ProblemError(f"{folder / LOCK}: another program holds this lock; nothing was saved")
            time.sleep(random.uniform(0.25 * _TRIES_S, _TRIES_S))


@contextlib.contextmanager
def locked_at_once(folder: Path) -> Iterator[bool]:
    """Lock a folder's tables unless another thread or process has locked them; yield whether they are locked.

    Raises
    ------
    ProblemError, OSError : as of `locked`, except the time limit
    """
    turn = _turn(folder)
    if not turn.lock.acquire(blocking=False):
        yield False
        return
    try:
        with _file(folder / LOCK) as is_mine:
            yield is_mine
    finally:
        turn.lock.release()


@contextlib.contextmanager
def _file(path: Path) -> Iterator[bool]:
    """Lock a file unless another process has locked it; yield whether it is locked."""
    try:
        lock = os.open(path, os.O_RDWR | os.O_CREAT | _HOW, 0o666)
    except PermissionError:
        # That of another user.
        if not path.exists():
            raise
        lock = os.open(path, os.O_RDONLY | _HOW)
    try:
        if not stat.S_ISREG(os.fstat(lock).st_mode):
            raise ProblemError(f"{path}: the lock of tables must be a regular file; nothing was saved")
        if not _lock(lock):
            yield False
            return
        try:
            # A lock file that was deleted in between locks nothing.
            is_there = os.path.samestat(os.fstat(lock), os.stat(path))
        except FileNotFoundError:
            is_there = False
        yield is_there
    finally:
        os.close(lock)
