//! At any time the last frame of each source is shown.

use std::sync::Arc;

use super::*;
use crate::columns::{COLUMN_US, Curve, MISSING, TimeColumns, column_of};
use crate::player::{Player, ViewOptions};
use rand::{Rng, SeedableRng, rngs::StdRng};

fn about(name: &str, left: u16, sensor: Array, rest: FrameRest) -> FramesOfSource {
    FramesOfSource { name: name.to_owned(), left, sensor, rest }
}

fn foot() -> Array {
    Array::unmeasured(2, 3, "foot")
}

fn index(left: &(Vec<i64>, Vec<f32>), right: &(Vec<i64>, Vec<f32>)) -> Arc<Index> {
    let array = Array::new(2, 7, 1.0, "feet").unwrap();
    let rest = FrameRest {
        source: RestSource::None,
        values: vec![0.0; 6],
        ticks_by_unit: 1.0,
        loaded_from: 0.0,
        falls: false,
        preload_at: String::new(),
    };
    let sources = [("left", 0, left), ("right", 4, right)].map(|(name, left, (t, values))| FrameSource {
        about: about(name, left, foot(), rest.clone()),
        t: t.clone(),
        values,
    });
    Arc::new(indexed(array, sources.into()))
}

fn indexed(array: Array, sources: Vec<FrameSource<'_>>) -> Index {
    let kept = Kept::All { memory: u64::MAX, folder: "/nowhere".into() };
    Index::of_frames(array, String::new(), None, sources, kept).unwrap()
}

fn frames(index: &Index) -> &Frames {
    index.sensor.frames.as_ref().unwrap()
}

fn drawn(random: &mut StdRng, fractions: bool) -> (Vec<i64>, Vec<f32>) {
    let mut t = random.random_range(-50_000..50_000_i64);
    let (mut times, mut values) = (vec![], vec![]);
    for _ in 0..random.random_range(1..200) {
        times.push(t);
        t += if random.random_range(0..20) == 0 { 5_000_000 } else { random.random_range(1..20_000) };
        for _ in 0..6 {
            let value = random.random_range(-20..200_i16);
            values.push(match random.random_range(0..12) {
                0 => f32::NAN,
                _ if fractions => f32::from(value) * 0.37,
                _ => f32::from(value),
            });
        }
    }
    (times, values)
}

#[test]
fn where_most_values_are_negative_they_are_above_the_least() {
    let of = |values: [f32; 3]| (vec![0, 10_000, 20_000], values.iter().flat_map(|&value| [value; 6]).collect());
    let index = index(&of([-1800.0, -300.0, 20.0]), &of([1800.0, -300.0, 20.0]));
    let mut player = Player::open(&index, 20_000, &ViewOptions::plain(COLUMN_US), None).unwrap();
    player.state.update_curve();
    let sums: Vec<f64> = player.state.curves().map(|curve| f64::from(curve.sum) * frames(&index).steps.size).collect();
    for (sum, expected) in sums.iter().zip([6.0 * 1840.0, 6.0 * 1820.0, 6.0 * 20.0]) {
        assert!((sum - expected).abs() < 12.0, "{sum} {expected}");
    }
}

#[test]
fn at_any_time_the_last_frame_of_each_source_is_shown_with_its_load() {
    let mut random = StdRng::seed_from_u64(7);
    for round in 0..40 {
        let (left, right) = (drawn(&mut random, round % 2 == 0), drawn(&mut random, round % 2 == 0));
        let index = index(&left, &right);
        let steps = frames(&index).steps;
        let (first, last) = index.range().unwrap();
        let open = |t| Player::open(&index, t, &ViewOptions::plain(COLUMN_US), None).unwrap();
        let mut player = open(first);
        for _ in 0..10 {
            let t = random.random_range(first..=last);
            let mut sought = open(t);
            if t >= player.t {
                player.advance(t).unwrap();
            }
            let (mut expected, mut sums) = (vec![f32::NAN; 14], [None; 2]);
            for (source, ((times, values), offset)) in [(&left, 0), (&right, 4)].into_iter().enumerate() {
                let Some(k) = times.partition_point(|&at| at <= t).checked_sub(1) else { continue };
                for cell in 0..6 {
                    let value = values[6 * k + cell];
                    expected[cell / 3 * 7 + offset + cell % 3] = value;
                    if !value.is_nan() {
                        *sums[source].get_or_insert(0.0) += value.max(0.0);
                    }
                }
            }
            let shown = |player: &Player| -> Vec<f64> {
                let value = |ticks: u16| (f64::from(ticks) - f64::from(steps.zero)) * steps.size;
                let held = player.state.held().iter();
                held.map(|&ticks| if ticks == UNKNOWN { f64::NAN } else { value(ticks) }).collect()
            };
            for player in [&sought].into_iter().chain((player.t == t).then_some(&player)) {
                for (ours, theirs) in shown(player).iter().zip(&expected) {
                    let near = (ours - f64::from(*theirs)).abs() <= 0.51 * steps.size;
                    assert!(near || ours.is_nan() && theirs.is_nan(), "{ours} {theirs}");
                }
            }
            sought.state.update_curve();
            let column = column_of(t, COLUMN_US);
            let curves: Vec<Curve> = sought.state.curves().collect();
            let load = f64::from(curves[0].sum) * steps.size;
            let sum: f32 = sums.iter().flatten().sum();
            assert!((load - f64::from(sum)).abs() < 12.0 * steps.size, "{load} {sum}");
            for (source, (curve, theirs)) in curves[1..].iter().zip(sums).enumerate() {
                let Curve { sum, x, y, .. } = *curve;
                assert_eq!(curve.area == MISSING.area, theirs.is_none());
                let near = |expected: f32| (f64::from(sum) * steps.size - f64::from(expected)).abs() < 6.0 * steps.size;
                assert!(theirs.is_none_or(near), "{sum} {theirs:?}");
                assert_eq!(x.is_nan(), sum == 0 || theirs.is_none());
                let (mut mass, mut at) = (0.0, [0.0; 2]);
                for (cell, value) in expected.iter().enumerate().filter(|(_, value)| **value > 0.0) {
                    let (row, column) = (cell / 7, cell % 7);
                    if (column >= 4) == (source == 1) {
                        mass += value;
                        at = [at[0] + value * column as f32, at[1] + value * row as f32];
                    }
                }
                let far = |ours: f32, moment: f32| (ours - moment / mass).abs() > 0.02;
                assert!(mass < 30.0 || !(far(x, at[0]) || far(y, at[1])), "{source}: {x}, {y} of {at:?} / {mass}");
            }
            if sought.t == last {
                let of = |columns: &TimeColumns| columns.curves(column);
                assert_eq!(of(index.whole.as_ref().unwrap()), of(sought.state.columns()));
            }
        }
    }
}

#[test]
fn steps_go_from_frame_to_frame_both_ways() {
    let left = ((0..9).map(|k| 10_000 * k).collect::<Vec<i64>>(), vec![1.0; 54]);
    let index = index(&left, &(vec![], vec![]));
    let mut player = Player::open(&index, 30_000, &ViewOptions::plain(COLUMN_US), None).unwrap();
    assert_eq!((index.stamp_before(30_000).unwrap(), player.next_stamp().unwrap()), (Some(20_000), Some(40_000)));
    assert_eq!(player.state.events, 4);
    player.advance(80_000).unwrap();
    assert_eq!((player.next_stamp().unwrap(), player.state.events), (None, 9));
}
