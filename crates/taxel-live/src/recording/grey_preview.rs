//! The low-rate preview: values above rest in grey, so that a viewer shows touches and not the sensor's rest.

use std::collections::VecDeque;

use taxel_core::encode::Tare;
use taxel_core::rest::{NOISE_FLOOR, Rest, TrackedRest, Value};

/// White is the largest value of this period, us.
const SCALE_US: i64 = 10_000_000;

/// Largest age of a preview relative to the latest one, us, at which it is drawn with that one's scale.
const LATE_US: i64 = 1_000_000;

/// From values to grey: what each taxel reads at rest, and how strongly it was pressed lately.
#[derive(Debug)]
pub(super) struct GreyScale {
    rest: Rest<f64>,
    /// The rest as it is tracked, from the first preview on, unless a tare was given.
    tracked: Option<TrackedRest>,
    tared: bool,
    /// The largest values above rest of the last 10 s, with their times, us; they decrease, so the first, which is white, is the
    /// largest.
    peaks: VecDeque<(i64, f64)>,
}

/// A preview, and the meaning of its grey values.
#[derive(Debug, PartialEq)]
pub(super) struct GreyPreview {
    /// 0 at rest, 255 at `full`, row by row.
    pub(super) bytes: Vec<u8>,
    /// The rest that was subtracted.
    pub(super) rest: &'static str,
    /// Value of white, ticks above rest.
    pub(super) full: f64,
}

impl GreyScale {
    /// The scale of so many taxels, whose rest is tracked.
    pub(super) fn new(taxels: usize) -> Self {
        Self { rest: Rest::measured(vec![f64::NO_REST; taxels]), tracked: None, tared: false, peaks: VecDeque::new() }
    }

    /// Subtracts a tare's rest from now on.
    pub(super) fn tare(&mut self, tare: &Tare) {
        // A taxel without any event so far reads 0 and rests there.
        self.rest = Rest::measured(tare.rest.iter().map(|rest| rest.unwrap_or(0.0)).collect());
        (self.tracked, self.tared) = (None, true);
        self.peaks.clear();
    }

    /// Subtracts this rest from the values of a taxel from now on.
    pub(super) fn zero(&mut self, taxel: usize, rest: f64) {
        if taxel < self.rest.values().len() {
            self.rest.set(taxel, rest);
        }
    }

    /// The grey preview of the values at `t_us`; a value of 0 is also that of a taxel without any event so far.
    pub(super) fn draw(&mut self, t_us: i64, columns: usize, held: &[u16]) -> GreyPreview {
        if self.rest.values().len() != held.len() {
            *self = Self::new(held.len());
        }
        if !self.tared {
            let fresh_rest = || TrackedRest::new(columns, NOISE_FLOOR, vec![f64::NO_REST; held.len()]);
            let tracked = self.tracked.get_or_insert_with(fresh_rest);
            tracked.take(t_us, held.iter().map(|&value| if value == 0 { f32::NAN } else { value.into() }));
            for (taxel, rest) in tracked.rests().enumerate() {
                self.rest.track(taxel, rest.unwrap_or(f64::NO_REST));
            }
        }
        let mut above = vec![0.0; held.len()];
        for (taxel, &value) in held.iter().enumerate().filter(|(_, value)| **value > 0) {
            self.rest.follow(taxel, value.into());
            above[taxel] = self.rest.above(taxel, value.into());
        }
        let quiet = self.tracked.as_ref().map(|tracked| tracked.quiet().is_some());
        let rest = quiet.map_or("tare", |quiet| if quiet { "quiet stretch" } else { "first values" });
        let full = self.full(t_us, above.iter().copied().fold(0.0, f64::max));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let bytes = above.iter().map(|&value| (value / full * 255.0).round().min(255.0) as u8).collect();
        GreyPreview { bytes, rest, full }
    }

    /// The value of white of a preview with this largest value: at least one tick, so that a sensor at rest stays black.
    fn full(&mut self, t_us: i64, peak: f64) -> f64 {
        let late = self.peaks.back().is_some_and(|&(t, _)| (1..=LATE_US).contains(&t.saturating_sub(t_us)));
        // If time steps far back, the scale starts again.
        let t_us = if late { self.peaks.back().map_or(t_us, |&(t, _)| t) } else { t_us };
        while self.peaks.front().is_some_and(|&(t, _)| t <= t_us.saturating_sub(SCALE_US) || t > t_us) {
            self.peaks.pop_front();
        }
        while self.peaks.back().is_some_and(|&(_, earlier)| earlier <= peak) {
            self.peaks.pop_back();
        }
        self.peaks.push_back((t_us, peak));
        self.peaks.front().map_or(1.0, |&(_, largest)| largest.max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_core::Array;

    /// A scale above this rest, which does not change.
    fn tared(rest: &[f64]) -> GreyScale {
        let array = Array { rows: 1, columns: rest.len() as u16, ..Array::thesis() };
        let rest: Vec<_> = rest.iter().map(|&rest| Some(rest)).collect();
        let mut scale = GreyScale::new(array.len());
        scale.tare(&Tare { array, noise: vec![None; rest.len()], rest, start_us: 0, stop_us: 1, note: String::new() });
        scale
    }

    #[test]
    fn rest_is_black_and_the_largest_of_the_last_ten_seconds_white() {
        let mut scale = tared(&[100.0, 50.0, 7.0]);
        let first = scale.draw(0, 3, &[100, 50, 0]);
        assert_eq!(first, GreyPreview { bytes: vec![0, 0, 0], rest: "tare", full: 1.0 });
        let pressed = scale.draw(100_000, 3, &[160, 80, 0]);
        assert_eq!((pressed.bytes, pressed.full), (vec![255, 128, 0], 60.0));
        // A weaker press next to a stronger one, then alone: it becomes white ten seconds later.
        assert_eq!(scale.draw(5_000_000, 3, &[130, 50, 7]).bytes, [128, 0, 0]);
        assert_eq!(scale.draw(10_100_000, 3, &[130, 50, 7]).bytes, [255, 0, 0]);
    }

    #[test]
    fn what_stays_for_half_a_second_is_a_rest_and_values_below_it_are_black() {
        let mut scale = GreyScale::new(2);
        for k in 0..7 {
            // A taxel that moves every time is no quiet stretch.
            assert_eq!(scale.draw(k * 100_000, 2, &[100, 20 + 10 * (k as u16 % 2)]).rest, "first values");
        }
        for k in 7..20 {
            scale.draw(k * 100_000, 2, &[100, 20]);
        }
        let grey = scale.draw(2_000_000, 2, &[90, 60]);
        assert_eq!((grey.bytes, grey.rest), (vec![0, 255], "quiet stretch"));
    }

    #[test]
    fn a_preview_that_comes_late_keeps_the_scale() {
        let mut scale = tared(&[100.0]);
        scale.draw(0, 1, &[100]);
        assert_eq!(scale.draw(1_000_000, 1, &[140]).full, 40.0);
        assert_eq!(scale.draw(1_500_000, 1, &[120]).full, 40.0);
        // Previews from half a second ago, weaker and stronger than the latest values.
        assert_eq!(scale.draw(1_400_000, 1, &[110]).bytes, [64]);
        assert_eq!(scale.draw(1_450_000, 1, &[180]).full, 80.0);
        assert_eq!(scale.draw(1_600_000, 1, &[140]).bytes, [128]);
        // The clock restarts.
        assert_eq!(scale.draw(0, 1, &[140]).bytes, [255]);
    }

    #[test]
    fn a_zeroed_taxel_is_black_until_it_is_pressed() {
        let mut scale = GreyScale::new(2);
        scale.draw(0, 2, &[100, 100]);
        assert_eq!(scale.draw(1, 2, &[130, 140]).bytes, [191, 255]);
        scale.zero(0, 130.0);
        assert_eq!(scale.draw(2, 2, &[130, 140]).bytes, [0, 255]);
        assert_eq!(scale.draw(3, 2, &[150, 140]).bytes, [128, 255]);
    }

    #[test]
    fn a_tare_is_what_is_subtracted_once_there_is_one() {
        let array = Array { rows: 1, columns: 3, ..Array::thesis() };
        let rest = vec![Some(90.5), None, Some(20.0)];
        let tare = Tare { array, rest, noise: vec![None; 3], start_us: 0, stop_us: 1, note: String::new() };
        let mut scale = GreyScale::new(3);
        scale.draw(0, 3, &[100, 50, 20]);
        scale.tare(&tare);
        let grey = scale.draw(100_000, 3, &[110, 39, 20]);
        assert_eq!(grey, GreyPreview { bytes: vec![128, 255, 0], rest: "tare", full: 39.0 });
    }
}
