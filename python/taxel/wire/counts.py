"""What a decoder received, decoded, refused and missed, and the board's totals."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Counts", "Received", "Status"]


@dataclass(frozen=True)
class Counts:
    """Hold what a decoder read, and all that it dropped or missed, by cause; causes that a version does not have are 0.

    The sums close at any time. Version 1: ``bytes == 5 * words + skipped``, and ``words == changes + intensities +
    unpaired + markers + contradictory + outside``; the bytes of a word that is not complete count when it is, or is
    given up. Version 2: ``datagrams == intact + repeated + old + short + long + foreign + checksum``.

    Parameters
    ----------
    bytes, words : int
        Version 1: bytes read, and complete words.
    skipped : int
        Version 1: bytes that belong to no complete word.
    short : int
        Version 1: words cut off by the next first byte, or by the end. Version 2: datagrams refused as too short.
    changes : int
        Version 1: changes on the array, the rows of `Events`.
    intensities, unpaired : int
        Version 1: intensities that found their change, and those that did not.
    markers : int
        Starts and stops.
    contradictory : int
        Version 1: words that are an intensity and a marker at once.
    outside : int
        Events, states and intensities outside the array.
    back : int
        Version 1: changes and markers behind the latest time, which are kept.
    datagrams, intact : int
        Version 2: given to the decoder, and decoded.
    repeated, old : int
        Version 2: received again; more than 65 536 numbers late, so that it is unknown whether they came before.
    long, foreign, checksum : int
        Version 2: refused as longer than 1400 bytes, not of version 2 or of another board, damaged.
    missing : int
        Version 2: numbers between the first and the last of each session that were never received intact.
    unknown_kind, unknown_flags, unknown_marker : int
        Version 2: datagrams of unknown kind, skipped; with unknown flags, decoded; markers of unknown code, left out.
    malformed : int
        Version 2: bodies that end within a word, or have an offset above 32 511 us; what stands before is decoded.
    events, repaired : int
        Version 2: events on the array, and those of them that a state gave.
    states, stale : int
        Version 2: states on the array, and those of them that came too late to count.
    dropped, resets : int
        Version 2: datagrams that report dropped events; resets of the board.
    unknown_value : int
        Version 2: differences from a value that was not received, whose events have none.
    """

    bytes: int = 0
    words: int = 0
    skipped: int = 0
    short: int = 0
    changes: int = 0
    intensities: int = 0
    unpaired: int = 0
    markers: int = 0
    contradictory: int = 0
    outside: int = 0
    back: int = 0
    datagrams: int = 0
    intact: int = 0
    repeated: int = 0
    old: int = 0
    long: int = 0
    foreign: int = 0
    checksum: int = 0
    missing: int = 0
    unknown_kind: int = 0
    unknown_flags: int = 0
    unknown_marker: int = 0
    malformed: int = 0
    events: int = 0
    repaired: int = 0
    states: int = 0
    stale: int = 0
    dropped: int = 0
    resets: int = 0
    unknown_value: int = 0


@dataclass(frozen=True)
class Received:
    """Hold what a datagram of version 2 was (`Decoder.last`).

    Parameters
    ----------
    until : int, us, or None
        No datagram of a higher sequence number holds anything before this time; None where nothing is promised.
    intact : bool
        False where it was refused, or received before (`Decoder.counts` has the cause).
    """

    until: int | None
    intact: bool


@dataclass(frozen=True)
class Status:
    """Hold the board's totals since its reset.

    Parameters
    ----------
    frames, events, dropped, datagrams, faults : int
        Frames scanned, events sent, events dropped, datagrams made before this one, comparators that had not returned.
    """

    frames: int
    events: int
    dropped: int
    datagrams: int
    faults: int
