//! Compares held values and rests with a search through all events.

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use taxel_core::held::{Held, HeldOverTime, UNKNOWN, as_events};
use taxel_core::rest::{Rest, Value, touched_from};
use taxel_core::{Array, Events, Intensities};

/// Random events with and without values, out of order, several at one time.
fn events(random: &mut StdRng, array: &Array, n: usize) -> Events {
    let column = |random: &mut StdRng, most: u16| (0..n).map(|_| random.random_range(0..most)).collect();
    Events {
        t: (0..n).map(|_| random.random_range(-50..50 + n as i64 / 2)).collect(),
        x: column(random, array.columns),
        y: column(random, array.rows),
        p: (0..n).map(|_| random.random()).collect(),
        intensity: Some(Intensities {
            ticks: column(random, u16::MAX),
            present: (0..n).map(|_| random.random_range(0..4) > 0).collect(),
        }),
        ..Events::empty(array.clone())
    }
}

/// The value of the latest event of a taxel up to `t`, by a search through all events.
fn latest(events: &Events, taxel: usize, t: i64) -> Option<u16> {
    let intensity = events.intensity.as_ref().unwrap();
    let its = |k: &usize| {
        events.t[*k] <= t && intensity.present[*k] && events.array.index(events.x[*k], events.y[*k]) == taxel
    };
    // Of several events at one time, the last one is valid.
    (0..events.len()).filter(its).max_by_key(|&k| (events.t[k], k)).map(|k| intensity.ticks[k])
}

#[test]
fn held_values_at_any_time_are_those_of_the_latest_events() {
    let mut random = StdRng::seed_from_u64(5);
    for (n, array) in [(0, Array::new(3, 5, 1.0, "").unwrap()), (300, Array::new(3, 5, 1.0, "").unwrap())] {
        let events = events(&mut random, &array, n);
        let chosen: Vec<u32> = vec![14, 0, 7];
        let mut all = HeldOverTime::new(events.view(), None, vec![UNKNOWN; array.len()]).unwrap();
        let mut some = HeldOverTime::new(events.view(), Some(&chosen), vec![1.5_f32; 3]).unwrap();
        for _ in 0..200 {
            let t = random.random_range(-60..60 + n as i64 / 2);
            let expected: Vec<u16> =
                (0..array.len()).map(|taxel| latest(&events, taxel, t).unwrap_or(UNKNOWN)).collect();
            assert_eq!(all.at(t), expected, "at {t} us");
            let expected: Vec<f32> =
                chosen.iter().map(|&taxel| latest(&events, taxel as usize, t).map_or(1.5, f32::from)).collect();
            assert_eq!(some.at(t), expected, "at {t} us");
        }
    }
    let array = Array::new(2, 2, 1.0, "").unwrap();
    assert!(HeldOverTime::new(Events::empty(array.clone()).view(), None, vec![0_u16; 3]).is_err(), "one value missing");
}

#[test]
fn stored_states_lead_to_the_same_values_as_a_walk_from_the_beginning() {
    let mut random = StdRng::seed_from_u64(6);
    let array = Array::new(4, 4, 1.0, "").unwrap();
    let events = events(&mut random, &array, 20_000);
    let fresh = HeldOverTime::new(events.view(), None, vec![0_u16; 16]).unwrap();
    let mut used = fresh.clone();
    for _ in 0..60 {
        let t = random.random_range(-60..10_100);
        assert_eq!(used.at(t), fresh.clone().at(t), "at {t} us");
    }
}

#[test]
fn events_without_values_are_steps_up_and_down() {
    let mut random = StdRng::seed_from_u64(7);
    let array = Array::new(2, 3, 1.0, "").unwrap();
    let events = Events { intensity: None, ..events(&mut random, &array, 200) };
    let mut steps = HeldOverTime::by_steps(events.view(), None).unwrap();
    for t in -60..160 {
        let mut expected = vec![0.0; 6];
        for k in (0..events.len()).filter(|&k| events.t[k] <= t) {
            expected[array.index(events.x[k], events.y[k])] += if events.p[k] { 1.0 } else { -1.0 };
        }
        assert_eq!(steps.at(t), expected, "at {t} us");
    }
}

#[test]
fn events_of_held_values_are_repaired_and_lead_back_to_them() {
    let array = Array::new(2, 3, 1.0, "").unwrap();
    let values = [5, UNKNOWN, 0, 7, UNKNOWN, 9];
    let events = as_events(&values, 12, &array);
    assert_eq!((events.len(), events.t[3], events.repaired.clone()), (4, 12, Some(vec![true; 4])));
    let mut held = Held::unknown(6);
    held.push(events.view());
    assert_eq!(held.values(), values);
    assert_eq!(held.frame().collect::<Vec<_>>(), [5, 0, 0, 7, 0, 9]);
    held.clear();
    assert_eq!(held, Held::unknown(6));
}

#[test]
fn in_whole_ticks_above_noise_is_the_same_as_touched() {
    let mut random = StdRng::seed_from_u64(8);
    for _ in 0..10_000 {
        let (value, rest, floor): (u16, u16, u16) =
            (random.random_range(0..400), random.random_range(0..400), random.random_range(0..9));
        let above = Rest::measured(vec![rest]).above_noise(0, value, floor);
        assert_eq!(
            above > 0,
            f64::from(value) >= touched_from(rest.into(), floor.into()),
            "{value} over {rest}, {floor}"
        );
        assert!(above == 0 || above == value - rest);
        let fine = Rest::measured(vec![f64::from(rest)]).above(0, f64::from(value));
        assert_eq!(fine, (f64::from(value) - f64::from(rest)).max(0.0));
    }
    assert_eq!(Rest::measured(vec![u16::NO_REST]).above(0, 9), 0);
    assert_eq!(Rest::measured(vec![3_u16]).above(0, UNKNOWN), 0);
    assert_eq!(Rest::measured(vec![f64::NO_REST]).above(0, 1e9), 0.0);
}

#[test]
fn half_a_tick_is_half_of_a_floor_below_a_tick() {
    for (floor, from) in [(0.0, 0.5), (0.04, 0.06), (0.5, 0.75), (1.0, 1.5), (3.0, 3.5), (30.0, 30.5)] {
        assert!((touched_from(0.0, floor) - from).abs() < 1e-12, "{floor}");
    }
}

#[test]
fn an_unknown_rest_is_the_first_value_and_one_that_was_set_stays() {
    let mut rest = Rest::measured(vec![30, u16::NO_REST]);
    assert!(!rest.follow(0, 10) && rest.follow(1, 20) && !rest.follow(1, 10));
    assert_eq!(rest.values(), [30, 20]);
    assert!(rest.track(0, 31) && !rest.track(0, 31));
    rest.set(0, 45);
    assert!(!rest.track(0, 10) && rest.track(1, 19));
    assert_eq!((rest.values(), rest.above(0, 47)), (&[45, 19][..], 2));
}
