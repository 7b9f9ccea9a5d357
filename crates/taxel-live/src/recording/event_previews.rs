//! The low-rate previews of a recording that is converted from events: the taxels' values, for viewers.

use std::collections::BTreeSet;

use taxel_core::held::HeldOverTime;
use taxel_core::{EventsView, Result};

use super::LOW_RATE_EVERY;

/// Interval between previews while there are events, us.
const EVERY_US: i64 = LOW_RATE_EVERY.as_micros() as i64;

/// Interval between previews around a time of interest (a detection, a note, a marker), us.
const NEAR_US: i64 = 10_000;

/// The sequence of previews, in order of time.
#[derive(Debug)]
pub struct EventPreviews {
    times: std::vec::IntoIter<i64>,
    held: HeldOverTime<u16>,
}

impl EventPreviews {
    /// The previews of events: at each multiple of 100 ms if an event occurred in the 100 ms up to it, and at the
    /// multiples of 10 ms before and after each of the times `around`, within the range of events. None if no event has
    /// an intensity.
    ///
    /// # Errors
    ///
    /// `Problem` if columns are unequal or a taxel is outside the array.
    pub fn new(events: EventsView<'_>, around: &[i64]) -> Result<Self> {
        // In a preview, the value of a taxel without any event so far is 0.
        let held = HeldOverTime::new(events, None, vec![0; events.array.len()])?;
        let ends = |t: i64, period_us: i64| -(-t).div_euclid(period_us) * period_us;
        let mut times: BTreeSet<i64> = held.times().map(|t| ends(t, EVERY_US)).collect();
        if let (Some(first), Some(&last)) = (held.times().next(), times.last()) {
            let near = around.iter().map(|&t| ends(t, NEAR_US)).flat_map(|t| [t - NEAR_US, t]);
            times.extend(near.filter(|t| (first..=last).contains(t)));
        }
        let times: Vec<i64> = times.into_iter().collect();
        Ok(Self { times: times.into_iter(), held })
    }

    /// The next preview: its time, us, and each taxel's value, by index; 0 for a taxel without any event so far.
    pub fn next_preview(&mut self) -> Option<(i64, &[u16])> {
        let time = self.times.next()?;
        Some((time, self.held.at(time)))
    }
}
