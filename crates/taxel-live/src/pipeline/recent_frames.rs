//! The latest frames of a source at some distance, from which the rest of its taxels is taken.

use std::collections::VecDeque;

/// Frames are kept this far apart at least, ns, and this many at most: the last second of a fast source.
const EVERY_NS: i64 = 50_000_000;
const COUNT: usize = 20;

/// A taxel's middle is over this time, ns.
const MIDDLE_NS: i64 = 1_000_000_000;

/// The latest frames, each with its arrival, ns since 1970.
#[derive(Debug, Default)]
pub(super) struct RecentFrames(VecDeque<(i64, Vec<f32>)>);

impl RecentFrames {
    /// Takes a frame that arrived at `at_ns`, which is kept if it is far enough behind the last one.
    pub(super) fn take(&mut self, at_ns: i64, values: &[f32]) {
        if self.0.back().is_some_and(|(last_ns, _)| at_ns - last_ns < EVERY_NS) {
            return;
        }
        // The oldest one's memory is used again.
        let mut kept =
            if self.0.len() == COUNT { self.0.pop_front().map_or_else(Vec::new, |(_, kept)| kept) } else { vec![] };
        values.clone_into(&mut kept);
        self.0.push_back((at_ns, kept));
    }

    /// The median of a taxel's values over the last second, or its last value; none without a value.
    pub(super) fn middle(&self, taxel: usize) -> Option<f64> {
        let last_ns = self.0.back()?.0;
        let recent = self.0.iter().rev().take_while(|(at_ns, _)| last_ns - at_ns < MIDDLE_NS);
        let mut values: Vec<f64> =
            recent.map(|(_, frame)| f64::from(frame[taxel])).filter(|value| !value.is_nan()).collect();
        values.sort_by(f64::total_cmp);
        let middle = values.len() / 2;
        let upper = *values.get(middle)?;
        Some(if values.len().is_multiple_of(2) { f64::midpoint(values[middle - 1], upper) } else { upper })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_is_that_of_the_last_second_without_touches_and_missing_values() {
        let mut recent = RecentFrames::default();
        assert_eq!(recent.middle(0), None);
        for k in 0..3000_i64 {
            let touched = k < 2400;
            recent.take(k * 1_000_000, &[if touched { 900.0 } else { 500.0 + (k % 7) as f32 }, f32::NAN]);
        }
        assert!((500.0..=506.0).contains(&recent.middle(0).unwrap()));
        assert_eq!(recent.middle(1), None);
        assert_eq!(recent.0.len(), COUNT);
    }

    #[test]
    fn a_slow_source_has_the_last_frame_alone() {
        let mut recent = RecentFrames::default();
        for (k, value) in [7.0, 8.0, 3.0].into_iter().enumerate() {
            recent.take(k as i64 * 1_000_000_000, &[value]);
        }
        assert_eq!(recent.middle(0), Some(3.0));
    }
}
