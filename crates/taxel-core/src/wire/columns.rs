//! Columns that a decoder fills, in place.

use std::mem::MaybeUninit;
use std::ops::Range;

use crate::{Events, Intensities, Marker, Result, problem};

/// Columns to be filled; all equally long, but for `ticks` and `present` where rows have no intensities.
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

    pub(in crate::wire) fn len(&self) -> usize {
        self.t.len()
    }

    /// The room from a row on.
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

    /// Writes "none" for the first rows.
    pub(in crate::wire) fn without_intensities(&mut self, rows: usize) {
        self.ticks[..rows].fill(MaybeUninit::new(0));
        self.present[..rows].fill(MaybeUninit::new(false));
    }
}

/// The same entries, to be written only.
///
/// # Safety
///
/// `U` must have the size and alignment of `T`, and the caller must write valid `U` that are valid `T` too.
unsafe fn open<T, U>(column: &mut [T]) -> &mut [MaybeUninit<U>] {
    // SAFETY: the caller's promise; length and lifetime are the slice's own.
    unsafe { std::slice::from_raw_parts_mut(column.as_mut_ptr().cast(), column.len()) }
}

/// What a decoder wrote into columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Filled {
    /// Rows.
    pub rows: usize,
    /// Whether the columns of intensities were written too; else no event has one.
    pub paired: bool,
}

/// Appends rows to events: `fill` gets room for `most` of them, whether intensities are there already, and the markers.
///
/// # Safety
///
/// `fill` must have written as many rows as it says: t, x, y and p of each, and with `paired` ticks and present too.
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
    assert!(filled.rows <= most, "more rows than there was room for");
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

/// Where version 2 writes the rows of datagrams: columns that grow, or columns that were laid out.
pub(in crate::wire) trait Table {
    /// Takes a start or a stop.
    fn mark(&mut self, marker: Marker);

    /// Whether each row has an intensity, or the mark that it has none.
    fn paired(&self) -> bool;

    /// Takes rows: `fill` gets room, the row from which on there is some for `most` of them, and whether each has an intensity or the mark that it has none, as it
    /// must where they are `valued`; it returns how many it wrote. States gave them where they are `repaired`.
    ///
    /// # Safety
    ///
    /// `fill` must have written as many rows as it says, as [`append`] asks for.
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
    fn paired(&self) -> bool {
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
        if valued || self.paired() {
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
        assert!(rows <= most, "more rows than there was room for");
        // SAFETY: the caller's promise: so many entries were written behind each column's own, into what was reserved.
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

/// Room for so many entries behind a column's own.
#[inline]
fn spare<T>(column: &mut Vec<T>, entries: usize) -> &mut [MaybeUninit<T>] {
    column.reserve(entries);
    &mut column.spare_capacity_mut()[..entries]
}

/// What was written into columns that were laid out, and what stands beside them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Columns {
    /// How far the columns were filled.
    pub filled: Filled,
    /// Which rows states gave; none where no row is of that kind.
    pub repaired: Option<Vec<bool>>,
    /// Starts and stops, as they came.
    pub markers: Vec<Marker>,
}

/// Columns that were laid out, as they fill from their first row on.
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
    fn paired(&self) -> bool {
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
        assert!(rows <= most, "more rows than there was room for");
        self.filled.rows += rows;
        if repaired && rows > 0 {
            self.repaired.push(before..before + rows);
        }
    }
}
