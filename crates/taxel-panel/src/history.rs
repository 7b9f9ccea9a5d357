//! The values of one taxel over time: its least, greatest and last value in each column of time.

use std::collections::VecDeque;

use crate::columns::{SPAN, column_of};
use taxel_core::held::UNKNOWN;
use taxel_live::pipeline::TaxelChange;

/// Least, greatest and last value of one taxel in each column of time.
#[derive(Debug, Clone)]
pub struct TaxelHistory {
    /// Index of the taxel.
    pub taxel: u32,
    column_us: i64,
    /// Column in which the history begins and the value held then; nothing is known before.
    first: (i64, u16),
    last: u16,
    columns: VecDeque<(i64, [u16; 3])>,
}

impl TaxelHistory {
    /// Begins the history of a taxel that holds `held` at time `since` (us; `None`: before the first event).
    pub fn new(taxel: u32, held: u16, since: Option<i64>, column_us: i64) -> Self {
        let first = since.map_or(i64::MIN, |t| column_of(t, column_us));
        Self { taxel, column_us, first: (first, held), last: held, columns: VecDeque::new() }
    }

    /// Applies the next changes; those of other taxels are ignored.
    pub fn push(&mut self, changes: &[TaxelChange]) {
        let taxel = self.taxel;
        let own = changes.iter().filter(|change| change.taxel == taxel && change.ticks != UNKNOWN);
        own.for_each(|change| self.extend(change.t, [change.ticks; 3]));
    }

    /// Applies changes that are all in the column of `t` us, of which these are the least, the greatest and the last value.
    pub(crate) fn extend(&mut self, t: i64, [least, greatest, last]: [u16; 3]) {
        let column = column_of(t, self.column_us);
        let before = std::mem::replace(&mut self.last, last);
        match self.columns.back_mut() {
            Some((there, all)) if *there >= column => *all = [all[0].min(least), all[1].max(greatest), last],
            _ if before == UNKNOWN => self.columns.push_back((column, [least, greatest, last])),
            _ => self.columns.push_back((column, [before.min(least), before.max(greatest), last])),
        }
        while self.columns.len() > 1 && self.columns[1].0 <= column - SPAN {
            if let Some((gone, [_, _, last])) = self.columns.pop_front() {
                self.first = (gone, last);
            }
        }
    }

    /// Appends least, greatest and last value of these columns; [`UNKNOWN`] before the history begins.
    pub fn write(&self, columns: std::ops::Range<i64>, out: &mut Vec<u8>) {
        let mut index = self.columns.partition_point(|(column, _)| *column < columns.start);
        let (since, held) = self.first;
        let mut last = if index == 0 { held } else { self.columns[index - 1].1[2] };
        for column in columns {
            if column < since {
                out.extend_from_slice(&[0xFF; 6]);
                continue;
            }
            let three = match self.columns.get(index) {
                Some((there, three)) if *there == column => {
                    index += 1;
                    *three
                }
                _ => [last; 3],
            };
            last = three[2];
            three.iter().for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::columns::COLUMN_US;

    fn change(t: i64, taxel: u32, ticks: u16) -> TaxelChange {
        TaxelChange { t, taxel, ticks, up: true, repaired: false }
    }

    #[test]
    fn a_history_has_every_extreme_and_goes_on_through_silence() {
        let mut history = TaxelHistory::new(1, 40, Some(-4000), COLUMN_US);
        for (t, ticks) in [(0, 50), (1000, 20), (2000, 45), (12_000, 60)] {
            history.push(&[change(t, 1, ticks), change(t, 0, 999)]);
        }
        let mut bytes = vec![];
        history.write(-2..5, &mut bytes);
        let values: Vec<u16> = bytes.chunks(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
        let expected =
            [[UNKNOWN; 3], [40, 40, 40], [20, 50, 45], [45, 45, 45], [45, 45, 45], [45, 60, 60], [60, 60, 60]];
        assert_eq!(values, expected.concat());
    }
}
