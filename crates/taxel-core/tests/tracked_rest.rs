//! The rest of a sensor whose rest was not measured.

use rand::{Rng, SeedableRng, rngs::StdRng};
use taxel_core::rest::{QUIET_US, TrackedRest, Value};

/// Samples of an 8 x 8 array every 50 ms: `value` of the sample's number and taxel.
fn sampled(rest: &mut TrackedRest, from: i64, samples: i64, mut value: impl FnMut(i64, usize) -> f32) -> Vec<f32> {
    let mut above = vec![];
    for k in from..from + samples {
        above = rest.take(k * 50_000, (0..64).map(|taxel| value(k, taxel))).to_vec();
    }
    above
}

fn unknown() -> TrackedRest {
    TrackedRest::new(8, 3.0, vec![f64::NO_REST; 64])
}

/// The 3 x 3 taxels around row 3, column 4.
fn touched(taxel: usize) -> bool {
    (2..5).contains(&(taxel / 8)) && (3..6).contains(&(taxel % 8))
}

#[test]
fn a_quiet_stretch_is_half_a_second_in_which_no_neighbours_move() {
    let mut rest = unknown();
    // Bad taxels that move alone and as a pair are no touch.
    let bad = |k: i64, taxel: usize| if matches!(taxel, 0 | 20 | 21) { (50 * (k % 2)) as f32 } else { 50.0 };
    sampled(&mut rest, 0, 10, bad);
    assert_eq!(rest.quiet(), None);
    sampled(&mut rest, 10, 1, bad);
    assert_eq!(rest.quiet(), Some((0, QUIET_US)));
    // Three that move together are one.
    let mut rest = unknown();
    sampled(&mut rest, 0, 60, |k, taxel| if (20..23).contains(&taxel) { (50 * (k % 2)) as f32 } else { 50.0 });
    assert_eq!(rest.quiet(), None);
    // A channel that moves alone is one too.
    let mut rest = TrackedRest::new(8, 3.0, vec![f64::NO_REST; 8]);
    for k in 0..60_i16 {
        rest.take(
            i64::from(k) * 50_000,
            (0..8).map(|channel| if channel == 2 { f32::from(10 * (k % 2)) } else { 0.0 }),
        );
    }
    assert_eq!(rest.quiet(), None);
}

#[test]
fn a_quiet_stretch_of_a_slow_sensor_lasts_until_its_fourth_value() {
    for (rate_hz, end) in [(1, 3_000_000), (2, 1_500_000), (4, 750_000), (5, 600_000)] {
        let mut rest = TrackedRest::new(8, 3.0, vec![f64::NO_REST; 8]);
        (0..8).for_each(|k| _ = rest.take(k * 1_000_000 / rate_hz, [50.0; 8]));
        assert_eq!(rest.quiet(), Some((0, end)), "{rate_hz} Hz");
    }
}

#[test]
fn a_noisy_array_with_nothing_on_it_rests_at_its_mean_and_not_at_its_lowest_value() {
    let mut random = StdRng::seed_from_u64(4);
    for noise in [0.0_f32, 1.2, 3.0] {
        let mut rest = unknown();
        let mut value = |_: i64, taxel: usize| {
            48.0 + taxel as f32 + noise * (0..12).map(|_| random.random_range(-0.5..0.5_f32)).sum::<f32>()
        };
        sampled(&mut rest, 0, 40, &mut value);
        assert!(rest.quiet().is_some(), "noise {noise}");
        for (taxel, found) in rest.rests().enumerate() {
            let off = found.unwrap() - 48.0 - taxel as f64;
            assert!(off.abs() <= 0.01 + 1.5 * f64::from(noise), "noise {noise}, taxel {taxel}: {off}");
        }
    }
}

#[test]
fn a_load_stays_above_the_rest_and_what_was_loaded_at_first_is_found_once_it_is_not() {
    let mut rest = unknown();
    sampled(&mut rest, 0, 20, |_, _| 50.0);
    let above = sampled(&mut rest, 20, 20, |_, taxel| if touched(taxel) { 90.0 } else { 50.0 });
    // After a second the rest has hardly moved: far values of a rest that is known are followed with an hour.
    assert!((39.9..40.0).contains(&above[28]), "{}", above[28]);
    assert_eq!(above[0], 0.0);
    // Loaded from the first value on; released for a second.
    let mut rest = unknown();
    sampled(&mut rest, 0, 30, |_, taxel| if touched(taxel) { 90.0 } else { 50.0 });
    assert_eq!((rest.rests().nth(28), rest.begins()[28]), (Some(Some(90.0)), 90.0));
    sampled(&mut rest, 30, 30, |_, _| 50.0);
    assert!((rest.rests().nth(28).unwrap().unwrap() - 50.0).abs() < 0.01);
    assert_eq!(rest.begins()[28], 50.0);
}

#[test]
fn a_taxel_without_a_value_has_no_rest_and_its_first_value_is_one() {
    let mut rest = unknown();
    let above = sampled(&mut rest, 0, 20, |_, taxel| if touched(taxel) { f32::NAN } else { 50.0 });
    assert_eq!((rest.rests().nth(28), rest.begins()[28], above[28]), (Some(None), f64::NO_REST, 0.0));
    let above = sampled(&mut rest, 20, 1, |_, taxel| if touched(taxel) { 54.0 } else { 50.0 });
    assert_eq!((rest.rests().nth(28), above[28]), (Some(Some(54.0)), 0.0));
    let above = sampled(&mut rest, 21, 2, |_, taxel| if touched(taxel) { 94.0 } else { 50.0 });
    assert!((39.0..=40.0).contains(&above[28]), "{}", above[28]);
    // A value that is missing for a while is none of a load.
    let above = sampled(&mut rest, 23, 2, |_, _| f32::NAN)[28];
    assert!(above.abs() < 0.05, "{above}");
}

#[test]
fn a_clock_that_steps_back_begins_a_new_stretch() {
    let mut rest = unknown();
    sampled(&mut rest, 100, 5, |_, _| 50.0);
    sampled(&mut rest, 0, 10, |_, _| 50.0);
    assert_eq!(rest.quiet(), None);
    sampled(&mut rest, 10, 1, |_, _| 50.0);
    assert_eq!(rest.quiet(), Some((0, QUIET_US)));
}
