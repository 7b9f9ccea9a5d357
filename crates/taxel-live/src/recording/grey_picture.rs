//! The low-rate picture: values above rest in grey, so that a viewer shows touches and not the sensor's rest.

use std::collections::VecDeque;

use taxel_core::encode::Tare;
use taxel_core::rest::{Rest, Value};

/// White is the largest value of this period, us.
const SCALE_US: i64 = 10_000_000;

/// Largest age of a picture relative to the latest one, us, at which it is drawn with that one's scale.
const LATE_US: i64 = 1_000_000;

/// From values to grey: what each taxel reads at rest, and how strongly it was pressed lately.
#[derive(Debug)]
pub(super) struct GreyScale {
    rest: Rest<f64>,
    /// Largest recent values above rest, with their times, us; they decrease, so the first is the largest.
    peaks: VecDeque<(i64, f64)>,
}

/// A picture, and the meaning of its grey values.
#[derive(Debug, PartialEq)]
pub(super) struct GreyPicture {
    /// 0 at rest, 255 at `full`, row by row.
    pub(super) bytes: Vec<u8>,
    /// The rest that was subtracted.
    pub(super) rest: &'static str,
    /// Value of white, ticks above rest.
    pub(super) full: f64,
}

impl GreyScale {
    /// The scale of so many taxels, above the lowest value of each.
    pub(super) fn new(taxels: usize) -> Self {
        Self { rest: Rest::lowest(vec![f64::NO_REST; taxels]), peaks: VecDeque::new() }
    }

    /// Subtracts a tare's rest from now on.
    pub(super) fn tare(&mut self, tare: &Tare) {
        // A taxel without any event so far reads 0 and rests there.
        self.rest = Rest::measured(tare.rest.iter().map(|rest| rest.unwrap_or(0.0)).collect());
        self.peaks.clear();
    }

    /// Subtracts this rest from the values of a taxel from now on.
    pub(super) fn zero(&mut self, taxel: usize, rest: f64) {
        if taxel < self.rest.values().len() {
            self.rest.set(taxel, rest);
        }
    }

    /// The grey picture of the values at `t_us`; a value of 0 is also that of a taxel without any event so far.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) fn draw(&mut self, t_us: i64, held: &[u16]) -> GreyPicture {
        if self.rest.values().len() != held.len() {
            self.rest = Self::new(held.len()).rest;
        }
        let mut above = vec![0.0; held.len()];
        for (taxel, &value) in held.iter().enumerate().filter(|(_, value)| **value > 0) {
            self.rest.follow(taxel, value.into());
            above[taxel] = self.rest.above(taxel, value.into());
        }
        let rest = if self.rest.is_lowest() { "lowest so far" } else { "tare" };
        let peak = above.iter().copied().fold(0.0, f64::max);
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
        // The scale is at least one tick, so that a sensor at rest stays black.
        let full = self.peaks.front().map_or(1.0, |&(_, largest)| largest.max(1.0));
        let bytes = above.iter().map(|&value| (value / full * 255.0).round().min(255.0) as u8).collect();
        GreyPicture { bytes, rest, full }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_core::Array;

    #[test]
    fn rest_is_black_and_the_largest_of_the_last_ten_seconds_white() {
        let mut scale = GreyScale::new(3);
        let first = scale.draw(0, &[100, 50, 0]);
        assert_eq!(first, GreyPicture { bytes: vec![0, 0, 0], rest: "lowest so far", full: 1.0 });
        let pressed = scale.draw(100_000, &[160, 80, 0]);
        assert_eq!((pressed.bytes, pressed.full), (vec![255, 128, 0], 60.0));
        // A weaker press next to a stronger one, then alone: it becomes white ten seconds later.
        assert_eq!(scale.draw(5_000_000, &[130, 50, 7]).bytes, [128, 0, 0]);
        assert_eq!(scale.draw(10_100_000, &[130, 50, 7]).bytes, [255, 0, 0]);
        // A value below the lowest so far lowers the rest.
        assert_eq!(scale.draw(10_200_000, &[90, 50, 7]).bytes, [0, 0, 0]);
        assert_eq!(scale.draw(30_000_000, &[100, 50, 7]).full, 10.0);
    }

    #[test]
    fn a_picture_that_comes_late_keeps_the_scale() {
        let mut scale = GreyScale::new(1);
        scale.draw(0, &[100]);
        assert_eq!(scale.draw(1_000_000, &[140]).full, 40.0);
        assert_eq!(scale.draw(1_500_000, &[120]).full, 40.0);
        // Pictures from half a second ago, weaker and stronger than the latest values.
        assert_eq!(scale.draw(1_400_000, &[110]).bytes, [64]);
        assert_eq!(scale.draw(1_450_000, &[180]).full, 80.0);
        assert_eq!(scale.draw(1_600_000, &[140]).bytes, [128]);
        // The clock restarts.
        assert_eq!(scale.draw(0, &[140]).bytes, [255]);
    }

    #[test]
    fn a_zeroed_taxel_is_black_until_it_is_pressed() {
        let mut scale = GreyScale::new(2);
        scale.draw(0, &[100, 100]);
        assert_eq!(scale.draw(1, &[130, 140]).bytes, [191, 255]);
        scale.zero(0, 130.0);
        assert_eq!(scale.draw(2, &[130, 140]).bytes, [0, 255]);
        assert_eq!(scale.draw(3, &[150, 140]).bytes, [128, 255]);
    }

    #[test]
    fn a_tare_is_what_is_subtracted_once_there_is_one() {
        let array = Array { rows: 1, columns: 3, ..Array::thesis() };
        let rest = vec![Some(90.5), None, Some(20.0)];
        let tare = Tare { array, rest, noise: None, start_us: 0, stop_us: 1, note: String::new() };
        let mut scale = GreyScale::new(3);
        scale.draw(0, &[100, 50, 20]);
        scale.tare(&tare);
        let grey = scale.draw(100_000, &[110, 39, 20]);
        assert_eq!(grey, GreyPicture { bytes: vec![128, 255, 0], rest: "tare", full: 39.0 });
    }
}
