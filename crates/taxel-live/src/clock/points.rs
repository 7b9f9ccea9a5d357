//! Quantile regression: the line that a share of the points lies below.

/// How well a slope is known when it is searched no further, ns/us.
const FINE: f64 = 2e-6;
/// How far from the last one a slope is looked for first, ns/us.
const NEAR: f64 = 2e-3;

/// Points, times from their mean time on, of which so many may lie below a line.
pub(super) struct Points {
    pub(super) all: Vec<(f64, f64)>,
    pub(super) early: f64,
}

impl Points {
    /// The line of a slope that so many points lie below: its height at the mean time, and to which side of that those below
    /// it lie, the sum of their times.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) fn under(&self, slope: f64) -> (f64, f64) {
        let mut above: Vec<(f64, f64)> = self.all.iter().map(|&(t, late)| (late - slope * t, t)).collect();
        let whole = (self.early.floor() as usize).min(above.len() - 1);
        let (below, &mut (height, at), _) = above.select_nth_unstable_by(whole, |a, b| a.0.total_cmp(&b.0));
        let sum: f64 = below.iter().map(|point| point.1).sum();
        (height, sum + self.early.fract() * at)
    }

    /// The slope within `most` of 0 at which those below the line are balanced; `last` is where it was.
    pub(super) fn slope(&self, last: f64, most: f64) -> f64 {
        let (mut low, mut high) = (-most, most);
        let mut narrow = |slope: f64| {
            if slope <= low || slope >= high {
            } else if self.under(slope).1 > 0.0 {
                high = slope;
            } else {
                low = slope;
            }
            (low, high)
        };
        narrow(last - NEAR);
        let (mut low, mut high) = narrow(last + NEAR);
        while high - low > FINE {
            (low, high) = narrow(f64::midpoint(low, high));
        }
        // No finer than it was searched, and 0 where it is as good as that.
        (f64::midpoint(low, high) / FINE).round() * FINE + 0.0
    }
}
