//! Detections against reference events: found, missed, false, and how far off (thesis 6.5.2).
//!
//! Reading: the thesis counts "additional/missing spikes within 50 ms of a gait event", which leaves spikes far from any
//! event uncounted. Here every further spike is false, inside the window too; the thesis' count stands beside it.

use std::collections::BTreeMap;

use crate::detect::{Detection, Reference};
use crate::{Result, Stop, problem};

/// The widest window that a score takes, us: one hour.
pub const WIDEST_WINDOW_US: i64 = 3_600_000_000;

/// The most pairs within the windows of one label: a byte each while they are matched.
const MOST_PAIRS: usize = 200_000_000;

/// How the detections of one label met the reference events of that label.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tally {
    /// What happened.
    pub label: String,
    /// Detection and reference event that belong together, by their places in the input, ascending in time.
    pub pairs: Vec<(usize, usize)>,
    /// Reference events that nothing was said of, by their places in the input, ascending in time.
    pub missed: Vec<usize>,
    /// Detections of nothing, by their places in the input, ascending in time.
    pub false_: Vec<usize>,
    /// Those of the false ones that lie within the window of a reference event: the thesis' false positives.
    pub false_near: usize,
    /// Detection minus reference, one a pair, ms; negative is early.
    pub errors_ms: Vec<f64>,
    /// `known` minus reference, one a pair, ms.
    pub delays_ms: Vec<f64>,
}

/// Mean, spread and range of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Arithmetic mean.
    pub mean: f64,
    /// Standard deviation of the sample (divisor n - 1); NaN below two values.
    pub sd: f64,
    /// Median.
    pub median: f64,
    /// 2.5th percentile, interpolated.
    pub low: f64,
    /// 97.5th percentile, interpolated.
    pub high: f64,
}

impl Spread {
    /// The spread of `values`; all NaN where there are none.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let n = values.len();
        if n == 0 {
            return Self { mean: f64::NAN, sd: f64::NAN, median: f64::NAN, low: f64::NAN, high: f64::NAN };
        }
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let quantile = |q: f64| {
            let place = q * (n - 1) as f64;
            let (below, share) = (place.floor() as usize, place.fract());
            sorted[below] + share * (sorted[(below + 1).min(n - 1)] - sorted[below])
        };
        Self {
            mean,
            sd: if n > 1 { (squares / (n - 1) as f64).sqrt() } else { f64::NAN },
            median: quantile(0.5),
            low: quantile(0.025),
            high: quantile(0.975),
        }
    }
}

/// Scores detections against reference events, label by label (6.5.2), in the order of their names.
///
/// `windows` (us) says for each reference event how far a detection may lie from it, either way, and still belong to
/// it. Every detection that belongs to none is false, however near.
///
/// # Errors
///
/// `Problem` where there is not one window a reference event, a window is below 0 or above [`WIDEST_WINDOW_US`], or so
/// many detections lie within the windows that matching them would not end; `Interrupted` where `stop` says so.
pub fn score(found: &[Detection], truth: &[Reference], windows: &[i64], stop: Stop<'_>) -> Result<Vec<Tally>> {
    if windows.len() != truth.len() {
        return Err(problem!("{} windows for {} reference events: must be one each", windows.len(), truth.len()));
    }
    let mut labels: BTreeMap<&str, (Vec<usize>, Vec<usize>)> = BTreeMap::new();
    for (k, detection) in found.iter().enumerate() {
        labels.entry(&detection.label).or_default().0.push(k);
    }
    for (k, reference) in truth.iter().enumerate() {
        labels.entry(&reference.label).or_default().1.push(k);
    }
    let mut tallies = Vec::with_capacity(labels.len());
    for (label, (mut said, mut events)) in labels {
        said.sort_by_key(|&k| found[k].t);
        events.sort_by_key(|&k| truth[k].t);
        let said_t: Vec<i64> = said.iter().map(|&k| found[k].t).collect();
        let events_t: Vec<i64> = events.iter().map(|&k| truth[k].t).collect();
        let reach: Vec<i64> = events.iter().map(|&k| windows[k]).collect();
        let pairs = match_in_order(&said_t, &events_t, &reach, stop).map_err(|error| {
            if let crate::Error::Problem(text) = error { problem!("{label}: {text}") } else { error }
        })?;

        let mut tally = Tally { label: label.to_owned(), ..Tally::default() };
        let (mut matched, mut met) = (vec![false; said.len()], vec![false; events.len()]);
        for (j, i) in pairs {
            (matched[j], met[i]) = (true, true);
            let (detection, reference) = (&found[said[j]], &truth[events[i]]);
            tally.pairs.push((said[j], events[i]));
            tally.errors_ms.push(ms_between(reference.t, detection.t));
            tally.delays_ms.push(ms_between(reference.t, detection.known));
        }
        let near = near_any(&said_t, &events_t, &reach);
        tally.missed = (0..events.len()).filter(|&i| !met[i]).map(|i| events[i]).collect();
        tally.false_ = (0..said.len()).filter(|&j| !matched[j]).map(|j| said[j]).collect();
        tally.false_near = (0..said.len()).filter(|&j| !matched[j] && near[j]).count();
        tallies.push(tally);
    }
    Ok(tallies)
}

/// Pairs detections with reference events one to one and in the order of time: as many pairs as the windows allow, and
/// of all ways to have so many the one with the least sum of distances. Gives `(detection, reference)`, ascending.
///
/// Times (us) must ascend; `windows` is one a reference event. With one width for all, no pairing at all, in order or
/// not, has more pairs or a smaller sum: two pairs that cross can be uncrossed without growing the longer or the sum.
///
/// # Errors
///
/// As [`score`].
pub fn match_in_order(found: &[i64], truth: &[i64], windows: &[i64], stop: Stop<'_>) -> Result<Vec<(usize, usize)>> {
    if let Some(k) = windows.iter().position(|w| !(0..=WIDEST_WINDOW_US).contains(w)) {
        return Err(problem!("window of {} us: must lie between 0 and one hour, {WIDEST_WINDOW_US} us", windows[k]));
    }
    // Row i of the table stands for the first i + 1 reference events, its column j for the first j detections. Only the
    // band of columns that some window reaches is kept; both its edges ascend from row to row.
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
            "{cells} pairs lie within the windows, at most {MOST_PAIRS} are matched: narrow the window"
        ));
    }

    #[derive(Clone, Copy)]
    enum Step {
        PassDetection,
        PassEvent,
        Match,
    }
    // One number orders "more pairs, then less distance": distances sum to less than 2^64.
    const PAIR: i128 = 1 << 64;
    let mut steps: Vec<Vec<Step>> = Vec::with_capacity(rows);
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
            let (mut best, mut step) = (from_above(j + 1), Step::PassEvent);
            let left = row[j - low[i]];
            if left > best {
                (best, step) = (left, Step::PassDetection);
            }
            if apart <= windows[i].unsigned_abs() {
                let pair = from_above(j) + PAIR - i128::from(apart);
                if pair > best {
                    (best, step) = (pair, Step::Match);
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
                Step::PassDetection => j -= 1,
                Step::PassEvent => break,
                Step::Match => {
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

/// Whether each detection lies within the window of any reference event; times ascend.
fn near_any(found: &[i64], truth: &[i64], windows: &[i64]) -> Vec<bool> {
    let mut change = vec![0_i64; found.len() + 1];
    for (t, w) in truth.iter().zip(windows) {
        change[found.partition_point(|&f| f < t.saturating_sub(*w))] += 1;
        change[found.partition_point(|&f| f <= t.saturating_add(*w))] -= 1;
    }
    let mut windows_open = 0;
    change[..found.len()]
        .iter()
        .map(|c| {
            windows_open += c;
            windows_open > 0
        })
        .collect()
}

/// From one time to another, us to ms, without overflow.
fn ms_between(from: i64, to: i64) -> f64 {
    (i128::from(to) - i128::from(from)) as f64 / 1000.0
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    fn matched(found: &[i64], truth: &[i64], window: i64) -> Vec<(usize, usize)> {
        match_in_order(found, truth, &vec![window; truth.len()], Stop::never()).unwrap()
    }

    /// The best of all pairings, crossing ones too: pairs, then the negative sum of distances.
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
            let pairs = matched(&found, &truth, window);
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
            let pairs = match_in_order(&found, &truth, &windows, Stop::never()).unwrap();
            let cost: i64 = pairs.iter().map(|&(j, i)| -(found[j] - truth[i]).abs()).sum();
            assert!(pairs.iter().all(|&(j, i)| (found[j] - truth[i]).abs() <= windows[i]));
            assert_eq!((pairs.len(), cost), best_of_all(&found, &truth, &windows, 0, true), "{found:?} {truth:?}");
        }
    }

    #[test]
    fn a_pair_is_never_given_up_for_a_nearer_one() {
        // The nearest pairing (second with second) would leave the first event without its only partner.
        assert_eq!(matched(&[40, 60], &[0, 50], 50), [(0, 0), (1, 1)]);
        assert_eq!(matched(&[-50, 50], &[0], 50), [(0, 0)]);
        assert_eq!(matched(&[-51, 51], &[0], 50), []);
    }

    #[test]
    fn every_further_spike_is_false_inside_the_window_too() {
        let said = |label: &str, t| Detection { label: label.to_owned(), t, known: t + 300, slope: 1.0 };
        let event = |label: &str, t| Reference { label: label.to_owned(), t };
        let found = [said("lift", 9_000), said("contact", 1_000), said("contact", 2_000), said("contact", 900_000)];
        let truth = [event("contact", 500_000), event("contact", 0), event("lift", 10_000)];
        let tallies = score(&found, &truth, &[50_000; 3], Stop::never()).unwrap();
        let [contact, lift] = &tallies[..] else { panic!("two labels") };
        assert_eq!(
            (contact.label.as_str(), &contact.pairs[..], &contact.missed[..]),
            ("contact", &[(1, 1)][..], &[0][..])
        );
        assert_eq!((&contact.false_[..], contact.false_near), (&[2, 3][..], 1));
        assert_eq!((&contact.errors_ms[..], &contact.delays_ms[..]), (&[1.0][..], &[1.3][..]));
        assert_eq!((&lift.errors_ms[..], lift.false_.len(), lift.missed.len()), (&[-1.0][..], 0, 0));
    }

    #[test]
    fn the_spread_is_that_of_the_textbook() {
        let spread = Spread::of(&[4.0, 1.0, 2.0, 3.0]);
        assert_eq!((spread.mean, spread.median), (2.5, 2.5));
        assert!((spread.sd - (5.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!((spread.low - 1.075).abs() < 1e-12 && (spread.high - 3.925).abs() < 1e-12);
        assert!(Spread::of(&[]).mean.is_nan() && Spread::of(&[1.0]).sd.is_nan());
    }

    #[test]
    fn windows_that_make_no_sense_and_too_many_pairs_are_refused() {
        let never = Stop::never();
        assert!(match_in_order(&[0], &[0], &[-1], never).unwrap_err().to_string().contains("window of -1 us"));
        assert!(match_in_order(&[0], &[0], &[i64::MAX], never).is_err());
        assert!(score(&[], &[Reference { label: "a".into(), t: 0 }], &[], never).is_err());
        let many = vec![0; 20_000];
        assert!(matches!(match_in_order(&many, &many, &vec![1; 20_000], never), Err(crate::Error::Problem(_))));
        assert_eq!(matched(&[i64::MIN, i64::MAX], &[i64::MIN, i64::MAX], 5), [(0, 0), (1, 1)]);
    }
}
