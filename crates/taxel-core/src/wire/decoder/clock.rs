//! Unwraps the stamps of version 1: finds the turn of the 16-bit counter to which a stamp belongs.

use crate::events::FARTHEST_BACK_US;
use crate::wire::silence;
use crate::wire::v1::STAMP_US;

/// How far a stamp may be behind the latest time and still count as a step back (reordered datagrams), in stamps: 0.1
/// s. Reading: any other stamp is ahead, so silences of up to 6.45 s are correct from the stamps alone.
pub const FARTHEST_BACK: i64 = FARTHEST_BACK_US / STAMP_US;

/// Number of stamps in a turn of the 16-bit counter: 6.5536 s.
pub(in crate::wire) const TURN: i64 = 65_536;

/// Unwraps stamps into 64 bits.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::wire) struct StampClock {
    /// The latest time, in stamps.
    pub(super) latest: Option<i64>,
    /// The time of the last stamp if it was a step back, in stamps.
    pub(super) behind: Option<i64>,
    /// The host's clock when the last stamp arrived, us.
    pub(super) arrived: Option<i64>,
}

impl StampClock {
    /// Returns the unwrapped time in stamps, and whether it is a step back.
    pub(in crate::wire) fn unwrap(&mut self, stamp: u16, arrived: Option<i64>) -> (i64, bool) {
        let Some(latest) = self.latest else {
            (self.latest, self.arrived) = (Some(i64::from(stamp)), arrived);
            return (i64::from(stamp), false);
        };
        let ahead = (i64::from(stamp) - latest).rem_euclid(TURN);
        let mut time = if ahead >= TURN - FARTHEST_BACK { latest + ahead - TURN } else { latest + ahead };
        if let (Some(now), Some(before)) = (arrived, self.arrived) {
            // The host's clock shows how many whole turns of the counter passed during the silence.
            let expected = latest + silence(before, now) / STAMP_US;
            time += ((expected - time + TURN / 2).div_euclid(TURN)).max(0) * TURN;
        }
        self.arrived = arrived;
        self.latest = Some(latest.max(time));
        self.behind = (time < latest).then_some(time);
        (time, time < latest)
    }
}
