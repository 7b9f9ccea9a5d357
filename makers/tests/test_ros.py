"""ROS bags, made with rosbags itself: what opens, by which times, and what is refused."""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from draws import mixed
from formats import bags
from formats.bags import BEGIN_NS, HAND, PALM, SKIN
from hypothesis import given, settings
from hypothesis import strategies as st
from shell import call

import taxel
from taxel import FormatError, ProblemError
from taxel.formats.foreign import is_bag
from taxel.options import FullReading
from taxel.tasks.labels import references
from taxel_makers import ros

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


@pytest.mark.parametrize(("begins", "sizes", "name"), mixed([0, 2], [(2, 3), (6,), ()], ["grasp.bag", "grasp.db3"]))
def test_multi_arrays_say_their_rows_and_columns_also_after_empty_ones(
    begins: int, sizes: tuple[int, ...], name: str, tmp_path: Path
) -> None:
    dtypes = (np.uint8, np.int16, np.uint32, np.int64, np.float32, np.float64)
    values, shape = RNG.integers(0, 100, (5, 2, 3)), (2, 3) if len(sizes) == 2 else (1, 6)
    sent = [
        (f"/{np.dtype(d).name}", bags.array_of(d), 10 * k, None,
         bags.multi_array(values[k] if k >= begins else [], sizes if k >= begins else (0, 0), d))
        for k in range(5) for d in dtypes
    ]  # fmt: skip
    sent.append(("/never", bags.array_of(np.float64), 60, None, bags.multi_array([], (0,), np.float64)))
    sent.append(("/one", bags.array_of(np.float64), 61, None, bags.multi_array([1], (1,), np.float64)))
    bag = bags.write(tmp_path / name, sent)
    listed = {one.topic: (one.field, one.shape, one.dtype, one.messages) for one in ros.topics(bag)}
    stated = shape if len(sizes) == 2 else (6,)
    assert listed == {f"/{(n := np.dtype(d).name)}": ("data", stated, n, 5) for d in dtypes}
    for d in dtypes:
        opened = taxel.open(bag, topic=f"/{np.dtype(d).name}")
        assert np.array_equal(opened.frames().values, values[begins:].reshape(-1, *shape))
        assert opened.frames().unit == ("as sent" if np.dtype(d).kind == "f" else "counts")
        assert opened.counts["messages_of_another_length"] == begins
    with pytest.raises(FormatError, match="topic /one: no field has more than one number"):
        taxel.open(bag, topic="/one")


def test_messages_of_another_length_are_left_out_and_counted(tmp_path: Path) -> None:
    lengths = (3, 3, 5, 3, 0, 3)
    several = [("/hand", HAND, 10 * k + 3, 10 * k, bags.hand(range(n), [1, 1])) for k, n in enumerate(lengths)]
    bag = bags.write(tmp_path / "grasp.db3", several)
    for array in (None, taxel.Array(1, 3)):
        opened = taxel.open(bag, topic="/hand", field="thumb", array=array)
        assert (opened.counts["messages"], opened.counts["messages_of_another_length"]) == (4, 2)
        assert opened.lost == ("2 of 6 messages are left out, of another length",)
        assert np.array_equal(opened.frames().t - BEGIN_NS // 1000, [0, 10_000, 30_000, 50_000])
    with pytest.raises(FormatError, match="thumb: the messages have 3 values each; the array has 2 x 2"):
        taxel.open(bag, topic="/hand", field="thumb", array=taxel.Array(2, 2))


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
        ({"topic": ["/palm", "/palm"]}, ProblemError, "two sources would have the name palm_taxels"),
        ({"topic": "/palm", "ros": "hubble"}, ProblemError, "ros is hubble: must be one of .*humble"),
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


@pytest.mark.parametrize(
    ("kind", "make", "why", "ending"),
    [
        (
            "sensor_msgs/msg/Image",
            bags.image(np.zeros((2, 6), np.uint8), "rgb8"),
            "the encoding of the images is rgb8; must be one",
            ".bag",
        ),
        (
            "sensor_msgs/msg/CompressedImage",
            bags.compressed,
            "the messages are compressed images, which taxel does not read; record them as sensor_msgs/Image",
            ".db3",
        ),
        (
            "sensor_msgs/msg/PointCloud2",
            bags.cloud,
            "the messages are clouds of points, which taxel does not read; record the readings as an array",
            ".mcap",
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


def test_only_a_bag_has_topics_and_a_taxel_mcap_is_no_bag(tmp_path: Path) -> None:
    events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    taxel.convert(events, tmp_path / "own.mcap")
    assert not is_bag(tmp_path / "own.mcap")
    assert taxel.open(tmp_path / "own.mcap").events == events
    with pytest.raises(ProblemError, match=r"own\.mcap: is not a ROS bag; topic, field and ros are only for ROS bags"):
        taxel.open(tmp_path / "own.mcap", topic="/palm")


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
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(ImportError, match=r"needs rosbags, which is not installed: pip install 'taxel\[ros\]'"):
        taxel.open(bag, topic="/palm")
    code, _, said = call(capsys, "info", bag)
    assert (code, "pip install 'taxel[ros]'" in said) == (2, True)


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
    given = ("--topic", "/skin", "--field", "patches.taxels", "--array", "2x3")
    Path("finger.toml").write_text('rows = 2\ncolumns = 3\n[ros]\ntopic = "/skin"\nfield = "patches.taxels"\n')
    finger = ("--layout", "finger.toml")
    assert "--topic /skin --field patches.taxels --array ROWSxCOLUMNS" in call(capsys, "info", "grasp")[1]
    facts = json.loads(call(capsys, "info", "grasp", *given, "--json")[1])
    assert (facts["kind"], facts["frames"], facts["frames_per_s"]) == ("ros", 600, 100.0)
    train = call(capsys, "train", "grasp", *finger, "--labels", "labels.csv", "--folds", 0, "-o", "touch.json")
    assert train[0] == 0, train
    detect = ("--readout", "touch.json", "--tare", ".5", "--truth", "labels.csv", "--json")
    score = json.loads(call(capsys, "detect", "grasp", *finger, *detect)[1])["score"]
    assert (score["found"], score["missed"], score["false"]) == (len(begins), 0, 0)
    assert call(capsys, "convert", "grasp", "grasp.npz", *given)[0] == 0
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
    options = FullReading(topic=["/grip/left", "/grip/right"], field=["patches.taxels"])
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


@pytest.mark.parametrize("stamps", [[0, 10, 20, 30, 40, 50, 60, 70, 80, 90, None], [*range(100, 0, -10), 3], [5] * 11])
def test_times_are_stamps_or_if_many_are_wrong_those_of_the_bag(stamps: list[float | None], tmp_path: Path) -> None:
    messages = [("/palm", PALM, 10 * k + 2, stamp, bags.palm(PALMS[k % 6])) for k, stamp in enumerate(stamps)]
    with warnings.catch_warnings(record=True):
        opened = taxel.open(bags.write(tmp_path / "a.mcap", messages), topic="/palm")
    t = opened.frames().t - BEGIN_NS // 1000
    if stamps[-1] is None:
        assert t.tolist() == [*range(0, 100_000, 10_000), 102_000]
        assert opened.counts["times_by_the_bag"] == 1
    else:
        assert t.tolist() == [10_000 * k + 2000 for k in range(11)]
        assert opened.counts["times_by_the_bag"] == 11


NAMED, PATCH = "skins_msgs/msg/Named", "skins_msgs/msg/Touch"


def test_named_channels_are_taken_by_name_and_a_field_splits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    definitions = {NAMED: "string[] name\nfloat64[] position\n", PATCH: "string hand\nuint16[] taxels\n"}
    monkeypatch.setattr(bags, "DEFINITIONS", bags.DEFINITIONS | definitions)

    def named(names: list[str], values: list[float]) -> bags.Make:
        return lambda types, _: types[NAMED](names, np.array(values, float))

    def touch(hand: str, values: list[int]) -> bags.Make:
        return lambda types, _: types[PATCH](hand, np.array(values, np.uint16))

    bag = bags.write(
        tmp_path / "a.mcap",
        [
            ("/joints", NAMED, 1, None, named(["thumb", "index"], [1, 2])),
            ("/joints", NAMED, 11, None, named(["index", "thumb"], [4, 3])),
            ("/touch", PATCH, 12, None, touch("left", [5, 6])),
            ("/touch", PATCH, 17, None, touch("right", [7, 8])),
            ("/touch", PATCH, 22, None, touch("left", [9, 9])),
        ],
    )
    opened = taxel.open(bag, topic="/joints")
    assert opened.frames().values[:, 0].tolist() == [[1, 2], [3, 4]]
    assert opened.array.names == ("thumb", "index")
    # Messages of both hands are not mixed.
    with pytest.raises(FormatError, match="left, right in turn \\(hand\\): write by = 'hand'"):
        taxel.open(bag, topic="/touch")
    (tmp_path / "a.layout.toml").write_text('[ros]\ntopic = "/touch"\nby = ""\n')
    assert len(taxel.open(bag).frames()) == 3
    (tmp_path / "a.layout.toml").write_text('[ros]\ntopic = "/touch"\nby = "hand"\n')
    split = taxel.open(bag)
    assert list(split.sources) == ["touch_left", "touch_right"]
    roles = {role["name"]: role["role"] for role in split.sources["touch_left"]._main.facts.roles}
    assert roles == {"time of the bag": "time", "hand": "sensor", "taxels": "taxel"}
    assert split.sources["touch_left"].frames().values[:, 0].tolist() == [[5, 6], [9, 9]]


def test_channels_are_taken_by_name_wherever_the_names_are(tmp_path: Path) -> None:
    channels = {"ff": [100, 1], "mf": [200, 2], "rf": [301, 3]}
    turned = dict(reversed(channels.items()))
    scalars = {name: values[0] for name, values in channels.items()}
    bag = bags.write(
        tmp_path / "a.mcap",
        [
            *(("/state", bags.STATE, 10 * k, 10 * k, bags.state([channels, turned][k % 2])) for k in range(6)),
            *(
                ("/side", bags.SIDE, 10 * k, None, bags.side("left", [scalars, dict(reversed(scalars.items()))][k % 2]))
                for k in range(6)
            ),
        ],
    )
    found = taxel.open(bag, topic="/state")
    assert found.array.names == ("ff[0]", "ff[1]", "mf[0]", "mf[1]", "rf[0]", "rf[1]")
    assert found.frames().values[:, 0].tolist() == [[100, 1, 200, 2, 301, 3]] * 6
    found = taxel.open(bag, topic="/side")
    assert found.array.names == ("ff", "mf", "rf")
    assert found.frames().values[:, 0].tolist() == [[100, 200, 301]] * 6
