"""A skin: its densities, its places, and its trains against the encoder of each type on what its field feels."""

import numpy as np
import pytest
from refusal import refused

from taxel import Array, Frames
from taxel.encode import FA1, FA2, SA1, SA2, Skin

from .scenes import frames_of

REPAIRED = "both"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "skin": Skin(),
    "skin of small fields": Skin(sa1_field_mm2=0.01, fa1_field_mm2=0.5, fa2_per_cm2=0.0, seed=9, period_ms=0.5),
}
KINDS = ("SA-1", "FA-1", "SA-2", "FA-2")


def places(encoder, array):
    """Where each train's afferent stands, mm."""
    afferents = encoder.afferents(array)
    return np.stack([afferents.x_mm, afferents.y_mm], axis=1)


@pytest.mark.parametrize(("rows", "columns", "pitch"), [(10, 10, 1.0), (64, 64, 2.67), (7, 30, 0.4)])
def test_densities_are_those_of_the_fingertip_on_any_array(rows, columns, pitch):
    array = Array(rows, columns, pitch)
    afferents = Skin().afferents(array)
    area = rows * columns * pitch**2 / 100
    counts = [len(afferents.trains(kind)) for kind in KINDS]
    assert counts == [round(area * density) for density in (70, 140, 6, 25)]
    assert list(dict.fromkeys(afferents.kind)) == [k for k, n in zip(KINDS, counts, strict=True) if n]
    assert Skin().trains(array) == len(afferents) == sum(counts)
    for at, size in ((afferents.x_mm, columns), (afferents.y_mm, rows)):
        assert (-0.5 * pitch <= at.min()) & (at.max() <= (size - 0.5) * pitch)


def test_places_are_even_and_belong_to_the_seed():
    array = Array(20, 20, 1.0)
    skin = Skin()
    afferents = skin.afferents(array)
    fa1 = afferents.trains("FA-1")
    taxel_ = np.rint(afferents.y_mm[fa1]) * 20 + np.rint(afferents.x_mm[fa1])
    # 1.4 afferents per taxel: one in each of 560 equal parts, so a taxel has none (or one) to three.
    assert np.bincount(taxel_.astype(int), minlength=400).max() <= 3
    assert (np.diff(taxel_) >= 0).all()
    assert np.array_equal(skin.afferents(array).x_mm, afferents.x_mm)
    assert not np.isin(Skin(seed=2).afferents(array).x_mm, afferents.x_mm).any()
    fewer = Skin(sa1_per_cm2=0).afferents(array)
    assert np.array_equal(fewer.x_mm[fewer.trains("FA-2")], afferents.x_mm[afferents.trains("FA-2")])


def test_no_afferent_stands_on_a_taxel_that_does_not_exist():
    exists = np.random.default_rng(1).random((8, 9)) < 0.5
    array = Array(8, 9, 1.5, exists=exists)
    afferents = Skin().afferents(array)
    y, x = (np.rint(at / 1.5).astype(int) for at in (afferents.y_mm, afferents.x_mm))
    assert exists[y, x].all()
    assert len(Skin().afferents(Array(2, 2, 1.0, exists=np.zeros((2, 2), bool)))) == 0


def felt(frames, array, x, y, field):
    """What afferents feel: the mean of the taxels in their fields, weighed by a Gaussian of half the edge."""
    edge = np.sqrt(field / np.pi)
    rows, columns = np.mgrid[: array.rows, : array.columns] * array.pitch_mm
    exists = np.ones(array.shape, bool) if array.exists is None else array.exists
    means = []
    for at in zip(x, y, strict=True):
        away = np.hypot(columns - at[0], rows - at[1])
        weights = np.where((away <= edge) & exists, np.exp(-(away**2) / (2 * (edge / 2) ** 2)), 0)
        if not weights.any():
            weights[round(at[1] / array.pitch_mm), round(at[0] / array.pitch_mm)] = 1
        means.append(np.tensordot(frames, weights / weights.sum()))
    return np.stack(means, axis=1)


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("pitch", [0.8, 2.67])
def test_each_train_is_its_type_s_encoder_on_what_its_field_feels(pitch, masked):
    rng = np.random.default_rng(4)
    array = Array(9, 11, pitch, exists=rng.random((9, 11)) < 0.7 if masked else None)
    t = np.arange(600) * 200
    y, x = np.mgrid[:9, :11]
    at = np.stack([np.linspace(1, 9, 600), np.linspace(2, 6, 600)], axis=1)
    bump = np.exp(-((x - at[:, :1, None]) ** 2 + (y - at[:, 1:, None]) ** 2) / 6)
    frames = 120 * bump * (1 + 0.3 * np.sin(2 * np.pi * 0.2 * t / 1000))[:, None, None]
    skin = Skin(seed=3)
    spikes, afferents = skin.encode(Frames(frames, t, array=array)), skin.afferents(array)
    encoders = {
        "SA-1": (SA1(period_ms=0.2), 11.0),
        "FA-1": (FA1(period_ms=0.2, decay="ms", range=150.0), 12.6),
        "SA-2": (SA2(period_ms=0.2), 60.0),
        "FA-2": (FA2(), 120.0),
    }
    for kind, (encoder, field) in encoders.items():
        trains = afferents.trains(kind)
        if not len(trains):
            continue
        values = felt(frames.astype(np.float32), array, afferents.x_mm[trains], afferents.y_mm[trains], field)
        theirs = encoder.encode(frames_of(t, values))
        assert len(theirs.times), kind
        differ = sum(
            len(np.setxor1d(np.rint(spikes[train] * 1000), np.rint(theirs[k] * 1000)))
            for k, train in enumerate(trains.tolist())
        )
        # The encoder rounds weights to 32 bits and the oracle does not, so a spike may differ by a sample.
        assert differ <= 0.01 * len(theirs.times) + 2, kind
    assert spikes.values is None


@pytest.mark.parametrize(
    ("more", "array", "argument"),
    [
        ({"sa1_per_cm2": -1.0}, Array(1, 1), "sa1_per_cm2"),
        ({"fa2_field_mm2": 0.0}, Array(1, 1), "fa2_field_mm2"),
        ({"period_ms": 2.0}, Array(1, 1), "period_ms"),
        ({"seed": -1}, Array(1, 1), "seed"),
        ({}, Array(1000, 1000, 100.0), None),
        ({}, None, "array"),
    ],
)
def test_skins_that_make_no_sense_are_refused(more, array, argument):
    with refused(argument=argument):
        Skin(**more).afferents(array)
