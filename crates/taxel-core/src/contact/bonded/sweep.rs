//! Pressures on few cells: projected Gauss-Seidel sweeps with the influence between each two cells.

use super::cell::Cell;
use crate::vectors::wide;
use crate::{Result, Stop};

/// Over-relaxation of a sweep.
const RELAXATION: f64 = 1.2;
/// Neighbouring cells of one row.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellRun {
    pub first: usize,
    pub count: usize,
    pub x: usize,
    pub y: usize,
}

impl CellRun {
    /// The runs of cells that are ordered by rows, then columns.
    fn find(cells: &[Cell], runs: &mut Vec<Self>) {
        runs.clear();
        for (k, cell) in cells.iter().enumerate() {
            let (x, y) = (cell.x as usize, cell.y as usize);
            match runs.last_mut() {
                Some(run) if run.y == y && run.x + run.count == x => run.count += 1,
                _ => runs.push(Self { first: k, count: 1, x, y }),
            }
        }
    }
}

/// The vectors of a solution, whose memory is used again by the next one.
#[derive(Debug, Default)]
pub(super) struct Sweep {
    pushed: Vec<f64>,
    runs: Vec<CellRun>,
}

impl Sweep {
    /// Sweeps over the cells until no pressure moves by more than `tolerance` of the largest, or `turns` are over.
    /// `wanted` is how far each face must give way, mm; `pressure`, MPa, holds the start, then the result.
    ///
    /// # Errors
    ///
    /// `Interrupted`.
    pub fn solve(
        &mut self,
        grid: Influence<'_>,
        cells: &[Cell],
        wanted: &[f64],
        pressure: &mut [f64],
        (turns, tolerance): (usize, f64),
        stop: Stop<'_>,
    ) -> Result<()> {
        let Self { pushed, runs } = self;
        CellRun::find(cells, runs);
        pushed.clear();
        pushed.resize(cells.len(), 0.0);
        for (cell, pressure) in cells.iter().zip(pressure.iter()) {
            if *pressure > 0.0 {
                grid.push(pushed, runs, *cell, *pressure);
            }
        }
        for _ in 0..turns {
            stop.check()?;
            let (moved, largest) = turn(grid, cells, runs, wanted, pressure, pushed);
            if moved <= tolerance * largest {
                break;
            }
        }
        Ok(())
    }
}

/// How far pressure on one cell moves the faces of the others.
#[derive(Clone, Copy)]
pub(super) struct Influence<'a> {
    /// Displacement of a cell's face for 1 MPa on another one, mm: by rows and columns between them.
    pub table: &'a [f64],
    pub rows: usize,
    pub columns: usize,
}

impl Influence<'_> {
    #[inline(always)]
    fn row(&self, run: CellRun, cell: Cell) -> &[f64] {
        let (down, across) = (self.rows - 1 + run.y - cell.y as usize, self.columns - 1 + run.x - cell.x as usize);
        let from = down * (2 * self.columns - 1) + across;
        &self.table[from..from + run.count]
    }

    #[inline(always)]
    pub fn push(&self, pushed: &mut [f64], runs: &[CellRun], cell: Cell, by: f64) {
        for run in runs {
            let row = self.row(*run, cell);
            for (pushed, influence) in pushed[run.first..run.first + run.count].iter_mut().zip(row) {
                *pushed += by * influence;
            }
        }
    }
}

wide! {
    /// One sweep; how far the pressure moved that moved most, and the largest.
    fn turn(grid: Influence<'_>, cells: &[Cell], runs: &[CellRun], wanted: &[f64], pressure: &mut [f64], pushed: &mut [f64]) -> (f64, f64) {
        let self_influence = grid.table[grid.table.len() / 2];
        let (mut moved, mut largest) = (0.0_f64, 0.0_f64);
        for k in 0..cells.len() {
            let before = pressure[k];
            let after = (before - RELAXATION * (pushed[k] - wanted[k]) / self_influence).max(0.0);
            if after != before {
                pressure[k] = after;
                grid.push(pushed, runs, cells[k], after - before);
                moved = moved.max((after - before).abs());
            }
            largest = largest.max(after);
        }
        (moved, largest)
    }
}
