"""Sound calls of `taxel.wire`."""

from collections.abc import Callable
from typing import Any

import numpy as np

import taxel
from sound.things import ARRAY, BYTES, EVENTS, REGISTERS, Sound, fresh, method, plain


def quiet_board() -> tuple[taxel.wire.Decoder, list[bytes]]:
    """A decoder, and datagrams of version 2 of a board that nothing touches."""
    board = taxel.simulate.Board(
        taxel.simulate.board.fitting(None, taxel.Array.thesis()).replace(wire_version=2),
        version_2=taxel.simulate.Version2(heartbeat_us=500, states_us=5000),
    )
    frames = [board.frame(np.full(4096, 60, np.uint16)) for _ in range(100)]
    return taxel.wire.Decoder(2), [datagram for sent in frames for datagram in sent]


def received() -> Any:
    decoder, datagrams = quiet_board()
    decoder.push(datagrams[0])
    return decoder.last


def status() -> Any:
    decoder, datagrams = quiet_board()
    for datagram in datagrams:
        decoder.push(datagram)
    return decoder.status


#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.wire.described": plain(taxel.wire.described, registers=REGISTERS),
    "taxel.wire.Registers.from_words": plain(
        taxel.wire.Registers.from_words, words=list(REGISTERS.words), array=None, channels=16
    ),
    "taxel.wire.Columns": plain(taxel.wire.Columns, rows=100),
    "taxel.wire.Command": plain(taxel.wire.Command, register=1, value=300),
    "taxel.wire.Command.from_bytes": plain(taxel.wire.Command.from_bytes, data=taxel.wire.Command(1, 300).to_bytes()),
    "taxel.wire.Decoder": plain(taxel.wire.Decoder, version=1, array=ARRAY, pairing="direct", differences=False),
    "taxel.wire.Decoder.push": fresh(taxel.wire.Decoder, "push", data=BYTES, arrived=5),
    "taxel.wire.Decoder.push_into": fresh(
        taxel.wire.Decoder, "push_into", columns=taxel.wire.Columns(100), data=BYTES, arrived=5
    ),
    "taxel.wire.StreamReader.push": fresh(taxel.wire.StreamReader, "push", data=BYTES),
    "taxel.wire.Registers": plain(taxel.wire.Registers, array=None, noise_floor=4, line_period=3.0),
    "taxel.wire.Registers.commands_to": method(REGISTERS, "commands_to", target=REGISTERS),
    "taxel.wire.Registers.preset": plain(taxel.wire.Registers.preset, name="2 kHz", array=None),
    "taxel.wire.Registers.replace": method(REGISTERS, "replace", noise_floor=4, frame_sync=True, nrows=63),
    "taxel.wire.Registers.with_preset": plain(REGISTERS.with_preset, name="2 kHz"),
    "taxel.wire.decode": plain(
        taxel.wire.decode,
        data=BYTES,
        version=1,
        array=ARRAY,
        pairing="direct",
        differences=False,
        lengths=[len(BYTES)],
        columns=taxel.wire.Columns(100),
    ),
    "taxel.wire.encode": plain(taxel.wire.encode, events=EVENTS),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.wire.Counts": lambda: taxel.wire.Decoder().counts,
    "taxel.wire.Received": received,
    "taxel.wire.Status": status,
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
