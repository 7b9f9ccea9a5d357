//! The points of a time grid: their times and numbers, and limits on how many are stored or stepped through.
//!
//! Far from time 0, neighbouring floating-point times are so far apart that rounding `start + k step_ms` moves a time
//! by more than a trained potential tolerates. The state of a neuron and the ages of its inputs are therefore both
//! computed from step numbers, never from differences of rounded times.

use super::rounding_ms;
use crate::{Result, problem};

/// Limits on the points that are stored (a few GB), and on those that are stepped through (about ten seconds).
pub const MOST_LAID_OUT: f64 = 2e7;
pub(super) const MOST_STEPPED: f64 = 1e9;

/// The points `start + k step_ms`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// The time of point 0, ms.
    pub start: f64,
    /// The time between points, ms.
    pub step_ms: f64,
}

/// A time relative to the nearest point of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridTime {
    /// The number of the nearest point.
    point: f64,
    /// The time since that point, ms; 0 at the point itself, negative before it.
    rest: f64,
}

impl GridTime {
    /// The point with number `point` itself.
    pub fn at(point: f64) -> Self {
        Self { point, rest: 0.0 }
    }

    /// Whether the time is exactly a grid point.
    pub fn is_point(self) -> bool {
        self.rest == 0.0
    }

    /// The first point at or after the time.
    pub fn from(self) -> f64 {
        if self.rest > 0.0 { self.point + 1.0 } else { self.point }
    }

    /// The first point after the time.
    pub fn behind(self) -> f64 {
        if self.rest >= 0.0 { self.point + 1.0 } else { self.point }
    }

    /// The last point at or before the time.
    pub fn until(self) -> f64 {
        if self.rest < 0.0 { self.point - 1.0 } else { self.point }
    }
}

impl Grid {
    /// The grid of these.
    #[must_use]
    pub fn new(start: f64, step_ms: f64) -> Self {
        Self { start, step_ms }
    }

    /// The time of a point, ms.
    pub fn time(&self, point: f64) -> f64 {
        self.start + point * self.step_ms
    }

    /// The nearest point to a time, and the distance from it, which is exact. The point's rounded time decides whether
    /// `t` is before or after it.
    pub fn locate(&self, t: f64) -> GridTime {
        let since = t - self.start;
        let point = (since / self.step_ms).round();
        let rounded = self.time(point);
        if t == rounded {
            return GridTime::at(point);
        }
        // The rounding error of `t - start`.
        let back = since + self.start;
        let lost = (t - back) + ((back - since) - self.start);
        let rest = (-point).mul_add(self.step_ms, since) + lost;
        GridTime { point, rest: if t > rounded { rest.max(f64::MIN_POSITIVE) } else { rest.min(-f64::MIN_POSITIVE) } }
    }

    /// Whether a time is at or before a point, within rounding.
    pub fn has_come(&self, t: f64, point: f64) -> bool {
        let now = self.time(point);
        t <= now + rounding_ms(now)
    }

    /// Whether a time is a grid point, within rounding.
    pub fn is_at_point(&self, t: f64) -> bool {
        self.locate(t).rest.abs() <= rounding_ms(t)
    }

    /// The first point at or after a time, within rounding.
    pub fn first_from(&self, t: f64) -> f64 {
        let nearest = self.locate(t).point;
        if self.has_come(t, nearest) { nearest } else { nearest + 1.0 }
    }

    /// The time from `from` to `to`, ms.
    pub fn between(&self, from: GridTime, to: GridTime) -> f64 {
        (to.point - from.point) * self.step_ms + (to.rest - from.rest)
    }

    /// The number of points up to `end`, including a point that is after `end` by rounding alone.
    pub fn points_until(&self, end: f64) -> f64 {
        let time = self.locate(end);
        let last = if self.time(time.point) <= end + rounding_ms(end) { time.point } else { time.until() };
        (last + 1.0).max(0.0)
    }

    /// The largest rounding error of the time of a point, ms.
    pub(super) fn rounding_ms(&self, t: f64) -> f64 {
        4.0 * f64::EPSILON * self.start.abs().max(t.abs())
    }
}

/// The number of points of a grid of `step_ms` from `start` to `end`, ms.
pub fn points_between(start: f64, end: f64, step_ms: f64) -> f64 {
    Grid::new(start, step_ms).points_until(end)
}

/// Refuses more points than `most`, before memory is allocated.
pub fn check_points(points: f64, most: f64, step_ms: f64) -> Result<()> {
    if points <= most {
        return Ok(());
    }
    Err(problem!(
        "step_ms"; " is {step_ms} ms: makes {points:.1e} grid points, more than the limit of {most:.0e}; use a larger \
         step, or fewer or shorter patterns (times are in ms)"
    ))
}
