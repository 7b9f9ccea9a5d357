//! The rows and bounds that appear to bind at an interior point.

use super::super::program::{Guess, Iterate, PrimalDualPoint, WeightState};
use super::{Interior, PrimalDual};
use crate::vectors::dot;

impl Interior<'_> {
    pub(super) fn finish(&self, state: &PrimalDual) -> Iterate {
        let program = self.program;
        let weights = self.weights(&state.x);
        let n = program.width();
        // A constraint counts as binding if its multiplier, relative to the typical multiplier,
        // exceeds its relative distance; the costs are scaled to about 1.
        let typical = |v: &[f64]| dot(v, v) / v.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let (far, force) = (typical(&state.x).clamp(1e-3, 1.0), typical(&state.low).max(1.0));
        let (room, press) = (typical(&state.slack).clamp(1e-3, 1.0), typical(&state.inequality).max(1.0));
        let mut at_low = vec![true; n];
        let mut states: Vec<WeightState> = program
            .lower
            .iter()
            .zip(&program.upper)
            .map(|(l, u)| if l == u { WeightState::Lower } else { WeightState::Free })
            .collect();
        for (j, part) in self.parts.iter().enumerate() {
            let k = part.synapse;
            if state.x[j] / far >= state.low[j] / force {
                at_low[k] = false;
            }
            if (part.range - state.x[j]) / far < state.high[j] / force {
                states[k] = if part.sign > 0.0 { WeightState::Upper } else { WeightState::Lower };
            }
        }
        for (k, state) in states.iter_mut().enumerate() {
            if at_low[k] && *state == WeightState::Free {
                let split = program.l1 > 0.0 && program.lower[k] < 0.0 && program.upper[k] > 0.0;
                *state = if split { WeightState::Zero } else { WeightState::Lower };
            }
        }
        let binding = state.slack.iter().zip(&state.inequality).map(|(s, z)| s / room < z / press).collect();
        let pull = if self.normed { state.dual.1.iter().map(|y| -y).collect() } else { vec![0.0; n] };
        let (equality, inequality) = (state.equality.clone(), state.inequality.clone());
        let point = PrimalDualPoint { weights, equality, inequality, pull };
        Iterate { point, guess: Guess { states, binding } }
    }
}
