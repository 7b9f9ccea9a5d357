//! Compares a stream with a single neuron, and with itself when its input is divided elsewhere.

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

use super::*;
use crate::detect::TrainedNeuron;
use crate::neuron::{AfterSpike, Neuron, Time};
use crate::{Events, Intensities, SpikeKind};

/// An encoder that turns each event into a signed spike of its taxel's train at its stamp, and a frame into a spike
/// of each loaded taxel.
#[derive(Clone)]
struct Plain {
    latency_ms: f64,
}

impl Stream for Plain {
    fn fork(&self) -> Box<dyn Stream> {
        Box::new(self.clone())
    }
    fn late(&self) -> u64 {
        0
    }
    fn trains(&self) -> usize {
        4
    }
    fn kind(&self) -> SpikeKind {
        SpikeKind::Signed
    }
    fn latency_ms(&self) -> f64 {
        self.latency_ms
    }
    fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()> {
        for k in 0..events.len() {
            let train = events.array.index(events.x[k], events.y[k]) as u32;
            out.push(Spike { t: ms(events.t[k]), train, value: if events.p[k] { 1.0 } else { -1.0 } });
        }
        Ok(())
    }
    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()> {
        let loaded = values.iter().enumerate().filter(|(_, v)| **v > 0.0);
        out.extend(loaded.map(|(k, _)| Spike { t: ms(t), train: k as u32, value: 1.0 }));
        Ok(())
    }
    fn advance(&mut self, _t: i64, _out: &mut Vec<Spike>) {}
    fn finish(&mut self, _out: &mut Vec<Spike>) -> Option<f64> {
        None
    }
}

fn array() -> Array {
    Array::new(2, 2, 1.0, "small").unwrap()
}

fn stream(neuron: &Neuron, latency_ms: f64, period_us: f64) -> ReadoutStream {
    let toward_on = vec![0.9, 0.5, 0.0, 0.2, -0.6, 0.0, 0.1, -0.3];
    let off = vec![-0.4, 0.0, -0.2, 0.0, 0.8, 0.6, 0.4, 0.3];
    let neurons = [("contact", toward_on, 0.2), ("lift", off, 0.5)].into_iter().map(|(label, weights, delay_ms)| {
        let cell = TrainedNeuron { neuron: neuron.clone(), inputs: vec![], weights, delay_ms };
        NamedNeuron::new(label, &cell, 0.9, latency_ms, ReceivedTrains::new(None, 1))
    });
    let neurons = DelayedNeurons::new(neurons.collect(), vec![0.0]);
    let way = Way::of_neurons(Box::new(Plain { latency_ms }), neurons);
    ReadoutStream::new(vec![way], array(), FrameClock::new(period_us).unwrap(), None)
}

/// Events with the stamps of 192 us frames; some frames have many events, some pauses are long.
fn events(seed: u64, n: usize) -> Events {
    let mut random = StdRng::seed_from_u64(seed);
    let mut events = Events::empty(array());
    events.intensity = Some(Intensities::default());
    let mut frame = random.random_range(0..1000_i64);
    for _ in 0..n {
        frame += [0, 0, 0, 1, 2, 30][random.random_range(0..6)];
        events.t.push(192 * frame / 100 * 100);
        events.x.push(random.random_range(0..2));
        events.y.push(random.random_range(0..2));
        events.p.push(random.random());
        let intensity = events.intensity.as_mut().unwrap();
        intensity.ticks.push(5);
        intensity.present.push(true);
    }
    events
}

fn neurons() -> Vec<Neuron> {
    let mut all = Vec::new();
    for time in [Time::Continuous, Time::Grid] {
        for after_spike in [AfterSpike::Keep, AfterSpike::Ignore, AfterSpike::Reset] {
            all.push(Neuron { tau: 2.0, refractory: 4.0, time, after_spike, step_ms: 0.192, ..Neuron::default() });
        }
    }
    all
}

fn run(mut stream: ReadoutStream, events: &Events, end: i64) -> Vec<Detection> {
    let mut found = stream.push_recording(events.view(), Stop::never()).unwrap();
    stream.advance(end, &mut found).unwrap();
    found
}

#[test]
fn pieces_and_moves_of_time_change_nothing() {
    for (seed, neuron) in neurons().into_iter().cycle().take(60).enumerate() {
        let events = events(seed as u64, 400);
        let end = events.t[399] + 100_000;
        let whole = run(stream(&neuron, 0.0, 192.0), &events, end);
        assert!(whole.len() > 10, "something must be detected, to compare");

        let mut random = StdRng::seed_from_u64(1000 + seed as u64);
        let (mut pieces, mut from) = (Vec::new(), 0);
        let mut live = stream(&neuron, 0.0, 192.0);
        if random.random() {
            live.advance(events.t[0] - 500, &mut pieces).unwrap();
        }
        while from < 400 {
            let to = (from + random.random_range(0..40)).min(400);
            live.push_events(events.view().piece(from..to), &mut pieces).unwrap();
            from = to;
            // Time may be advanced up to the next event, but not beyond its time.
            let last = live.now().unwrap_or(events.t[0]);
            let next = events.t.get(to).copied().unwrap_or(end);
            for _ in 0..random.random_range(0..3) {
                live.advance(random.random_range(last..=next), &mut pieces).unwrap();
            }
        }
        live.advance(end, &mut pieces).unwrap();
        assert_eq!(pieces, whole, "seed {seed}");
        assert_eq!(live.late(), 0);
    }
}

#[test]
fn known_is_the_end_of_a_frame_that_the_crossing_lies_in() {
    for (seed, neuron) in neurons().iter().enumerate() {
        let events = events(seed as u64, 2000);
        let end = events.t[1999] + 100_000;
        let found = run(stream(neuron, 1.25, 192.0), &events, end);
        for d in found {
            let offset_us = if d.label == "contact" { 1450 } else { 1750 };
            let crossing = d.t + offset_us;
            assert_eq!(d.known % 192, 0);
            assert!(crossing <= d.known && d.known <= crossing + 292, "{d:?}");
        }
    }
}

#[test]
fn time_and_latency_are_taken_off_the_crossing_but_not_off_known() {
    let neuron = Neuron { tau: 2.0, ..Neuron::default() };
    let events = events(5, 300);
    let end = events.t[299] + 100_000;
    let plain = run(stream(&neuron, 0.0, 192.0), &events, end);
    let later = run(stream(&neuron, 7.5, 192.0), &events, end);
    assert_eq!(plain.len(), later.len());
    for (a, b) in plain.iter().zip(&later) {
        assert_eq!((a.t - 7500, a.known, a.slope), (b.t, b.known, b.slope));
    }
}

#[test]
fn silence_is_told_by_moving_time_on() {
    let neuron = Neuron { tau: 2.0, ..Neuron::default() };
    let mut event = events(0, 1);
    (event.x[0], event.y[0], event.p[0]) = (0, 0, true);
    let (mut live, mut out) = (stream(&neuron, 0.0, 192.0), Vec::new());
    live.push_events(event.view(), &mut out).unwrap();
    assert_eq!(out, [], "the crossing is ahead, and something could still come before it");
    live.advance(event.t[0] + 10 * 192, &mut out).unwrap();
    assert_eq!((out.len(), out[0].label.as_str()), (1, "contact"));
    assert!(out[0].slope > 0.0);
}

#[test]
fn a_late_event_counts_as_coming_now() {
    let neuron = Neuron { tau: 2.0, ..Neuron::default() };
    let mut late = events(9, 50);
    let end = late.t[49] + 100_000;
    let moved = {
        let mut e = late.clone();
        e.t[20] = e.t[19];
        e
    };
    late.t[20] = late.t[0] - 300;
    let (mut a, mut b) = (stream(&neuron, 0.0, 192.0), stream(&neuron, 0.0, 192.0));
    let (mut said_a, mut said_b) = (Vec::new(), Vec::new());
    a.push_events(late.view(), &mut said_a).unwrap();
    b.push_events(moved.view(), &mut said_b).unwrap();
    a.advance(end, &mut said_a).unwrap();
    b.advance(end, &mut said_b).unwrap();
    assert_eq!(said_a, said_b);
    assert_eq!((a.late(), b.late()), (1, 0));
}

#[test]
fn a_detection_in_a_frame_of_the_input_is_known_at_its_end() {
    let neuron = Neuron { tau: 2.0, ..Neuron::default() };
    let (mut t, mut values) = (vec![], vec![]);
    for k in 0..200 {
        t.push(7 + 2000 * k);
        values.extend([f32::from(u8::from(k % 40 == 3)), 0.0, 0.0, 0.0]);
    }
    let mut live = stream(&neuron, 0.0, 2000.0);
    let mut found = live.push_frames(FramesView { array: &array(), t: &t, values: &values }, Stop::never()).unwrap();
    live.advance(500_000, &mut found).unwrap();
    assert_eq!(found.len(), 5);
    for (d, k) in found.iter().zip([3, 43, 83, 123, 163]) {
        assert_eq!((d.label.as_str(), d.known), ("contact", 7 + 2000 * (k + 1)));
        assert!((7 + 2000 * k..7 + 2000 * (k + 1)).contains(&(d.t + 200)));
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let neuron = Neuron::default();
    let narrow = Events::empty(Array::new(3, 2, 1.0, "other").unwrap());
    let mut live = stream(&neuron, 0.0, 192.0);
    let mut out = Vec::new();
    assert!(live.push_events(narrow.view(), &mut out).is_err());
    assert!(live.advance(i64::MAX, &mut out).is_err());
    assert!(live.push_frame(i64::MIN, &[0.0; 4], &mut out).is_err());
    let mut far = events(1, 1);
    far.t[0] = 1 << 60;
    assert!(live.push_events(far.view(), &mut out).is_err());
}
