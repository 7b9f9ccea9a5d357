//! Several encoders side by side, each with a name: the trains of all are the inputs of a readout's neurons.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::law::Law;
use super::stream::{Stream, sort_from};
use super::{Encoder, Tare};
use crate::parameters::Described;
use crate::spikes::ms;
use crate::{Array, EventsView, Result, Spike, SpikeKind, problem};

/// Encoders side by side: first all trains of the part whose name comes first, then those of the next.
///
/// Signed trains of a part are split by sign, all ON, then all OFF. If a part is graded, the whole is, and the spikes of
/// the others have the value 1. The latency is the largest of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Composite {
    /// The encoders by name.
    pub parts: BTreeMap<String, Encoder>,
}

impl Composite {
    /// The parts with these names, in the order of all parts; no name stands for all of them.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no such part, or if a name comes twice.
    pub fn named(&self, names: &[String]) -> Result<Vec<(&str, &Encoder)>> {
        for (n, name) in names.iter().enumerate() {
            if !self.parts.contains_key(name) {
                let known: Vec<&str> = self.parts.keys().map(String::as_str).collect();
                return Err(problem!("inputs: no encoder {name:?}: there are {}", known.join(", ")));
            }
            if names[..n].contains(name) {
                return Err(problem!("inputs: {name:?} comes twice"));
            }
        }
        let chosen = |name: &str| names.is_empty() || names.iter().any(|one| one == name);
        Ok(self.parts.iter().map(|(name, part)| (name.as_str(), part)).filter(|(name, _)| chosen(name)).collect())
    }

    /// Whether each train of the whole is one of the parts with these names.
    ///
    /// # Errors
    ///
    /// As [`Composite::named`].
    pub fn of_parts(&self, names: &[String], array: &Array) -> Result<Vec<bool>> {
        let named = self.named(names)?;
        let chosen = |name: &str| named.iter().any(|(one, _)| *one == name);
        let parts = self.parts.iter();
        Ok(parts.flat_map(|(name, part)| std::iter::repeat_n(chosen(name), inputs(part, array))).collect())
    }
}

/// The inputs of a neuron that a part's trains are.
fn inputs(part: &Encoder, array: &Array) -> usize {
    part.trains(array) * part.kind().inputs_per_train()
}

impl Law for Composite {
    fn described() -> Described {
        Described::by(&Self { parts: BTreeMap::new() }, &["parts"], &[])
    }

    fn check(&self) -> Result<()> {
        if self.parts.is_empty() {
            return Err(problem!("composite: parts is empty: must be encoders by name, one or more"));
        }
        for (name, part) in &self.parts {
            if name.trim().is_empty() {
                return Err(problem!("composite: a part without a name: must have one"));
            }
            if matches!(part, Encoder::Composite(_)) {
                return Err(problem!("composite: {name} is a composite itself: must be another encoder"));
            }
            part.check().map_err(|error| error.of(name))?;
        }
        Ok(())
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let mut trains = 0;
        let mut parts = vec![];
        for (name, part) in &self.parts {
            let stream = part.stream(array).map_err(|error| error.of(name))?;
            parts.push(Part { first: trains as u32, stream });
            trains += inputs(part, array);
        }
        Ok(Box::new(SideBySide { parts, trains, kind: self.kind(), held: vec![] }))
    }

    fn trains(&self, array: &Array) -> usize {
        self.parts.values().map(|part| inputs(part, array)).sum()
    }

    fn kind(&self) -> SpikeKind {
        let graded = self.parts.values().any(|part| part.kind() == SpikeKind::Graded);
        if graded { SpikeKind::Graded } else { SpikeKind::Unsigned }
    }

    fn latency_ms(&self) -> f64 {
        self.parts.values().map(Encoder::latency_ms).fold(0.0, f64::max)
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.parts.values_mut().for_each(|part| part.law_mut().set_tare(tare));
    }
}

/// A running part.
#[derive(Clone)]
struct Part {
    /// The number of its first train in the whole.
    first: u32,
    stream: Box<dyn Stream>,
}

impl Part {
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
struct SideBySide {
    parts: Vec<Part>,
    trains: usize,
    kind: SpikeKind,
    /// Spikes that a spike of another part may still precede.
    held: Vec<Spike>,
}

impl SideBySide {
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

    fn hears_repaired_ms(&self) -> Option<f64> {
        self.parts.iter().filter_map(|part| part.stream.hears_repaired_ms()).reduce(f64::max)
    }

    fn set_rest(&mut self, t: i64, place: usize, rest: f64, out: &mut Vec<Spike>) {
        self.pass(|part, spikes| part.set_rest(t, place, rest, spikes));
        self.emit(t, out);
    }

    fn rest(&self, place: usize) -> Option<f64> {
        self.parts.iter().find_map(|part| part.stream.rest(place))
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
