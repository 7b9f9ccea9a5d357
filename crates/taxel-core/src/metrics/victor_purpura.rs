//! Victor-Purpura distance: the least cost of turning one spike train into another.

use std::array::from_fn;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::patterns::Two;
use super::work::Running;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::vectors::{LANES, wide};
use crate::{Error, Result, Stop};

/// The least cost of turning one train into the other: 1 for each spike removed or added, `q |dt|` for each spike
/// moved.
///
/// Victor and Purpura (1996), J. Neurophysiol. 76:1310; thesis 6.3.5. Spikes more than `2 / q` apart never match, so
/// only nearer pairs are considered: time O(n + m + pairs within `2 / q`), memory O(m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VictorPurpura {
    /// Cost of moving a spike by 1 ms; if infinite, only spikes at exactly the same time match.
    #[serde(deserialize_with = "number_or_name")]
    pub q: f64,
}

/// Reads a cost that may be infinite: a number, or its name as text because JSON has no infinity.
fn number_or_name<'de, D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<f64, D::Error> {
    let value = Value::deserialize(deserializer)?;
    let number = value.as_f64().or_else(|| value.as_str()?.parse().ok());
    number.ok_or_else(|| serde::de::Error::custom("must be a number"))
}

impl VictorPurpura {
    ranges! {
        q: "1/ms", Range::COST;
    }

    /// The parameters with their defaults and ranges.
    #[must_use]
    pub fn described() -> Described {
        Described::by(&Self { q: 0.0 }, &["q"], Self::RANGES)
    }

    /// The distance between two ascending trains.
    pub(super) fn between(&self, a: &[f64], b: &[f64], stop: Stop<'_>) -> Result<f64> {
        if self.q == 0.0 {
            return Ok(a.len().abs_diff(b.len()) as f64);
        }
        let [[saved]] = most_saved(self.cost(), a, b.as_chunks().0.as_chunks().0, b, b, stop)?;
        Ok((a.len() + b.len()) as f64 - saved)
    }

    /// The cost as a finite number: the greatest lets spikes match that are 1e-308 ms apart.
    fn cost(&self) -> f64 {
        self.q.min(f64::MAX)
    }

    /// A matrix of sums of distances over trains, where moving has a cost: each row against many columns side by side.
    pub(super) fn matrix(&self, two: &Two<'_>, running: &Running<'_>) -> Result<Vec<f64>> {
        let mut distances = two.zeros();
        let (done, all) = (AtomicUsize::new(0), two.rows.count * two.rows.trains);
        for n in 0..two.rows.trains {
            let columns: Vec<&[f64]> = (0..two.columns.count).map(|p| two.columns.train(p, n)).collect();
            let blocks: Vec<_> =
                columns.chunks(SIDE).map(|trains| SideBySide::new(trains, 2.0 / self.cost())).collect();
            distances.par_chunks_mut(two.width()).enumerate().try_for_each(|(i, row)| {
                let a = two.rows.train(i, n);
                let cells = row.chunks_mut(SIDE).zip(columns.chunks(SIDE)).zip(&blocks);
                for ((cells, trains), block) in cells.skip(two.first(i) / SIDE) {
                    let saved = most_saved_of_each(self.cost(), a, block, running.stop)?;
                    for ((cell, b), saved) in cells.iter_mut().zip(trains).zip(saved.as_flattened()) {
                        *cell += (a.len() + b.len()) as f64 - saved;
                    }
                }
                running.done.fetch_max(two.pairs() * (done.fetch_add(1, Relaxed) + 1) / all, Relaxed);
                Ok::<(), Error>(())
            })?;
        }
        Ok(distances)
    }
}

/// The number of trains side by side: those in two vectors, so that neither waits for its own last result.
const SIDE: usize = 2 * LANES;

/// Trains side by side: each row has a spike of each train, or infinity, which no spike matches. The spikes of a row are
/// near each other, so that few rows are within reach of a spike.
#[derive(Default)]
struct SideBySide {
    rows: Vec<[[f64; LANES]; 2]>,
    /// The earliest and the latest spike of each row.
    first: Vec<f64>,
    last: Vec<f64>,
}

impl SideBySide {
    /// At most [`SIDE`] trains, in rows that last no longer than `width`.
    fn new(trains: &[&[f64]], width: f64) -> Self {
        let mut block = Self::default();
        let mut left: Vec<_> = trains.iter().map(|train| train.iter().copied().peekable()).collect();
        while let Some(first) = left.iter_mut().filter_map(|train| train.peek().copied()).reduce(f64::min) {
            let (mut row, mut last) = ([[f64::INFINITY; LANES]; 2], first);
            for (spike, train) in row.as_flattened_mut().iter_mut().zip(&mut left) {
                if let Some(t) = train.next_if(|&t| t <= first + width) {
                    (*spike, last) = (t, greater(t, last));
                }
            }
            block.rows.push(row);
            block.first.push(first);
            block.last.push(last);
        }
        block
    }
}

wide! {
    /// As [`most_saved`], for each train of a block.
    fn most_saved_of_each(q: f64, a: &[f64], block: &SideBySide, stop: Stop<'_>) -> Result<[[f64; LANES]; 2]> {
        most_saved(q, a, &block.rows, &block.first, &block.last, stop)
    }
}

/// The most that moving spikes of `a` to those of each train saves, beside removing and adding all: to move one by dt
/// saves `2 - q |dt|`. `first` and `last` are the earliest and the latest spike of each row.
#[inline(always)]
fn most_saved<const N: usize, const M: usize>(
    q: f64,
    a: &[f64],
    rows: &[[[f64; N]; M]],
    first: &[f64],
    last: &[f64],
    stop: Stop<'_>,
) -> Result<[[f64; N]; M]> {
    // `saved[j]` is the most that can be saved with the spikes of `a` so far and the first j rows; only columns lo to hi
    // are up to date. Earlier columns have spikes too early to match and are no longer read; later ones, whose spikes
    // are still too late to match, save as much as column hi.
    let mut saved = vec![[[0.0; N]; M]; rows.len() + 1];
    let (mut lo, mut hi) = (0, 0);
    for (i, &from) in a.iter().enumerate() {
        if i % 64 == 0 {
            stop.check()?;
        }
        // By more than rounding takes: what is left out saves nothing.
        let reach = (2.0 / q + from.abs() * f64::EPSILON) * (1.0 + 4.0 * f64::EPSILON);
        while hi < rows.len() && first[hi] <= from + reach {
            saved[hi + 1] = saved[hi];
            hi += 1;
        }
        while lo < hi && last[lo] < from - reach {
            lo += 1;
        }
        let mut diagonal = saved[lo];
        let mut left = diagonal;
        for (to, above) in rows[lo..hi].iter().zip(&mut saved[lo + 1..=hi]) {
            for m in 0..M {
                let moved: [f64; N] = from_fn(|n| diagonal[m][n] + (2.0 - q * (from - to[m][n]).abs()));
                diagonal[m] = above[m];
                left[m] = from_fn(|n| greater(greater(moved[n], diagonal[m][n]), left[m][n]));
                above[m] = left[m];
            }
        }
    }
    Ok(saved[hi])
}

/// The greater of two numbers, neither of which is NaN: a single instruction, unlike `f64::max`.
#[inline(always)]
fn greater(x: f64, y: f64) -> f64 {
    if x > y { x } else { y }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::*;
    use crate::metrics::{Metric, Patterns, Work};

    #[test]
    fn a_matrix_has_each_pairs_distance_to_the_bit() {
        let mut random = StdRng::seed_from_u64(5);
        let mut moved = 0;
        for q in [0.0, 1e-300, 0.003, 0.05, 2.0, 1e300, f64::INFINITY] {
            for (count, trains, most) in [(1, 1, 9), (17, 2, 40), (40, 1, 90)] {
                // Many spikes and none, all the time and in bursts, at the same times, late.
                let (mut times, mut offsets) = (vec![], vec![0]);
                for _ in 0..count * trains {
                    let (begin, length) = (random.random_range(0.0..900.0), random.random_range(1.0..1000.0));
                    let spikes = random.random_range(0..most);
                    let mut train: Vec<f64> = (0..spikes).map(|_| begin + length * random.random::<f64>()).collect();
                    match random.random_range(0..3) {
                        0 => train.iter_mut().for_each(|t| *t = t.round()),
                        1 => train.iter_mut().for_each(|t| *t += 1e12),
                        _ => {}
                    }
                    train.sort_by(f64::total_cmp);
                    times.extend(train);
                    offsets.push(times.len());
                }
                let (times, offsets) = (&times[..], &offsets[..]);
                let all = Patterns { name: "a", count, trains, times, offsets, listed: true };
                let metric = Metric::VictorPurpura(VictorPurpura { q });
                let mut heard = vec![];
                let mut progress = |done, pairs| heard.push((done, pairs));
                let mut work = Work { threads: None, stop: Stop::never(), progress: &mut progress };
                let among = metric.pairwise(&all, None, &mut work).unwrap();
                let across = metric.pairwise(&all, Some(&all), &mut work).unwrap();
                assert_eq!(heard.last(), Some(&(count * count, count * count)));
                let between = metric.prepare(&Two::new(&all, None)).unwrap();
                for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
                    let pair = between((&all, i), (&all, j), Stop::never()).unwrap();
                    assert_eq!(across[i * count + j], pair, "q {q}, {i} {j}");
                    assert!(j <= i || among[i * count + j] == pair, "q {q}, {i} {j}");
                    moved += usize::from(pair.fract() != 0.0);
                }
            }
        }
        assert!(moved > 1000, "trains that say little: {moved}");
    }
}
