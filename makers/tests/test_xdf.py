"""XDF of the Lab Streaming Layer: streams of numbers are sources, streams of texts are labels."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusal import refused

import taxel
from taxel import FormatError
from taxel._base.errors import Place

pytest.importorskip("pyxdf")


def chunk(tag: int, content: bytes) -> bytes:
    return b"\x04" + struct.pack("<IH", len(content) + 2, tag) + content


def stream(number: int, name: str, kind: str, t: list[float], samples: list[Any], desc: str = "") -> bytes:
    channels = 1 if kind == "string" else len(samples[0])
    head = (
        f'<?xml version="1.0"?><info><name>{name}</name><type>x</type><channel_count>{channels}</channel_count>'
        f"<nominal_srate>0</nominal_srate><channel_format>{kind}</channel_format>{desc}</info>"
    )
    body = b"".join(
        b"\x08"
        + struct.pack("<d", at)
        + (b"\x01" + bytes([len(s)]) + s.encode() if kind == "string" else struct.pack(f"<{channels}f", *s))
        for at, s in zip(t, samples, strict=True)
    )
    foot = f'<?xml version="1.0"?><info><sample_count>{len(t)}</sample_count></info>'
    ident = struct.pack("<I", number)
    return (
        chunk(2, ident + head.encode())
        + chunk(3, ident + b"\x04" + struct.pack("<I", len(t)) + body)
        + chunk(6, ident + foot.encode())
    )


def write(path: Path, *streams: bytes) -> Path:
    head = b'<?xml version="1.0"?><info><version>1.0</version></info>'
    path.write_bytes(b"XDF:" + chunk(1, head) + b"".join(streams))
    return path


DESC = (
    "<desc><channels>"
    + "".join(f"<channel><label>{n}</label><unit>N</unit></channel>" for n in "ab")
    + "</channels></desc>"
)


def test_streams_of_numbers_are_sources_and_texts_are_labels(tmp_path: Path) -> None:
    t = [1.0 + k / 100 for k in range(20)]
    left = [[k, 2 * k] for k in range(20)]
    path = write(
        tmp_path / "a.xdf",
        stream(1, "left hand", "float32", t, left, DESC),
        stream(2, "right", "float32", t, [[5, k, 7] for k in range(20)]),
        stream(3, "marks", "string", [1.055], ["touch"]),
    )
    recording = taxel.open(path)
    assert list(recording.sources) == ["left_hand", "right"]
    frames = recording.sources["left_hand"].frames()
    np.testing.assert_array_equal(frames.values[:, 0], left)
    np.testing.assert_allclose(np.diff(frames.t), 10_000, atol=1)
    assert (frames.unit, frames.array.names) == ("N", ("a", "b"))
    roles = recording.sources["left_hand"]._main.facts.roles
    assert [(each["name"], each["role"], each["unit"]) for each in roles[1:]] == [
        ("a", "taxel", "N"),
        ("b", "taxel", "N"),
    ]
    assert [(note.text, note.t) for note in recording.sources["right"].notes] == [("touch", 1_055_000)]
    (tmp_path / "a.layout.toml").write_text('[data]\narray = "right"\n')
    assert taxel.open(path).frames().values.shape == (20, 1, 3)


def test_a_damaged_file_and_one_without_numbers_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.xdf", stream(3, "marks", "string", [1.0], ["touch"]))
    with refused(FormatError, place=Place("a.xdf")):
        taxel.open(tmp_path / "a.xdf")
    (tmp_path / "b.xdf").write_bytes(b"XDF:" + bytes(40))
    with refused(FormatError, place=Place("b.xdf")):
        taxel.open(tmp_path / "b.xdf")
