"""What `taxel view` shows by its options: topics of ROS bags, layouts, rates, calibrations."""

from __future__ import annotations

import re
from contextlib import contextmanager

import numpy as np
from formats import bags
from formats.bags import PALM
from formats.making import write_icub
from panel.protocol import ADDRESS, Client, door, opened, values_at
from shell import call, run_beside

import taxel
from taxel import Array, Calibration, Frames
from taxel.detect.readout import USES
from taxel.options import FullReading
from taxel.panel import Panel
from taxel.recording.kinds import recordings_in

KINDS = ("grasp.bag", "grasp.db3", "grasp.mcap", "grasp")


def palms(folder, name, count=40):
    """Write a bag of a palm in which a touch moves over 24 x 32 taxels; return its path and its values."""
    values = np.zeros((count, 24, 32), np.int16)
    for k in range(count // 2, count):
        values[k, 5:9, 3 + k % 8 : 6 + k % 8] = 400 + k
    messages = [("/palm", PALM, 10.0 * k + 2, 10.0 * k, bags.palm(values[k])) for k in range(count)]
    return bags.write(folder / name, messages), values


@contextmanager
def shown(path, **options):
    """A client of a panel with options, in this process."""
    with Panel(path, options=FullReading(**options)) as panel, Client(panel) as page:
        yield page


def test_a_folder_of_bags_is_shown_by_options_that_hold_for_each(capsys, tmp_path):
    (tmp_path / "bags").mkdir()
    for name in KINDS:
        palms(tmp_path / "bags", name)
    folder = tmp_path / "bags"
    assert [file.name for file in recordings_in(folder)] == sorted(KINDS)
    with shown(folder, topic=["/palm"], array=["24x32"]) as page:
        page.send(type="recordings")
        files = {one["name"]: one["bytes"] for one in page.until("recordings")["files"]}
        assert set(files) == set(KINDS)
        inside = sum(file.stat().st_size for file in (folder / "grasp").iterdir())
        assert files["grasp"] == inside
        for name in KINDS:
            assert opened(page, name)["frames"]["count"] == 40
    code, _, errors = call(capsys, "view", folder, "--no-open", "--seconds", 1)
    assert code == 2
    assert "ROS bag; open a topic by --topic /palm" in errors
    code, _, errors = call(capsys, "view", folder, "--topic", "/none", "--no-open", "--seconds", 1)
    assert (code, len(errors.strip().splitlines())) == (2, 1)
    assert "has no topic /none" in errors


def test_a_layout_and_a_rate_are_those_of_the_page(tmp_path):
    file = write_icub(tmp_path)
    with shown(file, rate_hz=50) as page:
        about = opened(page, file.name)
        assert (about["frames"]["number_us"], about["stop_us"]) == (None, 40_000)
    values, layout = np.random.default_rng(5).integers(0, 1000, (40, 6)), tmp_path / "said.toml"
    np.savetxt(tmp_path / "palm.txt", values, fmt="%d", delimiter=";")
    layout.write_text('rows = 2\ncolumns = 3\nrate_hz = 100\n[table]\nseparator = ";"\n')
    with shown(tmp_path / "palm.txt", layout=layout) as page:
        about = opened(page, "palm.txt")
        assert (about["frames"]["count"], about["stop_us"]) == (40, 390_000)
        assert np.array_equal(values_at(page, about, 200_000)[0], values[20].reshape(2, 3))


def test_frames_are_in_the_unit_of_a_calibration(capsys, tmp_path):
    frames = Frames(np.arange(12.0).reshape(3, 2, 2) * 10, [0, 10_000, 20_000], unit="counts", array=Array(2, 2))
    taxel.convert(frames, tmp_path / "press.npz")
    calibration = Calibration.table(Array(2, 2), [100], [5], unit="N", date="2026-11-23")
    calibration.save(tmp_path / "of another name.json")

    def look(said: str) -> None:
        with Client(door(said)) as page:
            about = opened(page, "press.npz")
            assert about["frames"]["unit"] == "N"
            values, _ = values_at(page, about, 20_000)
            assert np.allclose(values, calibration.apply(frames).values[2], atol=about["frames"]["step"])
            assert [one["rest"] for one in about["frames"]["sources"]] == ["given"]

    given = (tmp_path / "press.npz", "--calibration", tmp_path / "of another name.json")
    assert run_beside(look, "view", *given, "--no-open", says=ADDRESS).returncode == 0
    taxel.convert(Frames(np.zeros((2, 3, 2)), [0, 1000], unit="counts", array=Array(3, 2)), tmp_path / "other.npz")
    words = (tmp_path / "other.npz", "--calibration", tmp_path / "of another name.json", "--seconds", 1)
    code, _, errors = call(capsys, "view", *words)
    assert code == 2
    assert "the calibration is for counts of Array(" in errors


def test_labels_of_a_trial_are_its_own_and_training_takes_the_labelled_trials(capsys, tmp_path):
    rng = np.random.default_rng(4)
    trials = {}
    for number in range(1, 5):
        raw = np.full((180, 60), 240) + rng.integers(-1, 2, (180, 60))
        for begin in range(70, 170, 20):
            raw[begin : begin + 8, 20:40] -= 90
        trials[number] = np.clip(raw, 0, 255)
    file = write_icub(tmp_path, trials=trials)
    with shown(file, rate_hz=100) as page:
        for trial in ("ball/1", "ball/3"):
            opened(page, file.name, trial=trial)
            for begin in range(70, 170, 20):
                assert page.mark("touch", begin * 10_000)["type"] == "done"
        opened(page, file.name, trial="ball/3")
        labels = page.since_asked("labels")["labels"]
        assert [label["trial"] for label in labels].count("ball/1") == 5
        answer = page.ask("train")
        assert answer["type"] == "done", answer
        assert re.search(r"touch: \w+ runs: ", page.since_asked("trained")["text"])
        said = [message for message in page.said[page.asked :] if message["type"] in ("training", "trained")]
        assert said.pop()["type"] == "trained"
        assert said[0]["text"].startswith(f"reading {file}, after ")
        assert any("fold 2 of" in message["text"] for message in said), said
        # Without a rule, a rule detects nothing.
        trained = taxel.Readout.load(tmp_path / "ball.csv.readout.json")
        trained._with_rules({}).save(tmp_path / "neuron.json")
        counts = {}
        for use in USES:
            assert page.ask("read_out", readout="neuron.json", use=use)["type"] == "done"
            counts[use] = len(page.since_asked("detections")["detections"])
        assert counts["better"] == counts["neuron"] >= 4
        assert counts["rule"] == 0
        assert page.ask("read_out", readout="neuron.json", use="both")["type"] == "refused"
    table = (tmp_path / "ball.csv.notes.csv").read_text().splitlines()
    assert table[0] == "label,t_us,recording"
    assert len(table) == 11
    notes = [len(one.notes) for one in taxel.open_all(file)]
    assert notes == [5, 0, 5, 0]
