//! The part of each cell's pressure that arrives at the taxels below.

use super::cell::Cell;
use crate::vectors::wide;

/// How a cell's pressure spreads over the taxels below; reach and margin in taxels.
#[derive(Clone, Copy)]
pub(super) struct PressureSpread<'a> {
    pub table: &'a [f32],
    pub per_pitch: usize,
    pub reach: usize,
    pub margin: usize,
    pub array: (usize, usize),
}

wide! {
    /// Adds what a cell's pressure gives to each taxel.
    pub(super) fn spread_pressure(spread: PressureSpread<'_>, out: &mut [f32], cell: Cell, pressure: f32) {
        let ((rows, columns), n) = (spread.array, spread.per_pitch);
        let side = 2 * spread.reach + 1;
        // The cell's taxel, and which of its cells it is. Taxel (x, y) of the array is (x + margin, y + margin); a table's
        // first entry is `reach` before the cell's own.
        let (own_x, own_y) = (cell.x as usize / n, cell.y as usize / n);
        let cell_number = cell.y as usize % n * n + cell.x as usize % n;
        let table = &spread.table[cell_number * side * side..(cell_number + 1) * side * side];
        let span = |at: usize, count: usize| {
            let first = at.saturating_sub(spread.margin + spread.reach);
            let last = (at + spread.reach + 1).saturating_sub(spread.margin).min(count);
            (first, last)
        };
        let (left, right) = span(own_x, columns);
        let (top, bottom) = span(own_y, rows);
        if left >= right {
            return;
        }
        for y in top..bottom {
            let down = y + spread.margin + spread.reach - own_y;
            let across = left + spread.margin + spread.reach - own_x;
            let from = down * side + across;
            let row = &table[from..from + right - left];
            for (stress, share) in out[y * columns + left..y * columns + right].iter_mut().zip(row) {
                *stress += pressure * share;
            }
        }
    }
}
