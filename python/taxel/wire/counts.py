"""Counts of what a decoder received, decoded, refused and missed, and the board's totals."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Counts:
    """Hold the numbers of what a decoder read, and of all that it dropped or missed, by cause.

    A cause that a version of the wire does not have is 0.

    These sums hold at any time. Version 1: ``bytes == 5 * words + skipped``, and ``words == changes + intensities +
    unpaired + markers + contradictory + outside``; the bytes of an incomplete word are counted once it is complete or
    discarded. Version 2: ``datagrams == intact + repeated + old + short + long + foreign + checksum``.

    Parameters
    ----------
    bytes, words : int
        Version 1: the number of bytes read, and of complete words.
    skipped : int
        Version 1: the number of bytes that belong to no complete word.
    short : int
        Version 1: the number of words cut off by the next first byte, or by the end. Version 2: of datagrams refused as
        too short.
    changes : int
        Version 1: the number of changes on the array, which are the rows of `Events`.
    intensities, unpaired : int
        Version 1: the number of intensities that belong to a change, and of those that belong to none.
    markers : int
        The number of starts and stops of a recording.
    contradictory : int
        Version 1: the number of words that are an intensity and a marker at once.
    outside : int
        The number of events, states and intensities outside the array.
    back : int
        Version 1: the number of changes and markers with a stamp behind the latest time; `Events` include them.
    datagrams, intact : int
        Version 2: the number of datagrams given to the decoder, and of those that it decoded.
    repeated, old : int
        Version 2: the number of datagrams received again, with the same contents, and of those whose sequence number
        is more than 65 536 behind the highest, so that it is unknown whether they were received before.
    long, foreign, checksum : int
        Version 2: the number of datagrams refused because they are longer than 1400 bytes, are not of version 2 or come
        from another board, or have a wrong checksum.
    other_board : int
        Version 2: the number of those among `foreign` that are intact, and of another board than the first: by its
        number, or as their session and sequence number came before with other contents.
    missing : int
        Version 2: the number of sequence numbers between the first and the last of each session that were never
        received intact.
    unknown_kind, unknown_flags, unknown_marker : int
        Version 2: the number of datagrams of unknown kind, which are skipped; of datagrams with unknown flags, which
        are decoded; and of markers of unknown code, which are left out.
    malformed : int
        Version 2: the number of bodies that end within a word, or have an offset above 32 511 us; the words before
        that point are decoded.
    events, repaired : int
        Version 2: the number of events on the array, and of those among them that were derived from a state.
    states, stale : int
        Version 2: the number of states on the array, and of those among them that were out of date on arrival.
    dropped, resets : int
        Version 2: the number of datagrams that report dropped events, and of resets of the board.
    events_dropped : int
        Version 2: the number of events that the board dropped by its own totals (kind 4), since its reset or since the
        first totals.
    unknown_value : int
        Version 2: the number of differences from a value that was not received; their events have no intensity.

    Notes
    -----
    Thesis, Appendix 1, Table 5.4, and the page *Wire version 2*.

    Examples
    --------
    A byte that does not begin a word, then one change.

    >>> from taxel.wire import Decoder
    >>> decoder = Decoder()
    >>> events = decoder.push(bytes.fromhex("05 c000050304"))
    >>> decoder.end_of_datagram()
    Events(1 event, 500 to 500 us, 64 x 64 taxels, no intensities)
    >>> decoder.counts.bytes, decoder.counts.words, decoder.counts.skipped
    (6, 1, 1)
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
    other_board: int = 0
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
    events_dropped: int = 0
    unknown_value: int = 0


@dataclass(frozen=True)
class Received:
    """Hold whether a datagram of version 2 was intact, and the time that it promises (`Decoder.last`).

    Parameters
    ----------
    until : int, us, or None
        No datagram of a higher sequence number holds an event before this time; None if the datagram promises no time.
    intact : bool
        False if it was refused, or received before (`Decoder.counts` has the cause).

    Examples
    --------
    >>> from taxel.wire import Decoder
    >>> decoder = Decoder(version=2)
    >>> decoder.push(b"no datagram")
    Events(0 events, no time, 64 x 64 taxels, no intensities)
    >>> decoder.last
    Received(until=None, intact=False)
    """

    until: int | None
    intact: bool


@dataclass(frozen=True)
class Status:
    """Hold the totals that a board of version 2 reports of the time since its reset (`Decoder.status`).

    Parameters
    ----------
    frames, events, dropped, datagrams, faults : int
        The number of frames scanned, of events sent, of events dropped, of datagrams sent before this datagram, and of
        conversions whose comparator had not returned.

    Notes
    -----
    The page *Wire version 2*.

    Examples
    --------
    >>> import numpy as np
    >>> from taxel.simulate import Board, Version2
    >>> from taxel.wire import Decoder, Registers
    >>> board = Board(Registers(wire_version=2), version_2=Version2(states_us=5000))
    >>> decoder = Decoder(version=2)
    >>> for _ in range(50):
    ...     for datagram in board.frame(np.full(4096, 60, np.uint16)):
    ...         events = decoder.push(datagram)
    >>> decoder.status.events, decoder.status.dropped
    (4096, 0)
    """

    frames: int
    events: int
    dropped: int
    datagrams: int
    faults: int
