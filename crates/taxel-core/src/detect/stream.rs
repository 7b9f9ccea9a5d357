//! Detections from events, piece by piece: the same live and from a recording.

use std::collections::VecDeque;

use crate::detect::running_rule::{Decision, RunningRule};
use crate::detect::{Detection, FrameClock};
use crate::encode::{Stream, Zeroing};
use crate::rest::{FollowedRest, LeftFloor};
use crate::spikes::ms;
use crate::{Array, EventsView, FramesView, Result, Spike, Stop, problem};

mod named_neuron;
mod neurons;
mod repairs;
#[cfg(test)]
mod tests;

pub(super) use named_neuron::{NamedNeuron, ReceivedTrains};
pub(super) use neurons::DelayedNeurons;
use repairs::Repairs;

/// The number of events between two checks of [`Stop`].
const PIECE: usize = 65_536;

/// Beyond this distance from 0, a time in ms no longer resolves whole us in a neuron.
const FARTHEST_US: i64 = 1 << 52;

/// A readout or a plain rule as a stream: events or frames in, detections out.
///
/// A crossing becomes a detection once no earlier input can follow: after a later event, or after the caller advanced
/// time by [`ReadoutStream::advance`]. Detections depend neither on how the input is divided nor on when time is
/// advanced.
#[derive(Clone)]
pub struct ReadoutStream {
    /// The neurons of a readout, and the rules that run beside them or alone: each reads the same input.
    ways: Vec<Way>,
    array: Array,
    clock: FrameClock,
    /// The rest of frames that follows, or is watched; events have none, whose values hold and are no samples.
    rest: Option<FollowedRest>,
    /// The time before which no input can follow, us.
    now: Option<i64>,
    /// Taxels to be zeroed, in order of time, each after all events up to its time.
    zeroings: VecDeque<Zeroing>,
    late: u64,
    /// Nothing before it is detected, us.
    begin: i64,
    /// The smaller array that the input is of, which is padded at its far edges; `None` where it is of the whole one.
    smaller: Option<Array>,
    /// The time by which an input is continued after its end, us.
    silence_us: i64,
}

/// An encoder, and what turns its spikes into detections.
#[derive(Clone)]
pub(super) struct Way {
    encoder: Box<dyn Stream>,
    decides: Decides,
    /// Spikes of the encoder that were not yet passed on, in order of time.
    emitted: Vec<Spike>,
    repairs: Repairs,
}

/// What turns the encoder's spikes into detections.
#[derive(Clone)]
enum Decides {
    Neurons(DelayedNeurons),
    /// A plain rule, for which they are changes of its quantities, with its labels, and its constant, us.
    Rule(Box<RunningRule>, [Option<String>; 2], i64),
}

impl Way {
    /// That of neurons.
    pub(super) fn of_neurons(encoder: Box<dyn Stream>, neurons: DelayedNeurons) -> Self {
        Self::new(encoder, Decides::Neurons(neurons))
    }

    /// That of a plain rule: `loads` emits the changes of its quantities.
    pub(super) fn of_rule(
        loads: Box<dyn Stream>,
        rule: RunningRule,
        labels: [Option<String>; 2],
        constant: i64,
    ) -> Self {
        Self::new(loads, Decides::Rule(Box::new(rule), labels, constant))
    }

    fn new(encoder: Box<dyn Stream>, decides: Decides) -> Self {
        let repairs = Repairs::with_memory(encoder.repaired_span_ms());
        Self { encoder, decides, emitted: vec![], repairs }
    }

    fn neurons(&self) -> Option<&DelayedNeurons> {
        match &self.decides {
            Decides::Neurons(neurons) => Some(neurons),
            Decides::Rule(..) => None,
        }
    }

    /// Passes the encoder's spikes on, up to `until`, before which every spike is known.
    fn settle(&mut self, until: i64, clock: &FrameClock, begin: i64, out: &mut Vec<Detection>) -> Result<()> {
        let certain = self.emitted.partition_point(|spike| spike.t < ms(until));
        let spikes = self.emitted.drain(..certain).map(|spike| (spike, self.repairs.may_repair(spike.t)));
        match &mut self.decides {
            Decides::Neurons(neurons) => {
                neurons.receive(spikes, self.encoder.trains(), self.encoder.kind());
                neurons.settle(ms(until), clock, begin, out)?;
            }
            Decides::Rule(rule, labels, constant) => {
                let mut decisions = vec![];
                spikes.for_each(|(change, repaired)| rule.change(change, repaired, clock, &mut decisions));
                rule.advance(until, clock, &mut decisions);
                out.extend(decisions.into_iter().filter_map(|Decision { label, t, known, repaired, .. }| {
                    let t = t - *constant;
                    let label = labels[label].clone().filter(|_| t >= begin)?;
                    // A rule has no potential, hence no slope.
                    Some(Detection { label, t, known, slope: f64::NAN, repaired })
                }));
            }
        }
        // The encoder has emitted all spikes before `until`, so repairs too far in the past no longer matter.
        self.repairs.forget_before(ms(until));
        Ok(())
    }
}

impl ReadoutStream {
    pub(super) fn new(ways: Vec<Way>, array: Array, clock: FrameClock, rest: Option<FollowedRest>) -> Self {
        Self {
            ways,
            array,
            clock,
            rest,
            now: None,
            zeroings: VecDeque::new(),
            late: 0,
            begin: i64::MIN,
            smaller: None,
            silence_us: 0,
        }
    }

    /// The stream for input of a smaller array, which is padded at its far edges.
    pub(super) fn padding(self, smaller: Array) -> Self {
        Self { smaller: Some(smaller), ..self }
    }

    /// Continues the input by `us` after its end ([`ReadoutStream::finish`]).
    pub(super) fn with_silence(self, us: i64) -> Self {
        Self { silence_us: us, ..self }
    }

    /// The array that the input is of.
    fn input_array(&self) -> &Array {
        self.smaller.as_ref().unwrap_or(&self.array)
    }

    /// Detects nothing before `t` us: where a tare was measured, the sensor was at rest.
    pub fn begin_at(&mut self, t: i64) {
        self.begin = t;
    }

    /// Processes the next events and appends the detections that are final now to `out`.
    ///
    /// An event earlier than previous input, or than the time advanced to, is treated as arriving now and counted as
    /// [`late`](Self::late).
    ///
    /// # Errors
    ///
    /// `Problem` if events are of another array or lack what the encoder needs, or a time is beyond 2^52 us.
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

    /// Processes the next frame, row by row, at `t` us and appends the detections that are final now to `out`.
    ///
    /// # Errors
    ///
    /// `Problem` if the frame has another size or is not in order of time, if the encoder reads events only, or if
    /// the time is beyond 2^52 us.
    pub fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Detection>) -> Result<()> {
        check_time(t)?;
        self.zero_before(t);
        let smaller = self.smaller.as_ref().filter(|smaller| values.len() == smaller.len());
        let padded = smaller.map(|smaller| self.array.padded(values, smaller.columns, &0.0));
        let values = padded.as_deref().unwrap_or(values);
        let values = self.rest.as_mut().map_or(values, |rest| rest.take(t, values));
        self.ways.iter_mut().try_for_each(|way| way.encoder.push_frame(t, values, &mut way.emitted))?;
        self.settle(t, out)?;
        self.clock.start_frame(t);
        Ok(())
    }

    /// Advances time to `t` us, promising that no earlier input follows. An earlier time changes nothing.
    ///
    /// # Errors
    ///
    /// `Problem` if the time is beyond 2^52 us.
    pub fn advance(&mut self, t: i64, out: &mut Vec<Detection>) -> Result<()> {
        check_time(t)?;
        if self.now.is_none_or(|now| t > now) {
            self.zero_before(t);
            self.ways.iter_mut().for_each(|way| way.encoder.advance(t, &mut way.emitted));
            self.settle(t, out)?;
        }
        Ok(())
    }

    /// Ends the input at `last` us, which continues with its last values for as long as it can cause a detection.
    ///
    /// # Errors
    ///
    /// As [`ReadoutStream::advance`].
    pub fn finish(&mut self, last: i64, out: &mut Vec<Detection>) -> Result<()> {
        self.advance(last.saturating_add(self.silence_us), out)
    }

    /// Sets the rest of a taxel after all events up to the zeroing's time, or from now on if that time is past.
    ///
    /// # Errors
    ///
    /// `Problem` if no such taxel exists, the rest is not a number, or the time is beyond 2^52 us.
    pub fn zero(&mut self, zeroing: &Zeroing) -> Result<()> {
        check_time(zeroing.t)?;
        zeroing.check(self.input_array())?;
        let index = self.zeroings.partition_point(|earlier| earlier.t <= zeroing.t);
        self.zeroings.insert(index, *zeroing);
        Ok(())
    }

    /// The rest of each taxel, row by row; `None` if it is unknown, or if no encoder uses a tare.
    #[must_use]
    pub fn rest(&self) -> Vec<Option<f64>> {
        let (rows, columns) = (self.input_array().rows, self.input_array().columns);
        let taxels = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
        let moved = |taxel| self.rest.as_ref().map_or(0.0, |rest| rest.moved(taxel));
        let measured = |taxel| self.ways.iter().find_map(|way| way.encoder.rest(taxel));
        let rest_of = |taxel| measured(taxel).map(|rest| rest + moved(taxel));
        taxels.map(|(x, y)| rest_of(self.array.index(x, y))).collect()
    }

    /// Since when what is at rest is outside the noise floor of the training, if it was so far; known of frames.
    #[must_use]
    pub fn left_floor(&self) -> Option<LeftFloor> {
        self.rest.as_ref().and_then(FollowedRest::left)
    }

    /// The number of events that arrived after later events, or after time was advanced beyond them.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.late
    }

    /// The time up to which all detections are final, us; `None` before any input.
    #[must_use]
    pub fn now(&self) -> Option<i64> {
        self.now
    }

    /// The label and present potential of each neuron, mV; a plain rule has none.
    pub fn potentials(&self) -> impl Iterator<Item = (&str, f64)> {
        self.ways.iter().filter_map(Way::neurons).flat_map(DelayedNeurons::potentials)
    }

    /// Processes a recording of events, checking `stop` between pieces.
    ///
    /// # Errors
    ///
    /// Those of [`push_events`](Self::push_events); `Interrupted` if asked to stop.
    pub fn push_recording(&mut self, events: EventsView<'_>, stop: Stop<'_>) -> Result<Vec<Detection>> {
        events.check()?;
        let mut out = Vec::new();
        for piece in events.pieces(PIECE) {
            stop.check()?;
            self.push_events(piece, &mut out)?;
        }
        Ok(out)
    }

    /// Processes a recording of frames, checking `stop` between them.
    ///
    /// # Errors
    ///
    /// Those of [`push_frame`](Self::push_frame); `Problem` if the frames are of another array; `Interrupted` if
    /// asked to stop.
    pub fn push_frames(&mut self, frames: FramesView<'_>, stop: Stop<'_>) -> Result<Vec<Detection>> {
        self.check_shape(frames.array)?;
        frames.check()?;
        let mut out = Vec::new();
        for (k, (t, frame)) in frames.iter().enumerate() {
            if k % 256 == 0 {
                stop.check()?;
            }
            self.push_frame(t, frame, &mut out)?;
        }
        Ok(out)
    }

    /// Passes events to the encoders in order of time, and zeroes taxels at their times in between.
    fn encode(&mut self, events: EventsView<'_>) -> Result<()> {
        let array = self.array.clone();
        let events = if self.smaller.is_some() { EventsView { array: &array, ..events } } else { events };
        self.ways.iter_mut().for_each(|way| way.repairs.note(events));
        let mut from = 0;
        while let Some(zeroing) = self.zeroings.front() {
            let upto = events.t.partition_point(|&t| t <= zeroing.t);
            if upto == events.len() {
                break;
            }
            if upto > from {
                self.push_piece(events.piece(from..upto))?;
                from = upto;
            }
            self.zero_before(events.t[upto]);
        }
        self.push_piece(events.piece(from..events.len()))
    }

    fn push_piece(&mut self, events: EventsView<'_>) -> Result<()> {
        self.ways.iter_mut().try_for_each(|way| way.encoder.push_events(events, &mut way.emitted))
    }

    /// Sets the rests of zeroings before `t` us.
    fn zero_before(&mut self, t: i64) {
        let over = self.zeroings.partition_point(|zeroing| zeroing.t < t);
        for zeroing in self.zeroings.drain(..over) {
            let at = self.now.map_or(zeroing.t, |now| now.max(zeroing.t));
            let taxel = self.array.index(zeroing.x, zeroing.y);
            self.rest.iter_mut().for_each(|rest| rest.set(taxel, zeroing.rest));
            for way in &mut self.ways {
                way.encoder.set_rest(at, taxel, zeroing.rest, &mut way.emitted);
            }
        }
    }

    /// Appends the detections that are known up to `until` us, before which all input is known, in the order in which they
    /// become known.
    fn settle(&mut self, until: i64, out: &mut Vec<Detection>) -> Result<()> {
        self.now = Some(self.now.map_or(until, |now| now.max(until)));
        let from = out.len();
        for way in &mut self.ways {
            way.settle(until, &self.clock, self.begin, out)?;
        }
        if self.ways.len() > 1 {
            out[from..].sort_by_key(|found| found.known);
        }
        Ok(())
    }

    fn check_shape(&self, array: &Array) -> Result<()> {
        let input = self.input_array();
        let (expected, given) = ((input.rows, input.columns), (array.rows, array.columns));
        if expected != given {
            return Err(problem!(
                "input from {} x {} taxels: this readout reads {} x {}",
                given.0,
                given.1,
                expected.0,
                expected.1
            ));
        }
        Ok(())
    }
}

fn check_time(t: i64) -> Result<()> {
    if (-FARTHEST_US..=FARTHEST_US).contains(&t) {
        Ok(())
    } else {
        Err(problem!("time {t} us: must be within 2^52 us ({FARTHEST_US} us) of 0"))
    }
}
