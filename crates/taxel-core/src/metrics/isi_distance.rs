//! ISI distance: the difference between the trains' interspike intervals, averaged over time.

use serde::{Deserialize, Serialize};

use super::distance::{Distance, Ready};
use super::edges::{Window, Within, begun, distinct, interval};
use super::patterns::Patterns;
use super::van_rossum_absolute::Exposure;
use crate::Result;
use crate::parameters::Described;

/// The mean over the window of `|x - y| / max(x, y)`, where x and y are the two trains' interspike intervals at each
/// time.
///
/// Kreuz et al. (2007), J. Neurosci. Methods 165:151. The profile is constant between spikes and integrated exactly.
/// Edges and empty trains are treated as in `PySpike`. Time O(n + m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IsiDistance {
    /// Start and end of the window, ms; by default the patterns' own window.
    #[serde(default)]
    pub window: Option<(f64, f64)>,
}

impl Distance for IsiDistance {
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
    let (mut i, mut j) = (begun(&a, window), begun(&b, window));
    let (mut sum, mut last) = (0.0, window.start);
    let (mut x, mut y) = (interval(&a, i, window), interval(&b, j, window));
    loop {
        let (next_a, next_b) = (a.get(i).copied(), b.get(j).copied());
        let next = next_a.unwrap_or(window.stop).min(next_b.unwrap_or(window.stop));
        // At the window's end both intervals can have length 0, but then no time is left to integrate.
        if next > last {
            sum += (x - y).abs() / x.max(y) * (next - last);
            last = next;
        }
        if next_a.is_none() && next_b.is_none() {
            break;
        }
        if next_a == Some(next) {
            i += 1;
            x = interval(&a, i, window);
        }
        if next_b == Some(next) {
            j += 1;
            y = interval(&b, j, window);
        }
    }
    mean(sum, window)
}

/// The mean of a profile over the window, from its integral; 0 if the window has no duration.
pub(super) fn mean(sum: f64, window: Window) -> f64 {
    if window.stop > window.start { sum / (window.stop - window.start) } else { 0.0 }
}
