"""The options of a `Live` that Rust reads too."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass

from taxel._base.options import option
from taxel.array import Array
from taxel.detect import PlainRule, Readout
from taxel.tare import Tare
from taxel.wire import Registers

__all__ = ["StatedOptions"]


@dataclass(frozen=True)
class StatedOptions:
    """Hold the options of a `Live`, which documents each, with their defaults."""

    port: int | None = option(
        None,
        "The UDP port that the board sends to. Default: 5208, unless --source names what to receive.",
        least=0,
        most=65_535,
        commands="live record",
    )
    _: KW_ONLY
    host: str | None = option(
        None, "The address of this machine to listen on for a board; 0.0.0.0: all.", commands="live record"
    )
    array: Array | None = option(
        None,
        "Rows, columns and pitch of the sensor. Default: those of the readout, else 64x64x2.67.",
        commands="live record",
        metavar="ROWSxCOLUMNS[xMM]",
        typed="For example 24x20x5. Default pitch: 2.67 mm, or unknown with --rate-hz.",
    )
    registers: str | Registers | None = option(
        None,
        "The board's registers, by a preset: one of `taxel.wire.PRESETS`. Default: those of a board of this array at "
        "reset.",
        commands="live record",
        flag="--preset",
    )
    differences: bool = option(False, "The board sends intensity differences.", commands="live record")
    readout: Readout | PlainRule | None = option(
        None,
        "A trained readout or a plain rule; without one nothing is detected.",
        metavar="FILE",
        typed="taxel train writes such files (JSON).",
    )
    tare: Tare | float | None = option(
        None,
        "Rest of the taxels: a saved tare, or the seconds at rest at the beginning, from which a fresh tare is taken.",
        metavar="FILE|SECONDS",
        typed="A recording of the sensor at rest (taxel cut) can be used instead of a saved tare.",
    )
    record: str | os.PathLike[str] | None = option(None, "Record in a new .mcap file.")
    record_later: bool = option(
        False, "Let `record` and `end_recording` begin and end recordings while the `Live` runs.", commands=""
    )
    name: str = option("board", "The board's name among the sources of the recording.", commands="record")
    sources: Mapping[str, str] | str | Sequence[str] | None = option(
        None,
        "The source to receive: [NAME=]KIND:PLACE and, after commas, KEY=VALUE; for example lines:-,array=16x16 or "
        "serial:COM3,array=16x16. It sends frames of numbers, is a board (board:HOST:PORT), or is a further source of "
        "a recording.",
        commands="live record",
        flag="--source",
        metavar="[NAME=]KIND:PLACE",
        typed="May be repeated.",
    )
    first_line_s: float = option(
        3.0, "How long each source of lines may be silent before its first line, s.", least=0, commands=""
    )
    compression: str = option("none", "Compression of a .mcap: none, lz4 or zstd.", commands="record")
    overwrite: bool = option(False, "Replace output files that exist already.", commands="live record")
    guard_frames: float | None = option(
        None,
        "How far, in frames, a readout stays behind the host's clock while no events arrive. Default: 3; 5 of a source "
        "of numbers.",
        least=0,
    )
    gap_frames: float = option(
        1.0,
        "With version 2 of the wire: how many frames to wait at a gap in the sequence: the data may only be late.",
        least=0,
        commands="",
    )
    lines: bool = option(False, "Print one line of JSON for each detection, and nothing else.", flag="--json")
    send: str | Sequence[str] = option(
        (),
        "Send each detection as a line of JSON to serial:PLACE, lines:PATH (a named pipe), lines+tcp:HOST:PORT or "
        "lines+udp:HOST:PORT.",
        metavar="WHERE",
        typed="May be repeated.",
    )
    kernel_buffer_bytes: int = option(
        33554432,
        "How much received data may wait in the operating system, bytes.",
        least=0,
        most=2_147_483_647,
        commands="",
    )
    queue_bytes: int = option(
        67108864, "How much received data may wait for the decoder, bytes.", least=0, most=2_147_483_647, commands=""
    )
    readout_events: int = option(
        1048576, "How many events may wait for the readout.", least=0, most=2_147_483_647, commands=""
    )
    gro: bool = option(
        True, "Let the kernel join several datagrams and hand them over together (`UDP_GRO`).", commands=""
    )
