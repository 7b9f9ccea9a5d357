//! Tests of readout files, checks, and zeroed taxels.

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

use super::*;
use crate::detect::Detector;
use crate::detect::detector::SILENCE_US;
use crate::encode::{ContactArea, Zeroing};
use crate::neuron::Neuron;
use crate::{Error, Events, Intensities, Stop};

fn readout() -> Readout {
    let neuron = Neuron { tau: 0.5, time: Time::Grid, step_ms: 0.192, ..Neuron::default() };
    let cell = |delay_ms, first: f64| TrainedNeuron {
        neuron: neuron.clone(),
        delay_ms,
        inputs: vec![],
        weights: (0..10).map(|k| first / f64::from(k + 3)).collect(),
    };
    Readout {
        encoder: Encoder::ContactArea(ContactArea::default()),
        array: Some(Array::thesis()),
        unit: Some("ticks".to_owned()),
        time: Time::Grid,
        after_spike: AfterSpike::Keep,
        run_threshold: 0.9,
        pads: false,
        delays_ms: vec![0.0],
        neurons: [("contact".to_owned(), cell(0.2, 3.0)), ("lift".to_owned(), cell(0.5, -0.1))].into(),
        rules: BTreeMap::new(),
        by_rule: BTreeSet::new(),
        rest: None,
        training: None,
    }
}

#[test]
fn a_file_gives_every_number_back() {
    let mut readout = readout();
    let weights = &mut readout.neurons.get_mut("lift").unwrap().weights;
    // Numbers that an inexact decimal reader changes in the last bit.
    weights[..6].copy_from_slice(&[
        0.1 + 0.2,
        1.0 / 3.0,
        5e-324,
        -2.2250738585072014e-308,
        -9.999_999_999_999_999e99,
        1e23,
    ]);
    let again = Readout::from_json(&readout.to_json()).unwrap();
    assert_eq!(again, readout);
    for (a, b) in again.neurons["lift"].weights.iter().zip(&readout.neurons["lift"].weights) {
        assert_eq!(a.to_bits(), b.to_bits());
    }
    assert!(readout.to_json().starts_with("{\n  \"format\": \"taxel readout\",\n  \"version\": 2,"));
}

#[test]
fn files_that_are_no_readout_are_refused_by_name() {
    let good = readout().to_json();
    let cases = [
        "",
        "[]",
        "{}",
        &good.replace("taxel readout", "other"),
        &good.replace("\"version\": 2,", ""),
        &good.replace("\"version\": 2,", "\"version\": 3,"),
        &good.replace("\"run_threshold\"", "\"threshold\""),
        &good.replace("\"neurons\"", "\"neuron\""),
        &good.replace("contact_area", "contact_are"),
        &good.replace("\"noise_floor\": 3.0", "\"noise_floor\": -3.0"),
        &good.replace("\"run_threshold\": 0.9", "\"run_threshold\": 0"),
        &good.replacen("\"time\": \"grid\"", "\"time\": \"continuous\"", 1),
        &good.replacen("\"after_spike\": \"keep\"", "\"after_spike\": \"reset\"", 1),
        &good.replacen("\"delay_ms\": 0.2", "\"delay_ms\": -0.2", 1),
        &good.replacen("\"tau\": 0.5", "\"tau\": 0", 1),
        &good.replacen("1.0,", "", 1),
    ];
    for text in cases {
        let error = Readout::from_json(text).unwrap_err();
        assert!(matches!(error, Error::Format(_)), "{text}: {error}");
        assert!(!error.to_string().contains('\n'));
    }
}

#[test]
fn a_readout_refuses_neurons_that_were_trained_otherwise() {
    let mut other = readout();
    other.neurons.get_mut("lift").unwrap().neuron.after_spike = AfterSpike::Reset;
    assert!(other.check().is_err());
    let mut other = readout();
    other.neurons.get_mut("lift").unwrap().neuron.time = Time::Continuous;
    assert!(other.check().is_err());
    let mut other = readout();
    other.neurons.clear();
    assert!(other.check().is_err());
}

#[test]
fn another_array_and_a_missing_tare_are_refused() {
    let array = Array::new(63, 64, 2.67, "other").unwrap();
    assert!(readout().stream(&array, 192.0, None).is_err());
    let Err(Error::Problem(reason)) = readout().stream(&Array::thesis(), 192.0, None) else {
        panic!("a tare is needed")
    };
    assert_eq!((reason.argument.as_deref(), reason.hint), (Some("tare"), Some(Hint::Give)));
    // A readout without an array of its own accepts every array with the same number of trains.
    let tare = Tare {
        array: array.clone(),
        rest: vec![Some(0.0); 63 * 64],
        noise: vec![None; 63 * 64],
        start_us: 0,
        stop_us: 1,
        note: String::new(),
    };
    assert!(Readout { array: None, ..readout() }.stream(&array, 192.0, Some(&tare)).is_ok());
}

/// Presses on 6 x 6 taxels with time stamps of the wire, some of which are shared by many events.
fn presses(random: &mut StdRng, array: &Array) -> Events {
    let (mut t, mut events, mut intensity) = (0, Events::empty(array.clone()), Intensities::default());
    for _ in 0..600 {
        t += [0, 0, 100, 100, 700, 40_000][random.random_range(0..6)];
        events.t.push(t);
        events.x.push(random.random_range(0..6));
        events.y.push(random.random_range(0..6));
        events.p.push(true);
        intensity.ticks.push(random.random_range(130..170));
        intensity.present.push(random.random_range(0..10) > 0);
    }
    Events { intensity: Some(intensity), ..events }
}

/// The same events with the taxel's values lower by `rise` after `z.t`, and with an event that reports the change.
fn lowered(mut events: Events, z: &Zeroing, rise: u16) -> Events {
    let at = events.t.partition_point(|&t| t <= z.t);
    let mut intensity = events.intensity.take().unwrap();
    let its = |k: &usize| (events.x[*k], events.y[*k]) == (z.x, z.y) && intensity.present[*k];
    let held = (0..at).rev().find(its).map(|k| intensity.ticks[k]);
    for k in (at..events.len()).filter(its).collect::<Vec<_>>() {
        intensity.ticks[k] -= rise;
    }
    if let Some(held) = held {
        events.t.insert(at, z.t);
        events.x.insert(at, z.x);
        events.y.insert(at, z.y);
        events.p.insert(at, false);
        intensity.ticks.insert(at, held - rise);
        intensity.present.insert(at, true);
    }
    Events { intensity: Some(intensity), ..events }
}

#[test]
fn a_zeroed_taxel_reads_as_one_whose_values_fell_by_what_its_rest_rose() {
    let array = Array::new(6, 6, 2.0, "small").unwrap();
    let rest = vec![Some(130.0); 36];
    let tare =
        Tare { array: array.clone(), rest, noise: vec![None; 36], start_us: -1, stop_us: 0, note: String::new() };
    let (mut count, mut changed) = (0, 0);
    for (seed, name) in (0..40).zip(["contact_area", "moments"].into_iter().cycle()) {
        let mut random = StdRng::seed_from_u64(seed);
        let encoder = Encoder::from_json(&format!(r#"{{"name": "{name}"}}"#)).unwrap();
        let weights = (0..encoder.trains(&array)).map(|_| random.random_range(-0.2..1.0)).collect();
        let neuron = Neuron { tau: 0.5, refractory: 0.5, theta_0: 0.3, ..Neuron::default() };
        let cell = TrainedNeuron { neuron: neuron.clone(), delay_ms: 0.0, inputs: vec![], weights };
        let neurons = [("touch".to_owned(), cell)].into();
        let readout =
            Readout { encoder, array: None, time: neuron.time, after_spike: neuron.after_spike, neurons, ..readout() };
        let events = presses(&mut random, &array);
        let (mut zeroings, mut low): (Vec<Zeroing>, _) = (vec![], events.clone());
        while zeroings.len() < 4 {
            let (x, y) = (random.random_range(0..6), random.random_range(0..6));
            if zeroings.iter().all(|z| (z.x, z.y) != (x, y)) {
                let (t, rise) = (
                    events.t[random.random_range(0..500)] + random.random_range(0..2) * 50,
                    random.random_range(1..30),
                );
                let z = Zeroing { t, x, y, rest: 130.0 + f64::from(rise), before: Some(130.0) };
                low = lowered(low, &z, rise);
                zeroings.push(z);
            }
        }
        let run = |events: &Events, zeroings: &[Zeroing]| {
            Detector::from(readout.clone())
                .run_events(events.view(), 192.0, Some(&tare), zeroings, None, Stop::never())
                .unwrap()
        };
        let detections = run(&events, &zeroings);
        assert_eq!(detections, run(&low, &[]), "seed {seed}, {name}");
        (count, changed) = (count + detections.len(), changed + usize::from(detections != run(&events, &[])));

        // Live: pushed in pieces, with time advanced in between and each zeroing set before any later input.
        let mut live = readout.stream(&array, 192.0, Some(&tare)).unwrap();
        let (mut pieces, mut from) = (vec![], 0);
        while from < events.len() {
            let to = (from + random.random_range(1..40)).min(events.len());
            let next = events.t.get(to).copied().unwrap_or(i64::MAX);
            let (now, later): (Vec<_>, Vec<_>) = zeroings.iter().partition(|z| z.t < next);
            now.iter().for_each(|z| live.zero(z).unwrap());
            zeroings = later;
            live.push_events(events.view().piece(from..to), &mut pieces).unwrap();
            live.advance(random.random_range(events.t[to - 1]..=next.min(events.t[to - 1] + 5000)), &mut pieces)
                .unwrap();
            from = to;
        }
        live.advance(events.t[599] + SILENCE_US, &mut pieces).unwrap();
        assert_eq!(pieces, detections, "seed {seed}, {name}");
    }
    assert!(count > 400, "there must be detections to compare: {count}");
    assert!(changed > 20, "a zeroing changes the detections: {changed} of 40");
}

#[test]
fn only_a_taxel_that_exists_is_zeroed() {
    let array = Array { exists: Some(vec![true, true, true, false]), ..Array::new(2, 2, 1.0, "three").unwrap() };
    let z = Zeroing { t: 0, x: 0, y: 0, rest: 1.0, before: None };
    assert!(z.check(&array).is_ok());
    for wrong in [Zeroing { x: 1, y: 1, ..z }, Zeroing { x: 2, ..z }, Zeroing { rest: f64::NAN, ..z }] {
        assert!(wrong.check(&array).is_err());
    }
}
