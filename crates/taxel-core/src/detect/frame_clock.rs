//! The frames of a board, or of an input of frames: the number of a time's frame, and the end of that frame, which is the earliest
//! time at which the host can know of an event in it.

use crate::spikes::ms;
use crate::wire::STAMP_US;
use crate::{Result, problem};

/// The duration of frames, and the unit of their time stamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameTime {
    /// The duration of a frame, us.
    pub period_us: f64,
    /// The unit of a time stamp, us: 100 with version 1 of the wire (Table 5.4), 1 with version 2.
    pub stamp_us: i64,
}

impl FrameTime {
    /// Frames of `period_us`, with time stamps of this version of the wire.
    #[must_use]
    pub fn on_wire(period_us: f64, version: u8) -> Self {
        Self { period_us, stamp_us: if version == 2 { 1 } else { STAMP_US } }
    }
}

impl From<f64> for FrameTime {
    /// Frames of `period_us`, with time stamps of version 1 of the wire.
    fn from(period_us: f64) -> Self {
        Self::on_wire(period_us, 1)
    }
}

/// Finds the frame of a time stamp, and the end of that frame.
///
/// With frame sync all events of a frame carry the stamp of its start, rounded down to whole units, which is up to one
/// unit *before* the start of the frame. A time therefore belongs to the frame with the last stamp at or before it,
/// even if the previous frame still lasts at that time. In version 1, frame `k` of 192 us has the stamp
/// `floor(1.92 k)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameClock {
    period_ns: i128,
    stamp_ns: i128,
    /// When the last frame of an input of frames began, ns; with events the board's frames start at time 0.
    last: Option<i128>,
}

impl FrameClock {
    /// A clock for frames of this duration and stamp unit.
    ///
    /// # Errors
    ///
    /// `Problem` if the period is not between 1 us and one hour.
    pub fn new(frames: impl Into<FrameTime>) -> Result<Self> {
        let FrameTime { period_us, stamp_us } = frames.into();
        if !(1.0..=3.6e9).contains(&period_us) {
            return Err(problem!("frame_us"; " is {period_us}: must be from 1 to 3600000000 us"));
        }
        let stamp_ns = i128::from(stamp_us) * 1000;
        Ok(Self { period_ns: (period_us * 1000.0).round() as i128, stamp_ns, last: None })
    }

    /// Starts a frame of the input at `t` us, with which frames are aligned from now on.
    pub fn start_frame(&mut self, t: i64) {
        self.last = Some(i128::from(t) * 1000);
    }

    /// The end of the frame to which the time `t` ms belongs, us, rounded up.
    #[must_use]
    pub fn end_of(&self, t: f64) -> i64 {
        // In whole ns, because rounding must not move a time that equals a stamp into the frame before.
        let t = (t * 1e6).round() as i128;
        let end = match self.last {
            Some(start_ns) => start_ns + ((t - start_ns).div_euclid(self.period_ns) + 1) * self.period_ns,
            None => (self.board_frame(t) + 1) * self.period_ns,
        };
        whole_us(end)
    }

    /// The ends of the frames to which times belong, us, as [`FrameClock::end_of`] gives them as they come; `times` (ms)
    /// and the times of the input's `frames` (us; none of events) ascend.
    #[must_use]
    pub fn ends_of(mut self, times: &[f64], frames: &[i64]) -> Vec<i64> {
        let mut frames = frames.iter().peekable();
        let end = |&t: &f64| {
            while let Some(&start) = frames.next_if(|&&start| ms(start) <= t) {
                self.start_frame(start);
            }
            self.end_of(t)
        };
        times.iter().map(end).collect()
    }

    /// Whether the frame that holds at `at` us is complete if no input before `t` us follows.
    #[must_use]
    pub fn is_over(&self, at: i64, t: i64) -> bool {
        let [frame, now] = [at, t].map(|t| self.board_frame(i128::from(t) * 1000));
        if self.last.is_some() { at < t } else { frame < now }
    }

    /// The number of the last of the board's frames that starts before the stamp after `t` ns.
    fn board_frame(&self, t: i128) -> i128 {
        let next_stamp = (t.div_euclid(self.stamp_ns) + 1) * self.stamp_ns;
        -(-next_stamp).div_euclid(self.period_ns) - 1
    }
}

/// Whole us, rounded up.
fn whole_us(ns: i128) -> i64 {
    i64::try_from(ns.div_euclid(1000) + i128::from(ns.rem_euclid(1000) > 0)).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stamp_belongs_to_its_frame() {
        let clock = FrameClock::new(192.0).unwrap();
        for k in 0..100_000_i64 {
            let stamp_us = 192 * k / 100 * 100;
            assert_eq!(clock.end_of(stamp_us as f64 / 1000.0), 192 * (k + 1), "frame {k}");
            // The frame's start and the last moment before the next stamp belong to the same frame.
            assert_eq!(clock.end_of(k as f64 * 0.192), 192 * (k + 1), "frame {k}");
            let next_us = 192 * (k + 1) / 100 * 100;
            assert_eq!(clock.end_of((next_us as f64 - 0.001) / 1000.0), 192 * (k + 1), "frame {k}");
        }
    }

    #[test]
    fn stamps_of_a_us_belong_to_the_frame_that_fills_that_moment() {
        for period_ns in [48_000_i64, 192_000, 499_200, 999_680, 2_000_000] {
            let clock = FrameClock::new(FrameTime::on_wire(period_ns as f64 / 1000.0, 2)).unwrap();
            for k in 0..20_000 {
                let (start, end) = (k * period_ns, (k + 1) * period_ns);
                // The stamp of the frame's start as the board rounds it down, the frame's middle, and the last moment
                // before the next stamp.
                for t in [start / 1000 * 1000, start + period_ns / 2, end / 1000 * 1000 - 1] {
                    let known = clock.end_of(t as f64 / 1e6);
                    assert_eq!(known, (end + 999) / 1000, "frame {k} of {period_ns} ns, {t} ns");
                }
            }
        }
    }

    #[test]
    fn a_frame_never_ends_before_what_happens_in_it() {
        for period in [48.0, 192.0, 499.84, 1000.0, 2000.0] {
            let clock = FrameClock::new(period).unwrap();
            for k in 0..50_000 {
                let t = f64::from(k) * 0.0137;
                let end = clock.end_of(t) as f64 / 1000.0;
                assert!(end >= t && end <= t + period / 1000.0 + 0.101, "{t} ms in a frame that ends at {end} ms");
            }
        }
    }

    #[test]
    fn frames_are_aligned_with_those_of_the_input() {
        let mut clock = FrameClock::new(2000.0).unwrap();
        clock.start_frame(7_000);
        assert_eq!([7.0, 8.999, 9.0, 13.5].map(|t| clock.end_of(t)), [9_000, 9_000, 11_000, 15_000]);
    }

    #[test]
    fn a_period_that_makes_no_sense_is_refused() {
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e12] {
            assert!(FrameClock::new(wrong).is_err());
        }
    }
}
