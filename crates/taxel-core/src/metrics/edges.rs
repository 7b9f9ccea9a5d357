//! What the ISI and SPIKE distances share: their window, the walk over the spikes of two trains, and the intervals before
//! the first and after the last one.

use super::distance::{Pattern, Ready, sum_over_trains};
use super::patterns::Patterns;
use crate::{Result, Stop, problem};

/// The start and end of the time that counts, ms.
#[derive(Debug, Clone, Copy)]
pub(super) struct ObservationWindow {
    pub(super) start: f64,
    pub(super) stop: f64,
}

/// A distance of two ascending trains inside a window.
pub(super) struct Within {
    pub(super) window: ObservationWindow,
    pub(super) between: fn(&[f64], &[f64], ObservationWindow) -> f64,
}

impl Ready for Within {
    fn between(&self, a: Pattern<'_>, b: Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        sum_over_trains(a, b, stop, |a, b| Ok((self.between)(a, b, self.window)))
    }
}

/// The given window, or by default the widest of the patterns' own; every spike must be inside.
pub(super) fn window(
    asked: Option<(f64, f64)>,
    a: &Patterns<'_>,
    b: Option<&Patterns<'_>>,
) -> Result<ObservationWindow> {
    let sides = || std::iter::once(a).chain(b);
    let widest = || {
        sides().map(|p| p.window).try_fold((f64::INFINITY, f64::NEG_INFINITY), |wide, window| {
            window.map(|window| (wide.0.min(window.0), wide.1.max(window.1)))
        })
    };
    let Some((start, stop)) = asked.or_else(widest) else {
        return Err(problem!("window"; ": is missing; with lists of times, give the window as (start, stop) in ms"));
    };
    for side in sides() {
        for (p, n) in (0..side.count).flat_map(|p| (0..side.trains).map(move |n| (p, n))) {
            let train = side.train(p, n);
            if let Some(k) = train.iter().position(|&t| t < start || t > stop) {
                let name = side.train_name(p, n);
                return Err(problem!("{name}, spike {k}: {} ms is outside the window {start} to {stop} ms", train[k]));
            }
        }
    }
    Ok(ObservationWindow { start, stop })
}

/// Declares a distance that is the mean of a profile over the window, which the function `between` of its file computes.
macro_rules! averaged {
    ($(#[$about:meta])* $Kind:ident) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $Kind {
            /// Start and end of the window, ms; by default the patterns' own window.
            #[serde(default)]
            pub window: Option<(f64, f64)>,
        }

        impl Distance for $Kind {
            fn described() -> Described {
                Described::by(&Self { window: None }, &[], &[])
            }

            fn check(&self) -> Result<()> {
                Exposure::check(self.window)
            }

            fn ready<'m>(&'m self, a: &Patterns<'_>, b: Option<&Patterns<'_>>) -> Result<Box<dyn Ready + 'm>> {
                Ok(Box::new(Within { window: super::edges::window(self.window, a, b)?, between }))
            }
        }
    };
}
pub(super) use averaged;

/// A train with at least one spike, walked interval by interval.
pub(super) struct IntervalWalk<'s> {
    pub(super) spikes: &'s [f64],
    pub(super) window: ObservationWindow,
    /// The number of spikes already passed.
    pub(super) k: usize,
    /// The length of the present interval, ms.
    pub(super) interval: f64,
}

impl<'s> IntervalWalk<'s> {
    fn new(spikes: &'s [f64], window: ObservationWindow) -> Self {
        let k = spikes_at_start(spikes, window);
        Self { spikes, window, k, interval: interval(spikes, k, window) }
    }

    fn next(&self) -> Option<f64> {
        self.spikes.get(self.k).copied()
    }

    fn pass(&mut self, t: f64) {
        if self.next() == Some(t) {
            self.k += 1;
            self.interval = interval(self.spikes, self.k, self.window);
        }
    }
}

/// The mean over the window, 0 if it has no duration, of a profile whose integral over each piece without a spike in it
/// is `piece`, of both trains and the piece's start and end.
pub(super) fn mean(
    a: &[f64],
    b: &[f64],
    window: ObservationWindow,
    piece: impl Fn(&IntervalWalk<'_>, &IntervalWalk<'_>, f64, f64) -> f64,
) -> f64 {
    let (mut a, mut b) = (IntervalWalk::new(a, window), IntervalWalk::new(b, window));
    let (mut sum, mut last) = (0.0, window.start);
    loop {
        let (next_a, next_b) = (a.next(), b.next());
        let next = next_a.unwrap_or(window.stop).min(next_b.unwrap_or(window.stop));
        // At the window's end both intervals can have length 0, but then no time is left to integrate.
        if next > last {
            sum += piece(&a, &b, last, next);
            last = next;
        }
        if next_a.is_none() && next_b.is_none() {
            break;
        }
        a.pass(next);
        b.pass(next);
    }
    if window.stop > window.start { sum / (window.stop - window.start) } else { 0.0 }
}

/// The spikes as these distances use them: without duplicates; an empty train gets a spike at each end of the window.
pub(super) fn distinct(train: &[f64], window: ObservationWindow) -> Vec<f64> {
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
fn interval(spikes: &[f64], k: usize, window: ObservationWindow) -> f64 {
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
pub(super) fn spikes_at_start(spikes: &[f64], window: ObservationWindow) -> usize {
    usize::from(spikes[0] <= window.start)
}
