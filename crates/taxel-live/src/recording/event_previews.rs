//! The low-rate previews of a recording that is converted from events: the taxels' values, for viewers.

use std::collections::BTreeSet;
use std::collections::btree_set::IntoIter;

use taxel_core::held::HeldOverTime;
use taxel_core::{EventsView, Result};

use super::LOW_RATE_EVERY;

/// Interval between previews, us.
const EVERY_US: i64 = LOW_RATE_EVERY.as_micros() as i64;

/// The sequence of previews, in order of time.
#[derive(Debug)]
pub struct EventPreviews {
    times: IntoIter<i64>,
    held: HeldOverTime<u16>,
}

impl EventPreviews {
    /// The previews of events: at each multiple of 100 ms if an event occurred in the 100 ms up to it. None if no event
    /// has an intensity.
    ///
    /// # Errors
    ///
    /// `Problem` if columns are unequal or a taxel is outside the array.
    pub fn new(events: EventsView<'_>) -> Result<Self> {
        // In a preview, the value of a taxel without any event so far is 0.
        let held = HeldOverTime::new(events, None, vec![0; events.array.len()])?;
        let times: BTreeSet<i64> = held.times().map(|t| -(-t).div_euclid(EVERY_US) * EVERY_US).collect();
        Ok(Self { times: times.into_iter(), held })
    }

    /// The next preview: its time, us, and each taxel's value, by index; 0 for a taxel without any event so far.
    pub fn next_preview(&mut self) -> Option<(i64, &[u16])> {
        let time = self.times.next()?;
        Some((time, self.held.at(time)))
    }
}
