//! The window of the ISI and SPIKE distances, and the intervals before the first and after the last spike.

use super::distance::{Pattern, Ready, summed};
use super::patterns::Patterns;
use crate::{Result, Stop, problem};

/// The start and end of the time that counts, ms.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    pub(super) start: f64,
    pub(super) stop: f64,
}

/// A distance of two ascending trains inside a window.
pub(super) struct Within {
    pub(super) window: Window,
    pub(super) between: fn(&[f64], &[f64], Window) -> f64,
}

impl Ready for Within {
    fn between(&self, a: Pattern<'_>, b: Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        summed(a, b, stop, |a, b| Ok((self.between)(a, b, self.window)))
    }
}

/// The given window, or by default the widest of the patterns' own; every spike must be inside.
pub(super) fn window(asked: Option<(f64, f64)>, a: &Patterns<'_>, b: Option<&Patterns<'_>>) -> Result<Window> {
    let sides = || std::iter::once(a).chain(b);
    let widest = || {
        sides().map(|p| p.window).try_fold((f64::INFINITY, f64::NEG_INFINITY), |wide, own| {
            own.map(|own| (wide.0.min(own.0), wide.1.max(own.1)))
        })
    };
    let Some((start, stop)) = asked.or_else(widest) else {
        return Err(problem!("window: must be given, (start, stop) in ms, as lists of times do not say it"));
    };
    for side in sides() {
        for (p, n) in (0..side.count).flat_map(|p| (0..side.trains).map(move |n| (p, n))) {
            let train = side.train(p, n);
            if let Some(k) = train.iter().position(|&t| t < start || t > stop) {
                let place = side.place(p, n);
                return Err(problem!(
                    "{place}, spike {k}: {} ms lies outside the window {start} to {stop} ms",
                    train[k]
                ));
            }
        }
    }
    Ok(Window { start, stop })
}

/// The spikes as these distances use them: without duplicates; an empty train gets a spike at each end of the window.
pub(super) fn distinct(train: &[f64], window: Window) -> Vec<f64> {
    if train.is_empty() {
        return vec![window.start, window.stop];
    }
    let mut spikes = train.to_vec();
    spikes.dedup();
    spikes
}

/// The interval between spikes `k - 1` and `k` of a train with at least one spike.
///
/// Before the first and after the last spike the interval extends to the window's edge, or is as long as the
/// neighbouring interval if that is longer.
pub(super) fn interval(spikes: &[f64], k: usize, window: Window) -> f64 {
    let n = spikes.len();
    let beside = |j: usize| if n > 1 { spikes[j + 1] - spikes[j] } else { 0.0 };
    if k == 0 {
        (spikes[0] - window.start).max(beside(0))
    } else if k == n {
        (window.stop - spikes[n - 1]).max(if n > 1 { beside(n - 2) } else { 0.0 })
    } else {
        beside(k - 1)
    }
}

/// The number of spikes at the window's start: 0 or 1.
pub(super) fn begun(spikes: &[f64], window: Window) -> usize {
    usize::from(spikes[0] <= window.start)
}
