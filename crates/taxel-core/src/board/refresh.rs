//! Schedules what a board of version 2 repeats: the value of each taxel, a line at a time, and its totals.

use super::counts::BoardCounts;
use crate::wire::Registers;
use crate::wire::v2::BoardTotals;

/// What a board repeats: a line each time that its share of the period is over, the totals each time that the period is.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Refresh {
    /// Time since a line was last due, 10 ns, times the number of lines; and whether one is due.
    since_line: u64,
    line_due: bool,
    /// Line that is repeated next.
    line: u16,
    /// The same of the totals.
    since_totals: u64,
    totals_due: bool,
}

impl Refresh {
    /// Advances by a frame, if all lines are repeated once in `period` (10 ns).
    pub(super) fn frame(&mut self, registers: &Registers, period: u64) {
        let passed = registers.frame_10ns();
        self.since_line += passed * u64::from(registers.lines);
        self.line_due |= self.since_line >= period;
        self.since_line %= period;
        self.since_totals += passed;
        self.totals_due |= self.since_totals >= period;
        self.since_totals %= period;
    }

    /// The line to repeat at the end of this frame: one at most, so that logic can do it.
    pub(super) fn line(&mut self, registers: &Registers) -> Option<u16> {
        if !std::mem::take(&mut self.line_due) {
            return None;
        }
        let line = if self.line < registers.lines { self.line } else { 0 };
        self.line = (line + 1) % registers.lines;
        Some(line)
    }

    /// Whether the totals are sent at the end of this frame.
    pub(super) fn totals(&mut self) -> bool {
        std::mem::take(&mut self.totals_due)
    }
}

/// The totals since reset, in which `markers` of what was dropped were no events. In a datagram the packer replaces the
/// number of datagrams by those before it.
pub(super) fn totals(now: &BoardCounts, at_reset: &BoardCounts, markers: u64) -> BoardTotals {
    let dropped = now.dropped - at_reset.dropped;
    BoardTotals {
        frames: now.frames - at_reset.frames,
        events: now.changes - at_reset.changes + markers - dropped,
        dropped,
        datagrams: now.datagrams - at_reset.datagrams,
        faults: now.not_returned - at_reset.not_returned,
    }
}
