//! Which spikes may rest on taxels that a state of version 2 repaired.

use std::collections::VecDeque;

use crate::EventsView;
use crate::spikes::ms;

/// When taxels were repaired, as far back as the encoder's spikes may rest on it.
#[derive(Clone)]
pub(super) struct Repairs {
    /// For how long after an event the encoder's spikes may rest on it, ms; nothing: its spikes never do.
    within_ms: Option<f64>,
    /// us.
    at: VecDeque<i64>,
}

impl Repairs {
    /// No repair so far.
    pub fn within(within_ms: Option<f64>) -> Self {
        Self { within_ms, at: VecDeque::new() }
    }

    /// Records when events repaired taxels.
    pub fn note(&mut self, events: EventsView<'_>) {
        let Some(repaired) = events.repaired.filter(|_| self.within_ms.is_some()) else { return };
        for (&t, _) in events.t.iter().zip(repaired).filter(|&(_, &repaired)| repaired) {
            if self.at.back() != Some(&t) {
                self.at.push_back(t);
            }
        }
    }

    /// Whether a spike of the encoder may rest on a repaired taxel. Spikes come in order of time.
    pub fn may_give(&mut self, t: f64) -> bool {
        self.forget_before(t);
        self.at.front().is_some_and(|&at| ms(at) <= t)
    }

    /// Drops the repairs on which no spike at `t` ms or later can rest.
    pub fn forget_before(&mut self, t: f64) {
        let within = self.within_ms.unwrap_or(0.0);
        // Half a us for what a sum of ms loses.
        while self.at.front().is_some_and(|&at| ms(at) + within + 5e-4 < t) {
            self.at.pop_front();
        }
    }
}
