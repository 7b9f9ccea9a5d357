"""From every reader to every writer: what a recording holds is there again, or listed as what the file cannot hold."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from formats import bags, making

import taxel
from taxel.formats import FORMATS

from .making import some_frames
from .sections import unsaid
from .test_chains import KINDS, write

#: Fields of the table itself and of how it is stored: they have tests of their own.
STORED = {
    "origin.path", "origin.name", "origin.kind", "origin.label", "event_table.events", "frame_table.frames",
    "timing.interval", "timing.clock", "timing.clock_of", "sensor.calibration", "wire.datagrams", "wire.payload",
    "wire.version_2", "wire.differences", "wire.origin_us", "wire.unmarked", "stream.samples", "losses.lost",
}  # fmt: skip


def bag(folder: Path) -> taxel.Recording:
    """A bag with a message of another length, and one whose stamp steps back."""
    every = [
        ("/hand", bags.HAND, 10.0 * k + 2, 10.0 * (k if k != 6 else -5), bags.hand([k, 1.0] + [5.0] * (k == 3), [2.0]))
        for k in range(12)
    ]
    opened = taxel.open(
        bags.write(folder / "grasp.bag", [*every, ("/other", bags.HAND, 5, 5, bags.hand([1], [2]))]),
        topic="/hand",
        field="thumb",
    )
    assert opened.counts["messages_of_another_length"] == 1
    return opened


def stream(folder: Path) -> taxel.Recording:
    """A recording of lines of which one could not be read, and bytes that were in no line."""
    lines = folder / "lines"
    lines.write_bytes(b"1,2\n3,4\nnonsense\n" + b"7" * 100_000 + b"\n5,6\n7")
    with taxel.live.Live(
        0, host="127.0.0.1", record=folder / "lines.mcap", sources={"imu": f"lines:{lines},columns=a:b"}
    ) as live:
        while live.counters["sources"]["imu"]["lines"] < 5:
            live.next(0.01)
        live.stop()
    return taxel.open(folder / "lines.mcap").sources["imu"]


def cut(folder: Path) -> taxel.Recording:
    """A recording that was killed, and whose file is damaged."""
    whole = write(folder / "whole.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    return taxel.open(folder / "cut.mcap")


def merged(folder: Path) -> taxel.Recording:
    """Two recordings that differ in their counts."""
    return taxel.merge([taxel.open(write(folder / f"{k}.mcap", k, 200 + k)) for k in range(2)], gap_us=1000)


def converted(kind: str, frames: bool) -> Callable[[Path], taxel.Recording]:
    def make(folder: Path) -> taxel.Recording:
        of: Any = some_frames() if frames else taxel.open(write(folder / "of.mcap"))
        taxel.convert(of, folder / f"from{kind}")
        return taxel.open(folder / f"from{kind}")

    return make


def of_format(name: str) -> Callable[[Path], taxel.Recording]:
    def make(folder: Path) -> taxel.Recording:
        return taxel.open_all(getattr(making, f"write_{name}")(folder))[0]

    return make


READERS: dict[str, Callable[[Path], taxel.Recording]] = {
    "bag": bag,
    "stream": stream,
    "cut": cut,
    "merged": merged,
    "as recorded": lambda folder: taxel.open(write(folder / "of.mcap")),
    "a part by time": lambda folder: taxel.open(write(folder / "of.mcap")).between(10_000, 200_000),
    "on the host's clock": lambda folder: taxel.open(write(folder / "of.mcap")).on_clock("host"),
    **{f"events{kind}": converted(kind, False) for kind in KINDS},
    **{f"frames{kind}": converted(kind, True) for kind in KINDS if kind != ".lsa"},
    **{name: of_format(name) for name in FORMATS},
}


@pytest.mark.parametrize(
    ("reader", "kind"),
    [
        # A .h5 is written and opened in processes of their own; a .npz holds the same columns.
        pytest.param(reader, kind, marks=pytest.mark.slow if kind == ".h5" and k % 8 else ())
        for k, reader in enumerate(READERS)
        for kind in KINDS
    ],
)
def test_what_a_recording_holds_is_there_again_or_said(tmp_path: Path, reader: str, kind: str) -> None:
    recording = READERS[reader](tmp_path)
    if kind == ".lsa" and not recording.has_events:
        with pytest.raises(taxel.ProblemError, match="can contain only events"):
            taxel.convert(recording, tmp_path / f"new{kind}")
        return
    said = taxel.convert(recording, tmp_path / f"new{kind}")
    again = taxel.open(tmp_path / f"new{kind}")
    before, after = recording._contents.main, again._contents.main
    assert unsaid(before, after, said, STORED) == []
    if kind in (".mcap", ".npz", ".h5"):
        assert again.counts == (recording.counts or again.counts)
        if before.losses.verdict() is not None:
            assert again.verdict.to_dict() == recording.verdict.to_dict()
        assert list(again.lost) == said
