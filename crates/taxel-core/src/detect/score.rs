//! Detections compared with reference events: found, missed, false, and timing errors (thesis 6.5.2).
//!
//! Reading: the thesis counts "additional/missing spikes within 50 ms of a gait event", which leaves out spikes far
//! from any event. Here every unmatched spike is false, inside the window too; the thesis' count is given separately.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::detect::{Detection, Reference};
use crate::metrics::matching::in_order;
use crate::{Result, Stop, problem};

/// The widest window that can be scored, us: one hour.
pub const WIDEST_WINDOW_US: i64 = 3_600_000_000;

/// How the detections of one label match the reference events of that label.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tally {
    /// The label of detections and reference events.
    pub label: String,
    /// Each pair of a detection and its reference event, as indices into the input, ascending in time.
    pub pairs: Vec<(usize, usize)>,
    /// Reference events without a detection, as indices into the input, ascending in time.
    pub missed: Vec<usize>,
    /// Detections without a reference event, as indices into the input, ascending in time.
    pub false_: Vec<usize>,
    /// The number of false detections within the window of a reference event: the thesis' false positives.
    pub false_near: usize,
    /// Detection minus reference, one per pair, ms; negative is early.
    pub errors_ms: Vec<f64>,
    /// `known` minus reference, one per pair, ms.
    pub delays_ms: Vec<f64>,
}

/// Mean, spread and range of values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
    /// The spread of `values`; all NaN if there are none.
    #[must_use]
    pub fn new(values: &[f64]) -> Self {
        let n = values.len();
        if n == 0 {
            return Self { mean: f64::NAN, sd: f64::NAN, median: f64::NAN, low: f64::NAN, high: f64::NAN };
        }
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let quantile = |q: f64| {
            let rank = q * (n - 1) as f64;
            let (below, share) = (rank.floor() as usize, rank.fract());
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
/// `windows` (us) has the largest distance, in either direction, between each reference event and its detection. Every
/// detection without a reference event is false, however near.
///
/// # Errors
///
/// `Problem` if there is not one window for each reference event, if a window is below 0 or above [`WIDEST_WINDOW_US`],
/// or if so many detections are within the windows that matching would take too long; `Interrupted` if asked to stop.
pub fn score(found: &[Detection], truth: &[Reference], windows: &[i64], stop: Stop<'_>) -> Result<Vec<Tally>> {
    if windows.len() != truth.len() {
        return Err(problem!("{} windows for {} reference events: must be one per event", windows.len(), truth.len()));
    }
    if let Some(window) = windows.iter().find(|w| !(0..=WIDEST_WINDOW_US).contains(*w)) {
        return Err(problem!("window_us"; " is {window} us: must be from 0 to {WIDEST_WINDOW_US}"));
    }
    let mut labels: BTreeMap<&str, (Vec<usize>, Vec<usize>)> = BTreeMap::new();
    for (k, detection) in found.iter().enumerate() {
        labels.entry(&detection.label).or_default().0.push(k);
    }
    for (k, reference) in truth.iter().enumerate() {
        labels.entry(&reference.label).or_default().1.push(k);
    }
    let mut tallies = Vec::with_capacity(labels.len());
    for (label, (mut detected, mut events)) in labels {
        detected.sort_by_key(|&k| found[k].t);
        events.sort_by_key(|&k| truth[k].t);
        let detected_t: Vec<i64> = detected.iter().map(|&k| found[k].t).collect();
        let events_t: Vec<i64> = events.iter().map(|&k| truth[k].t).collect();
        let reach: Vec<i64> = events.iter().map(|&k| windows[k]).collect();
        let pairs = in_order(&detected_t, &events_t, &reach, stop).map_err(|error| error.in_part(label))?;

        let mut tally = Tally { label: label.to_owned(), ..Tally::default() };
        let (mut matched, mut met) = (vec![false; detected.len()], vec![false; events.len()]);
        for (j, i) in pairs {
            (matched[j], met[i]) = (true, true);
            let (detection, reference) = (&found[detected[j]], &truth[events[i]]);
            tally.pairs.push((detected[j], events[i]));
            tally.errors_ms.push(ms_between(reference.t, detection.t));
            tally.delays_ms.push(ms_between(reference.t, detection.known));
        }
        let near = near_any(&detected_t, &events_t, &reach);
        tally.missed = (0..events.len()).filter(|&i| !met[i]).map(|i| events[i]).collect();
        tally.false_ = (0..detected.len()).filter(|&j| !matched[j]).map(|j| detected[j]).collect();
        tally.false_near = (0..detected.len()).filter(|&j| !matched[j] && near[j]).count();
        tallies.push(tally);
    }
    Ok(tallies)
}

/// Whether each detection is within the window of any reference event; times ascend.
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

/// The time between two times, us to ms, without overflow.
fn ms_between(from: i64, to: i64) -> f64 {
    (i128::from(to) - i128::from(from)) as f64 / 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_further_spike_is_false_inside_the_window_too() {
        let detected =
            |label: &str, t| Detection { label: label.to_owned(), t, known: t + 300, slope: 1.0, repaired: false };
        let event = |label: &str, t| Reference { label: label.to_owned(), t };
        let found = [
            detected("lift", 9_000),
            detected("contact", 1_000),
            detected("contact", 2_000),
            detected("contact", 900_000),
        ];
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
        let spread = Spread::new(&[4.0, 1.0, 2.0, 3.0]);
        assert_eq!((spread.mean, spread.median), (2.5, 2.5));
        assert!((spread.sd - (5.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!((spread.low - 1.075).abs() < 1e-12 && (spread.high - 3.925).abs() < 1e-12);
        assert!(Spread::new(&[]).mean.is_nan() && Spread::new(&[1.0]).sd.is_nan());
    }

    #[test]
    fn windows_that_make_no_sense_are_refused() {
        let never = Stop::never();
        let references = [Reference { label: "a".into(), t: 0 }];
        assert!(score(&[], &references, &[-1], never).is_err());
        assert!(score(&[], &references, &[i64::MAX], never).is_err());
        assert!(score(&[], &[Reference { label: "a".into(), t: 0 }], &[], never).is_err());
    }
}
