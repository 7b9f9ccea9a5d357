//! Matching of spikes to targets: which belong together, and which are missed or false.

use crate::allowed::{Parameter, Range};
use crate::parameters::Described;
use crate::{Result, Stop, problem};

/// The largest number of pairs within the windows: matching takes one byte for each.
const MOST_PAIRS: usize = 200_000_000;

/// The largest distance between a spike and its target, at most an hour.
const WINDOW: Parameter = Parameter { name: "window_ms", unit: "ms", range: Range::within(0.0, 3_600_000.0) };

/// The largest distance between a spike and its target where none is given, ms, as in 6.5.2.
pub const WINDOW_MS: f64 = 50.0;

/// The parameters of the matching of spikes to targets.
#[must_use]
pub fn described() -> Described {
    Described::by(&serde_json::json!({}), &[], &[]).with(WINDOW, WINDOW_MS)
}

/// Pairs the spikes of a pattern with its targets (ms), at a resolution of 1 ns: `(spike, target)`, ascending.
///
/// # Errors
///
/// `Problem` for times that do not ascend or are not valid (names the list, `name`), or for a window that is not valid;
/// those of [`in_order`].
pub fn match_spikes(
    (name, spikes): (&str, &[f64]),
    (wanted, targets): (&str, &[f64]),
    window_ms: f64,
    stop: Stop<'_>,
) -> Result<Vec<(usize, usize)>> {
    WINDOW.check(&window_ms)?;
    let windows = vec![(window_ms * 1e6).round() as i64; targets.len()];
    in_order(&nanoseconds(name, spikes)?, &nanoseconds(wanted, targets)?, &windows, stop)
}

/// Times in whole ns, so that a time at the edge of a window is inside despite rounding.
fn nanoseconds(name: &str, times: &[f64]) -> Result<Vec<i64>> {
    // A hundred years.
    const MOST_MS: f64 = 3.2e12;
    if let Some(k) = times.iter().position(|t| !(-MOST_MS..=MOST_MS).contains(t)) {
        return Err(problem!("{name}[{k}] is {} ms: must be finite, within a hundred years", times[k]));
    }
    if let Some(k) = times.windows(2).position(|w| w[1] < w[0]) {
        let (before, after) = (times[k], times[k + 1]);
        return Err(problem!("{name}[{}] is {after} ms, after {before} ms: times must ascend", k + 1));
    }
    Ok(times.iter().map(|t| (t * 1e6).round() as i64).collect())
}

/// Pairs detections (or spikes) with reference events (or targets), one to one and in order of time: as many pairs as
/// the windows allow, and among all pairings of that size the one with the least sum of distances. Returns
/// `(detection, reference)`, ascending.
///
/// Times must ascend; `windows` has one width for each reference event. If all widths are equal, no other pairing, in
/// order or not, has more pairs or a smaller sum: uncrossing two crossed pairs increases neither the longer distance
/// nor the sum.
///
/// # Errors
///
/// `Problem` if so many are within the windows that matching would take too long; `Interrupted` if the caller stops it.
pub fn in_order(found: &[i64], truth: &[i64], windows: &[i64], stop: Stop<'_>) -> Result<Vec<(usize, usize)>> {
    // Row i of the table represents the first i + 1 reference events, column j the first j detections. Only the band of
    // columns within reach of some window is stored; both its edges ascend from row to row.
    let rows = truth.len();
    let mut low: Vec<usize> =
        (0..rows).map(|i| found.partition_point(|&f| f < truth[i].saturating_sub(windows[i]))).collect();
    let mut high: Vec<usize> =
        (0..rows).map(|i| found.partition_point(|&f| f <= truth[i].saturating_add(windows[i]))).collect();
    for i in 1..rows {
        high[i] = high[i].max(high[i - 1]);
        low[rows - 1 - i] = low[rows - 1 - i].min(low[rows - i]);
    }
    let cells: usize = low.iter().zip(&high).map(|(l, h)| h - l).fold(0, usize::saturating_add);
    if cells > MOST_PAIRS {
        return Err(problem!(
            "{cells} pairs are within the windows; at most {MOST_PAIRS} can be matched: use a narrower window"
        ));
    }

    #[derive(Clone, Copy)]
    enum AlignmentStep {
        PassDetection,
        PassEvent,
        Match,
    }
    // A single number orders by more pairs, then by less distance: distances sum to less than 2^64.
    const PAIR: i128 = 1 << 64;
    let mut steps: Vec<Vec<AlignmentStep>> = Vec::with_capacity(rows);
    let mut above: Vec<i128> = vec![0];
    let (mut above_low, mut above_high) = (0, 0);
    for i in 0..rows {
        stop.check()?;
        let from_above = |j: usize| above[j.min(above_high) - above_low];
        let mut row = Vec::with_capacity(high[i] - low[i] + 1);
        let mut way = Vec::with_capacity(high[i] - low[i]);
        row.push(from_above(low[i]));
        for j in low[i]..high[i] {
            let apart = found[j].abs_diff(truth[i]);
            let (mut best, mut step) = (from_above(j + 1), AlignmentStep::PassEvent);
            let left = row[j - low[i]];
            if left > best {
                (best, step) = (left, AlignmentStep::PassDetection);
            }
            if apart <= windows[i].unsigned_abs() {
                let pair = from_above(j) + PAIR - i128::from(apart);
                if pair > best {
                    (best, step) = (pair, AlignmentStep::Match);
                }
            }
            row.push(best);
            way.push(step);
        }
        steps.push(way);
        (above, above_low, above_high) = (row, low[i], high[i]);
    }

    let mut pairs = Vec::new();
    let mut j = found.len();
    for i in (0..rows).rev() {
        j = j.min(high[i]);
        while j > low[i] {
            match steps[i][j - 1 - low[i]] {
                AlignmentStep::PassDetection => j -= 1,
                AlignmentStep::PassEvent => break,
                AlignmentStep::Match => {
                    j -= 1;
                    pairs.push((j, i));
                    break;
                }
            }
        }
    }
    pairs.reverse();
    Ok(pairs)
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    fn pairs_of(found: &[i64], truth: &[i64], window: i64) -> Vec<(usize, usize)> {
        in_order(found, truth, &vec![window; truth.len()], Stop::never()).unwrap()
    }

    /// The best of all pairings, including crossed ones: the number of pairs, then the negative sum of distances.
    fn best_of_all(found: &[i64], truth: &[i64], windows: &[i64], taken: u32, ordered: bool) -> (usize, i64) {
        let Some((&t, rest)) = truth.split_first() else { return (0, 0) };
        let mut best = best_of_all(found, rest, &windows[1..], taken, ordered);
        for (j, &f) in found.iter().enumerate() {
            if taken & (1 << j) == 0 && (f - t).abs() <= windows[0] {
                let blocked = if ordered { (1 << (j + 1)) - 1 } else { 1 << j };
                let (pairs, cost) = best_of_all(found, rest, &windows[1..], taken | blocked, ordered);
                best = best.max((pairs + 1, cost - (f - t).abs()));
            }
        }
        best
    }

    #[test]
    fn no_pairing_whatever_has_more_pairs_or_a_smaller_sum_of_distances() {
        let mut random = StdRng::seed_from_u64(3);
        for _ in 0..3000 {
            let mut times = |most| {
                let mut t: Vec<i64> = (0..random.random_range(0..=most)).map(|_| random.random_range(0..40)).collect();
                t.sort_unstable();
                t
            };
            let (found, truth) = (times(8), times(6));
            let window = random.random_range(0..12);
            let windows = vec![window; truth.len()];
            let pairs = pairs_of(&found, &truth, window);
            let cost: i64 = pairs.iter().map(|&(j, i)| -(found[j] - truth[i]).abs()).sum();
            assert!(pairs.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1), "in order, one to one");
            assert_eq!((pairs.len(), cost), best_of_all(&found, &truth, &windows, 0, false), "{found:?} {truth:?}");
        }
    }

    #[test]
    fn windows_of_different_widths_give_the_best_pairing_in_order() {
        let mut random = StdRng::seed_from_u64(4);
        for _ in 0..3000 {
            let mut times = |most| {
                let mut t: Vec<i64> = (0..random.random_range(0..=most)).map(|_| random.random_range(0..40)).collect();
                t.sort_unstable();
                t
            };
            let (found, truth) = (times(8), times(6));
            let windows: Vec<i64> = truth.iter().map(|_| random.random_range(0..15)).collect();
            let pairs = in_order(&found, &truth, &windows, Stop::never()).unwrap();
            let cost: i64 = pairs.iter().map(|&(j, i)| -(found[j] - truth[i]).abs()).sum();
            assert!(pairs.iter().all(|&(j, i)| (found[j] - truth[i]).abs() <= windows[i]));
            assert_eq!((pairs.len(), cost), best_of_all(&found, &truth, &windows, 0, true), "{found:?} {truth:?}");
        }
    }

    #[test]
    fn a_pair_is_never_given_up_for_a_nearer_one() {
        // The nearest pairing (second with second) would leave the first event without its only partner.
        assert_eq!(pairs_of(&[40, 60], &[0, 50], 50), [(0, 0), (1, 1)]);
        assert_eq!(pairs_of(&[-50, 50], &[0], 50), [(0, 0)]);
        assert_eq!(pairs_of(&[-51, 51], &[0], 50), []);
    }

    #[test]
    fn too_many_pairs_are_refused_and_far_times_do_not_overflow() {
        let never = Stop::never();
        let many = vec![0; 20_000];
        assert!(matches!(in_order(&many, &many, &vec![1; 20_000], never), Err(crate::Error::Problem(_))));
        assert_eq!(pairs_of(&[i64::MIN, i64::MAX], &[i64::MIN, i64::MAX], 5), [(0, 0), (1, 1)]);
    }

    #[test]
    fn what_lies_at_the_edge_to_rounding_is_found() {
        let pair = |spike: f64, window| {
            match_spikes(("spikes", &[spike]), ("targets", &[0.1]), window, Stop::never()).unwrap()
        };
        assert_eq!((pair(50.1, 50.0).len(), pair(0.1 + 0.2, 0.2).len(), pair(50.100_001, 50.0).len()), (1, 1, 0));
        for (spikes, window) in [(&[1.0, 0.0][..], 1.0), (&[f64::NAN], 1.0), (&[1.0], -1.0), (&[1e13], 1.0)] {
            assert!(match_spikes(("spikes", spikes), ("targets", &[0.0]), window, Stop::never()).is_err());
        }
    }
}
