//! SPIKE distance: the distance of spikes to the nearest spikes of the other train, averaged over time.

use super::distance::{Distance, Ready};
use super::edges::{IntervalWalk, ObservationWindow, Within, averaged, distinct, mean, spikes_at_start};
use super::patterns::Patterns;
use super::van_rossum_absolute::Exposure;
use crate::Result;
use crate::parameters::Described;

averaged! {
    /// The mean over the window of the distance between the spikes around each time and their nearest ones in the other
    /// train.
    ///
    /// Kreuz et al. (2013), J. Neurophysiol. 109:1457. The profile is linear between spikes and integrated exactly. Edges
    /// and empty trains are treated as in `PySpike`. Time O(n + m). Not a metric: the triangle inequality need not hold.
    SpikeDistance
}

/// The distance between two ascending trains inside the window.
fn between(a: &[f64], b: &[f64], window: ObservationWindow) -> f64 {
    let (a, b) = (distinct(a, window), distinct(b, window));
    let (far_a, far_b) = (Far::new(&a, &b, window), Far::new(&b, &a, window));
    // The profile at `t`, which must be inside the present intervals of both trains.
    let profile = |a: &IntervalWalk<'_>, b: &IntervalWalk<'_>, t: f64| {
        let sum = a.interval + b.interval;
        2.0 * (far_a.at(a, t) * (b.interval / sum) + far_b.at(b, t) * (a.interval / sum)) / sum
    };
    mean(&a, &b, window, |a, b, start, end| 0.5 * (profile(a, b, start) + profile(a, b, end)) * (end - start))
}

/// How far a train's spikes are from the other train.
struct Far {
    /// The distance of each spike to the nearest one of the other train, ms.
    nearest: Vec<f64>,
    /// For a lone spike at the window's start, the distance at the window's end to the nearest spike of the other
    /// train, ms.
    end: f64,
}

impl Far {
    fn new(spikes: &[f64], reference: &[f64], window: ObservationWindow) -> Self {
        // Outside its own spikes the other train gets one more on either side, at the distance of its edge intervals.
        let m = reference.len();
        let beyond = |j: usize| if m > 1 { reference[j + 1] - reference[j] } else { 0.0 };
        let before = window.start.min(reference[0] - beyond(0));
        let after = window.stop.max(reference[m - 1] + if m > 1 { beyond(m - 2) } else { 0.0 });
        let mut j = 0;
        let mut nearest = |t: f64| {
            while j < m && reference[j] < t {
                j += 1;
            }
            let earlier = if j > 0 { reference[j - 1] } else { before };
            let later = if j < m { reference[j] } else { after };
            (t - earlier).min(later - t)
        };
        Self { nearest: spikes.iter().map(|&t| nearest(t)).collect(), end: nearest(window.stop) }
    }

    /// The distance of the spikes around `t` to the other train, ms: linear between spikes, constant outside.
    fn at(&self, walk: &IntervalWalk<'_>, t: f64) -> f64 {
        let (k, n) = (walk.k, walk.spikes.len());
        if k == 0 {
            return self.nearest[0];
        }
        let (from, past) = (self.nearest[k - 1], t - walk.spikes[k - 1]);
        if k < n {
            from + (self.nearest[k] - from) * past / walk.interval
        } else if n == 1 && spikes_at_start(walk.spikes, walk.window) == 1 {
            // A lone spike at the window's start: like PySpike, continue linearly to the window's end.
            from + (self.end - from) * past / walk.interval
        } else {
            from
        }
    }
}
