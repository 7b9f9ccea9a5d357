//! Tests of a rule's parts and its file; `tests/detect/test_plain_rule.py` compares its detections with a plain loop.

use super::*;
use crate::Error;
use crate::detect::{Detector, Readout};

fn rule() -> PlainRule {
    PlainRule {
        quantity: Quantity::Load,
        level: 1.0 / 3.0,
        release: 0.1 + 0.2,
        quiet_ms: 20.0,
        date: Some(0.7),
        constant_ms: -0.1,
        touched_ms: Some(150.5),
        levels: vec![],
        age_ms: None,
        labels: [Some("contact".to_owned()), None],
        noise_floor: 0.0,
        unit: Some("kPa".to_owned()),
        tare: None,
        rest: None,
        training: None,
    }
}

#[test]
fn a_file_gives_every_number_back_and_names_its_kind() {
    let rule = rule();
    let text = rule.to_json();
    assert!(text.starts_with("{\n  \"format\": \"taxel plain rule\",\n  \"version\": 2,"));
    assert_eq!(PlainRule::from_json(&text).unwrap(), rule);
    assert_eq!(Detector::from_json(&text).unwrap(), rule.into());
    assert!(matches!(Readout::from_json(&text), Err(Error::Format(_))));
    assert!(matches!(Detector::from_json(&text.replace("plain rule", "song")), Err(Error::Format(_))));
}

/// Makes one part of a rule invalid.
type Spoil = fn(&mut PlainRule);

#[test]
fn parts_that_make_no_sense_are_refused_by_name() {
    let cases: [(Spoil, &str); 14] = [
        (|r| r.level = 0.0, "level is 0"),
        (|r| r.level = f64::NAN, "level is NaN"),
        (|r| r.release = 0.0, "release is 0"),
        (|r| r.release = 1.5, "release is 1.5"),
        (|r| r.quiet_ms = -1.0, "quiet_ms is -1"),
        (|r| r.constant_ms = 1e6, "constant_ms is 1000000"),
        (|r| r.date = Some(0.2), "date is 0.2"),
        (|r| r.touched_ms = Some(-1.0), "touched_ms is -1"),
        (|r| r.age_ms = Some(Age::Ms(-1.0)), "age_ms is -1"),
        (
            |r| (r.age_ms, r.touched_ms) = (Some(Age::Ms(1.0)), None),
            "age_ms is given with a release below 1, a quiet time or a date",
        ),
        (|r| r.noise_floor = f64::INFINITY, "noise_floor is inf"),
        (|r| r.labels = [None, None], "labels are both left out"),
        (|r| r.labels[1] = r.labels[0].clone(), "labels are both contact"),
        (|r| r.labels[0] = Some(" ".to_owned()), "labels: a label is empty"),
    ];
    for (spoil, expected) in cases {
        let mut spoilt = rule();
        spoil(&mut spoilt);
        let text = spoilt.check().unwrap_err().to_string();
        assert!(text.starts_with(expected), "{text}");
        if !text.contains("NaN") && !text.contains("inf") {
            let of_file = PlainRule::from_json(&spoilt.to_json()).unwrap_err().to_string();
            assert_eq!(of_file, format!("plain rule: {text}"));
        }
    }
}
