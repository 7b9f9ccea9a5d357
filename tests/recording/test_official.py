"""The official MCAP reader takes a finished file as it is, and finds the picture in its standard schema."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

import taxel

from .making import HEADER, record, some_events

#: The fields that the standard schemas name (https://docs.foxglove.dev, RawImage and Log).
RAW_IMAGE = {"timestamp", "frame_id", "width", "height", "encoding", "step", "data"}
LOG = {"timestamp", "level", "message", "name", "file", "line"}


def pressure(path: Path) -> list[dict[str, Any]]:
    with path.open("rb") as file:
        messages = make_reader(file).iter_messages()
        return [json.loads(m.data) for _, channel, m in messages if channel.topic == "/pressure"]


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_the_official_reader_gives_every_message_of_a_finished_file(tmp_path: Path, compression: str) -> None:
    path = tmp_path / "a.mcap"
    record(path, some_events(), compression=compression)
    ours = taxel.open(path).datagrams()
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages = list(reader.iter_messages())
        assert summary.statistics.message_count == len(messages)
        theirs = [m for _, channel, m in messages if channel.topic == "/datagrams"]
        assert [m.data for m in theirs] == [ours[k] for k in range(len(ours))]
        assert [m.log_time for m in theirs] == ours.arrived_ns.tolist()
        assert [m.sequence for m in theirs] == ours.number.tolist()
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
    assert json.loads(metadata["taxel"]["header"])["source"] == HEADER["source"]
    assert metadata["taxel.end"]["verdict"].startswith("nothing lost after arrival")


def test_the_picture_is_a_standard_raw_image_and_a_note_a_standard_log(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    record(path, some_events())
    with path.open("rb") as file:
        messages = {channel.topic: (schema, m) for schema, channel, m in make_reader(file).iter_messages()}
    # The last one: two taxels pressed by 60 and 30 ticks above what all read before.
    schema, message = messages["/pressure"]
    assert (schema.name, schema.encoding) == ("foxglove.RawImage", "jsonschema")
    assert set(json.loads(schema.data)["properties"]) >= RAW_IMAGE
    picture = json.loads(message.data)
    assert set(picture) >= RAW_IMAGE
    assert (picture["width"], picture["height"], picture["encoding"], picture["step"]) == (64, 64, "mono8", 64)
    assert base64.b64decode(picture["data"]) == bytes([255, 128]) + bytes(4094)
    assert (picture["rest"], picture["full_ticks"]) == ("first values", 60.0)
    schema, message = messages["/notes"]
    assert schema.name == "foxglove.Log"
    assert set(json.loads(message.data)) >= LOG


def test_a_converted_file_shows_the_pictures_around_what_happened(tmp_path: Path) -> None:
    # A taxel that gains a tick a ms for a second, in hours of silence.
    t = [-3_600_000_000, *(1000 * np.arange(1000)).tolist(), 3_600_000_000]
    ticks = np.array([1, *range(1, 1001), 1000])
    ramp = {"array": taxel.Array(1, 2), "intensity": ticks}
    happened = [(254_321, True), (600_000, True), (1_800_000_000, False), (9_000_000_000, True)]
    events = taxel.Events(t, [0] * 1002, [0] * 1002, [True] * 1002, markers=happened, **ramp)
    taxel.convert(events, tmp_path / "a.mcap")
    said = pressure(tmp_path / "a.mcap")
    near = [250_000, 260_000, 590_000, 600_000, 1_799_990_000, 1_800_000_000]
    tenths = [-3_600_000_000, *range(0, 1_000_001, 100_000), 3_600_000_000]
    assert [p["t_us"] for p in said] == sorted({*tenths, *near})
    for picture in said:
        held = ticks[np.asarray(t) <= picture["t_us"]][-1]
        grey = base64.b64decode(picture["data"])[0]
        # The rest follows what is far above it with 20 s.
        rest = 1 if picture["t_us"] < 0 else 1 + (held - 1) * min(1.0, picture["t_us"] / 20e6)
        assert 0 <= held - grey / 255 * picture["full_ticks"] + picture["full_ticks"] / 255 <= rest + held / 50 + 9
    # A note at 5 ms, a detection of 6 ms that was known at 6.2 ms.
    plain = some_events()
    plain.markers = []
    record(tmp_path / "b.mcap", plain)
    taxel.convert(tmp_path / "b.mcap", tmp_path / "c.mcap")
    assert [p["t_us"] for p in pressure(tmp_path / "c.mcap")] == [10_000, 100_000]
