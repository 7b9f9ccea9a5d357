//! Matrices of distances with a spatial kernel, by stored exponentials.
//!
//! The inner product of two smoothed patterns is a sum over their spikes of the inner products of trains, weighted by
//! the overlap of the taxels' spatial kernels. For each row and taxel n, the row's whole pattern is stored with the
//! weights of taxel n; then each column's spikes at n are looked up once.

use super::{SmoothedDistance, SmoothingKernel, VanRossumSpatial};
use crate::metrics::distance::{Pattern, Ready};
use crate::metrics::pairwise::DistanceMatrix;
use crate::metrics::stored::{Entries, Frame, Query};
use crate::metrics::van_rossum::NEAR;
use crate::metrics::{Patterns, Work};
use crate::{Result, Stop};

/// The number of column spikes that are stored at a time: half a GB.
const HELD: usize = 1 << 24;

/// The cost of a look-up, in steps of a traversal of both patterns.
const LOOK_UP: usize = 8;

impl Ready for SmoothedDistance<'_> {
    fn between(&self, a: Pattern<'_>, b: Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        self.0.between(&self.1, a, b, stop)
    }

    /// Fills a matrix by stored exponentials, if that is faster.
    fn fill(
        &self,
        matrix: &DistanceMatrix,
        a: &Patterns<'_>,
        b: Option<&Patterns<'_>>,
        work: &mut Work<'_>,
    ) -> Result<bool> {
        let Self(metric, kernel) = self;
        let others = b.unwrap_or(a);
        let spikes = (a.times.len() / a.count.max(1)).max(others.times.len() / others.count.max(1));
        let active = kernel.active(a, others);
        let walking = matrix.pairs().saturating_mul(2 * spikes * kernel.taxels());
        let storing = active.len().pow(2) * kernel.taxels()
            + a.count * spikes * active.len() * LOOK_UP
            + matrix.pairs() * spikes * LOOK_UP;
        let frame = Frame::around(metric.smoothing.tau, &[a, others], None);
        let Some(frame) = frame.filter(|_| storing < walking) else { return Ok(false) };
        let weights = kernel.common(&active);
        MatrixState { metric, kernel, frame, active, weights, rows: a, columns: others }.fill(
            matrix,
            b.is_none(),
            work,
        )?;
        Ok(true)
    }
}

impl SmoothingKernel {
    /// The taxels with a spike in any pattern, in any layer.
    fn active(&self, a: &Patterns<'_>, b: &Patterns<'_>) -> Vec<usize> {
        let mut active = vec![false; self.taxels()];
        for side in [a, b] {
            for (k, ends) in side.offsets.windows(2).enumerate() {
                active[k % side.trains.max(1) % self.taxels()] |= ends[1] > ends[0];
            }
        }
        (0..self.taxels()).filter(|&n| active[n]).collect()
    }

    /// The overlap of the spatial kernels of each two of these taxels: the sum over existing taxels of the product of
    /// both kernels.
    fn common(&self, taxels: &[usize]) -> Vec<f64> {
        let count = taxels.len();
        let mut common = vec![0.0; count * count];
        let mut reach = vec![0.0; count];
        for m in 0..self.taxels() {
            if self.exists.as_ref().is_some_and(|exists| !exists[m]) {
                continue;
            }
            let (row, column) = (m / self.columns, m % self.columns);
            for (reach, &n) in reach.iter_mut().zip(taxels) {
                *reach = self.reach(n, row)[column];
            }
            for (common, &first) in common.chunks_exact_mut(count).zip(&reach) {
                for (common, second) in common.iter_mut().zip(&reach) {
                    *common += first * second;
                }
            }
        }
        common
    }
}

/// The state of a matrix computation.
struct MatrixState<'s> {
    metric: &'s VanRossumSpatial,
    kernel: &'s SmoothingKernel,
    frame: Frame,
    /// The taxels with spikes, and the overlap of each two of them.
    active: Vec<usize>,
    weights: Vec<f64>,
    rows: &'s Patterns<'s>,
    columns: &'s Patterns<'s>,
}

impl MatrixState<'_> {
    fn fill(&self, matrix: &DistanceMatrix, symmetric: bool, work: &mut Work<'_>) -> Result<()> {
        let rows = self.squares(self.rows, work)?;
        let columns = if symmetric { rows.clone() } else { self.squares(self.columns, work)? };
        let spikes = (self.columns.times.len() / self.columns.count.max(1)).max(1);
        let tile = (HELD / spikes).max(1);
        let tiles = self.columns.count.div_ceil(tile);
        for (number, from) in (0..self.columns.count).step_by(tile).enumerate() {
            let to = (from + tile).min(self.columns.count);
            let trains = self.columns.trains;
            let (first, last) = (self.columns.offsets[from * trains], self.columns.offsets[to * trains]);
            let held: Vec<Query> = self.columns.times[first..last].iter().map(|&t| self.frame.query(t)).collect();
            let queries = |j: usize, n: usize| {
                let ends = &self.columns.offsets[j * trains + n..=j * trains + n + 1];
                &held[ends[0] - first..ends[1] - first]
            };
            let report = |row: usize| {
                let pairs = matrix.pairs();
                ((pairs * number + pairs * row / self.rows.count) / tiles, pairs)
            };
            work.each(self.rows.count, &report, |i, stop| {
                let begin = matrix.first(i).max(from);
                let mut products = vec![0.0; to.saturating_sub(begin)];
                if products.is_empty() {
                    return Ok(());
                }
                self.products(i, stop, |n, entries, sums| {
                    for (j, product) in (begin..).zip(&mut products) {
                        *product += entries.product(sums, queries(j, n));
                    }
                })?;
                for (j, product) in (begin..).zip(products) {
                    let squares = rows[i] + columns[j];
                    let square = squares - 2.0 * product;
                    let distance = if square > NEAR * squares {
                        self.metric.normalisation.root(square, self.metric.smoothing.tau)
                    } else {
                        self.metric.between(self.kernel, (self.rows, i), (self.columns, j), stop)?
                    };
                    matrix.add(i, j, distance);
                }
                Ok(())
            })?;
        }
        Ok(())
    }

    /// The sums of row `i` with the weights of each train that has spikes.
    fn products(&self, i: usize, stop: Stop<'_>, mut receive: impl FnMut(usize, &Entries, &[[f64; 2]])) -> Result<()> {
        let (taxels, count) = (self.kernel.taxels(), self.active.len());
        let (mut sums, mut weights) = (Vec::new(), Vec::new());
        for layer in (0..self.rows.trains).step_by(taxels) {
            let mut spikes: Vec<(f64, usize)> = Vec::new();
            for (k, &n) in self.active.iter().enumerate() {
                spikes.extend(self.rows.train(i, layer + n).iter().map(|&t| (t, k)));
            }
            spikes.sort_by(|x, y| x.0.total_cmp(&y.0));
            let together = || spikes.chunk_by(|x, y| x.0 == y.0);
            let (entries, of_time) = Entries::new(&self.frame, together().map(|spikes| spikes[0].0));
            let entry: Vec<(usize, usize)> =
                together().zip(of_time).flat_map(|(spikes, e)| spikes.iter().map(move |&(_, k)| (e, k))).collect();
            for (k, &n) in self.active.iter().enumerate() {
                stop.check()?;
                let common = &self.weights[k * count..(k + 1) * count];
                weights.clear();
                weights.resize(entries.len(), 0.0);
                for &(e, k) in &entry {
                    weights[e] += common[k];
                }
                entries.sums(|e| weights[e], &mut sums);
                receive(layer + n, &entries, &sums);
            }
        }
        Ok(())
    }

    /// The squared distance of each pattern to the empty pattern, in units of tau / 2.
    fn squares(&self, patterns: &Patterns<'_>, work: &mut Work<'_>) -> Result<Vec<f64>> {
        let offsets = vec![0; patterns.trains + 1];
        let none = Patterns { count: 1, times: &[], offsets: &offsets, ..patterns.clone() };
        let found = DistanceMatrix::new(patterns.count, Some(1));
        work.quietly(patterns.count, |i, stop| {
            found.add(i, 0, self.metric.square(self.kernel, (patterns, i), (&none, 0), stop)?);
            Ok(())
        })?;
        Ok(found.finish())
    }
}
