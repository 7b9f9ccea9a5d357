//! SPIKE distance: the distance of spikes to the nearest spikes of the other train, averaged over time.

use serde::{Deserialize, Serialize};

use super::distance::{Distance, Ready};
use super::edges::{Window, Within, begun, distinct, interval};
use super::isi_distance::mean;
use super::patterns::Patterns;
use super::van_rossum_absolute::Exposure;
use crate::Result;
use crate::parameters::Described;

/// The mean over the window of the distance between the spikes around each time and their nearest ones in the other
/// train.
///
/// Kreuz et al. (2013), J. Neurophysiol. 109:1457. The profile is linear between spikes and integrated exactly. Edges
/// and empty trains are treated as in `PySpike`. Time O(n + m). Not a metric: the triangle inequality need not hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpikeDistance {
    /// Start and end of the window, ms; by default the patterns' own window.
    #[serde(default)]
    pub window: Option<(f64, f64)>,
}

impl Distance for SpikeDistance {
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

/// The distance between two ascending trains inside the window.
pub(super) fn between(a: &[f64], b: &[f64], window: Window) -> f64 {
    let (a, b) = (distinct(a, window), distinct(b, window));
    let (mut a, mut b) = (Side::new(&a, &b, window), Side::new(&b, &a, window));
    let (mut sum, mut last) = (0.0, window.start);
    loop {
        let (next_a, next_b) = (a.next(), b.next());
        let next = next_a.unwrap_or(window.stop).min(next_b.unwrap_or(window.stop));
        if next > last {
            sum += 0.5 * (profile(&a, &b, last) + profile(&a, &b, next)) * (next - last);
            last = next;
        }
        if next_a.is_none() && next_b.is_none() {
            break;
        }
        if next_a == Some(next) {
            a.step();
        }
        if next_b == Some(next) {
            b.step();
        }
    }
    mean(sum, window)
}

/// The profile at `t`, which must be inside the present intervals of both trains.
fn profile(a: &Side<'_>, b: &Side<'_>, t: f64) -> f64 {
    let both = a.interval + b.interval;
    2.0 * (a.far(t) * (b.interval / both) + b.far(t) * (a.interval / both)) / both
}

/// One train, traversed interval by interval.
struct Side<'s> {
    spikes: &'s [f64],
    /// The distance of each spike to the nearest one of the other train, ms.
    far: Vec<f64>,
    window: Window,
    /// The number of spikes already passed.
    k: usize,
    interval: f64,
    /// For a lone spike at the window's start, the distance at the window's end to the nearest spike of the other
    /// train, ms.
    end: f64,
}

impl<'s> Side<'s> {
    fn new(spikes: &'s [f64], other: &[f64], window: Window) -> Self {
        let k = begun(spikes, window);
        // Outside its own spikes the other train gets one more on either side, at the distance of its edge intervals.
        let m = other.len();
        let beyond = |j: usize| if m > 1 { other[j + 1] - other[j] } else { 0.0 };
        let before = window.start.min(other[0] - beyond(0));
        let after = window.stop.max(other[m - 1] + if m > 1 { beyond(m - 2) } else { 0.0 });
        let mut j = 0;
        let mut nearest = |t: f64| {
            while j < m && other[j] < t {
                j += 1;
            }
            let earlier = if j > 0 { other[j - 1] } else { before };
            let later = if j < m { other[j] } else { after };
            (t - earlier).min(later - t)
        };
        let far = spikes.iter().map(|&t| nearest(t)).collect();
        Self { spikes, far, window, k, interval: interval(spikes, k, window), end: nearest(window.stop) }
    }

    fn next(&self) -> Option<f64> {
        self.spikes.get(self.k).copied()
    }

    fn step(&mut self) {
        self.k += 1;
        self.interval = interval(self.spikes, self.k, self.window);
    }

    /// The distance of the spikes around `t` to the other train, ms: linear between spikes, constant outside.
    fn far(&self, t: f64) -> f64 {
        let (k, n) = (self.k, self.spikes.len());
        if k == 0 {
            return self.far[0];
        }
        let (from, past) = (self.far[k - 1], t - self.spikes[k - 1]);
        if k < n {
            from + (self.far[k] - from) * past / self.interval
        } else if n == 1 && begun(self.spikes, self.window) == 1 {
            // A lone spike at the window's start: like PySpike, continue linearly to the window's end.
            from + (self.end - from) * past / self.interval
        } else {
            from
        }
    }
}
