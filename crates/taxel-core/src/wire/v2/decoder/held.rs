//! Each taxel's value, and the time since which it is valid, as far as they are known.

use crate::Array;
use crate::wire::v2::{NEVER, stride};

/// Stored by position on the wire (line << stride | row, with the array's own stride), so that the entries of one line
/// are contiguous.
#[derive(Debug, Clone)]
pub(super) struct ValuesByLine {
    pub(super) columns: u16,
    pub(super) rows: u16,
    /// Bits that name a row.
    pub(super) stride: u8,
    pub(super) values: Vec<u16>,
    /// Time of each value, us; [`NEVER`] if the value is unknown.
    pub(super) since: Vec<i64>,
    /// Upper bound of the entries of `since`.
    pub(super) newest: i64,
    /// Value of a taxel without any event so far: 0 if the session was received from its start.
    pub(super) initial: Option<u16>,
}

/// Time of a value that is known from elsewhere: earlier than anything received.
const BEFORE: i64 = NEVER + 1;

impl ValuesByLine {
    pub(super) fn new(array: &Array) -> Self {
        let stride = stride(array.rows);
        let taxels = usize::from(array.columns) << stride;
        Self {
            columns: array.columns,
            rows: array.rows,
            stride,
            values: vec![0; taxels],
            since: vec![NEVER; taxels],
            newest: NEVER,
            initial: None,
        }
    }

    /// The same array, with all values unknown.
    pub(super) fn blank(&self) -> Self {
        let taxels = self.values.len();
        Self { values: vec![0; taxels], since: vec![NEVER; taxels], newest: NEVER, initial: None, ..*self }
    }

    /// Sets the taxels' values, by index, none if a value is unknown.
    pub(super) fn begin_with(&mut self, held: impl IntoIterator<Item = Option<u16>>) {
        let (rows, columns) = (self.rows, self.columns);
        let positions = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
        for ((x, y), held) in positions.zip(held) {
            if let Some(value) = held {
                self.set(self.index(x, y), value, BEFORE);
            }
        }
    }

    /// Position of a taxel's entries.
    #[inline(always)]
    pub(super) fn index(&self, x: u16, y: u16) -> usize {
        usize::from(x) << self.stride | usize::from(y)
    }

    #[inline(always)]
    pub(super) fn get(&self, index: usize) -> Option<u16> {
        (self.since[index] != NEVER).then_some(self.values[index])
    }

    #[inline(always)]
    pub(super) fn set(&mut self, index: usize, value: u16, t: i64) {
        self.values[index] = value;
        self.since[index] = self.since[index].max(t);
        self.newest = self.newest.max(t);
    }

    /// Discards all values; a taxel without any event from now on has the value `initial`.
    pub(super) fn forget(&mut self, initial: Option<u16>) {
        self.since.fill(NEVER);
        self.newest = NEVER;
        self.initial = initial;
    }

    /// The values by taxel index.
    pub(super) fn by_index(&self) -> Vec<Option<u16>> {
        (0..self.rows).flat_map(|y| (0..self.columns).map(move |x| self.get(self.index(x, y)))).collect()
    }
}
