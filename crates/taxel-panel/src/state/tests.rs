//! A state begun from a keyframe equals one from the beginning; loads, rest and silence.

use super::*;
use crate::columns::SPAN;

fn begun(rows: u16, columns: u16, from: &Keyframe, us: i64) -> ArrayState {
    let sensor = Sensor::new(Array::unmeasured(rows, columns, "small"), 3, None);
    ArrayState::new(&Arc::new(sensor), from, us, 1 << 14)
}

fn small() -> ArrayState {
    begun(2, 2, &Keyframe::blank(4), COLUMN_US)
}

fn change(t: i64, taxel: u32, ticks: u16) -> TaxelChange {
    TaxelChange { t, taxel, ticks, up: true, repaired: false }
}

fn raster(columns: &TimeColumns, column: i64) -> Vec<u8> {
    let mut rows = vec![0; columns.rows()];
    columns.add_raster(column..column + 1, &mut rows);
    rows
}

#[test]
fn a_state_from_a_keyframe_equals_one_from_the_beginning() {
    [COLUMN_US, 500].into_iter().for_each(from_a_keyframe);
}

fn from_a_keyframe(us: i64) {
    use rand::{Rng, SeedableRng, rngs::StdRng};
    let mut random = StdRng::seed_from_u64(18);
    let (taxels, mut t) = (12, 0_i64);
    let mut changes = vec![];
    for _ in 0..5000 {
        // The time between two changes is sometimes an hour,
        t += match random.random_range(0..500) {
            0 => 3_600_000_000,
            // and often 0.
            1..200 => 0,
            _ => random.random_range(0..5000),
        };
        // Some arrive late.
        let back = if random.random_range(0..9) == 0 { random.random_range(0..9000) } else { 0 };
        changes.push(change(t - back, random.random_range(0..taxels), random.random_range(0..300)));
    }
    let mut whole = begun(3, 4, &Keyframe::blank(taxels as usize), us);
    let mut keyframes = vec![];
    for (k, change) in changes.iter().enumerate() {
        if k % 100 == 0 {
            keyframes.push((k, whole.keyframe()));
        }
        whole.apply(&[*change]);
    }
    for (k, keyframe) in keyframes {
        let mut fresh = begun(3, 4, &keyframe, us);
        fresh.apply(&changes[k..]);
        assert_eq!(fresh.held(), whole.held());
        assert_eq!(fresh.rest(), whole.rest());
        assert_eq!((fresh.events, fresh.latest), (whole.events, whole.latest));
        let begun = keyframe.latest.map_or(0, |t| column_of(t, us));
        let now = column_of(whole.latest.unwrap(), us);
        if (now - begun) * us > FORGET * COLUMN_US {
            assert_eq!(fresh.change(), whole.change());
        }
        fresh.update_curve();
        whole.update_curve();
        let (fresh, whole) = (fresh.columns(), whole.columns());
        for column in (begun + 30).max(now - SPAN)..=now {
            assert_eq!(raster(fresh, column), raster(whole, column), "column {column}");
            assert_eq!(format!("{:?}", fresh.curve(column)), format!("{:?}", whole.curve(column)), "column {column}");
        }
    }
}

#[test]
fn above_rest_is_more_than_the_floor_and_its_centre_is_known() {
    let mut state = small();
    for taxel in 0..4 {
        state.apply(&[change(0, taxel, 48)]);
    }
    state.apply(&[change(100, 0, 51)]);
    state.update_curve();
    assert_eq!(state.columns().curve(0).sum, (0, 0), "the noise floor is not a touch");
    state.apply(&[change(200, 0, 58)]);
    state.apply(&[change(300, 3, 78)]);
    state.update_curve();
    let curve = state.curves().next().unwrap();
    assert_eq!((curve.sum, curve.area, curve.x, curve.y), (40, 2, 0.75, 0.75));
    // Of 10 at the left upper taxel, and then of 30 more at the right lower one.
    let extent = state.columns().curve(0);
    assert_eq!((extent.sum, extent.area, extent.x, extent.y), ((0, 40), (0, 2), (0.0, 0.75), (0.0, 0.75)));
    assert_eq!(state.change(), [7, 0, 0, 30], "the larger of two changes, 3 and 7");
    state.set_rest(state.held().to_vec());
    assert_eq!(state.curves().next().unwrap().sum, 0);
    state.advance(FORGET * COLUMN_US);
    assert_eq!(state.change(), [0; 4]);
}

#[test]
fn a_zeroed_taxel_keeps_its_rest_until_the_rest_of_all_is_set() {
    let mut state = small();
    for (t, ticks) in [(0, 40), (100, 60)] {
        (0..4).for_each(|taxel| state.apply(&[change(t, taxel, ticks)]));
    }
    state.zero(1, 60);
    assert_eq!((state.curves().next().unwrap().sum, state.curves().next().unwrap().area), (60, 3));
    state.apply(&[change(200, 1, 30)]);
    state.apply(&[change(200, 0, 40)]);
    // Ten hours after, the others rest where they stay, and it still where it was zeroed.
    state.advance(36_000_000_000);
    assert_eq!(state.rest(), [40, 60, 60, 60]);
    state.set_rest(vec![40, 30, 60, 60]);
    assert_eq!(state.rest(), [40, 30, 60, 60]);
}

#[test]
fn the_rest_is_given_found_in_a_quiet_stretch_or_none() {
    let mut state = small();
    (0..4).for_each(|taxel| state.apply(&[change(0, taxel, 48)]));
    assert_eq!(state.rest_source(), RestSource::None);
    state.advance(1_000_000);
    assert_eq!((state.rest_source(), state.rest()), (RestSource::Quiet, &[48; 4][..]));
    // A value below the rest, once, is not the rest.
    state.apply(&[change(1_010_000, 0, 20)]);
    state.apply(&[change(1_050_000, 0, 48)]);
    state.advance(1_060_000);
    assert_eq!(state.rest(), [48; 4]);
    // A drift is followed within seconds.
    (0..4).for_each(|taxel| state.apply(&[change(1_100_000, taxel, 51)]));
    state.advance(9_000_000);
    assert_eq!(state.rest(), [51; 4]);
    state.set_rest(vec![40, 40, 40, UNKNOWN]);
    state.advance(19_000_000);
    assert_eq!((state.rest_source(), state.rest()), (RestSource::Given, &[40, 40, 40, UNKNOWN][..]));
}

#[test]
fn a_taxel_s_first_value_is_its_rest_however_soon_it_changes() {
    let mut state = small();
    (0..4).for_each(|taxel| state.apply(&[change(4000, taxel, 48)]));
    state.apply(&[change(9000, 1, 90)]);
    // The rest is tracked every 64 ms; what is far is followed slowly.
    state.advance(400_000);
    assert_eq!((state.rest_source(), state.rest()), (RestSource::None, &[48, 49, 48, 48][..]));
    assert_eq!(state.above(1), 41);
}

#[test]
fn time_set_back_removes_the_assumed_silence_and_goes_on() {
    let mut once = small();
    let mut stalled = once.clone();
    for t in [0, 40_000] {
        once.apply(&[change(t, 1, 60)]);
        stalled.apply(&[change(t, 1, 60)]);
    }
    stalled.advance(9_000_000);
    stalled.set_back(40_000);
    stalled.set_back(50_000);
    for t in [80_000, 81_000] {
        once.apply(&[change(t, 2, 70)]);
        stalled.apply(&[change(t, 2, 70)]);
    }
    once.update_curve();
    stalled.update_curve();
    assert_eq!(stalled.restarts, 1);
    assert_eq!(stalled.columns().reach(), once.columns().reach());
    for column in 0..=column_of(81_000, COLUMN_US) {
        assert_eq!(raster(once.columns(), column), raster(stalled.columns(), column), "column {column}");
        let curves = [once.columns().curve(column), stalled.columns().curve(column)];
        assert_eq!(format!("{:?}", curves[0]), format!("{:?}", curves[1]), "column {column}");
    }
}
