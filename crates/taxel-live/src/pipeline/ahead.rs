//! A readout that advances during silence: its detections from the events alone are the same as without advancing.

use taxel_core::detect::{Detection, ReadoutStream};
use taxel_core::encode::Zeroing;
use taxel_core::events::FARTHEST_BACK_US;
use taxel_core::{EventsView, Result};

/// Two copies of a readout. One gets the events that arrived and nothing else, so its detections are those of the recording. The
/// other runs ahead of it by the host's clock while no data arrive, and is discarded when something does. So an event that comes
/// later than the silence was assumed to last affects only detections that were output too early.
pub(super) struct Ahead {
    certain: Box<ReadoutStream>,
    ahead: Option<Box<ReadoutStream>>,
    /// Detections of the copy ahead that the other has not confirmed yet.
    early: Vec<Detection>,
    wrong: u64,
    found: Vec<Detection>,
}

impl Ahead {
    pub(super) fn new(certain: Box<ReadoutStream>) -> Self {
        Self { certain, ahead: None, early: vec![], wrong: 0, found: vec![] }
    }

    /// Processes the next events; adds to `out` the detections that are certain now and were not output before.
    pub(super) fn push(&mut self, events: EventsView<'_>, out: &mut Vec<Detection>) -> Result<()> {
        if !events.is_empty() {
            self.ahead = None;
            self.certain.push_events(events, &mut self.found)?;
            self.settle(out);
        }
        Ok(())
    }

    /// Assumes that no data arrive before `t` us; adds to `out` the detections that follow.
    pub(super) fn quiet(&mut self, t: i64, out: &mut Vec<Detection>) -> Result<()> {
        let ahead = self.ahead.get_or_insert_with(|| self.certain.clone());
        ahead.advance(t, &mut self.found)?;
        for detection in self.found.drain(..) {
            if !self.early.iter().any(|e| same(e, &detection)) {
                self.early.push(detection.clone());
                out.push(detection);
            }
        }
        // A silence is certain once it ends so long ago that an event in it would be too late to be accepted.
        self.advance(t - FARTHEST_BACK_US, out)
    }

    /// Advances on the certainty that no data arrive before `t` us.
    pub(super) fn advance(&mut self, t: i64, out: &mut Vec<Detection>) -> Result<()> {
        self.certain.advance(t, &mut self.found)?;
        self.settle(out);
        Ok(())
    }

    /// Zeroes a taxel; detections that were output ahead of that time are not withdrawn.
    pub(super) fn zero(&mut self, zeroing: &Zeroing) -> Result<()> {
        self.ahead = None;
        self.certain.zero(zeroing)
    }

    /// The rest of each taxel, as [`ReadoutStream::rest`].
    pub(super) fn rest(&self) -> Vec<Option<f64>> {
        self.certain.rest()
    }

    /// Number of events that arrived out of order, or later than a silence that was certain.
    pub(super) fn late(&self) -> u64 {
        self.certain.late()
    }

    /// Number of detections that were output during a silence that an event then interrupted.
    pub(super) fn wrong(&self) -> u64 {
        self.wrong
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
    use taxel_core::detect::{Readout, TrainedNeuron};
    use taxel_core::encode::Encoder;
    use taxel_core::neuron::{Neuron, Time};
    use taxel_core::{Array, Events, Intensities};

    use super::*;

    /// A readout that detects once, some 7 ms after a change at taxel 0.
    fn readout() -> Ahead {
        let neuron = Neuron { tau: 20.0, refractory: 500.0, theta_0: 0.3, ..Neuron::default() };
        let one = TrainedNeuron { delay_ms: 0.0, inputs: vec![], weights: vec![1.2; 8], neuron };
        let readout = Readout {
            encoder: Encoder::from_json(r#"{"name": "change_events"}"#).unwrap(),
            array: None,
            time: Time::Continuous,
            after_spike: one.neuron.after_spike,
            run_threshold: 1.0,
            delays_ms: vec![0.0],
            neurons: [("touch".to_owned(), one)].into(),
        };
        Ahead::new(Box::new(readout.stream(&array(), 192.0, None).unwrap()))
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
        ahead.quiet(5000, &mut out).unwrap();
        assert_eq!(out, []);
        ahead.quiet(20_000, &mut out).unwrap();
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
        ahead.quiet(5000, &mut out).unwrap();
        // 2 ms before the end of the silence that was assumed.
        ahead.push(event(3000, 30).view(), &mut out).unwrap();
        ahead.quiet(150_000, &mut out).unwrap();
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
    fn a_detection_in_a_silence_that_was_interrupted_is_counted() {
        let (mut ahead, mut out) = (readout(), vec![]);
        ahead.push(event(0, 10).view(), &mut out).unwrap();
        ahead.push(event(1000, 20).view(), &mut out).unwrap();
        ahead.quiet(20_000, &mut out).unwrap();
        let early = out.clone();
        // The event was before the crossing, which therefore was earlier: the detection is output again, as from the
        // recording.
        ahead.push(event(2000, 30).view(), &mut out).unwrap();
        ahead.advance(40_000, &mut out).unwrap();
        assert_eq!((early.len(), out.len(), ahead.wrong(), ahead.late()), (1, 2, 1, 0));
        assert!(out[1].t < out[0].t);
    }
}
