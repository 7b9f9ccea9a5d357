//! The network of rows, columns and taxels, solved exactly.
//!
//! `sense_ohm` connects a sense line to its source, `drive_ohm` a driven line to its switch; every crossing conducts.
//! Solved for is the current `I` that each sense line gives into the network while one driven line is read, with all
//! voltages counted from that of the idle lines. Without wire resistance the driven lines' voltages fall out, and with
//! `K = diag(sum of a row of G) - G W G'`, `W = diag(w)`, `w = r / (1 + r b)`, `r` the drive resistance and `b` the sums
//! of G's columns:
//!
//! `(1 + s K) I = K u - v / (1 + r b_j) G_j`, `s` the sense resistance, `u` the sources, `v` on the driven line j.
//!
//! That is symmetric, positive definite and as large as there are rows; ideal lines (0 ohm) are no special case, and
//! small currents are no differences of large ones. With wire resistance each crossing has two voltages of its own, and
//! the sparse system of all of them is factored.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, MatMut, Par, Side};

use super::dense::{Matrix, too_far_apart};
use crate::{Result, Stop, problem};

/// A network's lines; driven lines that are not read are held at one voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossbar {
    /// Sense lines.
    pub rows: usize,
    /// Driven lines.
    pub columns: usize,
    /// From a sense line's source to its first crossing, ohm.
    pub sense_ohm: f64,
    /// From a driven line's switch, on, to its first crossing, ohm.
    pub drive_ohm: f64,
    /// Resistance of a line from one crossing to the next, and from its end to the first, ohm; 0, or 0.001 or more.
    pub wire_ohm: f64,
}

/// The least wire resistance above 0: with less the system is too badly conditioned.
pub const LEAST_WIRE_OHM: f64 = 1e-3;

impl Crossbar {
    /// The current out of each sense line while each driven line is read, uA, `[row * columns + column]`.
    ///
    /// `conductance_us` is as long and in the same order; `drive_v` is the read line's voltage and `sense_v` each sense
    /// line's source, both above the idle lines'. Time: of 64 x 64 some 50 us without wire resistance, 14 ms with it.
    ///
    /// # Errors
    ///
    /// `Problem` where a conductance is below 0 or not finite, or there is not one a crossing; `Interrupted`.
    pub fn currents_ua(
        &self,
        conductance_us: &[f64],
        drive_v: f64,
        sense_v: &[f64],
        stop: Stop<'_>,
    ) -> Result<Vec<f64>> {
        let (n, m) = (self.rows, self.columns);
        if conductance_us.len() != n * m {
            let count = conductance_us.len();
            return Err(problem!("conductance: {count} values; must be {n} x {m}"));
        }
        if let Some(k) = conductance_us.iter().position(|g| !(0.0..=1e9).contains(g)) {
            let (x, y, g) = (k % m, k / m, conductance_us[k]);
            return Err(problem!("conductance at row {y}, column {x} is {g} uS: must be from 0 to 1e9"));
        }
        let siemens: Vec<f64> = conductance_us.iter().map(|g| 1e-6 * g).collect();
        let mut currents = if self.wire_ohm > 0.0 {
            self.with_wires(&siemens, drive_v, sense_v, stop)?
        } else {
            self.currents_of_ideal_lines(siemens, drive_v, sense_v)?
        };
        currents.iter_mut().for_each(|current| *current *= 1e6);
        Ok(currents)
    }

    fn currents_of_ideal_lines(&self, mut g: Vec<f64>, drive_v: f64, sense_v: &[f64]) -> Result<Vec<f64>> {
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
            matrix.subtract(&g, &turned);
            (0..n).for_each(|i| *matrix.at_mut(i, i) += by_row[i]);
            let mut matrix = matrix.scaled(self.sense_ohm);
            (0..n).for_each(|i| *matrix.at_mut(i, i) += 1.0);
            matrix.factor()?.solve(&mut solved);
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

    /// Unknowns: the sense lines' voltages at the crossings, then the driven lines'; ends at row 0 and column 0.
    fn with_wires(&self, g: &[f64], drive_v: f64, sense_v: &[f64], stop: Stop<'_>) -> Result<Vec<f64>> {
        let (n, m) = (self.rows, self.columns);
        let (sense, driven) = (|i: usize, k: usize| i * m + k, |i: usize, k: usize| n * m + i * m + k);
        let wire = self.wire_ohm.recip();
        let (sense_end, driven_end) =
            ((self.sense_ohm + self.wire_ohm).recip(), (self.drive_ohm + self.wire_ohm).recip());
        let mut entries = Vec::with_capacity(9 * n * m);
        let mut tie = |a: usize, b: usize, conductance: f64| {
            entries.push(Triplet::new(a, a, conductance));
            entries.push(Triplet::new(b, b, conductance));
            entries.push(Triplet::new(a.max(b), a.min(b), -conductance));
        };
        for i in 0..n {
            for k in 0..m {
                tie(sense(i, k), driven(i, k), g[sense(i, k)]);
                if k > 0 {
                    tie(sense(i, k - 1), sense(i, k), wire);
                }
                if i > 0 {
                    tie(driven(i - 1, k), driven(i, k), wire);
                }
            }
        }
        entries.extend((0..n).map(|i| Triplet::new(sense(i, 0), sense(i, 0), sense_end)));
        // Into the network from a sense line, through its taxels.
        let into = |volts: &Mat<f64>, i: usize, c: usize| -> f64 {
            (0..m).map(|k| g[sense(i, k)] * (volts[(sense(i, k), c)] - volts[(driven(i, k), c)])).sum()
        };
        entries.extend((0..m).map(|k| Triplet::new(driven(0, k), driven(0, k), driven_end)));
        let mut volts = Mat::zeros(2 * n * m, m);
        for k in 0..m {
            for i in 0..n {
                volts[(sense(i, 0), k)] = sense_end * sense_v[i];
            }
            volts[(driven(0, k), k)] = driven_end * drive_v;
        }
        Sparse::factor(2 * n * m, &entries, stop)?.solve(volts.as_mut())?;
        let mut currents = vec![0.0; n * m];
        for i in 0..n {
            (0..m).for_each(|k| currents[i * m + k] = into(&volts, i, k));
        }
        Ok(currents)
    }
}

/// A sparse matrix, factored.
struct Sparse {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

impl Sparse {
    /// Factors a symmetric matrix of which the lower triangle is given; entries of one place are summed.
    fn factor(n: usize, entries: &[Triplet<usize, usize, f64>], stop: Stop<'_>) -> Result<Self> {
        let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, entries).map_err(|_| too_far_apart())?;
        let symbolic =
            factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, Default::default(), Default::default())
                .map_err(|_| too_far_apart())?;
        stop.check()?;
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_far_apart())?;
        let mut values = vec![0.0; symbolic.len_val()];
        symbolic
            .factorize_numeric_llt(
                &mut values,
                matrix.as_ref(),
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|_| too_far_apart())?;
        stop.check()?;
        Ok(Self { symbolic, values })
    }

    /// Solves for all columns, in place.
    fn solve(&self, right: MatMut<'_, f64>) -> Result<()> {
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(right.ncols(), Par::Seq);
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_far_apart())?;
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            right,
            Par::Seq,
            MemStack::new(&mut memory),
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(sense_ohm: f64, drive_ohm: f64, wire_ohm: f64) -> Crossbar {
        Crossbar { rows: 2, columns: 2, sense_ohm, drive_ohm, wire_ohm }
    }

    fn currents(grid: &Crossbar, g: &[f64], sense_v: &[f64]) -> Vec<f64> {
        grid.currents_ua(g, -1.0, sense_v, Stop::never()).unwrap()
    }

    #[test]
    fn ideal_lines_give_each_taxel_its_own_current() {
        let g = [1.0, 20.0, 300.0, 0.0];
        let ideal = currents(&grid(0.0, 0.0, 0.0), &g, &[0.0, 0.0]);
        assert_eq!(ideal, [1.0, 20.0, 300.0, 0.0]);
    }

    #[test]
    fn a_taxel_by_itself_is_in_series_with_its_lines() {
        for (wire, segments) in [(0.0, 0.0), (10.0, 3.0)] {
            // The one at x 1, y 0: a segment more of its row than the one at x 0.
            let got = currents(&grid(70.0, 30.0, wire), &[0.0, 500.0, 0.0, 0.0], &[0.0, 0.0]);
            let wanted = 1e6 / (70.0 + 30.0 + 2000.0 + segments * wire);
            assert!((got[1] - wanted).abs() < 1e-9 * wanted, "{got:?} {wanted}");
            assert!([0, 2, 3].iter().all(|&k| got[k].abs() < 1e-9));
        }
    }

    #[test]
    fn a_wire_of_almost_nothing_is_none() {
        let g: Vec<f64> = (0..35).map(|k| 0.1 + f64::from(k * k % 17) * 30.0).collect();
        let with = |wire_ohm| {
            let (rows, columns, sense_ohm, drive_ohm) = (5, 7, 47.0, 5.0);
            let grid = Crossbar { rows, columns, sense_ohm, drive_ohm, wire_ohm };
            grid.currents_ua(&g, -1.3, &[0.0, 1e-3, 0.0, -2e-3, 0.0], Stop::never()).unwrap()
        };
        for (without, nearly) in with(0.0).iter().zip(with(LEAST_WIRE_OHM)) {
            assert!((without - nearly).abs() < 1e-4 * without.abs().max(1.0), "{without} {nearly}");
        }
    }

    #[test]
    fn a_crossing_that_conducts_nonsense_is_named() {
        for wrong in [-1.0, f64::NAN, f64::INFINITY] {
            let error = grid(0.0, 0.0, 0.0).currents_ua(&[0.0, 0.0, 0.0, wrong], 1.0, &[0.0; 2], Stop::never());
            assert!(error.unwrap_err().to_string().contains("row 1, column 1"), "{wrong}");
        }
    }
}
