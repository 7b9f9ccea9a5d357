//! A readout that advances during silence: its detections from the events alone are the same as without advancing.

use taxel_core::detect::{Detection, ReadoutStream};
use taxel_core::encode::Zeroing;
use taxel_core::rest::LeftFloor;
use taxel_core::{EventsView, Result};

use super::readout_queue::QuietUntil;

/// A readout, and copies of it that advance by the host's clock while no data arrive. The next event discards those that it
/// proves wrong. So an event that comes later than the silence was assumed to last affects only detections that were output too
/// early.
pub(super) struct SpeculativeReadout {
    /// Had the events that arrived and nothing else, so its detections are those of the recording.
    certain: Box<ReadoutStream>,
    /// Up to the time that the board is assumed to have reached.
    ahead: Option<Advanced>,
    /// Up to 0.1 s before that: an event that interrupts a long silence does not make `certain` compute all of it again.
    behind: Option<Advanced>,
    /// Detections that were output ahead of `certain` and that it has not confirmed yet.
    early: Vec<Detection>,
    wrong: u64,
    found: Vec<Detection>,
}

/// A copy that advanced through a silence, and what it has detected since it was made.
struct Advanced {
    stream: Box<ReadoutStream>,
    found: Vec<Detection>,
}

impl Advanced {
    fn new(stream: &ReadoutStream) -> Self {
        Self { stream: Box::new(stream.clone()), found: vec![] }
    }

    /// Whether no input that the copy missed is before `t` us.
    fn holds_until(&self, t: i64) -> bool {
        self.stream.now().is_none_or(|now| now <= t)
    }
}

impl SpeculativeReadout {
    pub(super) fn new(certain: Box<ReadoutStream>) -> Self {
        Self { certain, ahead: None, behind: None, early: vec![], wrong: 0, found: vec![] }
    }

    /// Processes the next events; adds to `out` the detections that are certain now and were not output before.
    pub(super) fn push(&mut self, events: EventsView<'_>, out: &mut Vec<Detection>) -> Result<()> {
        if let Some(&earliest) = events.t.iter().min() {
            self.end_silence(earliest);
            self.certain.push_events(events, &mut self.found)?;
            self.settle(out);
        }
        Ok(())
    }

    /// Processes the next frame, as [`SpeculativeReadout::push`].
    pub(super) fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Detection>) -> Result<()> {
        self.end_silence(t);
        self.certain.push_frame(t, values, &mut self.found)?;
        self.settle(out);
        Ok(())
    }

    /// Ends the input after its last data.
    pub(super) fn finish(&mut self, out: &mut Vec<Detection>) -> Result<()> {
        (self.ahead, self.behind) = (None, None);
        if let Some(last) = self.certain.now() {
            self.certain.finish(last, &mut self.found)?;
        }
        self.settle(out);
        Ok(())
    }

    /// Assumes that no data arrive before `t` us; adds to `out` the detections that follow.
    pub(super) fn advance_silence(&mut self, t: i64, out: &mut Vec<Detection>) -> Result<()> {
        let ahead = self.ahead.get_or_insert_with(|| Advanced::new(&self.certain));
        let before = ahead.found.len();
        ahead.stream.advance(t, &mut ahead.found)?;
        for detection in &ahead.found[before..] {
            if !self.early.iter().any(|e| same(e, detection)) {
                self.early.push(detection.clone());
                out.push(detection.clone());
            }
        }
        let t = QuietUntil::ByHostClock(t).certain();
        if self.certain.now().is_none_or(|now| now < t) {
            let behind = self.behind.get_or_insert_with(|| Advanced::new(&self.certain));
            behind.stream.advance(t, &mut behind.found)?;
        }
        Ok(())
    }

    /// Advances on the certainty that no data arrive before `t` us.
    pub(super) fn advance(&mut self, t: i64, out: &mut Vec<Detection>) -> Result<()> {
        self.end_silence(t);
        self.certain.advance(t, &mut self.found)?;
        self.settle(out);
        Ok(())
    }

    /// Zeroes a taxel; detections that were output ahead of that time are not withdrawn.
    pub(super) fn zero(&mut self, zeroing: &Zeroing) -> Result<()> {
        (self.ahead, self.behind) = (None, None);
        self.certain.zero(zeroing)
    }

    /// The rest of each taxel, as [`ReadoutStream::rest`].
    pub(super) fn rest(&self) -> Vec<Option<f64>> {
        self.certain.rest()
    }

    /// Since when what is at rest is outside its noise floor, as [`ReadoutStream::left_floor`].
    pub(super) fn left_floor(&self) -> Option<LeftFloor> {
        self.certain.left_floor()
    }

    /// Number of events that arrived out of order.
    pub(super) fn late(&self) -> u64 {
        self.certain.late()
    }

    /// Number of detections that were output during a silence that an event then interrupted.
    pub(super) fn wrong(&self) -> u64 {
        self.wrong
    }

    /// Ends the silence at `t` us: a copy that has not passed that time is what the certain readout would be there.
    fn end_silence(&mut self, t: i64) {
        let copies = [self.ahead.take(), self.behind.take()];
        if let Some(copy) = copies.into_iter().flatten().find(|copy| copy.holds_until(t)) {
            self.certain = copy.stream;
            self.found.extend(copy.found);
        }
    }

    /// Compares certain detections with those that were output ahead of them.
    fn settle(&mut self, out: &mut Vec<Detection>) {
        for detection in self.found.drain(..) {
            match self.early.iter().position(|e| same(e, &detection)) {
                Some(k) => drop(self.early.swap_remove(k)),
                None => out.push(detection),
            }
        }
        let before = self.early.len();
        let now = self.certain.now().unwrap_or(i64::MIN);
        self.early.retain(|e| e.known > now);
        self.wrong += (before - self.early.len()) as u64;
    }
}

fn same(a: &Detection, b: &Detection) -> bool {
    (&a.label, a.t, a.known) == (&b.label, b.t, b.known)
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};
    use taxel_core::detect::{Readout, TrainedNeuron};
    use taxel_core::encode::Encoder;
    use taxel_core::neuron::{Neuron, Time};
    use taxel_core::{Array, Events, Intensities};

    use super::*;

    /// A readout that detects once, some 7 ms after a change at taxel 0.
    fn readout() -> SpeculativeReadout {
        let neuron = Neuron { tau: 20.0, refractory: 500.0, theta_0: 0.3, ..Neuron::default() };
        let cell = TrainedNeuron { delay_ms: 0.0, inputs: vec![], weights: vec![1.2; 8], neuron };
        let readout = Readout {
            encoder: Encoder::from_json(r#"{"name": "change_events"}"#).unwrap(),
            array: None,
            unit: None,
            time: Time::Continuous,
            after_spike: cell.neuron.after_spike,
            run_threshold: 1.0,
            pads: false,
            delays_ms: vec![0.0],
            neurons: [("touch".to_owned(), cell)].into(),
            rules: BTreeMap::new(),
            by_rule: BTreeSet::new(),
            rest: None,
            training: None,
        };
        SpeculativeReadout::new(Box::new(readout.stream(&array(), 192.0, None).unwrap()))
    }

    fn array() -> Array {
        Array::new(2, 2, 1.0, "four").unwrap()
    }

    fn event(t: i64, ticks: u16) -> Events {
        let intensity = Some(Intensities { ticks: vec![ticks], present: vec![true] });
        Events { t: vec![t], x: vec![0], y: vec![0], p: vec![true], intensity, ..Events::empty(array()) }
    }

    #[test]
    fn a_detection_in_silence_is_not_repeated_when_events_confirm_it() {
        let (mut ahead, mut out) = (readout(), vec![]);
        ahead.push(event(0, 10).view(), &mut out).unwrap();
        ahead.push(event(1000, 20).view(), &mut out).unwrap();
        ahead.advance_silence(5000, &mut out).unwrap();
        assert_eq!(out, []);
        ahead.advance_silence(20_000, &mut out).unwrap();
        assert_eq!(out.len(), 1);
        ahead.push(event(60_000, 22).view(), &mut out).unwrap();
        ahead.advance(60_000, &mut out).unwrap();
        assert_eq!((out.len(), ahead.wrong(), ahead.late()), (1, 0, 0));
    }

    #[test]
    fn an_event_that_comes_late_counts_at_its_own_time() {
        let (mut ahead, mut out) = (readout(), vec![]);
        ahead.push(event(0, 10).view(), &mut out).unwrap();
        ahead.push(event(1000, 20).view(), &mut out).unwrap();
        ahead.advance_silence(5000, &mut out).unwrap();
        // 2 ms before the end of the silence that was assumed.
        ahead.push(event(3000, 30).view(), &mut out).unwrap();
        ahead.advance_silence(150_000, &mut out).unwrap();
        let mut straight = readout();
        let mut expected = vec![];
        for (t, ticks) in [(0, 10), (1000, 20), (3000, 30)] {
            straight.push(event(t, ticks).view(), &mut expected).unwrap();
        }
        straight.advance(150_000, &mut expected).unwrap();
        assert_eq!(out, expected);
        assert_eq!((ahead.wrong(), ahead.late()), (0, 0));
    }

    #[test]
    fn whatever_silence_is_assumed_detections_are_those_of_the_events_and_those_counted_as_wrong() {
        let mut random = StdRng::seed_from_u64(5);
        for round in 0..200 {
            let (mut ahead, mut out) = (readout(), vec![]);
            let (mut straight, mut expected) = (readout(), vec![]);
            let (mut t, mut ticks) = (0, 10);
            for _ in 0..random.random_range(1..12) {
                // From the same stamp up to a minute later; the silence assumed before may end after the event.
                let pause = 10_f64.powf(random.random_range(0.0..7.8)) as i64 / 100 * 100;
                for _ in 0..random.random_range(0..4) {
                    ahead.advance_silence(t + (pause as f64 * random.random_range(0.0..1.6)) as i64, &mut out).unwrap();
                }
                t += pause;
                ticks += random.random_range(0..12);
                for (stream, found) in [(&mut ahead, &mut out), (&mut straight, &mut expected)] {
                    stream.push(event(t, ticks).view(), found).unwrap();
                }
            }
            for (stream, found) in [(&mut ahead, &mut out), (&mut straight, &mut expected)] {
                stream.advance(t + 1_000_000, found).unwrap();
            }
            assert_eq!((ahead.late(), out.len() as u64), (0, expected.len() as u64 + ahead.wrong()), "{round}");
            for detection in &expected {
                assert!(out.iter().any(|found| same(detection, found)), "{round}: {detection:?} is not among {out:?}");
            }
        }
    }

    #[test]
    fn a_detection_in_a_silence_that_was_interrupted_is_counted() {
        let (mut ahead, mut out) = (readout(), vec![]);
        ahead.push(event(0, 10).view(), &mut out).unwrap();
        ahead.push(event(1000, 20).view(), &mut out).unwrap();
        ahead.advance_silence(20_000, &mut out).unwrap();
        let early = out.clone();
        // The event was before the crossing, which therefore was earlier: the detection is output again, as from the
        // recording.
        ahead.push(event(2000, 30).view(), &mut out).unwrap();
        ahead.advance(40_000, &mut out).unwrap();
        assert_eq!((early.len(), out.len(), ahead.wrong(), ahead.late()), (1, 2, 1, 0));
        assert!(out[1].t < out[0].t);
    }
}
