//! The neurons of a readout in a stream, and the spikes that wait for them.

use super::named_neuron::NamedNeuron;
use crate::detect::{Detection, FrameClock};
use crate::neuron::{NeuronStream, OutputSpike};
use crate::spikes::us;
use crate::{Result, Spike, SpikeKind};

/// Neurons with the delays at which they receive the encoder's trains.
#[derive(Clone)]
pub(in crate::detect) struct Neurons {
    neurons: Vec<NamedNeuron>,
    /// The delays at which each train enters the neurons, ms.
    delays_ms: Vec<f64>,
    /// Spikes assigned to inputs that wait for possibly earlier spikes, and whether each may rest on a repaired event.
    waiting: Vec<(Spike, bool)>,
}

impl Neurons {
    pub fn new(neurons: Vec<NamedNeuron>, delays_ms: Vec<f64>) -> Self {
        Self { neurons, delays_ms, waiting: vec![] }
    }

    /// The label and present potential of each neuron, mV.
    pub fn potentials(&self) -> impl Iterator<Item = (&str, f64)> {
        self.neurons.iter().map(|one| (one.label.as_str(), one.stream.as_ref().map_or(0.0, NeuronStream::potential)))
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

    /// Advances the neurons to `until_ms`, before which every spike is known.
    pub fn settle(&mut self, until_ms: f64, clock: &FrameClock, out: &mut Vec<Detection>) -> Result<()> {
        self.waiting.sort_by(|(a, _), (b, _)| a.t.total_cmp(&b.t).then(a.train.cmp(&b.train)));
        let certain = self.waiting.partition_point(|(spike, _)| spike.t < until_ms);
        let mut crossings: Vec<(OutputSpike, usize, bool)> = Vec::new();
        for (k, one) in self.neurons.iter_mut().enumerate() {
            for (spike, repaired) in &self.waiting[..certain] {
                if one.push(*spike)? && *repaired {
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
            known: clock.end_of(t),
            slope,
            repaired,
        }));
        Ok(())
    }
}
