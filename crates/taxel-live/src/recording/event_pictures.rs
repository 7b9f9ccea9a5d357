//! The low-rate pictures of a recording that is made of events: what the taxels hold, for viewers.

use std::collections::BTreeSet;

use taxel_core::held::HeldOverTime;
use taxel_core::{EventsView, Result};

use super::PICTURE_EVERY;

/// From one picture to the next where events come, us.
const EVERY_US: i64 = PICTURE_EVERY.as_micros() as i64;

/// From a picture to the next around a time of interest (a detection, a note, a marker), us.
const NEAR_US: i64 = 10_000;

/// The pictures, one by one, in order of time.
#[derive(Debug)]
pub struct EventPictures {
    times: std::vec::IntoIter<i64>,
    held: HeldOverTime<u16>,
}

impl EventPictures {
    /// The pictures of events: at each whole 100 ms up to which an event came, and at the whole 10 ms before and behind each of
    /// the times `around`, as far as events reach. None where no event has an intensity.
    ///
    /// # Errors
    ///
    /// `Problem` where columns are unequal or a taxel lies outside the array.
    pub fn new(events: EventsView<'_>, around: &[i64]) -> Result<Self> {
        // In a picture 0 is also a taxel without any event so far.
        let held = HeldOverTime::new(events, None, vec![0; events.array.len()])?;
        let ends = |t: i64, every: i64| -(-t).div_euclid(every) * every;
        let mut times: BTreeSet<i64> = held.times().map(|t| ends(t, EVERY_US)).collect();
        if let (Some(first), Some(&last)) = (held.times().next(), times.last()) {
            let near = around.iter().map(|&t| ends(t, NEAR_US)).flat_map(|t| [t - NEAR_US, t]);
            times.extend(near.filter(|t| (first..=last).contains(t)));
        }
        let times: Vec<i64> = times.into_iter().collect();
        Ok(Self { times: times.into_iter(), held })
    }

    /// The next picture: its time, us, and what each taxel holds then, by index; 0 of one without any event so far.
    pub fn next_picture(&mut self) -> Option<(i64, &[u16])> {
        let time = self.times.next()?;
        Some((time, self.held.at(time)))
    }
}
