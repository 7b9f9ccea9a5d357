//! Matrices of van Rossum distances, train after train, by stored exponentials.

use std::sync::OnceLock;

use super::{NEAR, VanRossum};
use crate::metrics::distance::{Pattern, Ready, sum_over_trains};
use crate::metrics::pairwise::DistanceMatrix;
use crate::metrics::stored::{Entries, Frame, Query};
use crate::metrics::{Patterns, Work};
use crate::{Result, Stop};

/// The number of rows processed together: each column's spikes are loaded once for all of them.
const ROWS: usize = 4;

impl Ready for &VanRossum {
    fn between(&self, a: Pattern<'_>, b: Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        sum_over_trains(a, b, stop, |a, b| Ok(VanRossum::between(self, a, b)))
    }

    /// Fills a matrix with the sums of distances over trains.
    fn fill(
        &self,
        matrix: &DistanceMatrix,
        a: &Patterns<'_>,
        b: Option<&Patterns<'_>>,
        work: &mut Work<'_>,
    ) -> Result<bool> {
        let others = b.unwrap_or(a);
        let pairs = matrix.pairs();
        for n in 0..a.trains {
            let frame = Frame::around(self.tau, &[a, others], Some(n));
            let rows = Train::all(frame.as_ref(), a, n, work)?;
            let columns = b.map(|b| Train::all(frame.as_ref(), b, n, work)).transpose()?;
            let columns = columns.as_ref().unwrap_or(&rows);
            let report = |group: usize| {
                let share = pairs * (group * ROWS).min(a.count) / a.count;
                ((pairs * n + share) / a.trains, pairs)
            };
            work.each(a.count.div_ceil(ROWS), &report, |group, stop| {
                let group = group * ROWS..((group + 1) * ROWS).min(a.count);
                for (j, column) in columns.iter().enumerate().skip(matrix.first(group.start)) {
                    stop.check()?;
                    for i in group.clone().filter(|&i| j >= matrix.first(i)) {
                        let far = rows[i].get().zip(column.get()).and_then(|(row, column)| row.far(column));
                        let distance = match far {
                            Some(square) => self.normalisation.root(square, self.tau),
                            None => VanRossum::between(self, a.train(i, n), others.train(j, n)),
                        };
                        matrix.add(i, j, distance);
                    }
                }
                Ok(())
            })?;
        }
        Ok(true)
    }
}

/// A train prepared for comparison with others.
struct Train {
    queries: Vec<Query>,
    entries: Entries,
    sums: Vec<[f64; 2]>,
    /// The squared distance to the empty train, in units of tau / 2.
    square: f64,
}

impl Train {
    fn new(frame: &Frame, spikes: &[f64]) -> Self {
        let (entries, _) = Entries::new(frame, spikes.iter().copied());
        let queries: Vec<Query> = spikes.iter().map(|&t| frame.query(t)).collect();
        let mut sums = Vec::new();
        entries.sums(|_| 1.0, &mut sums);
        let square = entries.product(&sums, &queries);
        Self { queries, entries, sums, square }
    }

    /// Train n of each pattern, prepared.
    fn all(
        frame: Option<&Frame>,
        patterns: &Patterns<'_>,
        n: usize,
        work: &mut Work<'_>,
    ) -> Result<Vec<OnceLock<Self>>> {
        let trains: Vec<OnceLock<Self>> = (0..patterns.count).map(|_| OnceLock::new()).collect();
        let Some(frame) = frame else { return Ok(trains) };
        work.quietly(trains.len(), |p, _| {
            trains[p].get_or_init(|| Self::new(frame, patterns.train(p, n)));
            Ok(())
        })?;
        Ok(trains)
    }

    /// The squared distance to another train, in units of tau / 2; `None` if it is so small relative to both trains'
    /// squares that their difference has lost its digits.
    #[inline]
    fn far(&self, other: &Self) -> Option<f64> {
        let squares = self.square + other.square;
        let square = squares - 2.0 * self.entries.product(&self.sums, &other.queries);
        (square > NEAR * squares).then_some(square)
    }
}
