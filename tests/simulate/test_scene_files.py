"""Scene files: what they say, what they refuse, and what the command line makes of them."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from refusal import refused
from shell import run

import taxel
from taxel import SceneError
from taxel._base.errors import Place
from taxel.demo.script import script
from taxel.simulate import Scene, SceneFile, Silence, play, truth
from taxel.wire import Registers

ROOT = Path(__file__).parents[2]
BALL = """
seed = 5
[[bodies]]
shape.sphere.radius_mm = 15
x_mm = 70
y_mm = 90
mass_g = 30
motion.dropped = { height_mm = 60, ending.left_to_rest = { rest_ms = 180, lift_mm_s = 100 } }
"""


def write(folder, text):
    place = folder / "scene.toml"
    place.write_text(text)
    return place


def example():
    page = (ROOT / "docs" / "scenes.md").read_text()
    return re.findall(r"```toml\n(.*?)```", page, re.S)[0]


def test_the_pages_example_plays_and_its_bodies_touch_where_they_should(tmp_path):
    file = SceneFile.open(write(tmp_path, example()))
    contacts, force = truth(file.acts(), preset=file.preset, array=file.array)
    assert {"first", "roll"} <= {contact.kind for contact in contacts}
    assert force.max() > 5
    events = play(file.acts(), seed=file.seed, **file.options).events
    events = events.between(events.markers[0][0], int(events.t[-1]))
    near = [np.hypot(events.x * 2.67 - x, events.y * 2.67 - y) < 30 for x, y in ((50, 60), (95, 110))]
    assert all(n.sum() > 150 for n in near)
    assert np.mean(near[0] | near[1]) > 0.9


def test_every_key_of_the_page_is_known_and_every_key_is_on_the_page():
    page = (ROOT / "docs" / "scenes.md").read_text()
    drawn = Scene.draw(1).parameters
    for name in (*drawn, *drawn["foam"], *drawn["bodies"][0]):
        assert name in page, name


def test_bodies_side_by_side_share_the_foam():
    """Two blocks edge to edge press as one twice as wide, under the same depth: the joint has no rim."""

    def block(x, columns):
        return {
            "shape": {"height_map": {"heights_mm": [[0.0] * columns] * 9, "pitch_mm": 2.67}},
            "x_mm": x, "y_mm": 80.0, "motion": {"pressed": {"depth_mm": 0.4, "speed_mm_s": 50, "hold_ms": 20}},
        }  # fmt: skip

    quiet = {"noise_ticks": 0.0, "gain_spread": 0.0, "offset_mv": 0.0}
    pitch = 2.67

    def held(*bodies):
        scene = Scene({"bodies": list(bodies), "foam": {"modulus_kpa": 1000.0, "dashpot_ms": 0.0}})
        events = play([Silence(100.0), scene], seed=1, sensor=quiet).events
        frame = np.zeros((64, 64))
        for event in range(len(events)):
            if events.t[event] < 100_000 + 40_000 + 18_000:
                frame[events.y[event], events.x[event]] = events.intensity[event]
        return frame

    two = held(block(26 * pitch, 9), block(34 * pitch, 9))
    one = held(block(30 * pitch, 17))
    assert one.max() > 60
    assert np.abs(two - one).max() <= 2


def test_a_height_map_may_lie_in_a_file(tmp_path):
    (tmp_path / "sole.csv").write_text("0, 1, 0\n0, 2, 0\n1 1 1\n")
    text = BALL.replace("shape.sphere.radius_mm = 15", 'shape.height_map = { file = "sole.csv", pitch_mm = 8 }')
    body = SceneFile.open(write(tmp_path, text)).scene.parameters["bodies"][0]
    assert body["shape"]["height_map"] == {"heights_mm": [[0, 1, 0], [0, 2, 0], [1, 1, 1]], "pitch_mm": 8}
    (tmp_path / "sole.csv").write_text("0, 1, 0\n0, 2\n")
    with refused(SceneError, place=Place("scene.toml")):
        SceneFile.open(tmp_path / "scene.toml")
    (tmp_path / "sole.csv").unlink()
    with refused(SceneError, place=Place("scene.toml")):
        SceneFile.open(tmp_path / "scene.toml")
    write(tmp_path, text.replace('file = "sole.csv"', 'file = "sole.csv", heights_mm = [[0, 0], [0, 0]]'))
    with refused(SceneError, place=Place("scene.toml")):
        SceneFile.open(tmp_path / "scene.toml")
    write(tmp_path, text.replace('file = "sole.csv"', "file = 3"))
    with refused(SceneError, place=Place("scene.toml")):
        SceneFile.open(tmp_path / "scene.toml")


def test_the_command_line_writes_recording_and_truth_and_replaces_none(tmp_path):
    scene = write(tmp_path, BALL)
    out, labels = tmp_path / "touch.npz", tmp_path / "touch.csv"
    wanted = (scene, "-o", out, "--truth", labels)
    done = run("simulate", *wanted, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    about = json.loads(done.stdout)
    events = taxel.open(out).events
    assert len(events) == about["events"] > 1000
    rows = labels.read_text().splitlines()
    assert rows[0] == "label,t_us"
    assert [row.split(",")[0] for row in rows[1:3]] == ["contact", "lift"]
    before = {path: path.read_bytes() for path in (out, labels)}
    again = run("simulate", *wanted)
    assert again.returncode != 0
    assert again.stdout == ""
    assert len(again.stderr.splitlines()) == 1
    assert {path: path.read_bytes() for path in before} == before
    assert run("simulate", *wanted, "--overwrite").returncode == 0
    assert out.read_bytes() == before[out]


def test_the_emulator_plays_a_scene_from_a_file(tmp_path):
    scene = write(tmp_path, BALL)
    labels = tmp_path / "truth.csv"
    done = run("emulate", "--scene", scene, "--scenes", 1, "--port", 9, "--truth", labels, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["seed"] == tomllib.loads(BALL)["seed"]
    file = SceneFile.open(scene)
    expected = [round(c.start_us) for c in truth(file.acts())[0]]
    written = [int(row.split(",")[1]) for row in labels.read_text().splitlines() if row.startswith("contact")]
    assert written == expected


@pytest.mark.parametrize(
    ("rows", "columns", "preset"), [(24, 40, None), (80, 70, None), (128, 128, "128 x 128, 2 kHz")]
)
def test_an_array_of_any_size_feels_a_scene(tmp_path, rows, columns, preset):
    """By the lines that it has: it is felt where and when it happens."""
    said = BALL.replace("x_mm = 70", "x_mm = 50").replace("y_mm = 90", "y_mm = 30").replace("seed = 5", "seed = 5\n")
    said = f"array = {{ rows = {rows}, columns = {columns} }}\n" + (f'preset = "{preset}"\n' if preset else "") + said
    file = SceneFile.open(write(tmp_path, said))
    assert file.registers.lines == columns
    assert file.registers.wire_version == (1 if max(rows, columns) <= 64 else 2)
    contacts, _ = truth(file.acts(), preset=file.preset, array=file.array)
    events = play(file.acts(), seed=file.seed, **file.options).events
    first = contacts[0].start_us
    before, after = events.between(first - 110_000, first - 10_000), events.between(first, first + 10_000)
    near = np.hypot(after.x * 2.67 - 50, after.y * 2.67 - 30) < 30
    # Noise of the same duration.
    assert len(before) / 10 < 0.05 * len(after)
    assert near.mean() > 0.9


def test_a_file_that_begins_with_a_byte_order_mark_is_read(tmp_path):
    text = "[[bodies]]\nshape.sphere.radius_mm = 25\nx_mm = 80\ny_mm = 80\nmass_g = 36\nmotion.dropped.height_mm = 50\n"
    for name, encoding in (("plain.toml", "utf-8"), ("marked.toml", "utf-8-sig")):
        (tmp_path / name).write_text(text, encoding=encoding)
    assert repr(SceneFile.open(tmp_path / "marked.toml")) == repr(SceneFile.open(tmp_path / "plain.toml"))


def test_random_scenes_are_those_of_their_seed_with_their_truth(tmp_path):
    out, table = tmp_path / "two.mcap", tmp_path / "two.csv"
    done = run("simulate", "--scenes", 2, "--seed", 7, "-o", out, "--truth", table, "--json")
    assert done.returncode == 0, done.stderr
    assert taxel.open(out).registers == Registers.preset("5.2 kHz")
    acts = script(7, 2)
    contacts, _ = truth(acts)
    assert taxel.open(out).events == play(acts, seed=7).events
    assert json.loads(done.stdout)["contacts"] == [contact._asdict() for contact in contacts]
    ends = sorted([(c.start_us, "contact") for c in contacts] + [(c.stop_us, "lift") for c in contacts])
    assert table.read_text().splitlines()[1:] == [f"{label},{round(t)}" for t, label in ends]
    for wrong in ((), (write(tmp_path, BALL), "--scenes", 2)):
        refused_call = run("simulate", *wrong)
        assert (refused_call.returncode, refused_call.stderr) == (2, "taxel: SCENE or --scenes: give one of them\n")


def test_momentum_of_an_impact_is_what_the_ball_brought_and_took():
    """The integral of force less weight over a contact is mass times the change of speed."""
    scene = Scene.draw(5)
    motion = scene.motion(6.0)
    first, second = motion.contacts[:2]
    inside = slice(round(first.start_us / 6.0), round(first.stop_us / 6.0) + 1)
    mass = scene.parameters["bodies"][0]["mass_g"] * 1e-3
    pushed = float(motion.force_n[inside].sum()) * 6e-6 - mass * 9.81 * 1e-6 * (first.stop_us - first.start_us)
    # The ball leaves a little below the foam's face, where the dashpot frees it, and rises against gravity to it.
    assert pushed == pytest.approx(mass * (first.speed_m_s + second.speed_m_s), rel=0.02)
