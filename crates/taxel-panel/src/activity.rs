//! Counts by taxel from which dead, stuck and noisy ones are found.

use taxel_core::Array;
use taxel_core::health::TouchCounts;
use taxel_core::held::UNKNOWN;
use taxel_core::rest::Value;
use taxel_live::pipeline::TaxelChange;

/// Events and held values of each taxel so far.
#[derive(Debug, Clone)]
pub struct Activity {
    /// Events at each taxel.
    pub events: Vec<u32>,
    /// Events of the same direction as the taxel's previous event: a touch causes such events, noise at the floor hardly any.
    pub moved: Vec<u32>,
    /// The greatest value that the taxel held, ticks.
    pub greatest: Vec<u16>,
    /// Touches of each taxel, and what it did.
    pub touches: TouchCounts,
    up: Vec<bool>,
}

impl Activity {
    /// Counts of an array's taxels without any event.
    #[must_use]
    pub fn new(array: &Array) -> Self {
        let taxels = array.len();
        Self {
            touches: TouchCounts::new(array, f64::NO_REST),
            events: vec![0; taxels],
            moved: vec![0; taxels],
            greatest: vec![0; taxels],
            up: vec![false; taxels],
        }
    }

    /// Counts a change. A repaired one only updates the held value: states of version 2 also report dead taxels.
    pub fn count(&mut self, change: &TaxelChange) {
        let taxel = change.taxel as usize;
        self.hold(taxel, change.ticks);
        self.touches.event(change.t, taxel, change.ticks, change.up, !change.repaired);
        if change.repaired {
            return;
        }
        if self.events[taxel] > 0 && self.up[taxel] == change.up {
            self.moved[taxel] = self.moved[taxel].saturating_add(1);
        }
        self.up[taxel] = change.up;
        self.events[taxel] = self.events[taxel].saturating_add(1);
    }

    /// Notes the values that the taxels hold.
    pub(super) fn set_held(&mut self, held: &[u16]) {
        held.iter().enumerate().for_each(|(taxel, &ticks)| self.hold(taxel, ticks));
    }

    fn hold(&mut self, taxel: usize, ticks: u16) {
        if ticks != UNKNOWN {
            self.greatest[taxel] = self.greatest[taxel].max(ticks);
        }
    }
}
