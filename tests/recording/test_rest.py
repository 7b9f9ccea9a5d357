"""The rest of a recording: given, the calibration's, 0, that of a quiet stretch, or not known; never the lowest."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from shell import run

import taxel
from taxel import Array, Frames, Tare
from taxel.recording.analysis.pressure import above_rest, series
from taxel.recording.analysis.rest import TOUCH, by_unit, of_frames, standing, touched


def sent(frames: taxel.Frames) -> taxel.Events:
    """Return what a board sends of frames: an event where a value differs by more than 3 from the last one."""
    rows, last = [], np.full(frames.values.shape[1:], np.nan)
    for at, frame in zip(frames.t, frames.values, strict=True):
        for y, x in np.argwhere(~(np.abs(frame - last) <= 3)):
            rows.append((at, x, y, not frame[y, x] < last[y, x], frame[y, x]))
            last[y, x] = frame[y, x]
    t, x, y, p, ticks = map(np.array, zip(*rows, strict=True))
    return taxel.Events(t, x, y, p, array=frames.array, intensity=ticks.astype(int))


def noisy(noise: float) -> taxel.Events:
    """Return two seconds of a board of 12 x 16 taxels with nothing on it."""
    rng, array = np.random.default_rng(7), taxel.Array(12, 16)
    values = np.rint(48 + rng.normal(0, 2, array.shape) + rng.normal(0, noise, (10_000, *array.shape)))
    return sent(taxel.Frames(values, 200 * np.arange(10_000), unit="ticks", array=array))


def test_a_board_with_nothing_on_it_reads_nothing(tmp_path: Path) -> None:
    events = noisy(1.0)
    lowest = np.full(events.array.shape, 999.0)
    np.minimum.at(lowest, (events.y, events.x), events.intensity)
    held = taxel.Frames.from_events(events, 10_000)
    assert np.median(np.count_nonzero(held.values - lowest > 3, axis=(1, 2))) > 20, "above the lowest values it does"
    taxel.convert(events, tmp_path / "a.npz")
    found = series(taxel.open(tmp_path / "a.npz"))
    assert found is not None
    assert found.rest.source == "quiet"
    assert np.median(found.columns["area_taxels"]) <= 6


def test_a_tare_comes_first_then_the_calibrations_rest_then_a_quiet_stretch(tmp_path: Path) -> None:
    t = [0, 0, 1_000_000, 1_200_000]
    events = taxel.Events(t, [0, 1, 0, 0], [0] * 4, [1] * 4, array=taxel.Array(2, 2, 1.0), intensity=[50, 40, 90, 50])
    path = tmp_path / "a.npz"
    taxel.convert(events, path)
    said = json.loads(run("info", path, "--json").stdout)
    assert said["rest"]["source"] == "quiet"
    assert said["pressure"]["peak"]["most"] == pytest.approx(40, abs=0.1)
    tare = taxel.Tare.take(taxel.Frames(np.full((2, 2, 2), 30.0), [0, 1], unit="ticks", array=events.array))
    tare.save(tmp_path / "tare.json")
    said = json.loads(run("info", path, "--tare", tmp_path / "tare.json", "--json").stdout)
    assert (said["rest"]["source"], said["pressure"]["peak"]["most"]) == ("given", 60.0)
    assert "rest                the given tare" in run("info", path, "--tare", tmp_path / "tare.json").stdout
    refused = run("calibrate", path, "--load", "2", "--from", "1.0", "--to", "1.1", "--tare", tmp_path / "tare.json")
    assert refused.returncode == 0, refused.stderr
    said = json.loads(run("info", path, "--json").stdout)
    assert (said["rest"]["source"], said["pressure"]["unit"]) == ("calibration", "N")
    other = taxel.Tare.take(taxel.Frames(np.zeros((2, 3, 2)), [0, 1]))
    other.save(tmp_path / "other.json")
    assert "the tare has 3 x 2 taxels" in run("info", path, "--tare", tmp_path / "other.json").stderr


def test_what_is_never_quiet_has_no_rest_and_the_page_says_so(tmp_path: Path) -> None:
    values = np.arange(40)[:, None, None] % 2 * 30.0 + np.full((40, 3, 3), 50.0)
    taxel.convert(taxel.Frames(values, np.arange(40) * 50_000, unit="counts"), tmp_path / "a.npz")
    assert "rest                unknown" in run("info", tmp_path / "a.npz").stdout
    found = above_rest(taxel.open(tmp_path / "a.npz"))
    assert found is not None
    assert float(found[0].values.max()) == 80.0
    events = taxel.Events([0, 100], [0, 0], [0, 0], [1, 1], array=taxel.Array(2, 2), intensity=[50, 90])
    taxel.convert(events, tmp_path / "e.npz")
    refused = run("calibrate", tmp_path / "e.npz", "--load", "2")
    assert refused.returncode == 2
    assert "the values of its taxels at rest are not known" in refused.stderr
    assert "--tare" in refused.stderr


def preloaded(
    *, until_s: float = 0.8, events: bool = False
) -> tuple[taxel.Events | taxel.Frames, dict[str, list[int]]]:
    """A hand that lies on rows 2 to 4, columns 5 to 7 from the beginning, then presses of 0.3 s elsewhere, labelled."""
    rng, hz = np.random.default_rng(3), 200
    values = 50 + rng.integers(-1, 2, (8 * hz, 8, 10)).astype(np.float32)
    values[: round(until_s * hz), 2:5, 5:8] += 40
    contacts = [2 * hz + k * hz * 3 // 2 for k in range(4)]
    for k in contacts:
        values[k : k + hz * 3 // 10, 5:8, 1:4] += 60
    t = np.arange(len(values)) * (1_000_000 // hz)
    truth = {"contact": [int(t[k]) for k in contacts], "lift": [int(t[k + hz * 3 // 10]) for k in contacts]}
    frames = taxel.Frames(values, t, unit="ticks", array=taxel.Array(8, 10, 2.0))
    return sent(frames) if events else frames, truth


@pytest.mark.parametrize("until_s", [0.8, 2])
@pytest.mark.parametrize("events", [False, True])
def test_what_lay_on_the_array_in_its_quiet_stretch_is_said_and_is_no_rest_of_a_training(
    tmp_path: Path, events: bool, until_s: float
) -> None:
    source, _ = preloaded(until_s=until_s, events=events)
    path, where = tmp_path / "a.npz", "rows 2 to 4, columns 5 to 7 (up to 4"
    taxel.convert(source, path)
    assert where in run("info", path).stdout
    taken = taxel.tasks.rest(taxel.open(path))
    assert where in str(taken)
    assert taken.source == "quiet"
    # Events differ from the last one of their taxel by more than 3 ticks.
    assert np.abs(taken.tare.rest - 50).max() < (4 if events else 1)


@pytest.mark.parametrize("drift", [0.0, 30.0])
def test_where_nothing_lay_or_the_whole_array_drifts_nothing_is_said(tmp_path: Path, drift: float) -> None:
    frames, _ = preloaded(until_s=0)
    assert isinstance(frames, taxel.Frames)
    falling = np.linspace(drift, 0, len(frames))[:, None, None].astype(np.float32)
    taxel.convert(taxel.Frames(frames.values + falling, frames.t, unit="ticks", array=frames.array), tmp_path / "a.npz")
    assert "something lay" not in run("info", tmp_path / "a.npz").stdout


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("sigma", [0.02, 0.3, 5.0])
@pytest.mark.parametrize("cut_off", [False, True])
@pytest.mark.parametrize("press", [False, True])
def test_the_noise_of_pressures_is_their_deviation_also_where_a_sensor_cuts_off_what_is_below_0(
    sigma: float, cut_off: bool, press: bool
) -> None:
    values = np.random.default_rng(1).normal(0, sigma, (400, 12, 12))
    values[200:250, 4:7, 4:7] += 100 * sigma
    if press:
        # The first quiet stretch, half a second, ends as it begins.
        values[47:60, 8:11, 8:11] += 100 * sigma
    values = np.maximum(values, 0) if cut_off else values
    values[:, 0, 0] = np.nan
    tare = by_unit(taxel.Frames(values.astype(np.float32), np.arange(400) * 10_000, unit="kPa"))
    assert tare is not None
    assert not tare.rest.any()
    assert tare.noise[0, 0] == 0
    assert np.quantile(tare.noise, 0.5) == pytest.approx(sigma, rel=0.2)


HZ = 50


def walked(seed: int, shape: tuple[int, int], *, noise: float = 0.5, step: float = 0.25) -> taxel.Frames:
    """Return 12 s in N, touched again and again on all taxels, in steps of the sensor, cut off at 0."""
    random = np.random.default_rng(seed)
    values = noise * random.standard_normal((12 * HZ, *shape))
    for begin in range(HZ // 2, 12 * HZ - HZ, HZ):
        values[begin : begin + HZ // 2] += random.uniform(20, 60, shape)
    t = np.arange(len(values)) * (1_000_000 // HZ)
    return taxel.Frames(np.maximum(step * np.round(values / step), 0), t, unit="N", array=taxel.Array(*shape))


@pytest.mark.parametrize("seed", [1, 2])
def test_what_lies_on_a_mat_from_beginning_to_end_is_found(seed: int) -> None:
    frames = walked(seed, (8, 10))
    assert standing(frames) == ""
    random, values = np.random.default_rng(seed), frames.values.copy()
    values[:, 1:4, 5:9] += random.uniform(8, 12, (3, 4))
    lying = taxel.Frames(values, frames.t, unit="N", array=frames.array)
    assert standing(lying).startswith("rows 1 to 3, columns 5 to 8 (up to 1")
    assert standing(lying).endswith(" N in every frame)")


SHAPES = [(1, 1), (1, 4), (1, 16), (4, 4), (10, 12), (60, 80)]
WINDOWS_US = [5000, 20_000]


def drawn(shape: tuple[int, int], mean: float, seed: int, window_us: int) -> Frames:
    """Draw 300 frames of Poisson noise."""
    values = np.random.default_rng(seed).poisson(mean, (300, *shape)).astype(float)
    return Frames(values, window_us * np.arange(300), unit=f"events/{window_us / 1000:g} ms", array=Array(*shape))


@pytest.mark.parametrize("window_us", WINDOWS_US)
@pytest.mark.parametrize("mean", [0.01, 0.05, 0.2, 1.0, 7.0, 50.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_noise_is_quiet_and_no_touch_at_any_rate(shape: tuple[int, int], mean: float, window_us: int) -> None:
    for seed in range(1 if shape[0] > 20 else 4):
        frames = drawn(shape, mean, seed, window_us)
        rest = of_frames(frames)
        assert (rest.source, rest.falls, rest.preload_at) == ("quiet", False, "")
        for count in (25, 115, 250):
            tare = Tare.take(frames, stop_us=window_us * count)
            assert touched(frames, tare) < TOUCH
