"""The official MCAP reader takes a finished file as it is, and finds the picture in its standard schema."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

import taxel

from .making import HEADER, images, record, some_events

#: The fields that the standard schema names (https://docs.foxglove.dev, Log).
LOG = {"timestamp", "level", "message", "name", "file", "line"}


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
    # The last one: two taxels pressed by 60 and 30 ticks above what all read before.
    _, _, _, picture = images(path, "/pressure")[-1]
    assert (picture.width, picture.height, picture.encoding, picture.step) == (64, 64, "mono8", 64)
    assert picture.timestamp.nanos == 100_000_000
    assert list(picture.data) == [135, 105, *[75] * 4094]
    with path.open("rb") as file:
        messages = {channel.topic: (schema, m) for schema, channel, m in make_reader(file).iter_messages()}
    schema, message = messages["/notes"]
    assert schema.name == "foxglove.Log"
    assert set(json.loads(message.data)) >= LOG


def test_a_converted_file_shows_what_was_held_where_something_came(tmp_path: Path) -> None:
    # Two presses with an hour between: no pictures of the hour.
    t = [0, 50_000, 3_600_000_000, 3_600_150_000]
    events = taxel.Events(t, [1, 1, 1, 2], [0] * 4, [True] * 4, array=taxel.Array(1, 4), intensity=[10, 40, 300, 50])
    taxel.convert(events, tmp_path / "a.mcap")
    said = [image for _, _, _, image in images(tmp_path / "a.mcap", "/pressure")]
    times = [picture.timestamp.seconds * 1_000_000 + picture.timestamp.nanos // 1000 for picture in said]
    assert times == [0, 100_000, 3_600_000_000, 3_600_200_000]
    types = [{"mono8": "u1", "16UC1": "<u2"}[picture.encoding] for picture in said]
    held = [np.frombuffer(picture.data, dtype).tolist() for picture, dtype in zip(said, types, strict=True)]
    assert types == ["u1", "u1", "<u2", "<u2"]
    assert held == [[0, 10, 0, 0], [0, 40, 0, 0], [0, 300, 0, 0], [0, 300, 50, 0]]
