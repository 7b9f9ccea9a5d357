//! Columns that decoders fill.

use std::ops::Range;

use crate::{Events, Marker, Result, problem};

/// Rows of a block: more than a datagram of either version has.
pub(in crate::wire) const BLOCK: usize = 1024;

/// A change whose intensity may be the next word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::wire) struct PendingChange {
    pub(in crate::wire) t: i64,
    pub(in crate::wire) x: u16,
    pub(in crate::wire) y: u16,
    pub(in crate::wire) p: bool,
}

/// Columns that are filled from their first row on.
#[derive(Debug)]
pub struct Columns<'a> {
    pub(in crate::wire) t: &'a mut [i64],
    pub(in crate::wire) x: &'a mut [u16],
    pub(in crate::wire) y: &'a mut [u16],
    pub(in crate::wire) p: &'a mut [u8],
    pub(in crate::wire) ticks: &'a mut [u16],
    pub(in crate::wire) present: &'a mut [u8],
    /// Number of rows filled.
    pub rows: usize,
    /// Whether ticks and presence are filled too; otherwise no event has an intensity.
    pub paired: bool,
    /// Version 1: whether the last row's intensity may be the next word.
    pub(in crate::wire) open: bool,
    repaired: Vec<Range<usize>>,
    /// Starts and stops, in the order of the stream.
    pub markers: Vec<Marker>,
}

impl<'a> Columns<'a> {
    /// Columns without any row filled; polarity and presence are filled with 0 or 1.
    ///
    /// # Errors
    ///
    /// `Problem` if the columns are not equally long.
    pub fn new(t: &'a mut [i64], [x, y, ticks]: [&'a mut [u16]; 3], [p, present]: [&'a mut [u8]; 2]) -> Result<Self> {
        if [x.len(), y.len(), ticks.len(), p.len(), present.len()].iter().any(|&n| n != t.len()) {
            return Err(problem!("columns to fill must be equally long"));
        }
        let (repaired, markers) = (vec![], vec![]);
        Ok(Self { t, x, y, p, ticks, present, rows: 0, paired: false, open: false, repaired, markers })
    }

    /// Number of rows for which there is room.
    #[inline]
    pub(in crate::wire) fn left(&self) -> usize {
        self.t.len() - self.rows
    }

    /// Checks that there is room for the rows that bytes may need.
    ///
    /// # Errors
    ///
    /// `Problem` if a column has fewer entries.
    pub(in crate::wire) fn check_room(&self, bytes: usize, most: usize) -> Result<()> {
        let room = self.left();
        if room < most {
            return Err(problem!("columns have room for {room} rows: {bytes} bytes may need {most} rows"));
        }
        Ok(())
    }

    /// Marks all rows so far as without intensity, before the first one with one.
    #[inline]
    pub(in crate::wire) fn begin_pairs(&mut self) {
        if !self.paired {
            self.ticks[..self.rows].fill(0);
            self.present[..self.rows].fill(0);
            self.paired = true;
        }
    }

    /// Adds a change, whose intensity may be the next word.
    #[inline]
    pub(in crate::wire) fn push(&mut self, change: PendingChange) {
        let k = self.rows;
        (self.t[k], self.x[k], self.y[k], self.p[k]) = (change.t, change.x, change.y, u8::from(change.p));
        (self.rows, self.open) = (k + 1, true);
        if self.paired {
            self.clear_intensity();
        }
    }

    /// Marks the last row as without intensity; there must be a row.
    #[inline]
    pub(in crate::wire) fn clear_intensity(&mut self) {
        (self.ticks[self.rows - 1], self.present[self.rows - 1]) = (0, 0);
    }

    /// Sets the last row's intensity, if it is of the same taxel.
    #[inline]
    pub(in crate::wire) fn pair(&mut self, ticks: u16, x: u16, y: u16) -> bool {
        if self.last_taxel() != (x, y) {
            return false;
        }
        self.begin_pairs();
        (self.ticks[self.rows - 1], self.present[self.rows - 1]) = (ticks, 1);
        true
    }

    /// Column and row of the last row; there must be one.
    #[inline]
    pub(in crate::wire) fn last_taxel(&self) -> (u16, u16) {
        (self.x[self.rows - 1], self.y[self.rows - 1])
    }

    /// Takes back the last row, if its intensity may be the next word.
    pub(in crate::wire) fn take_pending(&mut self) -> Option<PendingChange> {
        if !std::mem::take(&mut self.open) {
            return None;
        }
        self.rows -= 1;
        let k = self.rows;
        Some(PendingChange { t: self.t[k], x: self.x[k], y: self.y[k], p: self.p[k] == 1 })
    }

    /// Notes that the rows from one on were decoded from states.
    pub(in crate::wire) fn mark_repaired(&mut self, first: usize) {
        if first < self.rows {
            self.repaired.push(first..self.rows);
        }
    }

    /// Which rows were decoded from states; none if no row was.
    #[must_use]
    pub fn repaired(&self) -> Option<Vec<bool>> {
        (!self.repaired.is_empty()).then(|| {
            let mut mask = vec![false; self.rows];
            self.repaired.iter().for_each(|rows| mask[rows.clone()].fill(true));
            mask
        })
    }
}

/// A decoder's own columns, from which it appends rows to events; they stay in the processor's cache.
#[derive(Debug, Clone, Default)]
pub(in crate::wire) struct Block {
    t: Vec<i64>,
    x: Vec<u16>,
    y: Vec<u16>,
    p: Vec<u8>,
    ticks: Vec<u16>,
    present: Vec<u8>,
}

impl Block {
    pub(in crate::wire) fn new() -> Self {
        let (x, y, ticks) = (vec![0; BLOCK], vec![0; BLOCK], vec![0; BLOCK]);
        Self { t: vec![0; BLOCK], x, y, p: vec![0; BLOCK], ticks, present: vec![0; BLOCK] }
    }

    /// The columns, without any row filled.
    pub(in crate::wire) fn columns(&mut self) -> Columns<'_> {
        let Self { t, x, y, p, ticks, present } = self;
        let (rows, paired, open, repaired, markers) = (0, false, false, vec![], vec![]);
        Columns { t, x, y, p, ticks, present, rows, paired, open, repaired, markers }
    }
}

impl Events {
    /// Appends the rows of columns, all of which, or none, were decoded from states.
    pub(in crate::wire) fn append_columns(&mut self, columns: &Columns<'_>) {
        let (before, n) = (self.len(), columns.rows);
        if columns.paired {
            self.complete_intensities();
        }
        self.t.extend_from_slice(&columns.t[..n]);
        self.x.extend_from_slice(&columns.x[..n]);
        self.y.extend_from_slice(&columns.y[..n]);
        self.p.extend(columns.p[..n].iter().map(|&p| p == 1));
        if columns.paired {
            if let Some(column) = &mut self.intensity {
                column.ticks.extend_from_slice(&columns.ticks[..n]);
                column.present.extend(columns.present[..n].iter().map(|&present| present == 1));
            }
        } else if self.intensity.is_some() {
            self.complete_intensities();
        }
        self.mark_repaired(before, !columns.repaired.is_empty());
        self.markers.extend_from_slice(&columns.markers);
    }
}
