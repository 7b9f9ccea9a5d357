"""How a `Live` works: each option once, for the constructor, the command line and Rust."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from taxel import _core
from taxel._base.arguments import flag, instance, number, several, shown, text, whole
from taxel._base.arguments import path as checked_path
from taxel._base.errors import refused
from taxel._base.options import option
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect import PlainRule, Readout
from taxel.detect.detector import detector
from taxel.live.remote import Remote
from taxel.live.sending import PORT
from taxel.tare import Tare
from taxel.wire import Registers
from taxel.wire.registers import QUOTED_PRESETS

if TYPE_CHECKING:
    from taxel.detections import Detection

__all__ = ["LiveOptions"]

#: The defaults of the values that Rust reads.
_DEFAULT = SimpleNamespace(**json.loads(_core.live_defaults()))


@dataclass(frozen=True)
class LiveOptions:
    """Hold the options of a `Live`, which documents each, with their defaults."""

    port: int = option(PORT, "The UDP port that the board sends to.", least=0, most=65_535)
    _: KW_ONLY
    host: str = option("0.0.0.0", "The address of this machine to listen on; 0.0.0.0: all.")
    remote: Remote | None = option(
        None, "Receive a board of another computer instead: zenoh:HOST:PORT/NAME, as taxel bridge prints it there."
    )
    array: Array | None = option(
        None,
        "Rows, columns and pitch of the sensor, as 24x20x5 (default pitch: 2.67 mm; with --rate-hz unknown). Default: "
        "64x64x2.67; with --from, the bridge reports it.",
    )
    registers: str | Registers | None = option(
        None,
        f'The board\'s registers: one of {QUOTED_PRESETS}. Default: "5.2 kHz"; with --from, the bridge reports them.',
    )
    differences: bool = option(_DEFAULT.differences, "The board sends intensity differences.")
    readout: Readout | PlainRule | None = option(
        None, "A trained readout (JSON), as taxel train writes it, or a plain rule; the panel needs none."
    )
    tare: Tare | float | None = option(
        None,
        "Rest of the taxels: seconds at rest at the beginning, or the file of a saved tare (JSON).",
        least=1e-6,
        most=3600,
    )
    record: str | os.PathLike[str] | None = option(None, "Record in a new file (.mcap or .lsa).")
    record_later: bool = option(_DEFAULT.record_later, "Recordings begin and end while it runs.")
    name: str = option(_DEFAULT.name, "The board's name among the sources of the recording.")
    sources: Mapping[str, str] | None = option(
        None,
        "Record another source too: a board (udp:HOST:PORT,array=16x16), or lines of numbers, as of an IMU "
        "(serial:PATH@BAUD or pipe:PATH, columns=t_us:ax:ay). May be repeated.",
    )
    compression: str = option("none", "Compression of a .mcap: none, lz4 or zstd.")
    overwrite: bool = option(False, "Replace the file if it exists.")
    guard_frames: float = option(
        _DEFAULT.guard_frames,
        "How far, in frames, a readout stays behind the host's clock while no events arrive.",
        least=0.0,
    )
    gap_frames: float = option(
        _DEFAULT.gap_frames, "At a gap in version 2, frames to wait for what may only be late.", least=0.0
    )
    say: Callable[[Detection], object] | None = option(None, "Called with each detection.")
    lines: bool = option(False, "Print one line of JSON for each detection, and nothing else.")
    send: str | Sequence[str] = option(
        (),
        "Send each detection as a line of --json to udp:HOST:PORT, pipe:PATH or serial:PATH@BAUD; may be repeated.",
    )
    kernel_buffer_bytes: int | None = option(None, "How much may wait in the kernel, bytes.", least=0, most=2**31 - 1)
    queue_bytes: int | None = option(None, "How much may wait for the decoder, bytes.", least=0, most=2**31 - 1)
    readout_events: int | None = option(None, "How many events may wait for the readout.", least=0, most=2**31 - 1)
    gro: bool | None = option(None, "Let the kernel hand over trains of datagrams in one piece.")

    def completed(self) -> LiveOptions:
        """Return the options with the sensor of the remote board or the readout; refuse options that make no sense."""
        readout, remote, array, registers, differences = (
            self.readout, self.remote, self.array, self.registers, self.differences,
        )  # fmt: skip
        if readout is not None:
            detector("readout", readout)._check_unit("ticks", "live values")
        if remote is not None:
            instance("remote", remote, Remote)
            array = remote.array if array is None else array
            registers = Registers._of(remote.registers, remote.array) if registers is None else registers
            differences = flag("differences", differences) or remote.differences
        if array is None and readout is not None:
            array = readout.array
        elif readout is not None and readout.array is not None:
            readout.array._warn_apart(instance("array", array, Array), "live")
        if self.say is not None and not callable(self.say):
            raise refused("say", f" is {shown(self.say)}: must be a function of a Detection")
        if readout is None and self.tare is not None:
            raise ProblemError("tare without a readout: nothing would use it")
        array = Array._of(array)
        registers = Registers(array=array) if registers is None else registers
        return replace(self, array=array, registers=registers, differences=differences)

    def destinations(self) -> list[str]:
        """Return where detections are sent."""
        return [text("send", to) for to in ([self.send] if isinstance(self.send, str) else several("send", self.send))]

    def named_sources(self) -> list[tuple[str, str]]:
        """Return the other sources of a recording, by name."""
        if self.sources is None:
            return []
        if not isinstance(self.sources, Mapping):
            raise ProblemError(
                f'sources is {shown(self.sources)}: must be a mapping, as {{"imu": "serial:/dev/ttyACM0"}}'
            )
        return [(text("name of a source", name), text(f"source {name}", what)) for name, what in self.sources.items()]

    def recording(self) -> tuple[str, str, bool] | None:
        """Return path, compression and whether to overwrite; None if nothing is recorded."""
        if self.record is None:
            return None
        path = os.fspath(checked_path("record", self.record))
        return path, text("compression", self.compression), flag("overwrite", self.overwrite)

    def for_rust(self, *, send: list[str], sources: list[tuple[str, str]]) -> dict[str, Any]:
        """Return the options that Rust reads; `send` and `sources` are those that it can open itself."""
        registers: object = self.registers
        contents = json.loads(registers._json()) if isinstance(registers, Registers) else text("registers", registers)
        sizes = {name: getattr(self, name) for name in ("kernel_buffer_bytes", "queue_bytes", "readout_events")}
        return {
            "registers": contents,
            "differences": flag("differences", self.differences),
            "guard_frames": number("guard_frames", self.guard_frames),
            "gap_frames": number("gap_frames", self.gap_frames),
            "gro": None if self.gro is None else flag("gro", self.gro),
            "send": send,
            "name": text("name", self.name),
            "record_later": flag("record_later", self.record_later),
            "sources": sources,
            **{name: None if n is None else whole(name, n, 0, 2**31 - 1) for name, n in sizes.items()},
        }
