"""Shares of load in the regions of drawn footprints, whose parts carry known loads."""

import numpy as np
import pytest
from drawn import drawn

from taxel import Region
from taxel_gait.loads import loads_of
from taxel_gait.masks import FAN, MASKS, Picture, find_mask, laid_on, mean_picture
from taxel_gait.prints import Print, place

POOLED = {"metatarsal 2": "metatarsals 2-3", "metatarsal 3": "metatarsals 2-3"}


def shares(frames, mask="nine"):
    one = Print.of(frames)
    placed = place(one)
    regions = laid_on(find_mask(Picture.of(one, placed)).regions(mask), placed)
    loads = loads_of(one, regions)
    impulse = {name: float(np.trapezoid(own.force, one.t)) for name, own in loads.items()}
    return {name: value / impulse["whole"] for name, value in impulse.items() if name != "whole"}


@pytest.mark.parametrize("left", [False, True])
@pytest.mark.parametrize("angle", [0, 33, 120, 200, 290])
def test_each_region_carries_what_was_drawn_there(angle, left):
    frames, drawn_shares = drawn(angle=angle, left=left)
    found = shares(frames)
    assert sum(found.values()) == pytest.approx(1, abs=1e-5)
    for name, share in drawn_shares.items():
        assert found[name] == pytest.approx(share, abs=0.03), name


@pytest.mark.parametrize("heads", [0.66, 0.69, 0.73, 0.77, 0.80])
def test_the_toe_line_follows_the_metatarsal_heads(heads):
    frames, drawn_shares = drawn(heads=heads)
    found = shares(frames)
    toes = found["hallux"] + found.get("toes 2-5", 0.0)
    assert toes == pytest.approx(drawn_shares["hallux"] + drawn_shares["toes 2-5"], abs=0.02)
    heads_found = sum(share for name, share in found.items() if name.startswith("metatarsal"))
    heads_drawn = sum(share for name, share in drawn_shares.items() if name.startswith("metatarsal"))
    assert heads_found == pytest.approx(heads_drawn, abs=0.03)


@pytest.mark.parametrize("cell", [5.0, 10.0, 15.0])
def test_cells_change_the_shares_little(cell):
    found, finest = shares(drawn(cell)[0], "seven"), shares(drawn(5.0)[0], "seven")
    for name, share in finest.items():
        assert found.get(name, 0.0) == pytest.approx(share, abs={5.0: 1e-9, 10.0: 0.04, 15.0: 0.07}[cell]), name


@pytest.mark.parametrize("mask", MASKS)
def test_the_regions_of_a_mask_add_up_to_the_whole(mask):
    found = shares(drawn(angle=15)[0], mask)
    assert sum(found.values()) == pytest.approx(1, abs=1e-5)
    assert {*found} <= {*MASKS[mask]}


@pytest.mark.parametrize("left", [False, True])
def test_heel_and_midfoot_carry_what_the_rule_of_pressure_gives(left):
    # After automask_novel of pressuRe: from the toes, 73 and 45 % of the print's length along its upright axis.
    frames, _ = drawn(left=left)
    found = shares(frames)
    total = frames.values.sum(axis=0, dtype=np.float64)
    rows = np.flatnonzero(total.sum(axis=1))
    from_toes = (np.arange(total.shape[0]) - rows[0] + 0.5) / (rows[-1] - rows[0] + 1)
    by_row = total.sum(axis=1) / total.sum()
    assert found["heel"] == pytest.approx(by_row[from_toes > 0.73].sum(), abs=0.03)
    assert found["midfoot"] == pytest.approx(by_row[(from_toes > 0.45) & (from_toes <= 0.73)].sum(), abs=0.04)


def test_masks_have_as_many_regions_as_their_names_say():
    assert {name: len(regions) for name, regions in MASKS.items()} == {
        "nine": 9,
        "seven": 7,
        "pedar": 9,
        "footscan": 10,
        "thirds": 3,
    }


def test_pooled_regions_are_the_sum_of_theirs():
    nine, seven = (shares(drawn()[0], mask) for mask in ("nine", "seven"))
    assert seven["metatarsals 2-3"] == pytest.approx(nine["metatarsal 2"] + nine["metatarsal 3"])
    assert seven["metatarsals 4-5"] == pytest.approx(nine["metatarsal 4"] + nine["metatarsal 5"])


def test_borders_between_metatarsals_are_where_they_are_said_to_be():
    one = Print.of(drawn()[0])
    placed = place(one)
    mask = find_mask(Picture.of(one, placed))
    for region, w in zip(mask.regions()[2:6], FAN, strict=True):
        corners = np.array(region.corners)
        medial, width = mask.width_at(corners[:, 1])
        assert np.any(np.isclose((corners[:, 0] - medial) / width, w, atol=1e-6))


def test_the_mask_of_the_mean_of_equal_prints_is_that_of_each():
    one = Print.of(drawn(angle=10)[0])
    picture = Picture.of(one, place(one))
    assert find_mask(mean_picture([picture] * 3)).regions() == find_mask(picture).regions()


def test_a_mask_laid_on_another_array_is_the_same_region_of_the_foot():
    straight, turned = (Print.of(drawn(angle=angle)[0]) for angle in (0, 90))
    mask = find_mask(Picture.of(straight, place(straight))).regions()
    loads = [loads_of(one, laid_on(mask, place(one))) for one in (straight, turned)]
    for name in ("heel", "midfoot", "hallux"):
        a, b = (float(own[name].force.max()) for own in loads)
        assert a == pytest.approx(b, rel=0.05)
    assert all(isinstance(one, Region) for one in mask)
