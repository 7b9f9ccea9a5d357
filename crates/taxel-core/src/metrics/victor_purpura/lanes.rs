//! One train compared with as many others side by side as fit in four of the machine's vectors.
//!
//! The operations and their order are those for a single pair, so the results are the same to the bit; a lane only
//! considers additional pairs, since a step includes all pairs that are near enough in any lane.

use crate::vectors::{Instructions, LANES, Vector, kernel, lines, lines_mut};
use crate::{Result, Stop};

/// The number of pairs processed side by side: those in four vectors, so that no vector waits for its own last result.
pub(super) fn lanes(set: Instructions) -> usize {
    match set {
        Instructions::Plain => 1,
        Instructions::Avx2 => 2 * LANES,
        Instructions::Avx512 => 4 * LANES,
    }
}

/// Trains stored side by side: spike j of each, then spike j + 1.
pub(super) struct TrainBlock {
    lanes: usize,
    /// The times by spike and lane, padded with infinity after a lane's last spike.
    times: Vec<f64>,
    /// The earliest and the latest time of all lanes, by spike.
    first: Vec<f64>,
    last: Vec<f64>,
    lengths: Vec<usize>,
}

impl TrainBlock {
    /// Stores `trains`, at least one and at most one per lane; the last one also fills the remaining lanes.
    pub(super) fn new(lanes: usize, trains: &[&[f64]]) -> Self {
        let lane = |l: usize| trains[l.min(trains.len() - 1)];
        let longest = (0..lanes).map(|l| lane(l).len()).max().unwrap_or(0);
        let mut times = vec![f64::INFINITY; longest * lanes];
        for l in 0..lanes {
            for (j, &t) in lane(l).iter().enumerate() {
                times[j * lanes + l] = t;
            }
        }
        let extreme = |pick: fn(f64, f64) -> f64, begin: f64| {
            times.chunks_exact(lanes).map(|row| row.iter().copied().fold(begin, pick)).collect()
        };
        Self {
            lanes,
            first: extreme(f64::min, f64::INFINITY),
            last: extreme(f64::max, f64::NEG_INFINITY),
            lengths: (0..lanes).map(|l| lane(l).len()).collect(),
            times,
        }
    }

    /// The distance of `a` to each train; `q` must be above 0 and finite, `cost` is reusable memory.
    pub(super) fn distances(
        &self,
        set: Instructions,
        a: &[f64],
        q: f64,
        reach: f64,
        cost: &mut Vec<f64>,
        stop: Stop<'_>,
    ) -> Result<Vec<f64>> {
        cost.resize((self.first.len() + 1) * self.lanes, 0.0);
        let against = if self.lanes == 2 * LANES { against_16 } else { against_32 };
        let hi = against(set, self, a, q, reach, cost, stop)?;
        let distance = |(lane, &length): (usize, &usize)| {
            let column = length.min(hi);
            cost[column * self.lanes + lane] + (length - column) as f64
        };
        Ok(self.lengths.iter().enumerate().map(distance).collect())
    }
}

kernel! {
    fn against_16<V>(on set; block: &TrainBlock, a: &[f64], q: f64, reach: f64, cost: &mut [f64], stop: Stop<'_>) -> Result<usize> {
        against::<V, 2>(block, a, q, reach, cost, stop)
    }
}

kernel! {
    fn against_32<V>(on set; block: &TrainBlock, a: &[f64], q: f64, reach: f64, cost: &mut [f64], stop: Stop<'_>) -> Result<usize> {
        against::<V, 4>(block, a, q, reach, cost, stop)
    }
}

/// Computes the cost of turning all of `a` into the first spikes of each lane, up to the number of spikes that is
/// returned; see [`super::VictorPurpura::between`] for the costs that are left out.
#[inline(always)]
fn against<V: Vector, const SIDE: usize>(
    block: &TrainBlock,
    a: &[f64],
    q: f64,
    reach: f64,
    cost: &mut [f64],
    stop: Stop<'_>,
) -> Result<usize> {
    let (times, cost) = (rows::<SIDE>(&block.times), rows_mut::<SIDE>(cost));
    let (unit, q) = (V::splat(1.0), V::splat(q));
    cost[0] = [[0.0; LANES]; SIDE];
    let (mut lo, mut hi) = (0, 0);
    for (i, &t) in a.iter().enumerate() {
        if i % 64 == 0 {
            stop.check()?;
        }
        while hi < block.first.len() && block.first[hi] <= t + reach {
            let (done, next) = cost.split_at_mut(hi + 1);
            for (from, to) in done[hi].iter().zip(&mut next[0]) {
                V::load(from).plus(unit).store(to);
            }
            hi += 1;
        }
        while lo < hi && block.last[lo] < t - reach {
            lo += 1;
        }
        let from = V::splat(t);
        let (mut diagonal, mut left) = ([unit; SIDE], [unit; SIDE]);
        for (s, above) in cost[lo].iter_mut().enumerate() {
            diagonal[s] = V::load(above);
            left[s] = diagonal[s].plus(unit);
            left[s].store(above);
        }
        for (to, above) in times[lo..hi].iter().zip(&mut cost[lo + 1..=hi]) {
            for s in 0..SIDE {
                let moved = diagonal[s].plus(q.times(from.away(V::load(&to[s]))));
                diagonal[s] = V::load(&above[s]);
                left[s] = moved.lesser(diagonal[s].lesser(left[s]).plus(unit));
                left[s].store(&mut above[s]);
            }
        }
    }
    Ok(hi)
}

/// The numbers as rows of one spike of every lane.
#[inline(always)]
fn rows<const SIDE: usize>(numbers: &[f64]) -> &[[[f64; LANES]; SIDE]] {
    lines(numbers).as_chunks().0
}

/// Mutable [`rows`].
#[inline(always)]
fn rows_mut<const SIDE: usize>(numbers: &mut [f64]) -> &mut [[[f64; LANES]; SIDE]] {
    lines_mut(numbers).as_chunks_mut().0
}
