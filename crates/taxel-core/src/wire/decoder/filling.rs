//! Columns that version 1 fills, with each intensity in the row of its change.

use crate::wire::columns::Room;

/// A change whose intensity may be the next word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PendingChange {
    pub(super) t: i64,
    pub(super) x: u16,
    pub(super) y: u16,
    pub(super) p: bool,
}

/// Columns being filled: the first `rows` entries of t, x, y, p are written, and with `paired` those of ticks and
/// present.
pub(super) struct FilledColumns<'a> {
    pub(super) room: Room<'a>,
    pub(super) rows: usize,
    pub(super) paired: bool,
    /// The last row's intensity may be the next word.
    pub(super) open: bool,
}

impl FilledColumns<'_> {
    #[inline]
    pub(super) fn change(&mut self, change: PendingChange) {
        let k = self.rows;
        self.room.t[k].write(change.t);
        self.room.x[k].write(change.x);
        self.room.y[k].write(change.y);
        self.room.p[k].write(change.p);
        self.rows = k + 1;
        self.open = true;
        if self.paired {
            self.clear_intensity();
        }
    }

    /// Marks the last row as without intensity; there must be a row.
    #[inline]
    pub(super) fn clear_intensity(&mut self) {
        self.room.ticks[self.rows - 1].write(0);
        self.room.present[self.rows - 1].write(false);
    }

    /// Sets the last row's intensity, if it is of the same taxel.
    #[inline]
    pub(super) fn pair(&mut self, ticks: u16, x: u16, y: u16) -> bool {
        if self.last_taxel() != (x, y) {
            return false;
        }
        self.begin_pairs();
        let k = self.rows - 1;
        self.room.ticks[k].write(ticks);
        self.room.present[k].write(true);
        true
    }

    /// Column and row of the last row; there must be one.
    #[inline]
    pub(super) fn last_taxel(&self) -> (u16, u16) {
        let k = self.rows - 1;
        // SAFETY: rows below `rows` are written.
        unsafe { (self.room.x[k].assume_init(), self.room.y[k].assume_init()) }
    }

    /// Marks all rows so far as without intensity; called before the first intensity.
    #[inline]
    pub(super) fn begin_pairs(&mut self) {
        if !self.paired {
            self.room.without_intensities(self.rows);
            self.paired = true;
        }
    }

    pub(super) fn take_last(&mut self) -> PendingChange {
        self.rows -= 1;
        let k = self.rows;
        let Room { t, x, y, p, .. } = &self.room;
        // SAFETY: the row was written; its entries may be overwritten from here on.
        unsafe {
            PendingChange { t: t[k].assume_init(), x: x[k].assume_init(), y: y[k].assume_init(), p: p[k].assume_init() }
        }
    }
}
