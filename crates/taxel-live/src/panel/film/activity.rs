//! What each taxel did: where dead, stuck and noisy ones are seen.

use crate::pipeline::{Change, UNKNOWN};

/// What each taxel did, and what it is known to have held.
#[derive(Debug, Clone)]
pub struct Activity {
    /// Events at each taxel.
    pub events: Vec<u32>,
    /// Events that went the way of the taxel's event before: a touch makes such, noise at the floor next to none.
    pub moved: Vec<u32>,
    /// Different values that its events showed: 0, 1, or 2 for more.
    pub values: Vec<u8>,
    /// The least and the greatest that it held, ticks; [`UNKNOWN`] and 0 where it was not heard of.
    pub range: Vec<(u16, u16)>,
    first: Vec<u16>,
    up: Vec<bool>,
}

impl Activity {
    /// Of so many taxels that have done nothing.
    #[must_use]
    pub fn new(taxels: usize) -> Self {
        Self {
            events: vec![0; taxels],
            moved: vec![0; taxels],
            values: vec![0; taxels],
            range: vec![(UNKNOWN, 0); taxels],
            first: vec![UNKNOWN; taxels],
            up: vec![false; taxels],
        }
    }

    /// Takes a change; one that a state told is none of the taxel's own, as a dead one is told of too.
    pub fn take(&mut self, change: &Change) {
        let taxel = change.taxel as usize;
        self.hold(taxel, change.ticks);
        if change.repaired {
            return;
        }
        if self.events[taxel] > 0 && self.up[taxel] == change.up {
            self.moved[taxel] = self.moved[taxel].saturating_add(1);
        }
        self.up[taxel] = change.up;
        self.events[taxel] = self.events[taxel].saturating_add(1);
        if change.ticks == UNKNOWN {
            return;
        }
        if self.values[taxel] == 0 {
            (self.values[taxel], self.first[taxel]) = (1, change.ticks);
        } else if self.first[taxel] != change.ticks {
            self.values[taxel] = 2;
        }
    }

    /// A taxel holds so much, as far as it is known.
    pub(super) fn hold(&mut self, taxel: usize, ticks: u16) {
        if ticks != UNKNOWN {
            let (least, greatest) = self.range[taxel];
            self.range[taxel] = (least.min(ticks), greatest.max(ticks));
        }
    }
}
