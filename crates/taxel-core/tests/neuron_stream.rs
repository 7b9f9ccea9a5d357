//! Tests that a neuron fed piece by piece fires at bit-identical times as one fed with whole trains, wherever the input
//! is cut.

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use taxel_core::neuron::{AfterSpike, FirstThreshold, Neuron, OutputSpike, Time};
use taxel_core::{Spike, SpikeKind, SpikeTrains, Stop};

fn random_trains(random: &mut StdRng, trains: usize, whole_ms: bool) -> SpikeTrains {
    let spikes: Vec<Spike> = (0..trains * 4)
        .map(|_| {
            let t: f64 = random.random_range(0.0..200.0);
            let t = if whole_ms { t.round() } else { t };
            Spike { t, train: random.random_range(0..trains as u32), value: 1.0 }
        })
        .collect();
    SpikeTrains::from_spikes(&spikes, trains, SpikeKind::Unsigned, 0.0, 220.0).unwrap()
}

fn neurons() -> impl Iterator<Item = Neuron> {
    let after = [AfterSpike::Keep, AfterSpike::Ignore, AfterSpike::Reset];
    let first = [FirstThreshold::Base, FirstThreshold::Printed];
    let grid = |step_ms, rearm| (Time::Grid, step_ms, rearm);
    let clocks = [
        (Time::Continuous, 1.0, None),
        grid(1.0, None),
        grid(0.192, None),
        grid(1.0, Some(1.0)),
        grid(0.192, Some(0.4)),
    ];
    after.into_iter().flat_map(move |after_spike| {
        first.into_iter().flat_map(move |first_threshold| {
            clocks.into_iter().map(move |(time, step_ms, rearm)| Neuron {
                after_spike,
                first_threshold,
                time,
                step_ms,
                rearm,
                tau: 8.0,
                ..Neuron::default()
            })
        })
    })
}

fn in_pieces(neuron: &Neuron, weights: &[f64], trains: &SpikeTrains, cuts: &[f64]) -> Vec<OutputSpike> {
    let mut stream = neuron.stream(weights, 1.0, trains.start).unwrap();
    let (mut out, mut cut) = (Vec::new(), 0);
    for spike in trains.by_time(Stop::never()).unwrap() {
        while cut < cuts.len() && cuts[cut] <= spike.t {
            stream.advance(cuts[cut], &mut out);
            cut += 1;
        }
        stream.push(spike, &mut out).unwrap();
    }
    for &t in &cuts[cut..] {
        stream.advance(t, &mut out);
    }
    stream.advance(trains.stop, &mut out);
    out
}

#[test]
fn a_stream_cut_anywhere_fires_as_the_whole() {
    let mut random = StdRng::seed_from_u64(7);
    let mut fired = 0;
    for round in 0..60 {
        let trains = random_trains(&mut random, 30, round % 2 == 0);
        let weights: Vec<f64> = (0..30).map(|_| random.random_range(-0.2..0.5)).collect();
        let mut cuts: Vec<f64> = (0..random.random_range(0..200)).map(|_| random.random_range(0.0..220.0)).collect();
        // Cuts at input spikes and at grid points are the most likely to cause a difference.
        cuts.extend(trains.times.iter().step_by(3));
        cuts.extend((0..40).map(|k| f64::from(k) * 5.0));
        cuts.sort_by(f64::total_cmp);
        for neuron in neurons() {
            let whole = neuron.run(&weights, &trains, 1.0, Stop::never()).unwrap();
            assert_eq!(in_pieces(&neuron, &weights, &trains, &cuts), whole, "{neuron:?}");
            fired += whole.len();
        }
    }
    assert!(fired > 10_000, "only {fired} spikes were compared");
}

#[test]
fn trains_pushed_in_another_order_at_equal_times_fire_at_the_same_times() {
    let neuron = Neuron::default();
    let spikes = [0, 1, 2].map(|train| Spike { t: 1.0, train, value: 1.0 });
    let weights = [0.5, 0.4, 0.3];
    let fire = |order: [usize; 3]| {
        let (mut stream, mut out) = (neuron.stream(&weights, 1.0, 0.0).unwrap(), Vec::new());
        for k in order {
            stream.push(spikes[k], &mut out).unwrap();
        }
        stream.advance(50.0, &mut out);
        out.iter().map(|s| s.t).collect::<Vec<_>>()
    };
    let (one, other) = (fire([0, 1, 2]), fire([2, 0, 1]));
    assert_eq!(one.len(), other.len());
    assert!(one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-12));
}

#[test]
fn an_input_from_the_past_is_an_error_and_changes_nothing() {
    let neuron = Neuron::default();
    let (mut stream, mut out) = (neuron.stream(&[1.0], 1.0, 0.0).unwrap(), Vec::new());
    let at = |t, train| Spike { t, train, value: 1.0 };
    stream.push(at(5.0, 0), &mut out).unwrap();
    let before = stream.potential();
    assert!(stream.push(at(4.0, 0), &mut out).is_err());
    assert!(stream.push(at(f64::NAN, 0), &mut out).is_err());
    assert!(stream.push(at(6.0, 1), &mut out).is_err());
    assert_eq!(stream.potential().to_bits(), before.to_bits());
}

#[test]
fn a_factor_on_the_threshold_moves_the_crossing_to_where_the_potential_has_that_value() {
    let neuron = Neuron { tau: 10.0, ..Neuron::default() };
    let trains =
        SpikeTrains::from_spikes(&[Spike { t: 0.0, train: 0, value: 1.0 }], 1, SpikeKind::Unsigned, 0.0, 40.0).unwrap();
    for factor in [0.5, 0.9, 1.0] {
        let first = neuron.run(&[1.0], &trains, factor, Stop::never()).unwrap()[0];
        let reached = neuron.potential(&[1.0], &trains, &[first.t], &[], Stop::never()).unwrap()[0];
        assert!((reached - 0.3 * factor).abs() < 1e-15);
        let x = first.t / 10.0;
        assert!((first.slope - (1.0 - x) * (-x).exp() / 10.0).abs() < 1e-14);
    }
}

#[test]
fn a_spikes_slope_is_that_of_the_potential_up_to_it() {
    let mut random = StdRng::seed_from_u64(9);
    let mut checked = 0;
    for round in 0..40 {
        let trains = random_trains(&mut random, 30, round % 2 == 0);
        let weights: Vec<f64> = (0..30).map(|_| random.random_range(-0.2..0.5)).collect();
        for neuron in neurons() {
            let spikes = neuron.run(&weights, &trains, 1.0, Stop::never()).unwrap();
            let apart = if neuron.time == Time::Grid { neuron.step_ms } else { 1e-6 };
            for (k, spike) in spikes.iter().enumerate() {
                // In the refractory time the potential is 0 by 6.7, while the slope is that of the sum of inputs.
                let free = k == 0 || spike.t - apart > spikes[k - 1].t + neuron.refractory + 1e-9;
                if !free || spike.t - apart < trains.start {
                    continue;
                }
                let times = [spike.t - apart, spike.t];
                let fired: Vec<f64> = spikes[..k].iter().map(|spike| spike.t).collect();
                let at = neuron.potential(&weights, &trains, &times, &fired, Stop::never()).unwrap();
                let slope = (at[1] - at[0]) / apart;
                let within = if neuron.time == Time::Grid { 1e-9 } else { 1e-4 };
                assert!((slope - spike.slope).abs() <= within * slope.abs().max(1.0), "{slope} {spike:?} {neuron:?}");
                checked += 1;
            }
        }
    }
    assert!(checked > 500, "{checked}");
}
