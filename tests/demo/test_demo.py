"""The demo: without the clock at toy size, and (slowly) in real time."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shell

import taxel
from taxel.demo.playing import evaluate, play_simulated, shipped
from taxel.demo.script import TRAINING_SEED, script
from taxel.simulate import Scene, Silence, play


def run(*arguments):
    return shell.run("demo", *arguments)


def test_the_demo_scores_scenes_and_leaves_a_report(tmp_path):
    folder = tmp_path / "report"
    ended = run("--no-clock", "--scenes", 2, "--seed", 5, "--folder", folder)
    assert ended.returncode == 0
    assert f"report: {folder / 'report.html'}" in ended.stdout
    page = (folder / "report.html").read_text()
    assert "2 scenes of seed 5" in page
    assert page.count('<div class="picture"><svg') >= 8
    assert page.index("deepest") < page.index("Mbit/s") < page.index(">missed<")
    assert f"taxel view {folder / 'recording.mcap'}" in page
    assert taxel.open(folder / "recording.mcap").events == play(script(5, 2), seed=5).events
    again = run("--no-clock", "--scenes", 1, "--folder", folder)
    assert (again.returncode, "exists already" in again.stderr) == (2, True)
    assert (folder / "report.html").read_text() == page


def test_the_shipped_readout_finds_every_impact_of_other_scenes(tmp_path):
    played = play_simulated(shipped(), tmp_path / "a.mcap", seed=17, scenes=2)
    assert (played.outcome.score.missed, played.outcome.score.false, played.plain.missed) == (0, 0, 0)
    for label in ("contact", "lift"):
        assert 0 < np.median(played.outcome.score[label].delays_ms) < 1.5


def test_impacts_have_a_narrow_window_and_presses_a_wide_one():
    acts = [Silence(300.0), Scene.draw(3), Silence(100.0)]
    events = play(acts, seed=3).events
    contacts, _ = taxel.simulate.truth(acts)
    late = np.rint([contact.start_us + 30_000 for contact in contacts]).astype(np.int64)
    found = taxel.Detections(["contact"] * len(late), late, late)
    played = evaluate(events, acts, shipped(), found)
    kinds = [contact.kind for contact in contacts]
    assert played.outcome.score["contact"].found < len(kinds)
    last = played.outcome.score["contact"].pairs[-1, 1]
    assert kinds[last] == "hand"


def test_the_demo_never_plays_what_the_readout_was_trained_on():
    assert run("--seed", TRAINING_SEED).returncode == 2
    drawn = {Scene.draw(TRAINING_SEED + n).parameters["bodies"][0]["x_mm"] for n in range(8)}
    assert len(drawn) == 8


def test_noise_alone_says_nothing():
    acts = [Silence(5_050.3)]
    quiet = evaluate(play(acts, seed=8).events, acts, shipped())
    assert (len(quiet.outcome.found), quiet.plain.false) == (0, 0)


def test_contact_listens_to_rises_and_lift_to_falls():
    contact, lift = (shipped().neurons[label].weights for label in ("contact", "lift"))
    assert np.argmax(contact) == 0
    assert contact[5:].max() < 0.1 * contact[0]
    assert np.argmax(lift) == 5
    assert lift[:5].max() < 0.1 * lift[5]


@pytest.mark.slow
def test_in_real_time_the_board_is_a_process_of_its_own_and_is_recorded(tmp_path):
    command = [sys.executable, "-m", "taxel", "demo", "--scenes", "2", "--seed", "5", "--json"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True, cwd=tmp_path)
    values = json.loads(ended.stdout)
    folder = tmp_path / Path(values["report"]).parent
    assert {path.name for path in folder.iterdir()} == {"recording.mcap", "report.html"}
    # On a busy machine events arrive too late for the readout; a verdict says how many.
    assert values["neurons"]["found"] > 0 or len(values["verdicts"]) > 2
    assert len(taxel.open(folder / "recording.mcap").events) > 1000
