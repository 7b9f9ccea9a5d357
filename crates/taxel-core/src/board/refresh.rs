//! Schedules what a board of version 2 repeats: the value of each taxel, a line at a time, and its totals.

use super::counts::BoardCounts;
use crate::wire::Registers;
use crate::wire::v2::Status;

/// How much was repeated since reset.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Refresh {
    /// Number of times that the totals were sent.
    totals: u64,
    /// Number of lines repeated, over all passes of the array.
    lines: u64,
}

impl Refresh {
    /// The driven lines whose values are due at `time` (10 ns), if all lines are repeated once in `every` (10 ns).
    ///
    /// If a frame is longer than the period, each line is repeated once per frame.
    pub(super) fn lines(&mut self, time: u64, every: u64, registers: &Registers) -> impl Iterator<Item = u16> + use<> {
        let lines = u64::from(registers.lines);
        let due = (u128::from(time) * u128::from(lines) / u128::from(every)) as u64;
        let from = std::mem::replace(&mut self.lines, due).max(due.saturating_sub(lines));
        (from..due).map(move |line| (line % lines) as u16)
    }

    /// Whether the totals are due at `time` (10 ns).
    pub(super) fn totals(&mut self, time: u64, every: u64) -> bool {
        let (due, sent) = (time / every, self.totals);
        self.totals = due.max(sent);
        due > sent
    }
}

/// The totals since reset; the packer fills in the number of datagrams before this one.
pub(super) fn totals(now: &BoardCounts, at_reset: &BoardCounts) -> Status {
    let dropped = now.dropped - at_reset.dropped;
    Status {
        frames: now.frames - at_reset.frames,
        events: (now.changes - at_reset.changes).saturating_sub(dropped),
        dropped,
        datagrams: 0,
        faults: now.not_returned - at_reset.not_returned,
    }
}
