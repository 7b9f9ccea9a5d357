//! Determines which spikes may rest on taxels that a state of version 2 repaired.

use std::collections::VecDeque;

use crate::EventsView;
use crate::spikes::ms;

/// The times of repairs, as far back as the encoder's spikes may rest on them.
#[derive(Clone)]
pub(super) struct Repairs {
    /// The time after an event during which the encoder's spikes may rest on it, ms; `None`: its spikes never do.
    within_ms: Option<f64>,
    /// The times of repairs, us.
    at: VecDeque<i64>,
}

impl Repairs {
    /// No repairs so far; `within_ms` is the encoder's memory.
    pub fn with_memory(within_ms: Option<f64>) -> Self {
        Self { within_ms, at: VecDeque::new() }
    }

    /// Records the times at which events repaired taxels.
    pub fn note(&mut self, events: EventsView<'_>) {
        let Some(repaired) = events.repaired.filter(|_| self.within_ms.is_some()) else { return };
        for (&t, _) in events.t.iter().zip(repaired).filter(|&(_, &repaired)| repaired) {
            if self.at.back() != Some(&t) {
                self.at.push_back(t);
            }
        }
    }

    /// Whether a spike of the encoder may rest on a repaired taxel. Calls must be in order of time.
    pub fn may_repair(&mut self, t: f64) -> bool {
        self.forget_before(t);
        self.at.front().is_some_and(|&at| ms(at) <= t)
    }

    /// Drops repairs on which no spike at or after `t` ms can rest.
    pub fn forget_before(&mut self, t: f64) {
        let within = self.within_ms.unwrap_or(0.0);
        // The half us allows for rounding of sums in ms.
        while self.at.front().is_some_and(|&at| ms(at) + within + 5e-4 < t) {
            self.at.pop_front();
        }
    }
}
