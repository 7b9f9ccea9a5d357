"""The change detector: which events, markers and frames' ends a scan gives, and what is repeated, with a full queue."""

import random
from collections import defaultdict, deque

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import begin, settled, within
from models import NOT_RETURNED, Afferent, Ball
from structs import NUMBERS, pack, unpack

EVENT, MARKER, FRAME, FLUSH = (NUMBERS[f"ENTRY_{name}"] for name in ("EVENT", "MARKER", "FRAME", "FLUSH"))
MARKERS = NUMBERS["MARKERS"]

#: The latest tick that a count can have.
LATEST = 65_534
#: Clocks from a read's report to its first taxel's event, and what may go ahead of a frame's first taxel.
LATENCY, AHEAD = 7, 6


def drawn(frames, build):
    """Return the reads of frames: their fields, those of the frame before, and their trip times by row."""
    reads, ended, ticks, at = [], None, defaultdict(int), 0
    for frame in range(frames):
        if frame % 4 == 0:
            ramp = random.choice([5, 150, 300, 65_000])
            now = {
                "ramp": ramp, "noise_floor": random.choice([0, 3, 255]) if ramp > 5 else 0,
                "lines": random.randrange(build["COLUMNS"]), "pattern": int(frame > 0 and random.random() < 0.3),
                "threshold": {"rest": random.choice([33, 400]), "jump": random.randrange(2000),
                              "decay": random.randrange(256)},
                "format": {"version_2": random.getrandbits(1), "wide_values": ramp > 255,
                           "frame_sync": random.getrandbits(1), "spikes": int(frame > 0 and random.random() < 0.4)},
            }  # fmt: skip
        said = {}
        if ended:
            said = {"initial_frame": frame == 1, "format": ended["format"], "micros": random.getrandbits(31),
                    "lines": ended["lines"], "changed": ended is not now,
                    "line_due": random.random() < 0.4, "totals_due": random.random() < 0.3}  # fmt: skip
        markers = random.choice([0, 0, 1, MARKERS])
        starts = random.randrange(1 << MARKERS)
        lines = random.sample(range(now["lines"] + 1), now["lines"] + 1)
        for line in lines:
            for step in range(build["STEPS"]):
                at += random.randrange(1000)
                read = {
                    "initial_frame": frame == 0, "frame_first": line == lines[0] and step == 0,
                    "frame_last": line == lines[-1] and step == build["STEPS"] - 1, "line": line, "step": step,
                    "stamp": at // 100 & 0xFFFF, "micros": at, "format": now["format"], "ended": said,
                    "pattern": now["pattern"], "ramp": now["ramp"],
                    "noise_floor": now["noise_floor"], "threshold": now["threshold"],
                    "markers": markers, "starts": starts,
                }  # fmt: skip
                counts = []
                for channel in range(build["CHANNELS"]):
                    taxel = line, channel * build["STEPS"] + step
                    if random.random() < 0.4:
                        ticks[taxel] = max(ticks[taxel] + random.randrange(-6, 7), 0)
                    if random.random() < 0.1:
                        ticks[taxel] = within(0, now["ramp"] + 9, now["ramp"])
                    if random.random() < 0.1:
                        # Just what gives no event, or what does.
                        moved = now["noise_floor"] + random.randrange(-1, 2)
                        ticks[taxel] = max(ticks[taxel] + random.choice([-moved, moved]), 0)
                    ticks[taxel] = min(ticks[taxel], LATEST)
                    counts.append(NOT_RETURNED if random.random() < 0.05 else ticks[taxel])
                reads.append((read, counts))
        ended = now
    return reads


class Model:
    """What comes of the reads, in their order, where some entries find no room."""

    def __init__(self, build):
        self.build = build
        self.held, self.afferents = defaultdict(int), defaultdict(Afferent)
        self.ball = Ball(build["COLUMNS"], build["ROWS"])
        self.seen = deque()  # entries, and what found no room: by clock
        self.first, self.faults, self.sent, self.frames = [], 0, 0, 0
        self.lost = self.frame = self.pushed = 0
        self.may_be_full = False
        self.line_pending = self.totals_pending = False
        self.line_next = 0
        self.states, self.totals = [], []  # that have to be repeated

    def entry(self, **fields):
        """Take what was seen next: an entry with these fields, or one that found no room; return which."""
        clock, seen, _ = self.seen.popleft()
        if seen is None:
            return False
        expected = {"frame": self.frame, "lost": self.lost, **fields}
        wrong = {name: value for name, value in expected.items() if getattr(seen, name) != value}
        assert not wrong, (clock, wrong, seen)
        if seen.kind == EVENT:
            late = clock - self.reported - LATENCY - seen.y // self.build["STEPS"]
            assert 0 <= late <= (AHEAD if self.first_of_frame else 0), late
        self.lost, self.pushed = 0, 1
        return True

    def times(self, form, read):
        return {
            "format": unpack("format_t", pack("format_t", **form)),
            "at": read["micros"] if form["version_2"] else read["stamp"],
        }

    def frame_end(self, read):
        """The end of the frame before, with what is repeated; a full queue leaves it out."""
        ended = read["ended"]
        states = False
        line = 0 if self.line_next > ended["lines"] else self.line_next
        after = 0 if line == ended["lines"] else line + 1
        if self.line_pending and ended["format"]["spikes"]:
            self.line_pending, self.line_next = False, after
        else:
            states = self.line_pending
        # It is seen, or left out.
        _, seen, busy = self.seen[0] if self.seen else (0, None, (False, False))
        if seen is None or seen.kind != FRAME:
            assert self.may_be_full
            return
        states, totals = states and not busy[0], self.totals_pending and not busy[1]
        micros = ended["micros"]
        parts = {"x": micros >> 24, "y": micros >> 17 & 127, "more": micros >> 16 & 1, "value": micros & 65535}
        assert self.entry(kind=FRAME, states=states, totals=totals, **parts, **self.times(ended["format"], read))
        if states:
            self.line_pending, self.line_next = False, after
            self.states.append((line, [self.held[line, row] for row in range(self.build["ROWS"])]))
        if totals:
            self.totals_pending = False

    def read(self, read, counts):
        build, form, ended = self.build, read["format"], read["ended"]
        self.first_of_frame = read["frame_first"]
        first = read["frame_first"] and not read["initial_frame"]
        after_sent = first and not ended["initial_frame"]
        if after_sent:
            self.line_pending |= build["REPEATS"] and ended["line_due"]
            self.totals_pending |= ended["totals_due"]
            if ended["format"]["version_2"]:
                self.frame_end(read)
        if first:
            for k in range(read["markers"]):
                self.entry(
                    kind=MARKER, more=read["starts"] >> k & 1, x=0, y=0, value=0, **self.times(ended["format"], read)
                )
            flush = build["HOLDS"] and after_sent and ended["format"]["version_2"] and ended["changed"]
            if flush and not (
                self.may_be_full and not (self.seen and self.seen[0][1] and self.seen[0][1].kind == FLUSH)
            ):
                assert self.entry(kind=FLUSH, **self.times(ended["format"], read))
        if not form["spikes"]:
            self.afferents.clear()
        if read["frame_first"]:
            self.ball.frame(read["pattern"])
        for channel, counted in enumerate(counts):
            row = channel * build["STEPS"] + read["step"]
            taxel = read["line"], row
            if row >= build["ROWS"]:
                continue
            count = self.ball.value(*taxel, read["ramp"]) if read["pattern"] else counted
            value = min(count, read["ramp"])
            if read["initial_frame"]:
                self.first.append(NOT_RETURNED if count == NOT_RETURNED else value)
                continue
            if count == NOT_RETURNED:
                self.faults += 1
                continue
            fields = {"kind": EVENT, "x": read["line"], "y": row, **self.times(form, read)}
            if form["spikes"]:
                spike = self.afferents[taxel].frame(value, **read["threshold"])
                if spike:
                    room = self.entry(more=spike[0], value=spike[1], **fields)
                    self.sent, self.lost = self.sent + room, self.lost or not room
                continue
            moved = value - self.held[taxel]
            if abs(moved) > read["noise_floor"]:
                room = self.entry(more=int(moved >= 0), value=abs(moved) if build["DIFFERENCE"] else value, **fields)
                self.sent, self.lost = self.sent + room, self.lost or not room
                if room:
                    self.held[taxel] = value
            if build["PREVIOUS_SAMPLE"]:
                self.held[taxel] = value
        if read["frame_last"]:
            self.frames += not read["initial_frame"]
            self.frame, self.pushed = self.frame ^ self.pushed, 0


@cocotb.test()
async def entries_are_those_of_the_page(dut):
    names = ("COLUMNS", "ROWS", "CHANNELS", "STEPS", "PREVIOUS_SAMPLE", "DIFFERENCE", "REPEATS", "HOLDS")
    build = {name: int(dut[name].value) for name in names}
    model, reads = Model(build), drawn(300, build)
    await begin(dut, step_end=0, read_done=0, full=0, states_sent=0, totals_sent=0)
    clock, often_full = 0, 0.0
    first, counted = [], dict.fromkeys(("sent", "not_returned", "frame_over"), 0)
    busy, repeated, totals_given, calm = [False, False], [], [], False
    wanted, rows_read = None, None

    async def run(count):
        """Run for some clocks: look at what comes, and read what is repeated as the packer does."""
        nonlocal clock, wanted, rows_read
        for _ in range(count):
            dut.full.value = int(random.random() < often_full)
            dut.totals.value = totals = random.getrandbits(240)
            dut.states_sent.value = dut.totals_sent.value = 0
            if rows_read is not None and rows_read[0] == "read" and calm and random.random() < 0.2:
                dut.states_sent.value, rows_read = 1, None
                busy[0] = False
            if busy[1] and calm and random.random() < 0.05:
                assert int(dut.repeated_totals.value) == totals_given[-1]
                dut.totals_sent.value, busy[1] = 1, False
            if rows_read == ("wait",) and int(dut.states_ready.value):
                rows_read, wanted = ("rows", []), int(dut.repeated_line.value)
            if rows_read is not None and rows_read[0] == "rows":
                if len(rows_read[1]) > 0:
                    repeated[-1][1].append(int(dut.value_repeated.value))
                else:
                    repeated.append((wanted, []))
                if len(rows_read[1]) == build["ROWS"]:
                    rows_read = ("read",)
                else:
                    dut.row_repeated.value = len(rows_read[1])
                    rows_read[1].append(0)
            await settled()
            if int(dut.push.value):
                found = unpack("event_t", dut.found.value)
                model.seen.append((clock, found, tuple(busy)))
                if found.kind == FRAME and found.states:
                    busy[0], rows_read = True, ("wait",)
                if found.kind == FRAME and found.totals:
                    busy[1] = True
                    totals_given.append(totals)
            if int(dut.lost.value):
                assert not int(dut.push.value)
                model.seen.append((clock, None, tuple(busy)))
            for name in counted:
                counted[name] += int(dut[name].value)
            if int(dut.counted_first.value):
                first.append(int(dut.count_first.value))
            clock += 1
            await FallingEdge(dut.clk)

    lost = 0
    for read, counts in reads:
        if read["frame_first"]:
            often_full = random.choice([0, 0, 0.1, 0.5])
            model.may_be_full = often_full > 0
        dut.read.value, dut.step_end.value = pack("read_t", **read), 1
        await run(1)
        dut.read.value, dut.step_end.value = random.getrandbits(len(dut.read)), 0
        await run(random.randrange(2, 5))
        # Nothing is found of the next read before the last one's entries.
        calm = False
        tripped = first_of = at = 0
        for c, count in enumerate(counts):
            # It is seen by the sample after the tick in which it trips; a ramp that did not pass is not seen.
            sample = 0 if count == NOT_RETURNED else count + 1
            seen = count == NOT_RETURNED or count < read["ramp"]
            tripped |= seen << c
            first_of |= (sample + 1 & 1 if seen else random.getrandbits(1)) << c
            at |= (sample >> 1 if seen else random.getrandbits(15)) << 15 * c
        dut.read_done.value, dut.tripped.value, dut.first.value, dut.at.value = 1, tripped, first_of, at
        model.reported = clock
        await run(1)
        dut.read_done.value, dut.tripped.value, dut.at.value = 0, 0, 0
        await run(build["CHANNELS"] + MARKERS + 2 + 7)
        lost += sum(seen is None for _, seen, _ in model.seen)
        model.read(read, counts)
        assert not model.seen
        calm = True
        await run(random.randrange(3, 12))
    assert first == model.first
    assert counted == {"sent": model.sent, "not_returned": model.faults, "frame_over": model.frames}
    complete = [state for state in repeated if len(state[1]) == build["ROWS"]]
    assert complete == model.states[: len(complete)]
    assert len(model.states) - len(complete) <= 1
    assert model.sent > 200
    assert lost > 50
    assert bool(complete) == bool(build["REPEATS"])
    assert len(totals_given) > 5


@pytest.mark.parametrize(
    "build",
    [
        "COLUMNS=3 ROWS=6 CHANNELS=4 STEPS=2",
        "COLUMNS=3 ROWS=8 CHANNELS=8 STEPS=1 PREVIOUS_SAMPLE=1 DIFFERENCE=1 HOLDS=1",
        "COLUMNS=2 ROWS=16 CHANNELS=4 STEPS=4 REPEATS=0 HOLDS=1",
    ],
)
def test_change_detector(simulate, build):
    simulate(build)
