//! Dense systems that are symmetric and positive definite, as large as an array has lines, with many right-hand sides.
//!
//! Rows are eliminated one after the other, each a few vectors wide that stay in registers: of 64 unknowns that takes a
//! fraction of what libraries made for large systems take. Plain arithmetic, so all machines give the same bits.

use crate::vectors::wide;
use crate::{Result, problem};

/// Columns that are processed together.
const LANES: usize = 32;

type Lanes = [f64; LANES];

/// A matrix, its columns in blocks of [`LANES`], each block row by row. Columns that fill up the last block stay 0.
#[derive(Debug, Clone)]
pub(super) struct Matrix {
    rows: usize,
    lanes: Vec<Lanes>,
}

impl Matrix {
    pub(super) fn zeros(rows: usize, columns: usize) -> Self {
        Self { rows, lanes: vec![[0.0; LANES]; rows * columns.div_ceil(LANES)] }
    }

    pub(super) fn at(&self, row: usize, column: usize) -> f64 {
        self.lanes[column / LANES * self.rows + row][column % LANES]
    }

    pub(super) fn at_mut(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.lanes[column / LANES * self.rows + row][column % LANES]
    }

    /// Writes a row, from its first column on.
    pub(super) fn set_row(&mut self, row: usize, values: &[f64]) {
        for (block, values) in values.chunks(LANES).enumerate() {
            self.lanes[block * self.rows + row][..values.len()].copy_from_slice(values);
        }
    }

    /// Writes a column, from its first row on.
    pub(super) fn set_column(&mut self, column: usize, values: impl Iterator<Item = f64>) {
        let from = column / LANES * self.rows;
        for (lanes, value) in self.lanes[from..from + self.rows].iter_mut().zip(values) {
            lanes[column % LANES] = value;
        }
    }

    /// Reads a row, from its first column on.
    pub(super) fn copy_row(&self, row: usize, values: &mut [f64]) {
        for (block, values) in values.chunks_mut(LANES).enumerate() {
            values.copy_from_slice(&self.lanes[block * self.rows + row][..values.len()]);
        }
    }

    /// Multiplies all of it.
    pub(super) fn scaled(mut self, by: f64) -> Self {
        self.lanes.iter_mut().flatten().for_each(|value| *value *= by);
        self
    }
}

/// `row - sum of factor times other row`, a block wide.
#[inline(always)]
fn subtract_rows(mut row: Lanes, factors: &[f64], others: &[Lanes]) -> Lanes {
    for (factor, row_behind) in factors.iter().zip(others) {
        for lane in 0..LANES {
            row[lane] -= factor * row_behind[lane];
        }
    }
    row
}

wide! {
    /// `out - left right`, in place; `left` row by row.
    pub(super) fn subtract(out: &mut Matrix, left: &[f64], right: &Matrix) {
        let (rows, inner) = (out.rows.max(1), right.rows.max(1));
        for (out, right) in out.lanes.chunks_exact_mut(rows).zip(right.lanes.chunks_exact(inner)) {
            for (row, factors) in out.iter_mut().zip(left.chunks_exact(inner)) {
                *row = subtract_rows(*row, factors, right);
            }
        }
    }
}

wide! {
    /// Factors a matrix, `M = U'U`; gives U' row by row, and the number that each of its rows is multiplied by. False
    /// where M is not positive definite in float64.
    fn eliminate(matrix: &mut Matrix, lower: &mut [f64], inverse: &mut [f64]) -> bool {
        let n = matrix.rows;
        for j in 0..n {
            let factors = &mut lower[j * n..(j + 1) * n];
            let pivot_block = j / LANES;
            for (factor, row) in factors[..j].iter_mut().zip(&matrix.lanes[pivot_block * n..]) {
                *factor = row[j % LANES];
            }
            // The first block that is processed holds the pivot.
            for block in pivot_block..matrix.lanes.len() / n {
                let (above, rest) = matrix.lanes[block * n..].split_at_mut(j);
                rest[0] = subtract_rows(rest[0], &factors[..j], above);
                if block == pivot_block {
                    let pivot = rest[0][j % LANES];
                    if !(pivot > 0.0 && pivot.is_finite()) {
                        return false;
                    }
                    inverse[j] = pivot.sqrt().recip();
                }
                for value in &mut rest[0] {
                    *value *= inverse[j];
                }
            }
        }
        true
    }
}

wide! {
    /// Solves `U'U x = right` in place, for all columns.
    pub(super) fn solve(factored: &FactoredMatrix, right: &mut Matrix) {
        let FactoredMatrix { upper, lower, inverse } = factored;
        let n = upper.rows.max(1);
        let mut factors = vec![0.0; n];
        for right in right.lanes.chunks_exact_mut(n) {
            for i in 0..n {
                let (above, rest) = right.split_at_mut(i);
                rest[0] = subtract_rows(rest[0], &lower[i * n..i * n + i], above);
                for value in &mut rest[0] {
                    *value *= inverse[i];
                }
            }
        }
        for i in (0..n).rev() {
            upper.copy_row(i, &mut factors);
            for right in right.lanes.chunks_exact_mut(n) {
                let (rest, below) = right.split_at_mut(i + 1);
                rest[i] = subtract_rows(rest[i], &factors[i + 1..], below);
                for value in &mut rest[i] {
                    *value *= inverse[i];
                }
            }
        }
    }
}

impl Matrix {
    /// Factors it: it must be symmetric, with as many columns as rows.
    ///
    /// # Errors
    ///
    /// `Problem` where it is not positive definite in float64.
    pub(super) fn factor(mut self) -> Result<FactoredMatrix> {
        let n = self.rows;
        let (mut lower, mut inverse) = (vec![0.0; n * n], vec![0.0; n]);
        if eliminate(&mut self, &mut lower, &mut inverse) {
            Ok(FactoredMatrix { upper: self, lower, inverse })
        } else {
            Err(problem!("the network's conductances differ too much for a solution in float64"))
        }
    }
}

/// A matrix, factored.
#[derive(Debug, Clone)]
pub(super) struct FactoredMatrix {
    upper: Matrix,
    lower: Vec<f64>,
    inverse: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_solved_multiplies_back_whatever_the_size() {
        for (n, columns) in [(1, 1), (5, 3), (31, 33), (32, 32), (64, 65), (70, 1)] {
            let value = |i: usize, k: usize| ((i * 131 + k * 37) % 29) as f64 / 29.0 - 0.5;
            // A'A + n on the diagonal is positive definite.
            let full: Vec<f64> = (0..n * n)
                .map(|at| {
                    let (i, j) = (at / n, at % n);
                    (0..n).map(|k| value(k, i) * value(k, j)).sum::<f64>() + if i == j { 1.0 } else { 0.0 }
                })
                .collect();
            let (mut matrix, mut x) = (Matrix::zeros(n, n), Matrix::zeros(n, columns));
            full.chunks(n).enumerate().for_each(|(i, row)| matrix.set_row(i, row));
            for i in 0..n {
                (0..columns).for_each(|k| *x.at_mut(i, k) = value(i + 3, k));
            }
            let mut left = x.clone();
            solve(&matrix.factor().unwrap(), &mut x);
            subtract(&mut left, &full, &x);
            let worst = (0..n * columns).map(|at| left.at(at / columns, at % columns).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-12, "{n} x {columns}: {worst:e}");
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut matrix = Matrix::zeros(2, 2);
            (*matrix.at_mut(0, 0), *matrix.at_mut(1, 1)) = (1.0, wrong);
            assert!(matrix.factor().is_err(), "{wrong}");
        }
    }
}
