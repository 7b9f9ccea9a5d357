//! The streams of several encoders as one stream (`Composite`).

use super::stream::{Stream, sort_from};
use crate::spikes::ms;
use crate::{EventsView, Result, Spike, SpikeKind};

/// A running part.
#[derive(Clone)]
struct EncoderPart {
    /// The number of its first train in the whole.
    first: u32,
    stream: Box<dyn Stream>,
}

impl EncoderPart {
    /// Appends spikes of the part to `out` as those of the whole.
    fn join(&self, spikes: Vec<Spike>, out: &mut Vec<Spike>) {
        let (kind, trains) = (self.stream.kind(), self.stream.trains() as u32);
        out.extend(spikes.into_iter().map(|spike| {
            let off = kind == SpikeKind::Signed && spike.value <= 0.0;
            let train = self.first + spike.train + if off { trains } else { 0 };
            Spike { t: spike.t, train, value: if kind == SpikeKind::Graded { spike.value } else { 1.0 } }
        }));
    }
}

/// The parts as one stream.
#[derive(Clone)]
pub(super) struct SideBySide {
    parts: Vec<EncoderPart>,
    trains: usize,
    kind: SpikeKind,
    /// Spikes that a spike of another part may still precede.
    held: Vec<Spike>,
}

impl SideBySide {
    /// Joins streams, each with the number of its first train in the whole, to one of so many `trains`.
    pub(super) fn new(streams: Vec<(usize, Box<dyn Stream>)>, trains: usize, kind: SpikeKind) -> Self {
        let parts = streams.into_iter().map(|(first, stream)| EncoderPart { first: first as u32, stream }).collect();
        Self { parts, trains, kind, held: vec![] }
    }

    /// Passes input to each part and holds the spikes.
    fn pass<T>(&mut self, mut input: impl FnMut(&mut dyn Stream, &mut Vec<Spike>) -> T) -> Vec<T> {
        let mut results = vec![];
        for part in &mut self.parts {
            let mut spikes = vec![];
            results.push(input(&mut *part.stream, &mut spikes));
            part.join(spikes, &mut self.held);
        }
        sort_from(&mut self.held, 0);
        results
    }

    /// Emits the spikes before `until` us, which each part has emitted by then.
    fn emit(&mut self, until: i64, out: &mut Vec<Spike>) {
        let certain = self.held.partition_point(|spike| spike.t < ms(until));
        out.extend(self.held.drain(..certain));
    }
}

impl Stream for SideBySide {
    fn trains(&self) -> usize {
        self.trains
    }

    fn kind(&self) -> SpikeKind {
        self.kind
    }

    fn latency_ms(&self) -> f64 {
        self.parts.iter().map(|part| part.stream.latency_ms()).fold(0.0, f64::max)
    }

    fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()> {
        self.pass(|part, spikes| part.push_events(events, spikes)).into_iter().collect::<Result<()>>()?;
        if let Some(&last) = events.t.iter().max() {
            self.emit(last, out);
        }
        Ok(())
    }

    fn repaired_span_ms(&self) -> Option<f64> {
        self.parts.iter().filter_map(|part| part.stream.repaired_span_ms()).reduce(f64::max)
    }

    fn set_rest(&mut self, t: i64, taxel: usize, rest: f64, out: &mut Vec<Spike>) {
        self.pass(|part, spikes| part.set_rest(t, taxel, rest, spikes));
        self.emit(t, out);
    }

    fn rest(&self, taxel: usize) -> Option<f64> {
        self.parts.iter().find_map(|part| part.stream.rest(taxel))
    }

    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()> {
        self.pass(|part, spikes| part.push_frame(t, values, spikes)).into_iter().collect::<Result<()>>()?;
        self.emit(t, out);
        Ok(())
    }

    fn advance(&mut self, t: i64, out: &mut Vec<Spike>) {
        self.pass(|part, spikes| part.advance(t, spikes));
        self.emit(t, out);
    }

    fn finish(&mut self, out: &mut Vec<Spike>) -> Option<f64> {
        let ends = self.pass(|part, spikes| part.finish(spikes));
        out.append(&mut self.held);
        ends.into_iter().flatten().reduce(f64::max)
    }

    fn fork(&self) -> Box<dyn Stream> {
        Box::new(self.clone())
    }

    fn late(&self) -> u64 {
        self.parts.first().map_or(0, |part| part.stream.late())
    }
}
