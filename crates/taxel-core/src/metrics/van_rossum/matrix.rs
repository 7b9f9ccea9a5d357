//! Matrices of van Rossum distances, train after train by stored exponentials.

use super::{NEAR, VanRossum};
use crate::Result;
use crate::metrics::pairwise::Matrix;
use crate::metrics::stored::{Entries, Frame, Query};
use crate::metrics::{Patterns, Work};

/// Rows that go together: each column's spikes are fetched once for all of them.
const ROWS: usize = 4;

impl VanRossum {
    /// Fills a matrix with the sums over trains.
    pub(in crate::metrics) fn fill(
        &self,
        matrix: &Matrix,
        a: &Patterns<'_>,
        b: Option<&Patterns<'_>>,
        work: &mut Work<'_>,
    ) -> Result<()> {
        let others = b.unwrap_or(a);
        let pairs = matrix.pairs();
        for n in 0..a.trains {
            let frame = Frame::around(self.tau, &[a, others], Some(n));
            let rows = frame.as_ref().map(|f| Side::new(f, a, n));
            let columns = b.and_then(|b| frame.as_ref().map(|f| Side::new(f, b, n)));
            let told = |group: usize| {
                let share = pairs * (group * ROWS).min(a.count) / a.count;
                ((pairs * n + share) / a.trains, pairs)
            };
            work.each(a.count.div_ceil(ROWS), &told, |group, stop| {
                let group = group * ROWS..((group + 1) * ROWS).min(a.count);
                for j in matrix.first(group.start)..others.count {
                    stop.check()?;
                    for i in group.clone().filter(|&i| j >= matrix.first(i)) {
                        let far = rows.as_ref().and_then(|rows| rows.far(i, columns.as_ref().unwrap_or(rows), j));
                        let distance = match far {
                            Some(square) => self.normalisation.root(square, self.tau),
                            None => self.between(a.train(i, n), others.train(j, n)),
                        };
                        matrix.add(i, j, distance);
                    }
                }
                Ok(())
            })?;
        }
        Ok(())
    }
}

/// Train n of each pattern of one side.
struct Side {
    queries: Vec<Vec<Query>>,
    entries: Vec<Entries>,
    sums: Vec<Vec<[f64; 2]>>,
    /// Squared distance from no spike at all, in units of tau / 2.
    square: Vec<f64>,
}

impl Side {
    fn new(frame: &Frame, patterns: &Patterns<'_>, n: usize) -> Self {
        let mut side = Self { queries: Vec::new(), entries: Vec::new(), sums: Vec::new(), square: Vec::new() };
        for p in 0..patterns.count {
            let train = patterns.train(p, n);
            let (entries, _) = Entries::new(frame, train.iter().copied());
            let queries: Vec<Query> = train.iter().map(|&t| frame.query(t)).collect();
            let mut sums = Vec::new();
            entries.sums(|_| 1.0, &mut sums);
            side.square.push(entries.product(&sums, &queries));
            side.queries.push(queries);
            side.entries.push(entries);
            side.sums.push(sums);
        }
        side
    }

    /// The squared distance of train i from train j of the other side, in units of tau / 2; none where it is so small
    /// beside both trains' own squares that their difference has lost its digits.
    #[inline]
    fn far(&self, i: usize, other: &Self, j: usize) -> Option<f64> {
        let own = self.square[i] + other.square[j];
        let square = own - 2.0 * self.entries[i].product(&self.sums[i], &other.queries[j]);
        (square > NEAR * own).then_some(square)
    }
}
