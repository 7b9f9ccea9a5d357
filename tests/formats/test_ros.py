"""ROS bags, made with rosbags itself: what opens, by which times, and what is refused."""

from __future__ import annotations

import json
import re
import shutil
import sqlite3
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from draws import mixed
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML
from shell import call

import taxel
from taxel import FormatError, ProblemError
from taxel.formats import ros
from taxel.formats.ros.reading import _times
from taxel.recording.text_options import TextOptions
from taxel.tasks.labels import references

from . import bags
from .bags import BEGIN_NS, HAND, PALM, SKIN

PALM_ARRAY = taxel.Array(24, 32)
IMAGE = "sensor_msgs/msg/Image"
KINDS = ("grasp.bag", "grasp.db3", "grasp.mcap", "grasp")
RNG = np.random.default_rng(7)
PALMS = RNG.integers(-(2**15), 2**15, (6, 24, 32))


def palms(count: int = 6, every_ms: float = 10.0) -> list[bags.Message]:
    """Messages of a palm, each under way for 2 ms."""
    return [("/palm", PALM, every_ms * k + 2, every_ms * k, bags.palm(PALMS[k % len(PALMS)])) for k in range(count)]


@pytest.mark.parametrize("name", KINDS)
def test_a_palm_opens_as_frames_from_every_kind_of_bag(name: str, tmp_path: Path) -> None:
    bag = bags.write(tmp_path / name, palms())
    opened = taxel.open(bag, topic="/palm", field="taxels", array=PALM_ARRAY)
    t = BEGIN_NS // 1000 + np.arange(6) * 10_000
    assert opened.frames() == taxel.Frames(PALMS, t, unit="counts", array=PALM_ARRAY)
    assert (opened.kind, opened.remarks, opened.source) == ("ros", (), f"/palm.taxels ({PALM})")
    assert opened.counts == {"messages": 6, "messages_of_another_length": 0, "times_by_the_bag": 0}
    # The only field with numbers need not be named; without an array a message is one row.
    assert np.array_equal(taxel.open(bag, topic="/palm").frames().values[:, 0], PALMS.reshape(6, 768))


def test_a_bag_of_split_files_is_one_recording(tmp_path: Path) -> None:
    every = palms(12)
    first, second = bags.write(tmp_path / "first", every[:5]), bags.write(tmp_path / "second", every[5:])
    shutil.move(second / "second.db3", first / "second.db3")
    yaml, place = YAML(typ="safe"), first / "metadata.yaml"
    about = yaml.load(place.read_text())
    of = about["rosbag2_bagfile_information"]
    of["relative_file_paths"].append("second.db3")
    of["message_count"] = of["topics_with_message_count"][0]["message_count"] = 12
    with place.open("w") as file:
        yaml.dump(about, file)
    frames = taxel.open(first, topic="/palm", array=PALM_ARRAY).frames()
    assert np.array_equal(frames.values, np.concatenate([PALMS, PALMS]))
    assert np.array_equal(np.diff(frames.t), np.full(11, 10_000))


def test_topics_are_listed_with_fields_shapes_and_rates(tmp_path: Path) -> None:
    several = palms()
    several += [("/hand", HAND, 20 * k + 3, 20 * k, bags.hand([1, 2, 3], [4, 5])) for k in range(3)]
    several += [("/near", IMAGE, 9 * k + 4, 9 * k, bags.image(np.ones((3, 4), np.uint16), "mono16")) for k in range(4)]
    several += [("/skin", SKIN, 5 + k, None, bags.skin([([1, 2], [0.5]), ([3, 4], [1.5])])) for k in range(2)]
    several += [("/colours", IMAGE, 6, 6, bags.image(np.zeros((2, 2, 3), np.uint8), "rgb8"))]
    found = ros.topics(bags.write(tmp_path / "grasp.mcap", sorted(several, key=lambda one: one[2])))
    rates = {one.topic: None if one.rate_hz is None else round(one.rate_hz, 3) for one in found}
    assert rates == {"/palm": 100.0, "/hand": 50.0, "/near": 111.111, "/skin": 1000.0, "/colours": None}
    facts = {(one.topic, one.field): (one.shape, one.dtype, one.messages) for one in found}
    assert facts == {
        ("/palm", "taxels"): ((768,), "int16", 6),
        ("/hand", "thumb"): ((3,), "float64", 3),
        ("/hand", "index"): ((2,), "float64", 3),
        ("/near", ""): ((3, 4), "uint16", 4),
        ("/skin", "patches.number"): ((2,), "int64", 2),
        ("/skin", "patches.taxels"): ((4,), "uint16", 2),
        ("/skin", "patches.forces.x"): ((2,), "float64", 2),
        ("/skin", "patches.forces.z"): ((2,), "float64", 2),
        ("/colours", ""): ((), "", 1),
    }
    (colours,) = (one for one in found if one.topic == "/colours")
    assert colours.trouble.startswith("the encoding of the images is rgb8; must be one with a single channel")


@pytest.mark.parametrize(("encoding", "dtype"), [
    ("mono8", np.uint8), ("8UC1", np.uint8), ("8SC1", np.int8), ("mono16", np.uint16), ("16UC1", np.uint16),
    ("16SC1", np.int16), ("32SC1", np.int32), ("32FC1", np.float32), ("64FC1", np.float64),
])  # fmt: skip
@settings(max_examples=settings.default.max_examples // 7)
@given(data=st.data())
def test_an_image_of_any_encoding_of_one_channel_reads_as_it_was_made(encoding, dtype, data, tmp_path_factory) -> None:
    rows, columns = data.draw(st.tuples(st.integers(1, 9), st.integers(2, 9)))
    raw = np.random.default_rng(data.draw(st.integers(0, 99))).integers(0, 200, (rows, columns))
    pixels = (raw - 100 if np.dtype(dtype).kind != "u" else raw).astype(dtype)
    make = bags.image(pixels, encoding, padding=data.draw(st.integers(0, 5)), big=data.draw(st.booleans()))
    bag = bags.write(tmp_path_factory.mktemp("image") / "a.mcap", [("/near", IMAGE, 1, 1, make)])
    assert np.array_equal(taxel.open(bag, topic="/near").frames().values[0], pixels)


def test_topics_fields_and_parts_of_lists_become_sources(tmp_path: Path) -> None:
    several = palms()
    several += [("/hand", HAND, 10 * k + 3, 10 * k, bags.hand([1, 2, k], [4, 5])) for k in range(6)]
    several += [("/skin", SKIN, 10 * k + 4, None, bags.skin([([1, 2], [0.5, k]), ([3, 4], [1.5])])) for k in range(6)]
    bag = bags.write(tmp_path / "grasp.db3", sorted(several, key=lambda one: one[2]))
    both = taxel.open(bag, topic=["/palm", "/hand"], field=["taxels", "thumb"], array=[PALM_ARRAY, taxel.Array(1, 3)])
    assert list(both.sources) == ["palm", "hand"]
    assert both.sources["palm"].frames().array == PALM_ARRAY
    assert np.array_equal(both.sources["hand"].frames().values[:, 0, 2], np.arange(6))
    with pytest.raises(ProblemError, match=r"contains 2 sources \(palm, hand\); choose one with"):
        both.frames()
    # What else the bag holds is named, in a recording made from it too.
    assert {one.lost for one in both.sources.values()} == {("other topics of the bag: /skin",)}
    taxel.convert(both, tmp_path / "both.mcap")
    assert taxel.open(tmp_path / "both.mcap").sources["hand"].lost == ("other topics of the bag: /skin",)
    fingers = taxel.open(bag, topic="/hand", field=["thumb", "index"])
    assert {name: one.array.shape for name, one in fingers.sources.items()} == {
        "hand_thumb": (1, 3),
        "hand_index": (1, 2),
    }
    forces = taxel.open(bag, topic="/skin", field="patches.forces.z")
    assert np.array_equal(forces.frames().values[:, 0], [[0.5, k, 1.5] for k in range(6)])
    assert forces.remarks == ("the times are those of the bag, because the messages have no header",)
    assert np.array_equal(taxel.open(bag, topic="/skin", field="patches.1.taxels").frames().values[0, 0], [3, 4])


@pytest.mark.parametrize("sizes", [(24, 32), (768,), ()])
def test_a_multi_array_is_its_data_and_says_its_rows_and_columns(
    sizes: tuple[int, ...], tmp_path: Path, capsys
) -> None:
    kind = "std_msgs/msg/Int16MultiArray"
    sent = [("/raw", kind, 10 * k, None, bags.multi_array(PALMS[k], sizes)) for k in range(3)]
    sent.append(("/status", "std_msgs/msg/Float64", 40, None, lambda types, _: types["std_msgs/msg/Float64"](1.0)))
    bag = bags.write(tmp_path / "palm.mcap", sent)
    [topic] = ros.topics(bag)
    assert (topic.field, topic.shape) == ("data", sizes if len(sizes) == 2 else (768,))
    assert "--topic /raw --field data" in call(capsys, "info", bag)[1]
    frames = taxel.open(bag, topic="/raw").frames()
    assert frames.array.shape == ((24, 32) if len(sizes) == 2 else (1, 768))
    assert np.array_equal(frames.values.reshape(3, 24, 32), PALMS[:3])
    with pytest.raises(FormatError, match="topic /status: no field has more than one number"):
        taxel.open(bag, topic="/status")


@pytest.mark.parametrize(("begins", "name"), mixed([0, 2], ["grasp.bag", "grasp.db3"]))
def test_multi_arrays_of_every_number_are_listed_and_read_also_after_empty_ones(
    begins: int, name: str, tmp_path: Path
) -> None:
    dtypes = (np.int8, np.uint8, np.int16, np.uint16, np.int32, np.uint32, np.int64, np.uint64, np.float32, np.float64)
    values = RNG.integers(0, 100, (5, 2, 3))
    sent = [
        (f"/{np.dtype(d).name}", bags.array_of(d), 10 * k, None,
         bags.multi_array(values[k] if k >= begins else [], (2, 3) if k >= begins else (0, 0), d))
        for k in range(5) for d in dtypes
    ]  # fmt: skip
    sent.append(("/never", bags.array_of(np.float64), 60, None, bags.multi_array([], (0,), np.float64)))
    sent.append(("/one", bags.array_of(np.float64), 61, None, bags.multi_array([1], (1,), np.float64)))
    bag = bags.write(tmp_path / name, sent)
    listed = {one.topic: (one.field, one.shape, one.dtype, one.messages) for one in ros.topics(bag)}
    assert listed == {f"/{(n := np.dtype(d).name)}": ("data", (2, 3), n, 5) for d in dtypes}
    for d in dtypes:
        opened = taxel.open(bag, topic=f"/{np.dtype(d).name}")
        assert np.array_equal(opened.frames().values, values[begins:])
        assert opened.frames().unit == ("as sent" if np.dtype(d).kind == "f" else "counts")
        assert opened.counts["messages_of_another_length"] == begins


def test_texts_count_from_the_recordings_beginning_and_json_from_1970(tmp_path: Path, capsys) -> None:
    values = RNG.integers(0, 2, (200, 4, 4)) + 100 * (np.arange(200) > 120)[:, None, None]
    sent = [
        ("/a", bags.array_of(np.float64), 10 * k, None, bags.multi_array(values[k], (4, 4), float)) for k in range(200)
    ]
    bag, begin = bags.write(tmp_path / "a.bag", sent), BEGIN_NS // 1000
    info = ("info", bag, "--topic", "/a")
    said = call(capsys, *info)[1]
    assert said.splitlines()[0].startswith(f"{bag}: ROS bag, from /a.data")
    assert re.search(
        r"^  rest +that of a quiet stretch, 0\.\d+ to [01]\.\d+ s; later the rest follows slow changes$", said, re.M
    )
    assert "losses unknown: the ROS bag does not record them" in said
    # Only the line that says the beginning has the time since 1970.
    assert [line.split()[0] for line in said.splitlines() if "1795" in line] == ["from"]
    quiet = json.loads(call(capsys, *info, "--json")[1])["rest"]["quiet_us"]
    assert begin <= quiet[0] < quiet[1] <= begin + 1_990_000
    labels = tmp_path / "labels.csv"
    for t in (6_000_000, begin + 10**7):
        labels.write_text(f"label,t_us\ncontact,{t}\n")
        wrong = call(capsys, "train", bag, "--topic", "/a", "--labels", labels, "-o", tmp_path / "r.json")[2]
        assert "none within" in wrong
        assert f"it begins 2026-11-18 11:06:40.000 UTC, {begin} us since 1970" in wrong


def test_messages_of_another_length_are_left_out_and_counted(tmp_path: Path) -> None:
    lengths = (3, 3, 5, 3, 0, 3)
    several = [("/hand", HAND, 10 * k + 3, 10 * k, bags.hand(range(n), [1, 1])) for k, n in enumerate(lengths)]
    bag = bags.write(tmp_path / "grasp.db3", several)
    for array in (None, taxel.Array(1, 3)):
        opened = taxel.open(bag, topic="/hand", field="thumb", array=array)
        assert (opened.counts["messages"], opened.counts["messages_of_another_length"]) == (4, 2)
        assert opened.lost == ("2 of 6 messages are left out, because they do not have 1 x 3 values",)
        assert np.array_equal(opened.frames().t - BEGIN_NS // 1000, [0, 10_000, 30_000, 50_000])
    with pytest.raises(FormatError, match="thumb: the messages have 3 values each; the array has 2 x 2"):
        taxel.open(bag, topic="/hand", field="thumb", array=taxel.Array(2, 2))


@pytest.mark.parametrize(
    ("stamps", "late", "expected", "by_the_bag"),
    [
        ([1, 11, 21, 31], 2, [1, 11, 21, 31], 0),
        ([1, None, 21, 31], 2, [1, 13, 21, 31], 1),
        ([None, 11, 21, 31], 2, [3, 11, 21, 31], 1),
        ([1, 11, 5, 31], 2, [1, 11, 23, 31], 1),
        ([1, 11, 11, 31], 2, [1, 11, 23, 31], 1),
        # The bag's time would come after the next stamp: the median time under way is taken off.
        ([1, None, 21, 31], 25, [1, 11, 21, 31], 1),
        # A clock that was set back: what follows continues by the bag.
        ([1001, 1011, 21, 31], 2, [1001, 1011, 1021, 1031], 2),
        # One stamp ahead, by less than a day or by years, leaves those after it as they are.
        ([1, 1011, 21, 31], 2, [1, 13, 21, 31], 1),
        ([1, 11, 21, 3e11], 2, [1, 11, 21, 33], 1),
        ([-1e12, 11, 21, 31], 2, [3, 11, 21, 31], 1),
        ([1, 11, -1e12, 31], 20, [1, 11, 21, 31], 1),
        # The last stamp ahead by an hour, the one before it, and the first back by an hour.
        ([1, 11, 21, 31, 3_600_041], 2, [1, 11, 21, 31, 43], 1),
        ([1, 11, 21, 3_600_031, 41], 2, [1, 11, 21, 33, 41], 1),
        ([-3_600_001, 11, 21, 31, 41], 2, [3, 11, 21, 31, 41], 1),
        # Half of them sound, ahead of the bag's time or behind it.
        ([1, None, 21, None], 2, [1, 13, 21, 33], 2),
        ([3_600_001, None, 3_600_021, None], 2, [3_600_001, 3_600_011, 3_600_021, 3_600_031], 2),
        # Fewer than half: none, one value for all, falling ones, all of another day, and three of four ahead.
        ([None] * 4, 2, [3, 13, 23, 33], 4),
        ([1] * 4, 2, [3, 13, 23, 33], 4),
        ([31, 21, 11, 1], 2, [3, 13, 23, 33], 4),
        ([86_500_001, 86_500_011, 86_500_021, 86_500_031], 2, [3, 13, 23, 33], 4),
        ([3e11, 3e11, 21, 3e11], 2, [3, 13, 23, 33], 4),
        # Of one message the one stamp counts, if it is sound.
        ([1], 2, [1], 0),
        ([None], 2, [3], 1),
        ([3e11], 2, [3], 1),
    ],
)
def test_a_wrong_stamp_gives_way_to_the_bags_time_and_those_of_most_to_the_bags_times(
    stamps, late, expected, by_the_bag, tmp_path
) -> None:
    several = [("/palm", PALM, 1 + 10 * k + late, stamp, bags.palm(PALMS[0])) for k, stamp in enumerate(stamps)]
    bag, count = bags.write(tmp_path / "grasp.mcap", several), len(stamps)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        opened = taxel.open(bag, topic="/palm")
    assert (opened.frames().t - BEGIN_NS // 1000).tolist() == [1000 * ms for ms in expected]
    assert opened.counts["times_by_the_bag"] == by_the_bag
    said = f"{by_the_bag} of {count} message{'s' * (count > 1)} have the time of the bag"
    assert [said in line for line in opened.lost] == [True] * (by_the_bag > 0)
    assert [f"{bag}: topic /palm: {line}" for line in opened.lost] == [str(one.message) for one in caught]


@pytest.mark.parametrize(
    ("lengths", "read", "places"),
    [
        # The first message, or the last, is odd; so are most in turn; the first of two lengths alike.
        ([5, 3, 3, 3], 3, [1, 2, 3]),
        ([3, 3, 3, 5], 3, [0, 1, 2]),
        ([1, 3, 3], 3, [1, 2]),
        ([0, 1, 2, 9, 4, 4], 4, [4, 5]),
        ([6, 2, 6, 2, 6, 2], 6, [0, 2, 4]),
        ([12] * 5 + [3] * 25, 3, list(range(5, 30))),
        ([7], 7, [0]),
    ],
)
@pytest.mark.parametrize(("layout", "name"), mixed(["a row", "a grid"], ["grasp.bag", "grasp.mcap"]))
def test_the_most_frequent_length_is_read_whatever_comes_first(
    name: str, layout: str, lengths: list[int], read: int, places: list[int], tmp_path: Path, capsys
) -> None:
    sizes = (lambda n: (2, n)) if layout == "a grid" else lambda n: ()
    twice = 2 if layout == "a grid" else 1
    kind = "std_msgs/msg/Int16MultiArray"
    sent = [
        ("/raw", kind, 10 * k, None, bags.multi_array(np.arange(twice * n) + k, sizes(n) if n else (0, 0)))
        for k, n in enumerate(lengths)
    ]
    bag = bags.write(tmp_path / name, sent)
    opened = taxel.open(bag, topic="/raw")
    assert opened.array.shape == ((2, read) if layout == "a grid" else (1, read))
    assert (opened.frames().t - BEGIN_NS // 1000).tolist() == [10_000 * k for k in places]
    assert opened.frames().values[:, 0, 0].tolist() == places
    left = len(lengths) - len(places)
    assert opened.counts["messages_of_another_length"] == left
    assert [f"{left} of {len(lengths)} messages are left out" in line for line in opened.lost] == [True] * (left > 0)
    # The count is told before anything else, and the list of topics names the shape of most.
    head, first, *_ = call(capsys, "info", bag, "--topic", "/raw")[1].splitlines()
    assert (f"{left} of {len(lengths)} messages are left out" in first) == (left > 0), head
    (listed,) = ros.topics(bag)
    assert listed.shape == ((2, read) if layout == "a grid" else (read,))


@given(
    stamps=st.lists(
        st.one_of(st.just(0), st.integers(-(10**12), 10**12), st.integers(1, 20), st.just(2**62)),
        min_size=1,
        max_size=30,
    ),
    steps=st.lists(st.integers(0, 10**9), min_size=30, max_size=30),
)
def test_times_never_fall_and_are_stamps_or_are_counted(stamps, steps) -> None:
    bag = np.cumsum(steps)[: len(stamps)] + 10**6
    t, by_the_bag = _times(np.array(stamps, np.int64), bag)
    assert (np.diff(t) >= 0).all()
    assert np.count_nonzero(t != stamps) <= by_the_bag
    # The most stamps that ascend, by trying each that could come before.
    most: list[int] = []
    for k, stamp in enumerate(stamps):
        near = stamp > 0 and abs(int(bag[k]) - stamp) <= 86_400 * 10**9
        most.append(near * (1 + max((most[j] for j in range(k) if stamps[j] < stamp), default=0)))
    sound = max(most)
    if 2 * sound < len(stamps):
        assert by_the_bag == len(stamps)
    else:
        # At most the first and the last of them lie too far from the bag's times.
        assert by_the_bag == len(stamps) or len(stamps) - sound <= by_the_bag <= len(stamps) - sound + 2
    if by_the_bag == len(stamps):
        assert t.tolist() == bag.tolist()


def without_definitions(bag: Path) -> Path:
    """Take the definitions out of a .db3, as releases of ROS before Iron write it."""
    with sqlite3.connect(bag) as database:
        database.execute("DELETE FROM message_definitions")
    database.close()
    return bag


def test_a_bag_without_definitions_names_both_options_and_opens_by_them(tmp_path: Path) -> None:
    bag = without_definitions(bags.write(tmp_path / "grasp.db3", palms()))
    (listed,) = ros.topics(bag)
    assert (listed.messages, listed.trouble) == (6, f"no definition of {PALM}")
    said = (
        rf"the definition of {PALM} \(topic /palm\) is not in the bag; .*folder of .* release of ROS, one of "
        r".*humble.*; give types"
    )
    with pytest.raises(FormatError, match=said):
        taxel.open(bag, topic="/palm")
    (tmp_path / "skins_msgs" / "msg").mkdir(parents=True)
    own = tmp_path / "skins_msgs" / "msg" / "Palm.msg"
    own.write_text(bags.DEFINITIONS[PALM])
    with pytest.raises(FormatError, match=r"the definition of std_msgs/msg/Header .*release of ROS"):
        taxel.open(bag, topic="/palm", types=tmp_path / "skins_msgs")
    flat = tmp_path / "flat"
    flat.mkdir()
    shutil.copy(own, flat)
    for types in (tmp_path / "skins_msgs", tmp_path / "skins_msgs" / "msg", flat):
        opened = taxel.open(bag, topic="/palm", types=types, ros="humble", array=PALM_ARRAY)
        assert np.array_equal(opened.frames().values, PALMS)
    # The bag holds the digest of its definition, so that another one is not taken for it.
    own.write_text("std_msgs/Header header\nint16[767] taxels\n")
    with pytest.raises(FormatError, match=f"was recorded with another definition of {PALM}"):
        taxel.open(bag, topic="/palm", types=tmp_path / "skins_msgs", ros="humble")


def test_a_definition_in_idl_opens_a_bag(tmp_path: Path) -> None:
    bag = without_definitions(bags.write(tmp_path / "grasp.db3", palms()))
    (tmp_path / "types").mkdir()
    (tmp_path / "types" / "Palm.idl").write_text(
        '#include "std_msgs/msg/Header.idl"\n\nmodule skins_msgs {\n  module msg {\n'
        "    typedef int16 int16__768[768];\n    struct Palm {\n      std_msgs::msg::Header header;\n"
        "      int16__768 taxels;\n    };\n  };\n};\n"
    )
    opened = taxel.open(bag, topic="/palm", types=tmp_path / "types", ros="humble", array=PALM_ARRAY)
    assert np.array_equal(opened.frames().values, PALMS)


@pytest.mark.parametrize(
    ("given", "error", "said"),
    [
        ({}, FormatError, "choose one of its topics.*; to list the topics, run taxel info .*grasp.*; give topic"),
        ({"topic": "/foot"}, FormatError, "has no topic /foot; its topics are /hand, /palm"),
        ({"topic": "/hand"}, FormatError, "topic /hand: has several fields with numbers: thumb, index.*; give field"),
        (
            {"topic": "/palm", "field": "thumb"},
            FormatError,
            "field thumb: the field has no numbers; fields with numbers: taxels",
        ),
        ({"topic": "/hand", "field": "note"}, FormatError, "field note: the field has no numbers"),
        ({"topic": "/palm", "field": "taxels.3"}, FormatError, r"field taxels\.3: the field has no numbers"),
        ({"topic": ["/hand", "/palm"], "field": ["a"] * 3}, ProblemError, "topic is given 2 times for 3 sources"),
        ({"topic": ["/palm", "/palm"]}, ProblemError, "palm.taxels is chosen twice"),
        ({"topic": "/palm", "ros": "hubble"}, ProblemError, "ros is hubble: must be one of .*humble"),
        ({"topic": "/palm", "types": "nowhere"}, ProblemError, "nowhere: must be a folder with .msg or .idl files"),
        ({"topic": 3}, ProblemError, "topic is 3"),
        ({"topic": [3]}, ProblemError, "topic is 3"),
        ({"topic": "/palm", "array": [3]}, ProblemError, "array is \\[3\\]: must be a taxel.Array"),
    ],
)
def test_what_cannot_be_opened_is_one_clear_error(given, error, said, tmp_path) -> None:
    several = [*palms(1), ("/hand", HAND, 5, 5, bags.hand([1, 2], [3, 4]))]
    bag = bags.write(tmp_path / "grasp.mcap", several)
    with pytest.raises(error, match=said) as raised:
        taxel.open(bag, **given)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("ending", [".bag", ".db3", ".mcap"])
@pytest.mark.parametrize(
    ("kind", "make", "why"),
    [
        (
            "sensor_msgs/msg/Image",
            bags.image(np.zeros((2, 6), np.uint8), "rgb8"),
            "the encoding of the images is rgb8; must be one",
        ),
        (
            "sensor_msgs/msg/CompressedImage",
            bags.compressed,
            "the messages are compressed images, which taxel does not read; record them as sensor_msgs/Image",
        ),
        (
            "sensor_msgs/msg/PointCloud2",
            bags.cloud,
            "the messages are clouds of points, which taxel does not read; record the readings as an array",
        ),
    ],
)
def test_images_that_are_not_read_are_listed_and_refused_by_their_topic(
    tmp_path: Path, ending: str, kind: str, make: bags.Make, why: str
) -> None:
    bag = bags.write(tmp_path / f"camera{ending}", [("/camera", kind, 5, 5, make), *palms(1)])
    (camera,) = (one for one in ros.topics(bag, ros="humble") if one.topic == "/camera")
    assert camera.trouble.startswith(why)
    with pytest.raises(FormatError, match=rf"camera\{ending}: topic /camera: {why}"):
        taxel.open(bag, topic="/camera", ros="humble")
    with pytest.raises(FormatError, match=rf"camera\{ending}: topic /camera, field x: "):
        taxel.open(bag, topic="/camera", field="x", ros="humble")


def test_a_bag_that_was_cut_off_says_what_makes_it_whole(tmp_path: Path) -> None:
    bag = bags.write(tmp_path / "grasp.mcap", palms())
    bag.write_bytes(bag.read_bytes()[:-200])
    with pytest.raises(
        FormatError, match=r"grasp\.mcap: .*the end of the file is missing; to repair it, run mcap recover"
    ):
        taxel.open(bag, topic="/palm")


@pytest.mark.parametrize("top", [0x40, 0xFF])
def test_a_position_in_the_header_that_no_file_has_is_damage(top: int, tmp_path: Path) -> None:
    bag = bags.write(tmp_path / "a.bag", palms())
    data = bytearray(bag.read_bytes())
    data[data.index(b"index_pos=") + 17] = top
    bag.write_bytes(data)
    with pytest.raises(taxel.FormatError, match=r"a\.bag: cannot be read as a ROS bag: .*beyond the end of any file"):
        taxel.open(bag, topic="/palm")


def test_only_a_bag_has_topics_and_a_taxel_mcap_is_no_bag(tmp_path: Path) -> None:
    events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    taxel.convert(events, tmp_path / "own.mcap")
    assert not ros.is_bag(tmp_path / "own.mcap")
    assert taxel.open(tmp_path / "own.mcap").events == events
    with pytest.raises(
        ProblemError, match=r"own\.mcap: is not a ROS bag; topic, field, types and ros are only for ROS bags"
    ):
        taxel.open(tmp_path / "own.mcap", topic="/palm")


def test_a_layout_file_says_the_topic_and_that_less_means_more(tmp_path: Path, capsys) -> None:
    bag = bags.write(tmp_path / "grasp.db3", palms())
    layout = tmp_path / "grasp.layout.toml"
    layout.write_text('rows = 24\ncolumns = 32\nfalls = 4095\n[ros]\ntopic = "/palm"\nfield = "taxels"\n')
    frames = taxel.open(bag).frames()
    assert np.array_equal(frames.values, np.float32(4095) - PALMS.astype(np.float32))
    assert frames.array.shape == (24, 32)
    assert json.loads(call(capsys, "info", bag, "--json")[1])["frames"] == 6
    layout.write_text('[ros]\ntopics = "/palm"\n')
    with pytest.raises(FormatError, match=r"ros\.topics is not known: must be one of topic, field, types, ros"):
        taxel.open(bag)


def test_a_folder_of_bags_opens_as_a_folder_of_trials(tmp_path: Path) -> None:
    for name in KINDS:
        bags.write(tmp_path / f"{name[:3]}{KINDS.index(name)}{name[5:]}", palms())
    (tmp_path / "labels.csv").write_text(f"recording,label,t_us\ngra1,contact,{BEGIN_NS // 1000 + 5000}\n")
    opened = taxel.open_all(tmp_path, topic="/palm", array=PALM_ARRAY)
    assert [one.name for one in opened] == ["gra0.bag", "gra1.db3", "gra2.mcap", "gra3"]
    assert [len(one.notes) for one in opened] == [0, 1, 0, 0]
    with pytest.raises(FormatError, match=r"gra0\.bag: is a ROS bag; choose one of its topics"):
        taxel.open_all(tmp_path)


def test_without_rosbags_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    bag = bags.write(tmp_path / "grasp.bag", palms())
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(ImportError, match=r"needs rosbags, which is not installed: pip install 'taxel\[ros\]'"):
        taxel.open(bag, topic="/palm")
    code, _, said = call(capsys, "info", bag)
    assert (code, "pip install 'taxel[ros]'" in said) == (2, True)


@pytest.mark.parametrize("name", KINDS[:3])
@settings(max_examples=settings.default.max_examples // 3)
@given(data=st.data())
def test_a_damaged_bag_never_crashes(name: str, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    bag = bags.write(tmp_path_factory.mktemp("damaged") / name, palms(2))
    content = bytearray(bag.read_bytes())
    if data.draw(st.booleans()):
        del content[data.draw(st.integers(8, len(content) - 1)) :]
    else:
        for at in data.draw(st.lists(st.integers(30, len(content) - 1), min_size=1, max_size=5)):
            content[at] = data.draw(st.integers(0, 255))
    bag.write_bytes(content)
    try:
        opened = taxel.open(bag, topic="/palm", array=PALM_ARRAY)
    except taxel.Error as error:
        said = str(error)
    else:
        said = name if opened.frames().values.shape[1:] == (24, 32) else "another shape"
    assert name in said
    assert "\n" not in said


def test_from_a_bag_to_a_detection_on_the_command_line(tmp_path: Path, monkeypatch, capsys) -> None:
    """Presses of a finger, by the commands that a user types: info, train, detect, convert, encode, cut."""
    monkeypatch.chdir(tmp_path)
    values = np.random.default_rng(3).integers(0, 3, (600, 6))
    begins = range(60, 560, 80)
    for k in begins:
        values[k : k + 40, 2:5] += 300
    several = (("/skin", SKIN, 10 * k, None, bags.skin([(one, [1])])) for k, one in enumerate(values))
    bags.write(tmp_path / "grasp", several)
    rows = [f"contact,{BEGIN_NS // 1000 + 10_000 * k}\n" for k in begins]
    Path("labels.csv").write_text("label,t_us\n" + "".join(rows))
    finger = ("--topic", "/skin", "--field", "patches.taxels", "--array", "2x3")
    assert "--topic /skin --field patches.taxels --array ROWSxCOLUMNS" in call(capsys, "info", "grasp")[1]
    facts = json.loads(call(capsys, "info", "grasp", *finger, "--json")[1])
    assert (facts["kind"], facts["frames"], facts["frames_per_s"]) == ("ros", 600, 100.0)
    train = call(capsys, "train", "grasp", *finger, "--labels", "labels.csv", "--folds", 0, "-o", "touch.json")
    assert train[0] == 0, train
    detect = ("--readout", "touch.json", "--tare", ".5", "--truth", "labels.csv", "--json")
    score = json.loads(call(capsys, "detect", "grasp", *finger, *detect)[1])["score"]
    assert (score["found"], score["missed"], score["false"]) == (len(begins), 0, 0)
    assert call(capsys, "convert", "grasp", "grasp.npz", *finger)[0] == 0
    assert np.array_equal(taxel.open("grasp.npz").frames().values.reshape(600, 6), values.astype(np.float32))
    levels = ("--encoder", "level_crossing", "--set", "levels=[4, 8]")
    assert call(capsys, "encode", "grasp", "spikes.npz", *finger, *levels)[0] == 0
    assert call(capsys, "cut", "grasp", "part.npz", *finger, "--rows", "0:1")[0] == 0
    assert taxel.open("part.npz").array.shape == (1, 3)
    assert call(capsys, "merge", "grasp", "grasp", *finger, "--gap", 1, "-o", "both.npz")[0] == 0
    for command in ("train", "detect", "cut", "merge"):
        assert "a ROS bag" in " ".join(call(capsys, command, "--help")[1].split()), command


@pytest.mark.parametrize(
    "names",
    [
        {"left": ",/grip/left,", "right": ",/grip/right,"},
        {"left": ",grip_left,", "right": ",grip_right,"},
        {"left": "pick,grip_left,", "right": "pick,/grip/right,"},
        {"left": "pick grip_left,,", "right": "pick grip_right,,"},
        {"left": "pick.mcap grip_left,,", "right": "pick,grip_right,"},
    ],
    ids=["topics", "sources", "recording and source", "titles", "mixed"],
)
def test_labels_of_two_topics_are_each_of_their_source(names: dict[str, str], tmp_path: Path) -> None:
    rows, us = [("left", 20_000), ("right", 30_000), ("left", 70_000)], BEGIN_NS // 1000
    several = [
        (f"/grip/{side}", SKIN, 10 * k, None, bags.skin([([k, 0], [1])]))
        for k in range(10)
        for side in ("left", "right")
    ]
    bag = bags.write(tmp_path / "pick.mcap", several)
    table = tmp_path / "labels.csv"
    table.write_text("recording,source,label,t_us\n" + "".join(f"{names[s]}touch,{us + t}\n" for s, t in rows))
    options = TextOptions(topic=["/grip/left", "/grip/right"], field=["patches.taxels"])
    opened = options.open_sensors([bag])
    left, right = references(str(table), opened)
    assert [(left["touch"] - us).tolist(), (right["touch"] - us).tolist()] == [[20_000, 70_000], [30_000]]
    table.write_text(table.read_text() + "pick"[: 4 * (names["left"][0] != ",")] + f",/grip/thumb,touch,{us}\n")
    with pytest.raises(ProblemError, match="names the source grip_thumb; the recording has grip_left, grip_right"):
        references(str(table), opened)
    table.write_text(f"label,t_us\ntouch,{us + 20_000}\n")
    assert [one["touch"].tolist() for one in references(str(table), opened)] == [[us + 20_000]] * 2
    other = bags.write(tmp_path / "other.mcap", several)
    with pytest.raises(
        ProblemError, match="there are 2 recordings; state it in the column recording; the columns are "
    ):
        references(str(table), options.open_sensors([bag, other]))
