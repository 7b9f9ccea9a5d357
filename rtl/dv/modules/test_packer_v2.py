"""The packer of version 2: which datagrams docs/wire-v2.md makes of the queue's entries, word by word."""

import random
from dataclasses import replace

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import AT_LIMITS, Pace, begin, clocks, offer, reset, settled, vary, within
from models import Datagram, Version2
from structs import NUMBERS, pack, unpack

EVENT, MARKER, FRAME, FLUSH = (NUMBERS[f"ENTRY_{name}"] for name in ("EVENT", "MARKER", "FRAME", "FLUSH"))
COUNTS = ("frames", "events", "dropped", "faults")


def drawn(frames, rows, board, valued, difference):
    """Return entries of frames, and give them to the board; with them go what is repeated after an entry."""
    entries, at, totals = [], random.randrange(1 << 20), dict.fromkeys(COUNTS, 0)
    form, spikes, usual = {"version_2": 1, "frame_sync": 1}, 0, 200

    def kind():
        return 0 if not valued and not spikes else 2 if form["wide_values"] or spikes else 1

    for k in range(frames):
        if k % 15 == 0:
            # Other registers: what was gathered is sent first.
            if k:
                entries.append((pack("event_t", kind=FLUSH, format=form, at=at), None, None))
                board.close(at)
            # Each kind of events comes often enough that some of its lines are repeated.
            spikes, wide = divmod(k // 15 % 4, 2)
            usual = random.choice([30, 200, 9000, 70_000])
            form = {
                "version_2": 1,
                "frame_sync": random.getrandbits(1),
                "spikes": spikes,
                "wide_values": wide or spikes,
            }
            often = random.choice([0, 0.1, 1])
        # Some frames end, and some events come, when a time that the page names is just over since what it counts from.
        limits = [
            since + limit + random.randrange(-1, 2) - at
            for since in (board.latest, board.promised, board.begun and board.begun.base)
            for limit in (100_000, 65_535, 32_511, board.heartbeat, board.hold)
            if since is not None
        ]
        limits = [length for length in limits if 0 < length < 200_000]
        length = random.choice(limits) if limits and random.random() < AT_LIMITS else usual
        sent = {"kind": kind(), "frame_sync": form["frame_sync"], "differences": int(difference and not spikes)}
        for x in random.sample(range(128), random.choice([1, 3])) if random.random() < often else ():
            time = at if form["frame_sync"] else at + random.choice([random.randrange(length), length - 1])
            lines = [(x, y) for y in sorted(random.sample(range(rows), min(rows, random.choice([1, 2, 9]))))]
            # The places between two events are as many as a word counts, one more or one less.
            place = (lines[-1][0] << board.stride | lines[-1][1]) + 1 + within(125, 129, 127)
            if place >> board.stride > x and place >> board.stride < 128 and place % (1 << board.stride) < rows:
                lines.append((place >> board.stride, place % (1 << board.stride)))
            for column, y in lines:
                event = {
                    "x": column,
                    "y": y,
                    "at": time,
                    "more": random.getrandbits(1),
                    "value": within(0, 65535, 255),
                }
                lost = random.random() < 0.05
                board.lost |= lost
                board.event(**event, **sent)
                entries.append((pack("event_t", kind=EVENT, format=form, lost=lost, **event), None, None))
            at = time
        at += length
        # The frame's end, with what is repeated then.
        states, counts = None, None
        if random.random() < 0.2 and not spikes:
            states = random.randrange(128), [random.choice([0, 255, 256, 65535]) for _ in range(rows)]
        if random.random() < 0.1:
            totals = {name: count + random.randrange(1 << 40) for name, count in totals.items()}
            counts = totals
        fields = dict(
            zip(
                ("x", "y", "more", "value"),
                (length >> 24 & 127, length >> 17 & 127, length >> 16 & 1, length & 65535),
                strict=True,
            )
        )
        also = states is not None or counts is not None
        entries.append(
            (
                pack(
                    "event_t",
                    kind=FRAME,
                    format=form,
                    at=at,
                    states=states is not None,
                    totals=counts is not None,
                    **fields,
                ),
                states,
                counts,
            )
        )
        board.frame_end(at, length, also, **sent)
        if states:
            board.states(at, *states, **sent | {"kind": 1 if sent["kind"] == 1 else 2})
        if counts:
            board.totals(at, **counts, **sent)
        if random.random() < 0.1:
            start, lost = random.getrandbits(1), random.random() < 0.1
            entries.append((pack("event_t", kind=MARKER, format=form, at=at, more=start, lost=lost), None, None))
            board.lost |= lost
            board.marker(at, start, **sent)
    return entries


@cocotb.test()
async def datagrams_are_those_of_the_page(dut):
    rows, valued, difference = int(dut.ROWS.value), int(dut.VALUED.value), int(dut.DIFFERENCE.value)
    in_pace, link_pace = Pace(), Pace()
    board = Version2(
        max(rows - 1, 0).bit_length(), 2 * int(dut.MOST.value), int(dut.HOLD_US.value), int(dut.HEARTBEAT_US.value)
    )
    entries = drawn(300, rows, board, valued, difference)
    # What is still gathered after the last entry goes when an entry of version 1 comes.
    if board.begun:
        board.close(board.begun.at)
    await begin(dut, valid=0, leaving=0, states_ready=0, sending=0)

    def put(entry):
        dut.entry.value = entry[0]

    # What was gathered before a reset is forgotten.
    before = drawn(20, rows, Version2(board.stride), valued, difference)
    source = cocotb.start_soon(offer(dut.clk, dut.valid, dut.taken, put, before, in_pace))
    # After some thousand clocks a line's values are most often waited for.
    await clocks(dut.clk, random.choice([random.randrange(20, 300), 3000]))
    source.cancel()
    await reset(dut, valid=0)
    cocotb.start_soon(vary(dut.clk, 1500, in_pace, link_pace))
    source = cocotb.start_soon(offer(dut.clk, dut.valid, dut.taken, put, entries, in_pace))
    came, body, bank, sending, asked, quiet = [], [], None, False, 0, 0
    taken, states = 0, None
    while quiet < 300:
        # The copied line comes to the packer a clock after it asked for a row.
        dut.states_ready.value = int(states is not None and random.random() < 0.1)
        dut.value_repeated.value = states[1][asked] if states and asked < rows else random.getrandbits(16)
        sending = sending and not (random.random() < 0.2 and link_pace())
        dut.sending.value = int(sending)
        await settled()
        asked = int(dut.row_repeated.value)
        if int(dut.taken.value):
            # What is repeated stands until it was sent.
            _, states, totals = entries[taken]
            taken += 1
            if states:
                dut.repeated_line.value = states[0]
            if totals:
                dut.totals.value = pack("totals_t", **totals, datagrams=random.getrandbits(48))
        if int(dut.write.value):
            # What is being sent stands still.
            assert int(dut.bank.value) != bank or not sending
            assert int(dut.place.value) == len(body)
            body.append(int(dut.unit.value))
        if int(dut.send.value):
            assert not sending
            head = unpack("datagram_t", dut.datagram.value)
            assert head.units == len(body)
            assert head.bank != bank
            bank, sending = head.bank, True
            came.append(
                Datagram(
                    kind=head.kind, base=head.base, frame_sync=head.frame_sync, differences=head.differences,
                    dropped=head.dropped, line=head.line, span=head.span, sequence=head.sequence_number,
                    body=b"".join(unit.to_bytes(2, "little") for unit in body),
                )
            )  # fmt: skip
            body = []
            k = len(came) - 1
            assert came[k] == replace(board.sent[k], at=0, position=-1)
        quiet = quiet + 1 if source.done() else 0
        # An entry of version 1 comes: what was gathered goes.
        dut.leaving.value = int(source.done())
        await FallingEdge(dut.clk)
    assert came == [replace(datagram, at=0, position=-1) for datagram in board.sent]
    assert {datagram.kind for datagram in came} >= {2, 3, 4, 7}
    assert int(dut.idle.value)


@pytest.mark.parametrize(
    "build",
    [
        "ROWS=9 MOST=60",
        "ROWS=128 MOST=688 HOLD_US=1000 DIFFERENCE=1",
        "ROWS=64 MOST=128 VALUED=0 HEARTBEAT_US=30000",
    ],
)
def test_packer_v2(simulate, build):
    simulate(build)
