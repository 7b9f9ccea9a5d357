//! Columns that a decoder fills, in place.

use std::mem::MaybeUninit;

use crate::{Result, problem};

/// A change whose intensity may be the next word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Change {
    pub(super) t: i64,
    pub(super) x: u16,
    pub(super) y: u16,
    pub(super) p: bool,
}

/// Columns to be filled; all equally long.
#[derive(Debug)]
pub struct Room<'a> {
    pub(super) t: &'a mut [MaybeUninit<i64>],
    pub(super) x: &'a mut [MaybeUninit<u16>],
    pub(super) y: &'a mut [MaybeUninit<u16>],
    pub(super) p: &'a mut [MaybeUninit<bool>],
    pub(super) ticks: &'a mut [MaybeUninit<u16>],
    pub(super) present: &'a mut [MaybeUninit<bool>],
}

impl<'a> Room<'a> {
    /// Room in the given columns; polarity and presence become 0 or 1.
    ///
    /// # Errors
    ///
    /// `Problem` where they are not equally long.
    pub fn new(t: &'a mut [i64], [x, y, ticks]: [&'a mut [u16]; 3], [p, present]: [&'a mut [u8]; 2]) -> Result<Self> {
        if [x.len(), y.len(), ticks.len(), p.len(), present.len()].iter().any(|&n| n != t.len()) {
            return Err(problem!("columns to fill must be equally long"));
        }
        // SAFETY: the decoder writes whole values only, never leaves an entry uninitialised, and a bool that it writes
        // is a byte of 0 or 1; sizes and alignments are those of the given types.
        unsafe {
            Ok(Self { t: open(t), x: open(x), y: open(y), p: open(p), ticks: open(ticks), present: open(present) })
        }
    }

    pub(super) fn len(&self) -> usize {
        self.t.len()
    }

    /// The room from a row on.
    pub(super) fn behind(&mut self, row: usize) -> Room<'_> {
        Room {
            t: &mut self.t[row..],
            x: &mut self.x[row..],
            y: &mut self.y[row..],
            p: &mut self.p[row..],
            ticks: &mut self.ticks[row..],
            present: &mut self.present[row..],
        }
    }

    /// Writes "none" for the first rows.
    pub(super) fn without_intensities(&mut self, rows: usize) {
        self.ticks[..rows].fill(MaybeUninit::new(0));
        self.present[..rows].fill(MaybeUninit::new(false));
    }
}

/// The same entries, to be written only.
///
/// # Safety
///
/// `U` must have the size and alignment of `T`, and whoever writes must write valid `U` that are valid `T` too.
unsafe fn open<T, U>(column: &mut [T]) -> &mut [MaybeUninit<U>] {
    // SAFETY: the caller's promise; length and lifetime are the slice's own.
    unsafe { std::slice::from_raw_parts_mut(column.as_mut_ptr().cast(), column.len()) }
}

/// What [`Decoder::fill`](super::Decoder::fill) wrote.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Filled {
    /// Rows.
    pub rows: usize,
    /// Whether the columns of intensities were written too; else no event has one.
    pub paired: bool,
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
        if self.paired {
            self.room.ticks[k].write(0);
            self.room.present[k].write(false);
        }
        self.rows = k + 1;
        self.open = true;
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
