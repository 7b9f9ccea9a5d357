"""The requests of the panel's server to this program: the board's serial line, health, cutting, labels, presets."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shlex
import socket
import struct
import subprocess
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.child_process import ChildProcess
from taxel._base.documents import read_toml
from taxel._base.files import whole_file
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect import load, run
from taxel.detections import Detection
from taxel.device import Cable
from taxel.frames import Frames
from taxel.labels import Note
from taxel.live._label_join import Conflict, Edit
from taxel.live._label_table import LabelTables, TableRead
from taxel.live._shown_files import Opening, ReadPictures, ShownFiles
from taxel.recorded import recorded
from taxel.recording import Recording
from taxel.recording.convert import convert
from taxel.recording.cut import cut
from taxel.recording.health import TaxelStatistics, Touches, judged
from taxel.recording.lain import without_what_lay
from taxel.recording.opening import sensors
from taxel.recording.rest import by_unit
from taxel.tare import Tare
from taxel.wire import Command

__all__ = ["RequestHandler", "own_addresses", "presets_path"]

#: SIOCGIFADDR of Linux (netdevice(7)).
_ADDRESS_OF = 0x8915

#: Code with which a command ends after Ctrl-C.
_INTERRUPTED = 130

#: The reason that a client sees of a training that was stopped.
_STOPPED = "the training was stopped: nothing was written"

#: A label that a person set may be late: the rest before it ends so much earlier, and lasts so long at least, us.
_BEFORE_US, _LEAST_REST_US = 20_000, 10_000

#: Rest at the beginning of a recording without labels, us.
_REST_US = 50_000

#: Taxels as (column, row).
_Taxels = list[tuple[int, int]]

#: A label, its time (us), source and trial ("": all), the time of the note that it replaces, and that by the host (ns);
#: "" removes that note.
_LabelRow = tuple[str, int, str, str, int | None, int | None]

#: Labels that were acknowledged and are missing in a table, that were deleted and returned, and other new ones.
_LabelConflict = tuple[list[_LabelRow], list[_LabelRow], list[_LabelRow]]

#: The labels of a table, and its conflict.
_LabelTable = tuple[list[_LabelRow], _LabelConflict]


def presets_path() -> Path:
    """Return the file of the user's own presets: taxel/presets.toml in the folder of user settings."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "taxel" / "presets.toml"


def own_addresses() -> list[tuple[str, str]]:
    """Return the IPv4 addresses of this machine: name of the network interface and address."""
    addresses = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        for _, name in socket.if_nameindex():
            # An interface that is down has none. struct ifreq: the name, then the address from byte 20 on.
            with contextlib.suppress(OSError):
                answer = fcntl.ioctl(any_socket, _ADDRESS_OF, struct.pack("256s", name.encode()[:15]))
                addresses.append((name, socket.inet_ntoa(answer[20:24])))
    return addresses


@contextlib.contextmanager
def _reasons() -> Iterator[None]:
    """Turn errors of the operating system into reasons that a person can read."""
    try:
        yield
    except (FileExistsError, FileNotFoundError, PermissionError) as error:
        reasons = {FileExistsError: "exists already", FileNotFoundError: "no such file or device"}
        raise ProblemError(f"{error.filename}: {reasons.get(type(error), 'permission denied')}") from None
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        raise ProblemError(f"{where}{error.strerror or error}") from None


def _rest(recording: Recording) -> Tare:
    """Return the taxels' rest: 0 by the unit, or before the first label and the start marker, or at the beginning."""
    source = recorded(recording)
    if isinstance(source, Frames) and (rest := by_unit(source)) is not None:
        return rest
    first = int(source.t[0]) if len(source) else 0
    ends = [note.t - _BEFORE_US for note in recording.notes if note.t is not None]
    ends += [t for t, start in getattr(source, "markers", ()) if start]
    stop = min((t for t in ends if t - first >= _LEAST_REST_US), default=first + _REST_US)
    tare, _ = without_what_lay(recording, stop)
    return Tare.take(source, stop_us=stop, note=str(recording.path)) if tare is None else tare


def _own_names(recording: str) -> frozenset[str]:
    """Return the names that a table beside a recording may have for it: none, its file name, and its stem."""
    return frozenset({"", recording, Path(recording).stem})


def _to_note(row: _LabelRow, unit_us: float) -> Note:
    label, t, source, trial, replaces, host_ns = row
    replaced = None if replaces is None else round(replaces / unit_us)
    return Note(label.strip(), round(t / unit_us), host_ns or 0, trial, source, replaced)


def _to_row(note: Note, unit_us: float) -> _LabelRow:
    replaced = None if note.replaces is None else round(note.replaces * unit_us)
    t = round((note.t or 0) * unit_us)
    return note.text, t, note.source, note.recording, replaced, note.at_ns or None


class RequestHandler:
    """Handle the requests of a panel's server, which calls from several threads at a time.

    The text of an exception is the reason that the client shows.

    Parameters
    ----------
    listen : function of host and port
        Receives the board's datagrams on another address.
    delta_intensity : function of a bool
        Interprets intensities as differences, or as values.
    read_out : function of a path
        Reads the board out with another readout.
    cable : Cable or None
        The board's serial line. The handler closes it.
    opening : Opening
        How recordings are opened.
    """

    def __init__(
        self,
        listen: Callable[[str, int], None],
        delta_intensity: Callable[[bool], None],
        read_out: Callable[[Path], None],
        cable: Cable | None,
        opening: Opening,
    ) -> None:
        self._listen, self._delta_intensity, self._read_out, self._cable = listen, delta_intensity, read_out, cable
        self._training: ChildProcess | None = None
        self._closed = False
        #: What the training has said on stderr, line by line.
        self._training_lines: list[str] = []
        self._training_lock = threading.Lock()
        self._cable_lock, self._file_lock = threading.Lock(), threading.Lock()
        self._files, self._opening = ShownFiles(opening), opening
        self._labels = LabelTables()

    def end_work(self) -> None:
        """End a training that runs, and begin no other: the server waits for no request that takes long."""
        with self._training_lock:
            self._closed = True
        self.end_training()

    def close(self) -> None:
        """Close the serial line, end a training that runs, and remove temporary files."""
        self.end_work()
        self._labels.close()
        self._files.close()
        self._disconnect()

    def _disconnect(self) -> None:
        with self._cable_lock:
            if self._cable is not None:
                self._cable.close()
                self._cable = None

    def _connected(self) -> Cable:
        if self._cable is None:
            raise ProblemError("the board's serial line is not connected")
        return self._cable

    def command(self, register: int, value: int) -> int:
        """Write a register; return the value that the board reports."""
        with _reasons(), self._cable_lock:
            return self._connected().command(Command(register, value))

    def channels(self) -> int:
        """Return the number of converter channels in the board's greeting."""
        with _reasons(), self._cable_lock:
            return self._connected().greeting().channels

    def board_lines(self) -> tuple[list[str], int]:
        """Return the board's lines since the last call, and how often it was reset."""
        with _reasons(), self._cable_lock:
            return ([], 0) if self._cable is None else (self._cable.said(), self._cable.resets)

    def connect(self, place: str | None) -> None:
        """Connect the serial line to another place, or disconnect it."""
        self._disconnect()
        if place is not None:
            with _reasons():
                cable = Cable(place)
            with self._cable_lock:
                self._cable = cable

    def listen(self, host: str, port: int) -> None:
        """Receive the board's datagrams on another address."""
        with _reasons():
            self._listen(host, port)

    def set_differences(self, on: bool) -> None:
        """Interpret intensities as differences, or as values."""
        with _reasons():
            self._delta_intensity(on)

    def addresses(self) -> list[tuple[str, str]]:
        """Return the IPv4 addresses of this machine, each with the name of its network interface."""
        with _reasons():
            return [(host, name) for name, host in own_addresses()]

    def health(
        self,
        array: _core._Array,
        events: NDArray[np.uint32],
        moved: NDArray[np.uint32],
        touches: tuple[NDArray[np.uint32], NDArray[np.uint32]],
        values: tuple[NDArray[np.uint8], NDArray[np.int32], NDArray[np.int32]] | None,
    ) -> tuple[_Taxels, _Taxels, _Taxels, int]:
        """Return the taxels that are dead, stuck and noisy, and how many were not touched enough to say.

        Parameters
        ----------
        array : the sensor
        events, moved : shape (taxels,)
            Events of each taxel, and those in the direction of the one before.
        touches : two arrays
            Indices of taxels, and five counts of touches of each, as the core gives them.
        values : three arrays of shape (taxels,), or None without intensities
            Number of different values; least and greatest held value, -1 where unknown.
        """
        sensor = Array._from_parts(array)
        activity, on, *known = (
            np.asarray(column, np.int64).reshape(sensor.shape) for column in (events, moved, *(values or ()))
        )
        result = judged(sensor, TaxelStatistics(activity, on, Touches.of(*touches), *known))
        taxels = result.named()
        return taxels["dead"], taxels["stuck"], taxels["noisy"], int(np.count_nonzero(result.untold))

    def recordings(self, folder: Path) -> list[str]:
        """Return the names of what is a recording in a folder."""
        with _reasons():
            return [file.name for file in folder.iterdir() if self._opening.is_recording(file)]

    def read(self, path: Path, trial: str | None, whole: bool) -> tuple[Path | None, ReadPictures | None]:
        """Read a recording that is no file of a board's events.

        Parameters
        ----------
        path : path
        trial : str or None
            Of a file with several; default: the first.
        whole : bool
            Whether all of a large text table is read, not only its beginning.

        Returns
        -------
        path or None
            Of events, a .mcap that holds them, until `close`.
        tuple or None
            Pictures, as the compiled part reads them.
        """
        with _reasons():
            return self._files.read(path, trial, whole=whole)

    def health_of_pictures(self, path: Path, trial: str | None) -> tuple[_Taxels, _Taxels, _Taxels, int]:
        """Return the taxels of a recording of pictures that are dead, stuck, noisy, and how many cannot be judged."""
        with _reasons():
            return self._files.health(path, trial)

    def cut(self, path: Path, trial: str | None, out: Path, start_us: int, stop_us: int) -> list[str]:
        """Write a stretch of a recording to a new file; return what that file cannot hold."""
        with _reasons():
            recording, _ = self._files.opened(path, trial)
            (part,) = cut(recording, start_us=start_us, stop_us=stop_us)
            return list(convert(part, out))

    def train(self, recording: Path, out: Path) -> str:
        """Train on the labels of a recording as ``taxel train`` does; return what it prints, then its warnings."""
        words = [*self._training_words(recording, out), "--overwrite"]
        with self._training_lock:
            if self._closed:
                raise ProblemError(_STOPPED)
            if self._training is not None:
                raise ProblemError("a training runs already: stop it first, or wait for its end")
            # A process of its own, so that it takes no time from what arrives.
            self._training = ChildProcess("taxel", words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            printed, errors = self._heard(self._training)
            code = self._training.returncode
        finally:
            self._training = None
        if code < 0 or code == _INTERRUPTED:
            raise ProblemError(_STOPPED)
        if code:
            lines = [line for line in errors.splitlines() if line.strip()]
            raise ProblemError(lines[-1].removeprefix("taxel: ") if lines else f"the training ended with code {code}")
        warned = [line.removeprefix("taxel: ") for line in errors.splitlines() if line.startswith("taxel: warning: ")]
        return "\n".join([printed.strip(), *warned])

    def _heard(self, training: ChildProcess) -> tuple[str, str]:
        """Wait until a training has ended; return what it printed, and what it said on stderr."""
        assert training.stdout is not None
        assert training.stderr is not None
        self._training_lines = []
        listener = threading.Thread(target=self._training_lines.extend, args=(training.stderr,))
        listener.start()
        printed = training.stdout.read()
        listener.join()
        training.wait()
        return printed, "".join(self._training_lines)

    def training_progress(self) -> str:
        """Return how far the training that runs is, as ``taxel train`` says it; empty if it has not said so yet."""
        said = [line for line in self._training_lines if ", after " in line] if self._training is not None else []
        return said[-1].removeprefix("taxel: ").strip() if said else ""

    def train_command(self, recording: Path, out: Path) -> str:
        """Return the command that trains the same in a shell, in the folder where taxel was started."""
        return shlex.join(["taxel", *self._training_words(recording, out)])

    def _training_words(self, recording: Path, out: Path) -> list[str]:
        """Return the words of a training on a recording; paths are from the folder where taxel was started."""
        here = Path.cwd()
        near = (str(path.relative_to(here) if path.is_relative_to(here) else path) for path in (recording, out))
        # A name that begins with a dash is no option.
        named, written = (f"./{name}" if name.startswith("-") else name for name in near)
        return ["train", named, "--labels", "notes", "-o", written, *self._opening.options_of(recording)]

    def end_training(self) -> None:
        """End the training that runs, if one does."""
        training = self._training
        if training is not None:
            training.end()

    def detect(self, recording: Path, trial: str | None, readout: Path) -> tuple[list[str], list[tuple[str, int, int]]]:
        """Return a readout's labels, and its detections in a recording or its trial: label, time, when known."""
        with _reasons():
            loaded = load(readout)
            opened, _ = self._files.opened(recording, trial)
            found: list[Detection] = []
            for one in sensors(opened):
                registers = one.registers
                frame_us = None if registers is None else registers.frame_us
                found += run(loaded, one, frame_us=frame_us, tare=_rest(one))
        return list(loaded.labels), sorted(((one.label, one.t, one.known) for one in found), key=lambda one: one[2])

    def read_out(self, readout: Path) -> None:
        """Read the board out with another readout."""
        with _reasons():
            self._read_out(readout)

    def label_stamp(self, table: Path) -> str:
        """Return a text that changes when a table of labels, or what was acknowledged of it, may have changed."""
        with _reasons():
            return self._labels.stamp(table)

    def read_labels(self, table: Path, recording: str) -> _LabelTable:
        """Return the labels of a recording from a table, and where the table lacks what was acknowledged."""
        with _reasons():
            return self._shown(table, self._labels.read(table, _own_names(recording)))

    def change_labels(
        self, table: Path, recording: str, requests: Sequence[Sequence[tuple[_LabelRow | None, _LabelRow | None]]]
    ) -> tuple[list[str | list[_LabelRow | None]], _LabelTable]:
        """Carry out requests in one write of a table as it is now, and return when it is on the disk.

        Parameters
        ----------
        table : Path
        recording : str
            Its file name.
        requests : sequence of sequence of (row or None, row or None)
            The edits of each request, the old row and the new one. A request is carried out whole or not at all.

        Returns
        -------
        list
            For each request the new rows as they were written, or why it was not carried out.
        table
            As `read_labels` returns it.
        """
        unit_us = self._opening.unit_us(table)

        def note(row: _LabelRow | None) -> Note | None:
            return None if row is None else _to_note(row, unit_us)

        edits = [[Edit(note(old), note(new)) for old, new in request] for request in requests]
        with _reasons():
            outcomes, read = self._labels.change(table, _own_names(recording), edits)
        written: list[str | list[_LabelRow | None]] = [
            one if isinstance(one, str) else [None if note is None else _to_row(note, unit_us) for note in one]
            for one in outcomes
        ]
        return written, self._shown(table, read)

    def settle_labels(self, table: Path, recording: str, conflict: _LabelConflict, restore: bool) -> _LabelTable:
        """End a conflict: restore what was acknowledged, or accept the table as it is."""
        unit_us = self._opening.unit_us(table)
        seen = Conflict(*(tuple(_to_note(row, unit_us) for row in rows) for rows in conflict))
        with _reasons():
            return self._shown(table, self._labels.settle(table, _own_names(recording), seen, restore=restore))

    def _shown(self, table: Path, read: TableRead) -> _LabelTable:
        unit_us = self._opening.unit_us(table)
        conflict = read.conflict
        rows, *others = (
            [_to_row(note, unit_us) for note in notes]
            for notes in (read.rows, conflict.missing, conflict.returned, conflict.new)
        )
        return sorted(rows, key=lambda row: row[1]), (others[0], others[1], others[2])

    def read_presets(self) -> tuple[Path, dict[str, dict[str, object]]]:
        """Return the file of the user's presets, and the presets: value by register name."""
        place = presets_path()
        with _reasons():
            own = read_toml(place) if place.exists() else {}
        return place, {name: values for name, values in own.items() if isinstance(values, dict)}

    def write_presets(self, presets: Mapping[str, Mapping[str, object]]) -> None:
        """Write the user's presets."""
        place = presets_path()
        lines = ["# Presets of the panel: a table each, every register in its own unit (taxel's docs, registers)."]
        for name, values in sorted(presets.items()):
            # A basic string of TOML has the escapes of JSON.
            lines += ["", f"[{json.dumps(name)}]"]
            lines += [f"{register} = {json.dumps(value)}" for register, value in values.items()]
        with _reasons(), self._file_lock:
            place.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(place, overwrite=True) as part:
                part.write_text("\n".join(lines) + "\n", "utf-8")
