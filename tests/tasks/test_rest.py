"""Which rest a detection takes: 0 by the unit, else the first quiet stretch; labels and notes never count."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tests.shell import run
from touching import pressed

import taxel
from taxel import Array, Frames, ProblemError, Tare
from taxel._base.messages import collected
from taxel.demo.script import script
from taxel.detect import PlainRule
from taxel.panel.shown_files import Opening, ShownFiles
from taxel.panel.training import Training
from taxel.simulate import play
from taxel.tasks import detect, rest

from .recordings import board, mat, trials


def test_forces_rest_at_0_and_other_values_at_their_first_quiet_stretch(tmp_path: Path) -> None:
    force = rest(taxel.open_all(trials(tmp_path))[0])
    assert (force.source, force.tare.rest.any(), force.to_dict()["us"]) == ("unit", np.False_, None)
    of_frames = rest(taxel.open(mat(tmp_path)))
    assert (of_frames.source, of_frames.to_dict()["us"], of_frames.detect_from_us) == ("quiet", [0, 500_000], None)
    assert np.abs(of_frames.tare.rest - 40).max() < 0.5
    events = rest(taxel.open(board(tmp_path)))
    assert (events.source, events.tare.stop_us - events.tare.start_us) == ("quiet", 500_000)
    assert events.tare.stop_us < 700_000


@pytest.mark.parametrize("begin_us", [0, 1_795_000_000_000_000])
def test_a_training_takes_the_rest_of_a_detection(begin_us: int, tmp_path: Path) -> None:
    frames, labels = pressed(1)
    later = Frames(frames.values, frames.t + begin_us, unit=frames.unit, array=frames.array)
    taxel.convert(later, tmp_path / "a.npz")
    recording, own = taxel.open(tmp_path / "a.npz"), {label: t + begin_us for label, t in labels.items()}
    training = taxel.train(recording, [own], taxel.tasks.TrainOptions(folds=0))
    assert [taken.to_dict() for taken in training.rests] == [rest(recording).to_dict()]
    assert f"rest: {rest(recording)}; --tare sets" in "\n".join(training.lines())
    assert "--tare" not in training.command("r.json")


@pytest.mark.parametrize("shape", [(1, 1), (1, 6), (4, 4)])
def test_a_stretch_in_which_the_sensor_was_loaded_is_no_rest(shape: tuple[int, int], tmp_path: Path) -> None:
    """Somebody stands for a second and walks then; the labels are later."""
    values = np.random.default_rng(1).normal(500, 2, (900, *shape))
    values[:100] += 2500
    for begin in range(130, 900, 60):
        values[begin : begin + 35] += 3000
    frames = Frames(values, 10_000 * np.arange(900), unit="counts", array=Array(*shape))
    taxel.convert(frames, tmp_path / "walk.npz")
    recording = taxel.open(tmp_path / "walk.npz")
    taken = rest(recording)
    assert (taken.source, taken.tare) == ("none", None)
    assert str(taken).startswith("unknown, because no stretch")
    assert "rest                unknown" in run("info", tmp_path / "walk.npz").stdout


@pytest.mark.parametrize("shape", [(1, 1), (1, 6), (8, 8)])
def test_a_load_in_the_first_quiet_stretch_is_taken_off(shape: tuple[int, int], tmp_path: Path) -> None:
    """A load lies on a part of the sensor for a second; later all of it is at rest, but for short presses."""
    values = np.random.default_rng(2).normal(500, 1, (900, *shape))
    lain = values.reshape(900, -1)[:, : max(1, values[0].size // 3)]
    lain[:100] += 2000
    for begin in range(300, 900, 100):
        values[begin : begin + 20] += 3000
    taxel.convert(Frames(values, 10_000 * np.arange(900), unit="counts", array=Array(*shape)), tmp_path / "a.npz")
    taken = rest(taxel.open(tmp_path / "a.npz"))
    assert taken.source == "quiet"
    assert np.abs(taken.tare.rest - 500).max() < 20


@pytest.mark.parametrize("unit", ["N", "kPa"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_forces_that_do_not_rest_near_0_are_said_with_the_tare_that_takes_that_off(
    seed: int, unit: str, tmp_path: Path
) -> None:
    frames, _ = pressed(seed)
    random = np.random.default_rng(seed)
    drift = np.linspace(0, 1, len(frames))[:, None, None] * random.uniform(0, 2, (6, 6))
    presses = np.maximum(frames.values - 50, 0) / 10

    def warned(name: str, values: np.ndarray, tare: float | None = None) -> list[str]:
        taxel.convert(Frames(values, frames.t, unit=unit, array=frames.array), tmp_path / f"{name}.npz")
        recording = taxel.open(tmp_path / f"{name}.npz")
        said = taxel.tasks.info(recording, tare).warnings
        with collected() as of_training:
            if tare is None:
                rest(recording)
        assert tuple(of_training) == said
        return list(said)

    (line,) = warned("offset", presses + random.uniform(4, 8, (6, 6)) + drift)
    assert "offset.npz: 36 of 36 taxels read 4." in line
    assert (
        f" {unit} in a quiet stretch, 0.000 to 0.500 s, and not 0; if nothing touches them then, give --tare 0.5 "
        in line
    )
    (line,) = warned("below", presses - random.uniform(4, 8, (6, 6)))
    assert "--tare 0.5 to subtract the values of this stretch" in line
    assert warned("tared", presses + 5.0, 0.5) == []
    assert warned("noise", presses + random.normal(0, 0.05, presses.shape)) == []
    # A foot that stands at first and is lifted later is a load.
    standing = presses.copy()
    standing[:80] += 30.0
    assert warned("standing", standing) == []
    # So it is in a shoe that presses a little for all of the time.
    assert warned("shoe", standing + random.uniform(1, 4, (6, 6))) == []


def test_the_page_takes_the_same_rest_also_where_a_touch_begins_the_recording(tmp_path: Path) -> None:
    values = np.full((300, 4, 4), 50.0)
    for begin in (2, 120, 220):
        values[begin : begin + 12, 1:3, 1:3] = 250
    taxel.convert(Frames(values, 10_000 * np.arange(300), unit="counts", array=Array(4, 4)), tmp_path / "a.npz")
    rule = PlainRule("area", 2, noise_floor=40.0)
    rule.save(tmp_path / "rule.json")
    found = detect(rule, taxel.open(tmp_path / "a.npz")).outcomes[0].found
    assert found.t.tolist()[-4:] == [1_200_000, 1_320_000, 2_200_000, 2_320_000]
    page = Training(Opening(), ShownFiles()).detect(tmp_path / "a.npz", None, tmp_path / "rule.json", "better")
    assert [one["t_us"] for one in page[1]] == found.t.tolist()


def test_where_nothing_is_quiet_it_is_refused_with_what_to_give(tmp_path: Path) -> None:
    values = np.full((300, 4, 4), 50.0)
    for begin in range(5, 300, 30):
        values[begin : begin + 10, 1:3, 1:3] = 250
    taxel.convert(Frames(values, 10_000 * np.arange(300), unit="counts", array=Array(4, 4)), tmp_path / "a.npz")
    rule = PlainRule("area", 2, noise_floor=40.0)
    with pytest.raises(
        ProblemError, match=r"a\.npz: the values .* and four values was quiet and without load; give tare$"
    ):
        detect(rule, taxel.open(tmp_path / "a.npz"))
    rule.save(tmp_path / "rule.json")
    refused = run("detect", tmp_path / "a.npz", "--readout", tmp_path / "rule.json")
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "give --tare SECONDS or FILE" in refused.stderr
    assert run("detect", tmp_path / "a.npz", "--readout", tmp_path / "rule.json", "--tare", "0.04").returncode == 0
    # One with its own tare, and one that reads none, need no quiet stretch.
    tared = PlainRule(
        "area", 2, noise_floor=40.0, tare=Tare.take(Frames(values, 10_000 * np.arange(300)), stop_us=40_000)
    )
    assert len(detect(tared, taxel.open(tmp_path / "a.npz")).outcomes[0].found) == 20
    levels = taxel.Readout(
        taxel.encode.LevelCrossing([100.0]), {"on": (taxel.Neuron(tau=2.0), [1.0] * 16 + [0.0] * 16)}
    )
    assert detect(levels, taxel.open(tmp_path / "a.npz")).each[0].rest is None


@pytest.mark.parametrize("begin_us", [0, 1_795_000_000_000_000])
def test_a_recording_at_rest_is_a_tare(tmp_path: Path, begin_us: int) -> None:
    """That which `taxel cut` makes of a stretch is the tare of this stretch, for each command."""
    frames, _ = pressed(1)
    later = Frames(frames.values, frames.t + begin_us, unit=frames.unit, array=frames.array)
    taxel.convert(later, tmp_path / "a.npz")
    assert run("cut", tmp_path / "a.npz", tmp_path / "rest.npz", "--from", 0.1, "--to", 0.6).returncode == 0
    recording = taxel.open(tmp_path / "a.npz")
    taken = rest(recording, tmp_path / "rest.npz").tare
    expected = Tare.take(recording.frames().between(begin_us + 100_000, begin_us + 600_000))
    assert np.array_equal(taken.rest, expected.rest)
    assert np.array_equal(taken.noise, expected.noise)
    saved = taken.save(tmp_path / "tare.txt")
    PlainRule("area", 2, noise_floor=20.0).save(tmp_path / "rule.json")
    command = ("detect", tmp_path / "a.npz", "--readout", tmp_path / "rule.json", "--json", "--tare")
    by_recording, by_tare = (json.loads(run(*command, file).stdout) for file in (tmp_path / "rest.npz", saved))
    assert by_recording["detections"] == by_tare["detections"] != []
    with collected() as warned:
        rest(recording, tmp_path / "a.npz")
    assert len(warned) == 1
    assert "a.npz: it is not quiet but contains a touch of " in warned[0]
    taxel.convert(Frames(later.values, later.t, unit="N", array=frames.array), tmp_path / "force.npz")
    with pytest.raises(ProblemError, match=r"force\.npz: a recording in N; must be in counts, as .*a\.npz is"):
        rest(recording, tmp_path / "force.npz")
    refused = run("detect", tmp_path / "a.npz", "--readout", tmp_path / "rule.json", "--tare", tmp_path / "rule.json")
    assert "rule.json: is a taxel plain rule, not a tare" in refused.stderr


@pytest.mark.parametrize(
    "unit", ["N", "mN", "gf", "kgf", "Pa", "hPa", "kPa", "mbar", "bar", "psi", "mmHg", "N/cm2", "N/cm²"]
)
def test_units_of_force_and_pressure_rest_at_0(tmp_path: Path, unit: str) -> None:
    taxel.convert(Frames(np.full((100, 1, 2), 5.0), 10_000 * np.arange(100), unit=unit), tmp_path / "a.npz")
    taken = rest(taxel.open(tmp_path / "a.npz"))
    assert (taken.source, taken.tare.rest.any()) == ("unit", np.False_)


def test_a_board_shows_its_rest_until_it_is_started(tmp_path: Path) -> None:
    """After that it holds values that are off by up to its noise floor; these count where taxels were silent before."""
    events = play(script(7, 1), seed=7).events
    start = events.markers[0][0]
    last = np.flatnonzero(events.t > start)[-1]
    is_one = (events.x == events.x[last]) & (events.y == events.y[last])
    for name, source, end in (
        ("whole.npz", events, start),
        ("silent.npz", events[~is_one | (events.t > start)], events.t[0] + 500_000),
    ):
        taxel.convert(source, tmp_path / name)
        taken = rest(taxel.open(tmp_path / name))
        assert (taken.source, taken.us) == ("quiet", (events.t[0], end))
        assert np.array_equal(taken.tare.rest, Tare.take(source, stop_us=end).rest, equal_nan=True)


def test_z_says_where_taxels_of_three_axes_are_at_rest(tmp_path):
    draw, names = np.random.default_rng(1), [f"{taxel}_{axis}" for taxel in "abcd" for axis in "xyz"]
    values = draw.normal(500.0, 2.0, (600, 1, 12))
    values[:, :, 0::3] += np.linspace(0.0, 4000.0, 600)[:, None, None]
    values[300:400, :, 2::3] += 900.0
    array = taxel.Array(1, 12, names=names)
    made = taxel.Frames(values, 10_000 * np.arange(600), unit="counts", array=array)
    taxel.convert(made, tmp_path / "a.npz")
    taken = rest(taxel.open(tmp_path / "a.npz"))
    begin, end = taken.us
    inside = made.values[(made.t >= begin) & (made.t < end)].mean(axis=0)
    assert end <= 3_000_000
    np.testing.assert_allclose(taken.tare.rest, inside, atol=0.5)
