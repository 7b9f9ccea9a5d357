//! Columns as version 1 fills them: an intensity comes behind its change.

use crate::wire::columns::Room;

/// From so many bytes on, rows go to memory past the caches, which they would only fill, and without being read first.
pub(super) const STREAMED: usize = 4 << 20;

/// A change whose intensity may be the next word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Change {
    pub(super) t: i64,
    pub(super) x: u16,
    pub(super) y: u16,
    pub(super) p: bool,
}

/// Columns as they fill: the first `rows` entries of t, x, y, p are written, and with `paired` those of ticks, present.
pub(super) struct Filling<'a> {
    pub(super) room: Room<'a>,
    pub(super) rows: usize,
    pub(super) paired: bool,
    /// The last row's intensity may be the next word.
    pub(super) open: bool,
}

impl Filling<'_> {
    #[inline]
    pub(super) fn change(&mut self, change: Change) {
        let k = self.rows;
        self.room.t[k].write(change.t);
        self.room.x[k].write(change.x);
        self.room.y[k].write(change.y);
        self.room.p[k].write(change.p);
        self.rows = k + 1;
        self.open = true;
        if self.paired {
            self.without_intensity();
        }
    }

    /// Writes "none" for the last row; there must be one.
    #[inline]
    pub(super) fn without_intensity(&mut self) {
        self.room.ticks[self.rows - 1].write(0);
        self.room.present[self.rows - 1].write(false);
    }

    /// Gives the last row its intensity, if it is of that taxel.
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

    /// Writes "none" for the rows so far, before the first intensity.
    #[inline]
    pub(super) fn begin_pairs(&mut self) {
        if !self.paired {
            self.room.without_intensities(self.rows);
            self.paired = true;
        }
    }

    pub(super) fn take_last(&mut self) -> Change {
        self.rows -= 1;
        let k = self.rows;
        let Room { t, x, y, p, .. } = &self.room;
        // SAFETY: the row was written; now it is free again.
        unsafe { Change { t: t[k].assume_init(), x: x[k].assume_init(), y: y[k].assume_init(), p: p[k].assume_init() } }
    }
}
