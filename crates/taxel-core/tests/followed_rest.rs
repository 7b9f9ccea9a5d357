//! The rest of frames that follows: closed forms of drift, steps, presses and objects, and a plain rule on such frames.

use taxel_core::detect::{Detection, Detector, PlainRule};
use taxel_core::encode::Tare;
use taxel_core::rest::{FollowedRest, Following, LeftFloor, NEAR_S};
use taxel_core::{Array, FramesView, Stop};

const STEP_US: i64 = 10_000;
const FLOOR: f64 = 10.0;
const FOLLOWS: Following = Following { noise_floor: FLOOR, absorb_s: 60.0 };

fn array() -> Array {
    Array::new(2, 2, 1.0, "four").unwrap()
}

/// A rest of 100 that was measured.
fn rest(following: Following) -> FollowedRest {
    FollowedRest::new(following, &array(), &[100.0, 100.0, 100.0, f64::INFINITY], &[1.0, 0.0, 0.0, 0.0])
}

/// What taxel 0 reads above its rest, frame by frame, where it reads so much above 100.
fn followed(rest: &mut FollowedRest, from_s: f64, until_s: f64, value: impl Fn(f64) -> f64) -> Vec<f64> {
    let frames = |s: f64| (s * 1e6) as i64 / STEP_US;
    (frames(from_s)..frames(until_s))
        .map(|k| {
            let value = (100.0 + value(k as f64 / 100.0)) as f32;
            f64::from(rest.take(k * STEP_US, &[value, 100.0, 100.0, value])[0]) - 100.0
        })
        .collect()
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-4
}

#[test]
fn a_drift_is_followed_with_a_lag_of_a_time_constant() {
    let read = followed(&mut rest(FOLLOWS), 0.0, 60.0, |s| -2.0 * s);
    let part = 1.0 - (-0.01 / NEAR_S).exp();
    // Each frame the rest moves by what the value drifts.
    assert!((read.last().unwrap() + 2.0 * 0.01 / part).abs() < 1e-3, "{:?}", read.last());
    let begin = -2.0 * 0.01 / part * (1.0 - (-0.5 / NEAR_S).exp());
    assert!(near(read[50], begin), "{} {begin}", read[50]);
}

#[test]
fn a_step_below_the_floor_is_followed_from_the_second_frame_on_within_half_a_second() {
    let mut rest = rest(FOLLOWS);
    let read = followed(&mut rest, 0.0, 2.0, |s| if s < 1.0 { 0.0 } else { -80.0 });
    assert_eq!(read[100..102], [-80.0, -80.0]);
    for k in [102, 110, 130, 156] {
        let since = f64::from(k - 101) / 100.0;
        assert!(near(read[k as usize], -80.0 * (-since * 6.0_f64).exp()), "{k}: {}", read[k as usize]);
    }
    // One frame is chance.
    let read = followed(&mut rest, 2.0, 3.0, |s| if (s - 2.5).abs() < 1e-3 { -300.0 } else { -80.0 });
    assert!(read[51..].iter().all(|value| value.abs() < FLOOR), "{:?}", &read[48..56]);
}

#[test]
fn a_press_of_half_a_minute_stays_whole() {
    let read = followed(&mut rest(FOLLOWS), 0.0, 40.0, |s| if (5.0..35.0).contains(&s) { 50.0 } else { 0.0 });
    assert!(read[500..3500].iter().all(|&value| value == 50.0));
    assert!(read[3500..].iter().all(|&value| value == 0.0));
}

#[test]
fn an_object_of_ten_minutes_is_rest_after_one_and_gone_within_half_a_second() {
    let on = |s: f64| !(600.0..605.0).contains(&s);
    let mut rest = rest(FOLLOWS);
    let read = followed(&mut rest, 0.0, 620.0, |s| if on(s) { 50.0 } else { 0.0 });
    assert!(read[..6000].iter().all(|&value| value == 50.0));
    assert!(read[6050].abs() < FLOOR, "{}", read[6050]);
    assert!(read[30_000..60_000].iter().all(|value| value.abs() < 1e-3));
    assert!(read[60_060].abs() < FLOOR, "{}", read[60_060]);
    // Put there again it is a touch as large as before.
    assert!(read[60_500..].iter().all(|&value| (value - 50.0).abs() < FLOOR / 10.0), "{}", read[60_500]);
}

#[test]
fn a_value_near_the_rest_ends_the_time_above_the_floor_and_one_at_the_floor_does_not() {
    // A frame of a hundred is within the floor, which is no time above it.
    let flickers = |s: f64| if (s * 100.0).round() % 100.0 == 0.0 { 8.0 } else { 50.0 };
    let read = followed(&mut rest(FOLLOWS), 0.0, 62.0, flickers);
    assert!(read[6050] > 45.0 && read[6190].abs() < FLOOR, "{} {}", read[6050], read[6190]);

    let read = followed(&mut rest(FOLLOWS), 0.0, 110.0, |s| if (s - 55.0).abs() < 1e-3 { 0.0 } else { 50.0 });
    assert!(read.iter().filter(|&&value| value != 0.0).all(|&value| value == 50.0));
}

#[test]
fn what_stays_is_watched_and_read_as_it_is() {
    let mut stays = rest(Following { absorb_s: 0.0, ..FOLLOWS });
    let both = |k: i64| 100.0 - k as f32 * 0.01;
    for k in 0..3000 {
        assert_eq!(stays.take(k * STEP_US, &[both(k); 4]), [both(k); 4]);
    }
    assert_eq!(stays.moved(0), 0.0);
    // Two taxels of three whose rest is known lag behind by a second, and leave a floor of 10.5; one alone is no touch.
    let left = stays.left().unwrap();
    assert!((11_400_000..11_600_000).contains(&left.since_us), "{left:?}");
    assert_eq!(left.taxels, 3);
    let mut alone = rest(FOLLOWS);
    followed(&mut alone, 0.0, 60.0, |s| -2.0 * s);
    assert_eq!((alone.left(), alone.moved(0) < -100.0), (None, true));
}

#[test]
fn taxels_without_a_rest_or_a_value_stay_as_they_are() {
    let mut rest = rest(FOLLOWS);
    for k in 0..6000 {
        // Taxel 3 has no rest, and taxel 0 no value before the last 10 s.
        let first = if k < 5000 { 0.0 } else { 103.0 };
        let frame = [first, 100.0, 100.0, 40.0];
        let read = rest.take(k * STEP_US, &frame);
        assert_eq!(read[3], 40.0);
        assert!(k >= 5000 || read[0] == 100.0);
    }
    assert!(near(rest.moved(0), 3.0 * (1.0 - (-9.99 / NEAR_S).exp())), "{}", rest.moved(0));
    assert_eq!(rest.take(60_000_000, &[1.0]), [1.0]);
    rest.set(3, 30.0);
    assert_eq!(rest.take(61_000_000, &[103.0, 100.0, 100.0, 41.0])[3], 41.0);
}

#[test]
fn whoever_goes_on_from_a_copy_reads_the_same() {
    let value = |s: f64| 8.0 * (s * 7.0).sin() - s + if s % 20.0 < 2.0 { 90.0 } else { 0.0 };
    let whole = followed(&mut rest(FOLLOWS), 0.0, 130.0, value);
    let mut first = rest(FOLLOWS);
    let mut pieces = followed(&mut first, 0.0, 61.0, value);
    pieces.extend(followed(&mut first.clone(), 61.0, 130.0, value));
    assert_eq!(pieces, whole);
}

/// What a plain rule detects of presses of 2 s each 10 s, on a sensor that drifts by 20 a minute, and when it left its floor.
fn presses(rest: Option<Following>) -> (Vec<Detection>, Option<LeftFloor>) {
    let text = format!(
        r#"{{"format": "taxel plain rule", "version": 2, "quantity": "load", "level": 100.0, "release": 0.5,
            "quiet_ms": 0.0, "constant_ms": 0.0, "age_ms": null, "labels": ["contact", "lift"],
            "noise_floor": {FLOOR}, "rest": {}}}"#,
        serde_json::to_string(&rest).unwrap()
    );
    let rule = PlainRule::from_json(&text).unwrap();
    assert_eq!(rule.rest, rest);
    let t: Vec<i64> = (0..30_000).map(|k| k * STEP_US).collect();
    let values: Vec<f32> =
        (0..30_000).flat_map(|k| [100.0 + k as f32 / 300.0 + if k % 1000 >= 800 { 60.0 } else { 0.0 }; 4]).collect();
    let array = array();
    let frames = FramesView { array: &array, t: &t, values: &values };
    let still = FramesView { t: &t[..2], values: &[100.0; 8], ..frames };
    let tare = Tare::of_frames(still, None, None, "").unwrap();
    Detector::from(rule).run_frames(frames, None, Some(&tare), &[], None, Stop::never()).unwrap()
}

#[test]
fn a_rule_finds_presses_on_a_sensor_that_drifts_where_its_rest_follows() {
    let (found, left) = presses(Some(FOLLOWS));
    let begins: Vec<i64> = found.iter().filter(|found| found.label == "contact").map(|found| found.t).collect();
    assert_eq!(begins, (0..30).map(|k| k * 10_000_000 + 8_000_000).collect::<Vec<_>>());
    let (missed, watched) = presses(Some(Following { absorb_s: 0.0, ..FOLLOWS }));
    assert!(missed.len() < 20, "{}", missed.len());
    let (found, unwatched) = presses(None);
    assert_eq!((found.len(), unwatched), (missed.len(), None));
    // Both say so, those that stay later: presses that last are no rest.
    assert!(left.unwrap().since_us >= 30_000_000 && watched.unwrap().taxels == 4);
}

#[test]
fn numbers_out_of_range_are_refused() {
    for (following, argument) in [
        (Following { noise_floor: -1.0, ..FOLLOWS }, "noise_floor"),
        (Following { noise_floor: f64::NAN, ..FOLLOWS }, "noise_floor"),
        (Following { absorb_s: 0.5, ..FOLLOWS }, "absorb_s"),
        (Following { absorb_s: 2000.0, ..FOLLOWS }, "absorb_s"),
    ] {
        assert_eq!(following.check().unwrap_err().reason().unwrap().argument.as_deref(), Some(argument));
    }
}
