//! ISI distance: the difference between the trains' interspike intervals, averaged over time.

use super::distance::{Distance, Ready};
use super::edges::{ObservationWindow, Within, averaged, distinct, mean};
use super::patterns::Patterns;
use super::van_rossum_absolute::Exposure;
use crate::Result;
use crate::parameters::Described;

averaged! {
    /// The mean over the window of `|x - y| / max(x, y)`, where x and y are the two trains' interspike intervals at each
    /// time.
    ///
    /// Kreuz et al. (2007), J. Neurosci. Methods 165:151. The profile is constant between spikes and integrated exactly.
    /// Edges and empty trains are treated as in `PySpike`. Time O(n + m).
    IsiDistance
}

/// The distance between two ascending trains inside the window.
fn between(a: &[f64], b: &[f64], window: ObservationWindow) -> f64 {
    mean(&distinct(a, window), &distinct(b, window), window, |a, b, start, end| {
        let (x, y) = (a.interval, b.interval);
        (x - y).abs() / x.max(y) * (end - start)
    })
}
