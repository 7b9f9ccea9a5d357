//! What each taxel holds, and since when, as far as it is known.

use crate::Array;
use crate::wire::v2::{NEVER, stride};

/// Laid out as the wire names places (position = line << stride | row, with the array's own stride), so that a line is
/// written as it comes.
#[derive(Debug, Clone)]
pub(super) struct Held {
    pub(super) columns: u16,
    pub(super) rows: u16,
    /// Bits that name a row.
    pub(super) stride: u8,
    pub(super) values: Vec<u16>,
    /// us; [`NEVER`] where nothing is known.
    pub(super) since: Vec<i64>,
    /// No entry of `since` is later.
    pub(super) newest: i64,
    /// What a taxel holds of which nothing was received: 0 where the session was received from its start.
    pub(super) unheard: Option<u16>,
}

/// Of what is known from elsewhere: before anything that is received.
const BEFORE: i64 = NEVER + 1;

impl Held {
    pub(super) fn new(array: &Array) -> Self {
        let stride = stride(array.rows);
        let places = usize::from(array.columns) << stride;
        Self {
            columns: array.columns,
            rows: array.rows,
            stride,
            values: vec![0; places],
            since: vec![NEVER; places],
            newest: NEVER,
            unheard: None,
        }
    }

    /// The same array, of whose taxels nothing is known.
    pub(super) fn blank(&self) -> Self {
        let places = self.values.len();
        Self { values: vec![0; places], since: vec![NEVER; places], newest: NEVER, unheard: None, ..*self }
    }

    /// Says what taxels hold, by index, none where that is not known.
    pub(super) fn begin_with(&mut self, held: impl IntoIterator<Item = Option<u16>>) {
        let (rows, columns) = (self.rows, self.columns);
        let places = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
        for ((x, y), held) in places.zip(held) {
            if let Some(value) = held {
                self.set(self.place(x, y), value, BEFORE);
            }
        }
    }

    /// Where a taxel's entries lie.
    #[inline(always)]
    pub(super) fn place(&self, x: u16, y: u16) -> usize {
        usize::from(x) << self.stride | usize::from(y)
    }

    #[inline(always)]
    pub(super) fn get(&self, place: usize) -> Option<u16> {
        (self.since[place] != NEVER).then_some(self.values[place])
    }

    #[inline(always)]
    pub(super) fn set(&mut self, place: usize, value: u16, t: i64) {
        self.values[place] = value;
        self.since[place] = self.since[place].max(t);
        self.newest = self.newest.max(t);
    }

    /// What was held holds no more; `unheard` as the field.
    pub(super) fn forget(&mut self, unheard: Option<u16>) {
        self.since.fill(NEVER);
        self.newest = NEVER;
        self.unheard = unheard;
    }

    /// By taxel index.
    pub(super) fn by_index(&self) -> Vec<Option<u16>> {
        (0..self.rows).flat_map(|y| (0..self.columns).map(move |x| self.get(self.place(x, y)))).collect()
    }
}
