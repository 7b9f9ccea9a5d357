"""The commands encode, train and detect: from a recording to scored detections, and what they refuse."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from discs import tare, touches
from markupsafe import escape
from shell import call

import taxel
from taxel.cli import main

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three recordings with their labels, a tare, a recipe."""
    folder = tmp_path_factory.mktemp("recordings")
    rows, far = ["recording,label,t_us"], ["label,t_us"]
    for seed in (1, 2, 9):
        events, truth = touches(seed)
        taxel.convert(events, folder / f"{seed}.npz")
        rows += [f"{seed}.npz,{label},{t}" for label, times in truth.items() for t in times]
        if seed == 9:
            far += [f"{label},{t}" for label, times in truth.items() for t in times]
    (folder / "labels.csv").write_text("\n".join(rows) + "\n")
    (folder / "truth.csv").write_text("\n".join(far) + "\n")
    tare().save(folder / "tare.json")
    (folder / "recipe.toml").write_text(
        """
        run_threshold = 0.9
        [encoder]
        name = "contact_area"
        levels = [2, 4, 8]
        [learner]
        step_ms = 0.192
        lb = -3.0
        ub = 3.0
        refractory = 15.0
        divide_b_by = "targets"
        [neurons.contact]
        tau = 1.5
        delay_ms = 2.0
        [neurons.lift]
        tau = 99.0
        delay_ms = 1.0
        """
    )
    return folder


@pytest.fixture(scope="module")
def trained(folder: Path) -> Path:
    """The readout that the command trains: a recipe's values, one of them changed on the command line."""
    out = folder / "touch.json"
    with pytest.raises(SystemExit) as ended:
        main(
            [
                *("train", str(folder / "1.npz"), str(folder / "2.npz"), "--labels", str(folder / "labels.csv")),
                *("--recipe", str(folder / "recipe.toml"), "--set", "neurons.lift.tau=3.0"),
                *("--tare", str(folder / "tare.json"), "--folds", "0", "--out", str(out), "--json"),
            ]
        )
    assert not ended.value.code
    return out


def test_a_trained_readout_finds_what_it_never_heard(folder: Path, trained: Path, capsys) -> None:
    arguments = ("detect", folder / "9.npz", "--readout", trained, "--tare", folder / "tare.json")
    code, out, _ = call(capsys, *arguments, "--truth", folder / "truth.csv", "--window-ms", 10, "--json")
    assert code == 0
    result = json.loads(out)
    assert result["score"]["by_label"]["contact"]["found"] == 6
    assert (result["score"]["missed"], result["score"]["false"]) == (0, 0)
    assert len(result["detections"]) == 12
    # The file of all recordings' labels works too: it names this recording.
    code, out, _ = call(capsys, *arguments, "--truth", folder / "labels.csv", "--window-ms", 10)
    assert (code, out.count("contact")) == (0, 4)
    assert "known (ms)" not in out
    code, out, _ = call(capsys, *arguments, "--truth", folder / "labels.csv", "--window-ms", 10, "--list")
    assert (code, out.count("contact")) == (0, 6 + 4)
    assert out.index("against ") < out.index("known (ms)")
    assert "slope (mV/ms)" not in out, "its rules are as good, and known earlier"
    assert "slope (mV/ms)" in call(capsys, *arguments, "--use", "neuron")[1]
    assert "not scored" not in out
    # Labels that the readout does not have do not count as missed; they are named.
    more = folder / "more.csv"
    more.write_text((folder / "truth.csv").read_text() + "step,9000\noff,12000\n")
    code, out, _ = call(capsys, *arguments, "--truth", more, "--window-ms", 10)
    assert code == 0
    assert "not scored, because the readout has only contact, lift: off, step" in out.splitlines()
    more.unlink()


def test_recordings_of_other_arrays_are_left_out_where_one_fits(
    tmp_path: Path, folder: Path, trained: Path, capsys
) -> None:
    small = taxel.Events([0, 1000], [0, 1], [0, 1], [1, 1], array=taxel.Array(4, 4))
    for name in ("1", "2", "3", "4"):
        taxel.convert(small, tmp_path / f"{name}.npz")
    shutil.copy(folder / "9.npz", tmp_path)
    rows = [f"9,{line}" for line in (folder / "truth.csv").read_text().splitlines()[1:]]
    (tmp_path / "labels.csv").write_text(
        "\n".join(["recording,label,t_us", *rows, *(f"{k},contact,500" for k in (1, 4))])
    )
    arguments = ("detect", tmp_path, "--readout", trained, "--tare", folder / "tare.json")
    code, said, error = call(capsys, *arguments, "--truth", tmp_path / "labels.csv", "--window-ms", 10)
    why = "an array of 4 x 4 taxels: the readout was trained on 8 x 8"
    warnings = [f"taxel: warning: left out: {tmp_path / f'{k}.npz'}: {why}" for k in (1, 2, 3, 4)]
    assert (code, [line for line in error.splitlines() if "left out" in line]) == (0, warnings)
    assert "(window 10 ms), in 1 of 5 recordings (the others are left out):" in said.splitlines()[0]
    code, said, _ = call(capsys, *arguments, "--json")
    found = json.loads(said)
    assert (code, [Path(each["recording"]).name for each in found["recordings"]]) == (0, ["9.npz"])
    assert [Path(name).name for name in found["left_out"]] == ["1.npz", "2.npz", "3.npz", "4.npz"]


def walk(folder: Path, seconds: int) -> Path:
    """Leave a footfall a second on 4 sensors as ``walk.npz``; give the table of its labels."""
    values = np.zeros((100 * seconds, 1, 4))
    steps = np.arange(50, 100 * seconds - 50, 100)
    steps += np.random.default_rng(0).integers(-10, 10, len(steps))
    for k in steps:
        for n in range(4):
            values[k + 3 * n : k + 50 + 3 * n, 0, n] = 60.0
    frames = taxel.Frames(values, np.arange(len(values)) * 10_000, unit="N")
    taxel.convert(frames, folder / "walk.npz", overwrite=True)
    rows = [f"contact,{k * 10_000}\nfoot-off,{(k + 59) * 10_000}\n" for k in steps]
    (folder / "labels.csv").write_text("label,t_us\n" + "".join(rows))
    return folder / "labels.csv"


def test_without_a_recipe_it_starts_from_the_recipe_of_the_unit(tmp_path: Path, capsys) -> None:
    labels = walk(tmp_path, 9)
    out = tmp_path / "gait.json"
    arguments = ("train", tmp_path / "walk.npz", "--labels", labels, "--folds", 0, "--out", out, "--overwrite")
    code, said, _ = call(capsys, *arguments, "--json")
    assert (code, json.loads(said)["recipe"]) == (0, "gait_insole")
    assert json.loads(said)["recordings"][0]["score"]["missed"] == 0
    readout = taxel.Readout.load(out)
    assert readout.encoder == taxel.encode.LevelCrossing([5, 10, 20, 30, 40, 50], release_share=0.7)
    assert {n.delay_ms for n in readout.neurons.values()} == {8.0}
    changes = ("--set", "learner.tau=20", "--set", "neurons.contact.delay_ms=10", "--set", "encoder.levels=[5, 50]")
    code, said, _ = call(capsys, *arguments, *changes)
    assert (code, "recipe gait_insole: few force sensors" in said) == (0, True)
    readout = taxel.Readout.load(out)
    assert (readout.encoder.levels, readout.neurons["contact"].delay_ms) == ([5.0, 50.0], 10.0)
    assert {trained.neuron.tau for trained in readout.neurons.values()} == {20.0}
    walk(tmp_path, 15)  # the running range needs 10 s
    assert call(capsys, *arguments, "--recipe", "gait_channel", "--json")[0] == 0
    assert taxel.Readout.load(out).encoder.running_range is not None


def test_folds_judge_what_was_not_trained_on_and_search_chooses(folder: Path, capsys, tmp_path: Path) -> None:
    plan = ("--recipe", folder / "recipe.toml", "--set", "neurons.lift.tau=3.0", "--tare", folder / "tare.json")
    arguments = (
        "train",
        folder / "1.npz",
        folder / "2.npz",
        folder / "9.npz",
        "--labels",
        folder / "labels.csv",
        *plan,
    )
    code, out, _ = call(capsys, *arguments, "--folds", 3, "--window-ms", 10, "--json", "-o", tmp_path / "a.json")
    result = json.loads(out)
    assert (code, result["judged_on"]) == (0, "whole recordings, 3 folds")
    assert result["score"]["missed"] == sum(one["score"]["missed"] for one in result["recordings"]) == 0
    report = ("--report", tmp_path / "r")
    code, out, _ = call(capsys, *arguments, "--folds", 3, "-o", tmp_path / "c.json", *report)
    assert code == 0
    page = (tmp_path / "r" / "report.html").read_text()
    held, own = (
        page.index("On held-out data: these scores count"),
        page.index("On the training data: these scores do not count"),
    )
    assert page.count("9.npz</td>", held, own) == 1
    assert page.count("9.npz</td>", own, page.index("Output of the command")) == 1
    assert out.startswith("held out: whole recordings, 3 folds (window 50 ms); ")


@pytest.mark.usefixtures("drawn")
def test_a_report_shows_potential_weights_and_the_worst(folder: Path, trained: Path, capsys, tmp_path: Path) -> None:
    arguments = ("detect", folder / "9.npz", "--readout", trained, "--tare", folder / "tare.json", "--use", "neuron")
    arguments += ("--report",)
    code, out, _ = call(capsys, *arguments, tmp_path / "with", "--truth", folder / "truth.csv")
    page = (tmp_path / "with" / "report.html").read_text()
    assert (code, f"report: {tmp_path / 'with' / 'report.html'}" in out) == (0, True)
    assert page.count('<div class="picture"><svg') == 13, "one of labels; of each label four moments, errors, weights"
    assert "<h2>contact</h2>" in page
    assert "The worst" in page
    code, out, _ = call(capsys, *arguments, tmp_path / "without")
    page = (tmp_path / "without" / "report.html").read_text()
    *lines, _ = out.splitlines()
    assert (code, len(lines) > 12) == (0, True)
    assert escape("\n".join(lines)) in page
    assert page.count('<div class="picture"><svg') == 2 * (4 + 1)
    assert "The worst" not in page
    code, _, error = call(capsys, *arguments, tmp_path / "without")
    assert (code, "exists already" in error) == (2, True)


def test_a_folder_of_trials_is_trained_on_and_heard_as_its_recordings_are(tmp_path: Path, capsys) -> None:
    """The rows of the folder are those of its recordings, one after the other; the score is of all of them."""
    trials = tmp_path / "trials"
    trials.mkdir()
    rows = ["recording,label,t_us"]
    for k in range(4):
        values = np.zeros((200, 2, 2))
        values[60 + 10 * k : 110 + 10 * k] = 20.0
        taxel.convert(taxel.Frames(values, range(0, 2_000_000, 10_000), unit="N"), trials / f"t{k}.npz")
        rows.append(f"t{k},contact,{600_000 + 100_000 * k}")
    (trials / "labels.csv").write_text("\n".join(rows) + "\n")
    out = tmp_path / "a.json"
    plain = ("--encoder", "level_crossing", "--set", "encoder.levels=[10]", "--set", "learner.tau=20")
    code, _, _ = call(capsys, "train", trials, "-o", out, "--folds", 2, *plain)
    assert code == 0
    files = [trials / f"t{k}.npz" for k in range(4)]
    table = tmp_path / "found.csv"
    code, said, _ = call(
        capsys,
        "detect",
        trials,
        "--readout",
        out,
        "--truth",
        "notes",
        "--json",
        "-o",
        table,
        "--report",
        tmp_path / "r",
    )
    assert code == 0
    folder = json.loads(said)
    alone = []
    for k, file in enumerate(files):
        _, said, _ = call(capsys, "detect", file, "--readout", out, "--json")
        alone.append(json.loads(said))
        assert folder["recordings"][k]["detections"] == alone[k]["detections"]
    assert [len(one["detections"]) for one in alone] == [1, 1, 1, 1]
    assert (folder["score"]["found"], folder["score"]["missed"], folder["score"]["false"]) == (4, 0, 0)
    assert [line.split(",")[:2] for line in table.read_text().splitlines()[1:]] == [
        [f"t{k}.npz", "contact"] for k in range(4)
    ]
    assert "t3.npz" in (tmp_path / "r" / "report.html").read_text()


def test_where_no_label_is_learnt_nothing_is_written(tmp_path: Path, capsys) -> None:
    random = np.random.default_rng(7)
    values = random.normal(0, 1, (2000, 4, 4))
    # What is felt has nothing to do with the labels.
    values[random.integers(60, 2000, 15)] += 20.0
    frames = taxel.Frames(values, np.arange(2000) * 10_000, unit="counts")
    taxel.convert(frames, tmp_path / "noise.npz")
    rows = "".join(f"contact,{t}\n" for t in range(2_000_000, 19_000_000, 1_000_000))
    (tmp_path / "labels.csv").write_text("label,t_us\n" + rows)
    out = tmp_path / "readout.json"
    command = "train", tmp_path / "noise.npz", "--labels", tmp_path / "labels.csv", "-o", out
    code, said, _ = call(capsys, *command, "--tare", "0.5")
    assert (code, out.exists()) == (3, False), said
