//! Columns that a decoder fills, in place.

use std::mem::MaybeUninit;
use std::ops::Range;

use crate::{Events, Intensities, Marker, Result, problem};

/// Columns that a decoder fills, all equally long; `ticks` and `present` may be empty if no row has an intensity.
#[derive(Debug)]
pub struct Room<'a> {
    pub(in crate::wire) t: &'a mut [MaybeUninit<i64>],
    pub(in crate::wire) x: &'a mut [MaybeUninit<u16>],
    pub(in crate::wire) y: &'a mut [MaybeUninit<u16>],
    pub(in crate::wire) p: &'a mut [MaybeUninit<bool>],
    pub(in crate::wire) ticks: &'a mut [MaybeUninit<u16>],
    pub(in crate::wire) present: &'a mut [MaybeUninit<bool>],
}

impl<'a> Room<'a> {
    /// Views the given columns as unfilled; the decoder writes polarity and presence as 0 or 1.
    ///
    /// # Errors
    ///
    /// `Problem` if the columns are not equally long.
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

    pub(in crate::wire) fn len(&self) -> usize {
        self.t.len()
    }

    /// The part of the columns from a row on.
    pub(in crate::wire) fn behind(&mut self, row: usize) -> Room<'_> {
        Room {
            t: &mut self.t[row..],
            x: &mut self.x[row..],
            y: &mut self.y[row..],
            p: &mut self.p[row..],
            ticks: &mut self.ticks[row..],
            present: &mut self.present[row..],
        }
    }

    /// Marks the first rows as without intensity.
    pub(in crate::wire) fn without_intensities(&mut self, rows: usize) {
        self.ticks[..rows].fill(MaybeUninit::new(0));
        self.present[..rows].fill(MaybeUninit::new(false));
    }
}

/// Views the same entries as uninitialised, for writing only.
///
/// # Safety
///
/// `U` must have the size and alignment of `T`, and the caller must write valid `U` that are valid `T` too.
unsafe fn open<T, U>(column: &mut [T]) -> &mut [MaybeUninit<U>] {
    // SAFETY: the caller guarantees this; length and lifetime are the slice's own.
    unsafe { std::slice::from_raw_parts_mut(column.as_mut_ptr().cast(), column.len()) }
}

/// How much of the columns a decoder wrote.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Filled {
    /// Number of rows written.
    pub rows: usize,
    /// Whether the columns of intensities were written too; otherwise no event has an intensity.
    pub paired: bool,
}

/// Appends rows to events: `fill` gets room for `most` rows, whether the events have intensities so far, and the
/// markers.
///
/// # Safety
///
/// `fill` must have written the number of rows that it returns: t, x, y and p of each, and with `paired` ticks and
/// present too.
#[inline]
pub(in crate::wire) unsafe fn append(
    out: &mut Events,
    most: usize,
    fill: impl FnOnce(Room<'_>, bool, &mut Vec<Marker>) -> Filled,
) {
    let before = out.len();
    let paired = out.intensity.is_some();
    let mut intensity = out.intensity.take().unwrap_or_default();
    let rows_to_come = before + most - intensity.ticks.len();
    out.t.reserve(most);
    out.x.reserve(most);
    out.y.reserve(most);
    out.p.reserve(most);
    intensity.ticks.reserve(rows_to_come);
    intensity.present.reserve(rows_to_come);
    let skip = before - intensity.ticks.len();
    let room = Room {
        t: &mut out.t.spare_capacity_mut()[..most],
        x: &mut out.x.spare_capacity_mut()[..most],
        y: &mut out.y.spare_capacity_mut()[..most],
        p: &mut out.p.spare_capacity_mut()[..most],
        ticks: &mut intensity.ticks.spare_capacity_mut()[skip..skip + most],
        present: &mut intensity.present.spare_capacity_mut()[skip..skip + most],
    };
    let filled = fill(room, paired, &mut out.markers);
    assert!(filled.rows <= most, "more rows than the columns have room for");
    let after = before + filled.rows;
    // SAFETY: the caller has written the first `rows` entries of t, x, y and p, which begin at `before`, and the capacity
    // was reserved above.
    unsafe {
        out.t.set_len(after);
        out.x.set_len(after);
        out.y.set_len(after);
        out.p.set_len(after);
    }
    if filled.paired {
        intensity.ticks.resize(before, 0);
        intensity.present.resize(before, false);
        // SAFETY: as above; with `paired`, the caller has written the first `rows` entries of ticks and present too.
        unsafe {
            intensity.ticks.set_len(after);
            intensity.present.set_len(after);
        }
        out.intensity = Some(intensity);
    }
}

/// The destination of the rows that version 2 decodes: columns that grow, or columns that the caller allocated.
pub(in crate::wire) trait Table {
    /// Appends a start or a stop marker.
    fn mark(&mut self, marker: Marker);

    /// Whether the intensity columns (ticks and present) are written for each row.
    fn writes_intensity(&self) -> bool;

    /// Appends rows: `fill` gets the room, the index of the first free row (at least `most` rows follow) and whether it
    /// must write the intensity columns, which it must if the rows are `valued`; it returns the number of rows that it
    /// wrote. Rows decoded from states are marked as `repaired`.
    ///
    /// # Safety
    ///
    /// `fill` must have written the number of rows that it returns, as [`append`] requires.
    unsafe fn rows(
        &mut self,
        most: usize,
        valued: bool,
        repaired: bool,
        fill: impl FnOnce(&mut Room<'_>, usize, bool) -> usize,
    );
}

impl Table for Events {
    fn mark(&mut self, marker: Marker) {
        self.markers.push(marker);
    }

    #[inline]
    fn writes_intensity(&self) -> bool {
        self.intensity.is_some()
    }

    #[inline]
    unsafe fn rows(
        &mut self,
        most: usize,
        valued: bool,
        repaired: bool,
        fill: impl FnOnce(&mut Room<'_>, usize, bool) -> usize,
    ) {
        if valued || self.writes_intensity() {
            self.complete_intensities();
        }
        let before = self.len();
        let Self { t, x, y, p, intensity, .. } = self;
        let paired = intensity.is_some();
        let mut none = Intensities::default();
        let Intensities { ticks, present } = intensity.as_mut().unwrap_or(&mut none);
        let valued = if paired { most } else { 0 };
        let mut room = Room {
            t: spare(t, most),
            x: spare(x, most),
            y: spare(y, most),
            p: spare(p, most),
            ticks: spare(ticks, valued),
            present: spare(present, valued),
        };
        let rows = fill(&mut room, 0, paired);
        assert!(rows <= most, "more rows than the columns have room for");
        // SAFETY: the caller guarantees that `fill` wrote this many entries after the end of each column, into reserved
        // capacity.
        unsafe {
            t.set_len(t.len() + rows);
            x.set_len(x.len() + rows);
            y.set_len(y.len() + rows);
            p.set_len(p.len() + rows);
            if paired {
                ticks.set_len(ticks.len() + rows);
                present.set_len(present.len() + rows);
            }
        }
        self.mark_repaired(before, repaired);
    }
}

/// The spare capacity of a column, as this many entries after its end.
#[inline]
fn spare<T>(column: &mut Vec<T>, entries: usize) -> &mut [MaybeUninit<T>] {
    column.reserve(entries);
    &mut column.spare_capacity_mut()[..entries]
}

/// What was written into columns that the caller allocated, and the markers found with it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Columns {
    /// How far the columns were filled.
    pub filled: Filled,
    /// Which rows were decoded from states; none if no row was.
    pub repaired: Option<Vec<bool>>,
    /// Starts and stops, in the order of the stream.
    pub markers: Vec<Marker>,
}

/// Columns that the caller allocated, filled from their first row on.
pub(in crate::wire) struct Laid<'a> {
    room: Room<'a>,
    filled: Filled,
    repaired: Vec<Range<usize>>,
    markers: Vec<Marker>,
}

impl<'a> Laid<'a> {
    pub(in crate::wire) fn new(room: Room<'a>) -> Self {
        Self { room, filled: Filled { rows: 0, paired: false }, repaired: vec![], markers: vec![] }
    }

    /// What was written.
    pub(in crate::wire) fn end(self) -> Columns {
        let repaired = (!self.repaired.is_empty()).then(|| {
            let mut mask = vec![false; self.filled.rows];
            self.repaired.into_iter().for_each(|rows| mask[rows].fill(true));
            mask
        });
        Columns { filled: self.filled, repaired, markers: self.markers }
    }
}

impl Table for Laid<'_> {
    fn mark(&mut self, marker: Marker) {
        self.markers.push(marker);
    }

    #[inline]
    fn writes_intensity(&self) -> bool {
        self.filled.paired
    }

    #[inline]
    unsafe fn rows(
        &mut self,
        most: usize,
        valued: bool,
        repaired: bool,
        fill: impl FnOnce(&mut Room<'_>, usize, bool) -> usize,
    ) {
        let before = self.filled.rows;
        if valued && !self.filled.paired {
            self.room.without_intensities(before);
            self.filled.paired = true;
        }
        let rows = fill(&mut self.room, before, self.filled.paired);
        assert!(rows <= most, "more rows than the columns have room for");
        self.filled.rows += rows;
        if repaired && rows > 0 {
            self.repaired.push(before..before + rows);
        }
    }
}
