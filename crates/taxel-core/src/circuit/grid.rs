//! The network of rows, columns and taxels, solved exactly.
//!
//! `sense_ohm` connects a sense line to its source, `drive_ohm` a driven line to its switch; every crossing conducts.
//! Solved for is the current `I` that each sense line gives into the network while one driven line is read, with all
//! voltages counted from that of the idle lines. The driven lines' voltages fall out, and with
//! `K = diag(sum of a row of G) - G W G'`, `W = diag(w)`, `w = r / (1 + r b)`, `r` the drive resistance and `b` the sums
//! of G's columns:
//!
//! `(1 + s K) I = K u - v / (1 + r b_j) G_j`, `s` the sense resistance, `u` the sources, `v` on the driven line j.
//!
//! That is symmetric, positive definite and as large as there are rows; ideal lines (0 ohm) are no special case, and
//! small currents are no differences of large ones.

use super::dense::{Matrix, solve, subtract};
use crate::{Result, problem};

/// A network's lines; driven lines that are not read are held at one voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossbar {
    /// Sense lines.
    pub rows: usize,
    /// Driven lines.
    pub columns: usize,
    /// From a sense line's source to its crossings, ohm.
    pub sense_ohm: f64,
    /// From a driven line's switch, on, to its crossings, ohm.
    pub drive_ohm: f64,
}

impl Crossbar {
    /// The current out of each sense line while each driven line is read, uA, `[row * columns + column]`.
    ///
    /// `conductance_us` is as long and in the same order; `drive_v` is the read line's voltage and `sense_v` each sense
    /// line's source, both above the idle lines'. Time: of 64 x 64 some 50 us.
    ///
    /// # Errors
    ///
    /// `Problem` where a conductance is below 0 or not finite, or there is not one a crossing.
    pub fn currents_ua(&self, conductance_us: &[f64], drive_v: f64, sense_v: &[f64]) -> Result<Vec<f64>> {
        let (n, m) = (self.rows, self.columns);
        if conductance_us.len() != n * m {
            let count = conductance_us.len();
            return Err(problem!("conductance: {count} values; must be {n} x {m}"));
        }
        if let Some(k) = conductance_us.iter().position(|g| !(0.0..=1e9).contains(g)) {
            let (x, y, g) = (k % m, k / m, conductance_us[k]);
            return Err(problem!("conductance at row {y}, column {x} is {g} uS: must be from 0 to 1e9"));
        }
        let siemens = conductance_us.iter().map(|g| 1e-6 * g).collect();
        let mut currents = self.currents_a(siemens, drive_v, sense_v)?;
        currents.iter_mut().for_each(|current| *current *= 1e6);
        Ok(currents)
    }

    fn currents_a(&self, mut g: Vec<f64>, drive_v: f64, sense_v: &[f64]) -> Result<Vec<f64>> {
        let (n, m, r) = (self.rows, self.columns, self.drive_ohm);
        let (mut by_row, mut by_column, mut of_sources) = (vec![0.0; n], vec![0.0; m], vec![0.0; m]);
        let mut turned = Matrix::zeros(m, n);
        // Columns of G, and behind them K u.
        let mut solved = Matrix::zeros(n, m + 1);
        for (i, row) in g.chunks_exact(m.max(1)).enumerate() {
            for (k, &g) in row.iter().enumerate() {
                by_row[i] += g;
                by_column[k] += g;
                of_sources[k] += g * sense_v[i];
            }
            turned.set_column(i, row.iter().copied());
            solved.set_row(i, row);
        }
        // G W, in the place of G.
        for (i, row) in g.chunks_exact_mut(m.max(1)).enumerate() {
            let mut back = 0.0;
            for (k, g) in row.iter_mut().enumerate() {
                *g *= r / (1.0 + r * by_column[k]);
                back += *g * of_sources[k];
            }
            *solved.at_mut(i, m) = by_row[i] * sense_v[i] - back;
        }
        if self.sense_ohm > 0.0 {
            let mut matrix = Matrix::zeros(n, n);
            subtract(&mut matrix, &g, &turned);
            (0..n).for_each(|i| *matrix.at_mut(i, i) += by_row[i]);
            let mut matrix = matrix.scaled(self.sense_ohm);
            (0..n).for_each(|i| *matrix.at_mut(i, i) += 1.0);
            solve(&matrix.factor()?, &mut solved);
        }
        let mut currents = vec![0.0; n * m];
        for (i, row) in currents.chunks_exact_mut(m.max(1)).enumerate() {
            solved.copy_row(i, row);
            let rest = solved.at(i, m);
            for (current, column) in row.iter_mut().zip(&by_column) {
                *current = rest - *current * drive_v / (1.0 + r * column);
            }
        }
        Ok(currents)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(sense_ohm: f64, drive_ohm: f64) -> Crossbar {
        Crossbar { rows: 2, columns: 2, sense_ohm, drive_ohm }
    }

    fn currents(grid: &Crossbar, g: &[f64], sense_v: &[f64]) -> Vec<f64> {
        grid.currents_ua(g, -1.0, sense_v).unwrap()
    }

    #[test]
    fn ideal_lines_give_each_taxel_its_own_current() {
        let g = [1.0, 20.0, 300.0, 0.0];
        let ideal = currents(&grid(0.0, 0.0), &g, &[0.0, 0.0]);
        assert_eq!(ideal, [1.0, 20.0, 300.0, 0.0]);
    }

    #[test]
    fn a_taxel_by_itself_is_in_series_with_its_lines() {
        let got = currents(&grid(70.0, 30.0), &[0.0, 500.0, 0.0, 0.0], &[0.0, 0.0]);
        let wanted = 1e6 / (70.0 + 30.0 + 2000.0);
        assert!((got[1] - wanted).abs() < 1e-9 * wanted, "{got:?} {wanted}");
        assert!([0, 2, 3].iter().all(|&k| got[k].abs() < 1e-9));
    }

    #[test]
    fn a_crossing_that_conducts_nonsense_is_named() {
        for wrong in [-1.0, f64::NAN, f64::INFINITY] {
            let error = grid(0.0, 0.0).currents_ua(&[0.0, 0.0, 0.0, wrong], 1.0, &[0.0; 2]);
            assert!(error.unwrap_err().to_string().contains("row 1, column 1"), "{wrong}");
        }
    }
}
