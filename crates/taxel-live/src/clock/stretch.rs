//! A stretch of arrivals, of which the fastest are stored.

use super::offset::Offset;

/// Duration of a part of a stretch, in which the fastest points are stored, us. Within it the drift of a quartz cannot
/// change which points are the fastest.
pub(super) const PART_US: i64 = 10_000;
/// Number of points stored for each part.
pub(super) const QUICK: usize = 2;

/// Number of stretches from which the line is fitted: 64 s, within which the rate of a quartz is constant.
pub(super) const STRETCHES: usize = 256;
/// Duration beyond which a slope larger than that of a quartz is accepted, us.
pub(super) const LONG_US: i64 = 10_000_000;

/// Fraction of the points that may be below the line.
const EARLY: f64 = 0.01;

/// Board time in us, and arrival minus board time in ns.
pub(super) type ArrivalPoint = (i64, i64);

/// The fastest points of a stretch, and the mean time of all its points.
#[derive(Debug, Clone, Default)]
pub(super) struct ArrivalStretch {
    /// The fastest points; those of one part are adjacent if they arrived in order.
    pub(super) quick: Vec<ArrivalPoint>,
    pub(super) points: u64,
    /// Sum of board times since the first, us.
    pub(super) sum: i64,
    pub(super) first: i64,
    pub(super) last: i64,
}

impl ArrivalStretch {
    pub(super) fn push(&mut self, point: ArrivalPoint) {
        if self.points > 0 && point.0 == self.last {
            // Datagrams of a train, which could all be sent at one time, form one point: the fastest of them.
            if let Some(same) = self.quick.iter_mut().rev().find(|quick| quick.0 == point.0) {
                same.1 = same.1.min(point.1);
                return;
            }
        } else {
            if self.points == 0 {
                (self.first, self.last) = (point.0, point.0);
            }
            self.points += 1;
            self.sum += point.0 - self.first;
            self.last = self.last.max(point.0);
        }
        let part = point.0.div_euclid(PART_US);
        let (mut rivals, mut slowest) = (0, 0);
        for (k, quick) in self.quick.iter().enumerate().rev().filter(|(_, quick)| quick.0.div_euclid(PART_US) == part) {
            if rivals == 0 || quick.1 > self.quick[slowest].1 {
                slowest = k;
            }
            rivals += 1;
            if rivals == QUICK {
                break;
            }
        }
        if rivals < QUICK {
            self.quick.push(point);
        } else if point.1 < self.quick[slowest].1 {
            self.quick[slowest] = point;
        }
    }

    /// The lowest point.
    pub(super) fn lowest(&self) -> Option<ArrivalPoint> {
        self.quick.iter().copied().min_by_key(|quick| quick.1)
    }

    /// Number of points that may lie below the line: the share `EARLY` of all, at most half of the points that are stored.
    #[allow(clippy::cast_precision_loss)]
    pub(super) fn early_points(&self) -> f64 {
        (EARLY * self.points as f64).min(self.quick.len() as f64 / 2.0)
    }

    /// Removes points far above a line.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) fn thin(&mut self, line: Offset) {
        self.quick.sort_unstable_by_key(|&(t, late)| late + t * 1000 - line.host_ns(t));
        self.quick.truncate((2.0 * self.early_points()).ceil() as usize);
    }
}
