"""A noun's columns: nobody changes them, and whoever reads them reads them where they lie."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest

import taxel
from taxel import Array, Detections, Events, Frames, SpikeTrains

ARRAY = Array(8, 8)


def events() -> Events:
    x = np.arange(6) % 8
    return Events(np.arange(6) * 100, x, x, x % 2 > 0, array=ARRAY, intensity=x * 9, present=x % 3 > 0)


def frames() -> Frames:
    return Frames(np.arange(192.0).reshape(3, 8, 8), [0, 1000, 2000], array=ARRAY)


def trains() -> SpikeTrains:
    return SpikeTrains.from_lists([[1.0, 2.0], [], [1.5]], stop=3.0, values=[[1, -1], [], [2]])


def found() -> Detections:
    return Detections(["a", "b"], [100, 900], [200, 1000], [0.5, 0.25], [210, 1010])


MADE = {
    "events": events,
    "a slice of events": lambda: events()[1:4],
    "chosen events": lambda: events()[np.array([3, 1])],
    "events of both": lambda: events() + events(),
    "sorted events": lambda: events().sorted(),
    "decoded events": lambda: taxel.wire.decode(taxel.wire.encode(events()), array=ARRAY),
    "pushed events": lambda: taxel.wire.Decoder(array=ARRAY).push(taxel.wire.encode(events())),
    "frames": frames,
    "a run of frames": lambda: frames()[1:],
    "a region of frames": lambda: frames().region(slice(2, 5), slice(1, 8)),
    "frames of events": lambda: Frames.from_events(events(), 100),
    "trains": trains,
    "delayed trains": lambda: trains().delayed([0.0, 1.0]),
    "split trains": lambda: trains().split_by_sign(),
    "chosen trains": lambda: trains().select([2, 0]),
    "encoded trains": lambda: taxel.encode.ChangeEvents().encode(events()),
    "detections": found,
    "one label's detections": lambda: found()["a"],
    "detections of both": lambda: found() + found(),
}


def columns(noun: object) -> dict[str, np.ndarray]:
    held = {name: value for name, value in vars(noun).items() if isinstance(value, np.ndarray)}
    assert held
    return held


@pytest.mark.parametrize("make", MADE.values(), ids=MADE)
def test_no_column_can_be_written_to_nor_one_of_a_copy(make) -> None:
    noun = make()
    for kept in (noun, copy.copy(noun), copy.deepcopy(noun), pickle.loads(pickle.dumps(noun))):
        assert kept == noun
        for name, column in columns(kept).items():
            assert not column.flags.writeable, name
            with pytest.raises(ValueError, match="read-only"):
                column[...] = column


GIVEN = {
    "events": lambda t: Events(t, t, t, t > 0, array=ARRAY, intensity=t.astype(np.uint16)),
    "events of the columns' own types": lambda t: Events(
        t, t.astype(np.uint16), t.astype(np.uint16), t > 0, array=ARRAY
    ),
    "frames": lambda t: Frames(np.zeros((len(t), 2, 2)), t),
    "trains": lambda t: SpikeTrains(np.array([0.5]), t, 0.0, 1.0),
    "detections": lambda t: Detections(["a"] * len(t), t, t),
}


@pytest.mark.parametrize("make", GIVEN.values(), ids=GIVEN)
def test_a_callers_array_stays_his_and_what_he_does_to_it_is_not_seen(make) -> None:
    for mine in (np.array([0, 1]), np.array([0, 9, 1])[::2], np.array([[0, 1]])[0]):
        noun = make(mine)
        before = copy.deepcopy(noun)
        assert mine.flags.writeable
        mine[...] = mine + 1
        assert noun == before
    loaned = np.array([0, 1])
    noun = Events(memoryview(loaned), [0, 1], [0, 1], [True, True], array=ARRAY)
    loaned[...] = 9
    assert list(noun.t) == [0, 1]
    empty = np.array([], np.int64)
    assert len(Events(empty, [], [], [], array=ARRAY)) == 0
    assert empty.flags.writeable


#: Prints how much more memory a call needed, at its peak, than the columns that it read hold.
PEAK = """
import sys
import numpy as np
import taxel


def resident(what):
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith(what)) * 1024


n = 4_000_000
rng = np.random.default_rng(3)
x = rng.integers(0, 64, n, dtype=np.uint16)
array = taxel.Array.thesis()
events = taxel.Events(np.arange(n) * 20, x, x[::-1], x % 2 > 0, array=array, intensity=x + 40)
frames = taxel.Frames(rng.random((4_000, 64, 64), np.float32), np.arange(4_000) * 192, array=array)
tare = taxel.Tare.take(events[:200_000])
quiet = {
    "encode": lambda: taxel.encode.ContactArea(tare=tare, noise_floor=200).encode(events),
    "stream": lambda: taxel.encode.ContactArea(tare=tare, noise_floor=200).stream().push(events),
    "encode frames": lambda: taxel.encode.ContactArea(tare=tare, noise_floor=200).encode(frames),
    "tare": lambda: taxel.Tare.take(events),
    "check": lambda: taxel.Events(events.t, events.x, events.y, events.p, array=array),
}
for name, work in quiet.items():
    columns = [frames.values] if "frames" in name else [events.t, events.x, events.y, events.p]
    size = sum(column.nbytes for column in columns)
    # Reading makes pages resident again that the system has reclaimed meanwhile, so that this does not count as a copy.
    for column in columns:
        column.max()
    with open("/proc/self/clear_refs", "w") as reset:
        reset.write("5")
    before = resident("VmRSS")
    work()
    print(name, (resident("VmHWM") - before) / size, sep=",")
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the peak is read from /proc")
def test_columns_are_read_in_place() -> None:
    """The peak of work that says little is a fraction of the columns: a copy of one of them would show."""
    least: dict[str, float] = {}
    # What else the process takes only adds to the peak; a copy is in each of three.
    for _ in range(3):
        said = subprocess.run([sys.executable, "-c", PEAK], capture_output=True, text=True, check=True).stdout
        peaks = {name: float(peak) for name, _, peak in (line.partition(",") for line in said.splitlines())}
        least = {name: min(peak, least.get(name, peak)) for name, peak in peaks.items()}
        if max(least.values()) < 0.1:
            break
    assert len(least) == 5
    assert max(least.values()) < 0.1, least
