//! The neurons of a readout in a stream, and the spikes that wait for them.

use super::named_neuron::NamedNeuron;
use crate::detect::{Detection, FrameClock};
use crate::neuron::NeuronStream;
use crate::{Result, Spike, SpikeKind};

/// Neurons with the delays at which they receive the encoder's trains.
#[derive(Clone)]
pub(in crate::detect) struct DelayedNeurons {
    neurons: Vec<NamedNeuron>,
    /// The delays at which each train enters the neurons, ms.
    delays_ms: Vec<f64>,
    /// Spikes assigned to inputs that wait for possibly earlier spikes, and whether each may rest on a repaired event.
    waiting: Vec<(Spike, bool)>,
}

impl DelayedNeurons {
    pub fn new(neurons: Vec<NamedNeuron>, delays_ms: Vec<f64>) -> Self {
        Self { neurons, delays_ms, waiting: vec![] }
    }

    /// The label and present potential of each neuron, mV.
    pub fn potentials(&self) -> impl Iterator<Item = (&str, f64)> {
        self.neurons
            .iter()
            .map(|neuron| (neuron.label.as_str(), neuron.stream.as_ref().map_or(0.0, NeuronStream::potential)))
    }

    /// Assigns the encoder's spikes to the neurons' inputs, each with whether it may rest on a repaired event.
    ///
    /// The order of trains is that of training: of signed trains all ON, then all OFF (`SpikeTrains::split_by_sign`),
    /// and all of these once for each delay.
    pub fn receive(&mut self, spikes: impl Iterator<Item = (Spike, bool)>, trains: usize, kind: SpikeKind) {
        let trains = u32::try_from(trains).unwrap_or(u32::MAX);
        let inputs = if kind == SpikeKind::Signed { 2 * trains } else { trains };
        for (spike, repaired) in spikes {
            let off = kind == SpikeKind::Signed && spike.value <= 0.0;
            let input = if off { trains + spike.train } else { spike.train };
            let value = if kind == SpikeKind::Graded { spike.value } else { 1.0 };
            for (copy, delay) in (0_u32..).zip(&self.delays_ms) {
                let delayed = Spike { t: spike.t + delay, train: copy * inputs + input, value };
                self.waiting.push((delayed, repaired));
            }
        }
    }

    /// Advances the neurons to `until_ms`, before which every spike is known; emits what lies at `begin` us or later.
    pub fn settle(&mut self, until_ms: f64, clock: &FrameClock, begin: i64, out: &mut Vec<Detection>) -> Result<()> {
        self.waiting.sort_by(|(a, _), (b, _)| a.t.total_cmp(&b.t).then(a.train.cmp(&b.train)));
        let certain = self.waiting.partition_point(|(spike, _)| spike.t < until_ms);
        let mut found = vec![];
        for neuron in &mut self.neurons {
            for (spike, repaired) in &self.waiting[..certain] {
                neuron.push(*spike, *repaired, clock, &mut found)?;
            }
            neuron.advance(until_ms, clock, &mut found);
        }
        self.waiting.drain(..certain);
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        out.extend(found.into_iter().map(|(_, detection)| detection).filter(|detection| detection.t >= begin));
        Ok(())
    }
}
