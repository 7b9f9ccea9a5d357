//! Quantile regression: the line with a given fraction of the points below it.

/// Precision to which a slope is searched, ns/us.
const FINE: f64 = 2e-6;
/// Initial search range around the last slope, ns/us.
const NEAR: f64 = 2e-3;

/// Points with times relative to their mean time, and the number of them that may be below a line.
pub(super) struct Points {
    pub(super) all: Vec<(f64, f64)>,
    pub(super) early: f64,
}

impl Points {
    /// The line with a given slope and the allowed number of points below it: its height at the mean time, and the sum
    /// of the times of the points below, whose sign shows on which side of the mean they are.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) fn line_below(&self, slope: f64) -> (f64, f64) {
        let mut above: Vec<(f64, f64)> = self.all.iter().map(|&(t, late)| (late - slope * t, t)).collect();
        let rank = (self.early.floor() as usize).min(above.len() - 1);
        let (below, &mut (height, at), _) = above.select_nth_unstable_by(rank, |a, b| a.0.total_cmp(&b.0));
        let sum: f64 = below.iter().map(|point| point.1).sum();
        (height, sum + self.early.fract() * at)
    }

    /// The slope, at most `most` in magnitude, at which the points below the line are balanced about the mean time; the
    /// search starts at `last`, which stays if all points are on one side of the mean time, as those of a few
    /// milliseconds.
    pub(super) fn slope(&self, last: f64, most: f64) -> f64 {
        if self.all.iter().all(|point| point.0 <= 0.0) || self.all.iter().all(|point| point.0 >= 0.0) {
            return last;
        }
        let (mut low, mut high) = (-most, most);
        let mut narrow = |slope: f64| {
            if slope <= low || slope >= high {
            } else if self.line_below(slope).1 > 0.0 {
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
        // Rounds to the precision of the search, so that a slope of practically 0 becomes exactly 0.
        (f64::midpoint(low, high) / FINE).round() * FINE + 0.0
    }
}
