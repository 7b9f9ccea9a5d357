//! The inputs of a neuron, compared with those of its training.

use std::collections::VecDeque;

use crate::detect::Seen;
use crate::{Spike, SpikeKind};

/// The range of each input in training, and the recent spikes of those that are counted.
#[derive(Clone, Default)]
pub(in crate::detect) struct Ranges {
    seen: Option<Seen>,
    /// The times of each input's recent spikes, ms; none of graded ones, whose values are compared.
    recent: Vec<VecDeque<f64>>,
}

impl Ranges {
    /// The inputs of one neuron before any spike.
    pub fn new(seen: Option<Seen>, kind: SpikeKind) -> Self {
        let counted = seen.as_ref().filter(|_| kind != SpikeKind::Graded).map_or(0, |seen| seen.most.len());
        Self { seen, recent: vec![VecDeque::new(); counted] }
    }

    /// Whether the range of the inputs is known.
    pub fn are_known(&self) -> bool {
        self.seen.is_some()
    }

    /// Whether a spike, whose train is the number of an input, is outside the range of that input.
    pub fn is_outside(&mut self, spike: Spike, memory_ms: f64) -> bool {
        let Some(seen) = &self.seen else { return false };
        let input = spike.train as usize;
        let value = match self.recent.get_mut(input) {
            Some(recent) => {
                recent.push_back(spike.t);
                while recent.front().is_some_and(|&t| t < spike.t - memory_ms) {
                    recent.pop_front();
                }
                recent.len() as f64
            }
            None => f64::from(spike.value),
        };
        let (least, most) = seen.range(input);
        !(least..=most).contains(&value)
    }
}
