//! From events to detections, piece by piece: the same detections live and from a recording.

use std::collections::VecDeque;

use crate::detect::{Detection, FrameClock, TrainedNeuron};
use crate::encode::{Stream, Zeroing};
use crate::neuron::{NeuronStream, OutputSpike};
use crate::spikes::{ms, us};
use crate::{Array, EventsView, FramesView, Result, Spike, Stop, problem};

mod named_neuron;
mod repairs;
#[cfg(test)]
mod tests;

use named_neuron::NamedNeuron;
use repairs::Repairs;

/// How many events go through the stream between two checks of [`Stop`].
const PIECE: usize = 65_536;

/// Times farther from 0 than this lose their whole us in a neuron's ms, us.
const FARTHEST_US: i64 = 1 << 52;

/// A readout as a stream: events or pictures in, detections out.
///
/// A crossing counts once nothing can come before it any more: when a later event has come, or the caller has moved time
/// on with [`ReadoutStream::advance`]. Detections depend neither on where the input is cut nor on when time is moved.
#[derive(Clone)]
pub struct ReadoutStream {
    encoder: Box<dyn Stream>,
    array: Array,
    neurons: Vec<NamedNeuron>,
    clock: FrameClock,
    /// No input comes before this time any more, us.
    now: Option<i64>,
    /// Each train enters the neurons once at each of these delays, ms.
    delays_ms: Vec<f64>,
    /// Spikes that the encoder emitted and that are not sorted to inputs yet.
    emitted: Vec<Spike>,
    /// Spikes by the neurons' inputs that earlier ones may still precede, and whether each may rest on an event that a
    /// state repaired.
    waiting: Vec<(Spike, bool)>,
    repairs: Repairs,
    /// Taxels that are to be zeroed, by time, each after all events up to then.
    zeroings: VecDeque<Zeroing>,
    late: u64,
}

impl ReadoutStream {
    pub(super) fn new(
        encoder: Box<dyn Stream>,
        array: Array,
        clock: FrameClock,
        threshold: f64,
        delays_ms: Vec<f64>,
        neurons: impl Iterator<Item = (String, TrainedNeuron)>,
    ) -> Self {
        let latency_ms = encoder.latency_ms();
        let neurons = neurons.map(|(label, one)| NamedNeuron::new(label, one, threshold, latency_ms)).collect();
        let repairs = Repairs::within(encoder.hears_repaired_ms());
        let (emitted, waiting, zeroings) = (vec![], vec![], VecDeque::new());
        Self { encoder, array, neurons, clock, now: None, delays_ms, emitted, waiting, repairs, zeroings, late: 0 }
    }

    /// Processes the next events; appends the detections that are certain now to `out`.
    ///
    /// An event that is earlier than what came before (or than where time was moved to) counts as coming now: it is
    /// counted as [`late`](Self::late).
    ///
    /// # Errors
    ///
    /// `Problem` where events come from another array or lack what the encoder needs, or a time is beyond 2^52 us.
    pub fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Detection>) -> Result<()> {
        self.check_shape(events.array)?;
        let Some((&first, rest)) = events.t.split_first() else { return Ok(()) };
        for &t in events.t {
            check_time(t)?;
        }
        let mut latest = self.now.map_or(first, |now| now.max(first));
        let in_order = latest == first && rest.iter().is_sorted() && rest.first().is_none_or(|&t| t >= first);
        if in_order {
            self.encode(events)?;
        } else {
            let mut moved = events.t.to_vec();
            for t in &mut moved {
                self.late += u64::from(*t < latest);
                latest = latest.max(*t);
                *t = latest;
            }
            self.encode(EventsView { t: &moved, ..events })?;
        }
        self.settle(events.t[events.len() - 1].max(latest), out)
    }

    /// Processes the next picture, row by row, at `t` us; appends the detections that are certain now to `out`.
    ///
    /// # Errors
    ///
    /// `Problem` where the picture has another size or comes out of order, the encoder reads events only, or the time is
    /// beyond 2^52 us.
    pub fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Detection>) -> Result<()> {
        check_time(t)?;
        self.zero_before(t);
        self.encoder.push_frame(t, values, &mut self.emitted)?;
        self.settle(t, out)?;
        self.clock.picture(t);
        Ok(())
    }

    /// Moves time on to `t` us: nothing will come before it any more. An earlier time changes nothing.
    ///
    /// # Errors
    ///
    /// `Problem` where the time is beyond 2^52 us.
    pub fn advance(&mut self, t: i64, out: &mut Vec<Detection>) -> Result<()> {
        check_time(t)?;
        if self.now.is_none_or(|now| t > now) {
            self.zero_before(t);
            self.encoder.advance(t, &mut self.emitted);
            self.settle(t, out)?;
        }
        Ok(())
    }

    /// Sets the rest of a taxel from a time on, after all events up to then; where that time is over, from now on.
    ///
    /// # Errors
    ///
    /// `Problem` where no such taxel exists, the rest is no number, or the time is beyond 2^52 us.
    pub fn zero(&mut self, zeroing: &Zeroing) -> Result<()> {
        check_time(zeroing.t)?;
        zeroing.check(&self.array)?;
        let place = self.zeroings.partition_point(|earlier| earlier.t <= zeroing.t);
        self.zeroings.insert(place, *zeroing);
        Ok(())
    }

    /// The rest of each taxel, row by row; `None` where that is not known, or the encoder reads no tare.
    #[must_use]
    pub fn rest(&self) -> Vec<Option<f64>> {
        (0..self.array.len()).map(|place| self.encoder.rest(place)).collect()
    }

    /// How many events came later than others with a later time, or later than time was moved on.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.late
    }

    /// The time up to which all detections are out, us; `None` before any input.
    #[must_use]
    pub fn now(&self) -> Option<i64> {
        self.now
    }

    /// Each neuron's label and potential now, mV.
    pub fn potentials(&self) -> impl Iterator<Item = (&str, f64)> {
        self.neurons.iter().map(|one| (one.label.as_str(), one.stream.as_ref().map_or(0.0, NeuronStream::potential)))
    }

    /// Processes many events, and checks `stop` between pieces of them.
    ///
    /// # Errors
    ///
    /// As [`push_events`](Self::push_events); `Interrupted` where asked to stop.
    pub fn push_recording(&mut self, events: EventsView<'_>, stop: Stop<'_>) -> Result<Vec<Detection>> {
        events.check()?;
        let mut out = Vec::new();
        for piece in events.pieces(PIECE) {
            stop.check()?;
            self.push_events(piece, &mut out)?;
        }
        Ok(out)
    }

    /// Processes many pictures, and checks `stop` between them.
    ///
    /// # Errors
    ///
    /// As [`push_frame`](Self::push_frame), and where they come from another array; `Interrupted` where asked to stop.
    pub fn push_frames(&mut self, frames: FramesView<'_>, stop: Stop<'_>) -> Result<Vec<Detection>> {
        self.check_shape(frames.array)?;
        frames.check()?;
        let mut out = Vec::new();
        for (k, (t, picture)) in frames.iter().enumerate() {
            if k % 256 == 0 {
                stop.check()?;
            }
            self.push_frame(t, picture, &mut out)?;
        }
        Ok(out)
    }

    /// Passes events to the encoder in order of time, and between them the taxels that are to be zeroed.
    fn encode(&mut self, events: EventsView<'_>) -> Result<()> {
        self.repairs.note(events);
        let mut from = 0;
        while let Some(zeroing) = self.zeroings.front() {
            let upto = events.t.partition_point(|&t| t <= zeroing.t);
            if upto == events.len() {
                break;
            }
            if upto > from {
                self.encoder.push_events(events.piece(from..upto), &mut self.emitted)?;
                from = upto;
            }
            self.zero_before(events.t[upto]);
        }
        self.encoder.push_events(events.piece(from..events.len()), &mut self.emitted)
    }

    /// Sets the rests that are due before `t` us.
    fn zero_before(&mut self, t: i64) {
        let over = self.zeroings.partition_point(|zeroing| zeroing.t < t);
        for zeroing in self.zeroings.drain(..over) {
            let at = self.now.map_or(zeroing.t, |now| now.max(zeroing.t));
            let place = self.array.index(zeroing.x, zeroing.y);
            self.encoder.set_rest(at, place, zeroing.rest, &mut self.emitted);
        }
    }

    /// Moves the neurons on to `until` us, before which every spike is known.
    fn settle(&mut self, until: i64, out: &mut Vec<Detection>) -> Result<()> {
        self.now = Some(self.now.map_or(until, |now| now.max(until)));
        let until_ms = ms(until);
        self.sort_to_inputs();
        // The encoder has emitted all spikes before `until`, so repairs that lie too far behind it no longer count.
        self.repairs.forget_before(until_ms);
        self.waiting.sort_by(|(a, _), (b, _)| a.t.total_cmp(&b.t).then(a.train.cmp(&b.train)));
        let certain = self.waiting.partition_point(|(spike, _)| spike.t < until_ms);
        let mut crossings: Vec<(OutputSpike, usize, bool)> = Vec::new();
        for (k, one) in self.neurons.iter_mut().enumerate() {
            for (spike, repaired) in &self.waiting[..certain] {
                one.push(spike.t, spike.train)?;
                if *repaired {
                    // Crossings up to here cannot rest on the repaired taxel.
                    one.drain_crossings(k, &mut crossings);
                    one.repaired = Some(spike.t);
                }
            }
            if let Some(stream) = &mut one.stream {
                stream.advance(until_ms, &mut one.crossings);
            }
            one.drain_crossings(k, &mut crossings);
        }
        self.waiting.drain(..certain);
        crossings.sort_by(|a, b| a.0.t.total_cmp(&b.0.t));
        out.extend(crossings.into_iter().map(|(OutputSpike { t, slope, .. }, k, repaired)| Detection {
            label: self.neurons[k].label.clone(),
            t: us(t - self.neurons[k].offset_ms).round() as i64,
            known: self.clock.end_of(t),
            slope,
            repaired,
        }));
        Ok(())
    }

    /// Sorts the encoder's spikes to the neurons' inputs.
    ///
    /// Trains come as the learner saw them: of signed ones all ON, then all OFF (`SpikeTrains::split_by_sign`), and all of
    /// these once a delay.
    fn sort_to_inputs(&mut self) {
        let trains = u32::try_from(self.encoder.trains()).unwrap_or(u32::MAX);
        let signed = self.encoder.signed();
        let inputs = if signed { 2 * trains } else { trains };
        for spike in std::mem::take(&mut self.emitted) {
            let repaired = self.repairs.may_give(spike.t);
            let input = if signed && spike.value <= 0.0 { trains + spike.train } else { spike.train };
            for (copy, delay) in (0_u32..).zip(&self.delays_ms) {
                let delayed = Spike { t: spike.t + delay, train: copy * inputs + input, ..spike };
                self.waiting.push((delayed, repaired));
            }
        }
    }

    fn check_shape(&self, other: &Array) -> Result<()> {
        let (mine, theirs) = ((self.array.rows, self.array.columns), (other.rows, other.columns));
        if mine != theirs {
            return Err(problem!(
                "input from {} x {} taxels: this readout reads {} x {}",
                theirs.0,
                theirs.1,
                mine.0,
                mine.1
            ));
        }
        Ok(())
    }
}

fn check_time(t: i64) -> Result<()> {
    if (-FARTHEST_US..=FARTHEST_US).contains(&t) {
        Ok(())
    } else {
        Err(problem!("time {t} us: must lie within 2^52 us, {FARTHEST_US}, of 0"))
    }
}
