//! Values of frames in whole steps, which have 16 bits as the values of a board do.

use super::value::{NOISE_FLOOR, TIMES_NOISE};
use crate::held::UNKNOWN;

/// Most steps from the least value to the greatest.
const MOST_STEPS: u16 = 65_533;

/// The middle of all steps.
const MIDDLE: u16 = MOST_STEPS / 2;

/// Values that arrive live have room for so many times the greatest of the first frame.
const ROOM: f64 = 16.0;

/// So many steps above rest are noise where it is not known.
const FLOOR: u16 = NOISE_FLOOR as u16;

/// Most decimals of values whose last decimal is a step.
const MOST_DECIMALS: i32 = 6;

/// The steps in which values are shown: a value is `(ticks - zero) * size`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValueSteps {
    /// Size of a step, in the unit of the values.
    pub size: f64,
    /// Steps of the value 0.
    pub zero: u16,
    /// So many steps above rest are noise.
    pub floor: u16,
}

impl ValueSteps {
    /// Steps for these values: of 1 where all are whole and not too far apart, else as small as 16 bits allow.
    #[must_use]
    pub fn fitting<'a>(values: impl Iterator<Item = &'a [f32]>, taxels: usize) -> Self {
        let (mut least, mut most, mut integers) = (0.0_f32, 0.0_f32, true);
        for &value in values.flatten().filter(|value| value.is_finite()) {
            (least, most) = (least.min(value), most.max(value));
            integers &= value.fract() == 0.0;
        }
        let (least, range) = (f64::from(least), f64::from(most) - f64::from(least));
        // The sum over the array has 32 bits.
        let steps = usize::from(MOST_STEPS).min(u32::MAX as usize / taxels.max(1)) as f64;
        let size = if integers && range <= f64::from(MOST_STEPS) { 1.0 } else { range / steps };
        Self { size, zero: (-least / size).ceil() as u16, floor: FLOOR }
    }

    /// Steps for values of which only the first frame is known: of 1 where all are whole, else of their last decimal, or
    /// larger, so that there is room for greater ones.
    #[must_use]
    pub fn of_first(values: &[f32]) -> Self {
        let known = || values.iter().copied().filter(|value| value.is_finite());
        let greatest = known().map(|value| f64::from(value.abs())).fold(0.0, f64::max);
        let negative = known().any(|value| value < 0.0);
        let decimal = |decimals: i32| 10_f64.powi(-decimals);
        let has = |size: f64| known().all(|value| is_multiple(value, size));
        let decimals = (0..MOST_DECIMALS).find(|&decimals| has(decimal(decimals))).unwrap_or(MOST_DECIMALS);
        if decimals == 0 && !negative && greatest <= f64::from(MOST_STEPS) {
            return Self { size: 1.0, zero: 0, floor: FLOOR };
        }
        let least = greatest * ROOM / f64::from(MIDDLE);
        Self { size: decimal(decimals).max(least), zero: MIDDLE, floor: FLOOR }
    }

    /// Steps that are not much smaller than the noise, its standard deviation, with a noise floor that holds it.
    #[must_use]
    pub fn above_noise(self, noise: f64) -> Self {
        let power = 10_f64.powf(noise.log10().floor());
        let size =
            [5.0, 2.0, 1.0].into_iter().map(|digit| digit * power).find(|&size| size <= noise).unwrap_or(self.size);
        let size = size.max(self.size);
        Self { size, floor: FLOOR.max((TIMES_NOISE * noise / size).ceil() as u16), ..self }
    }

    /// Larger steps, which have room for this value too.
    #[must_use]
    pub fn widened(self, value: f32) -> Self {
        let size = (f64::from(value.abs()) / f64::from(MIDDLE)).max(self.size) * ROOM;
        let floor = (f64::from(self.floor) * self.size / size).ceil() as u16;
        Self { size, zero: MIDDLE, floor: FLOOR.max(floor) }
    }

    /// Whether a value has a step; a missing one has.
    #[must_use]
    pub fn holds(self, value: f32) -> bool {
        let steps = f64::from(value) / self.size + f64::from(self.zero);
        value.is_nan() || (-0.5..=f64::from(MOST_STEPS)).contains(&steps)
    }

    /// The step of a value; [`UNKNOWN`] of a missing one.
    #[must_use]
    pub fn ticks(self, value: f32) -> u16 {
        if value.is_nan() {
            return UNKNOWN;
        }
        let steps = f64::from(value) * (1.0 / self.size) + (f64::from(self.zero) + 0.5);
        steps.min(f64::from(UNKNOWN - 1)) as u16
    }

    /// The step of a rest, which no value is above where it is not finite.
    #[must_use]
    pub fn of_rest(self, value: f64) -> u16 {
        if value.is_finite() { (value / self.size + f64::from(self.zero)).round() as u16 } else { UNKNOWN }
    }
}

/// Whether a value is a whole number of steps, but for the rounding of its 32 bits.
fn is_multiple(value: f32, size: f64) -> bool {
    let steps = f64::from(value) / size;
    (steps - steps.round()).abs() <= (steps.abs() * f64::from(f32::EPSILON)).max(1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_a_first_frame_have_steps_and_room_for_greater_ones() {
        for (values, size, zero) in [
            (&[0.0, 12.0, 1023.0][..], 1.0, 0),
            (&[0.0, -3.0, 12.0], 1.0, MIDDLE),
            (&[0.25, 0.5, f32::NAN], 0.01, MIDDLE),
            (&[0.0003, 0.0], 0.0001, MIDDLE),
            (&[0.0, 0.0], 1.0, 0),
            (&[], 1.0, 0),
        ] {
            assert_eq!(ValueSteps::of_first(values), ValueSteps { size, zero, floor: FLOOR }, "{values:?}");
        }
        let steps = ValueSteps::of_first(&[1e5, -70_000.0]);
        assert!([1e5, -70_000.0, 1.5e6, f32::NAN].iter().all(|&value| steps.holds(value)), "{steps:?}");
        for value in [1e9, -1e9, 65_534.0, -1.0] {
            let steps = ValueSteps { size: 1.0, zero: 0, floor: FLOOR };
            assert!(!steps.holds(value) && steps.widened(value).holds(value), "{value}");
        }
    }

    #[test]
    fn steps_are_as_large_as_the_noise_and_their_floor_holds_it() {
        let steps = ValueSteps { size: 0.001, zero: MIDDLE, floor: FLOOR };
        for (noise, size) in [(0.0, 0.001), (0.0004, 0.001), (0.37, 0.2), (5.0, 5.0), (1.99, 1.0), (12.0, 10.0)] {
            let steps = steps.above_noise(noise);
            assert!((steps.size - size).abs() < 1e-9, "{noise}");
            let (floor, least) = (f64::from(steps.floor) * size, TIMES_NOISE * noise);
            assert!(least <= floor && floor < least.max(NOISE_FLOOR * size) + 1.01 * size, "{noise}: {floor}");
        }
    }

    #[test]
    fn a_value_is_off_its_step_by_half_a_step_at_most() {
        let steps = ValueSteps::of_first(&[0.1234, -7.5]);
        for k in -1000..1000_i16 {
            let value = f32::from(k) * 0.037;
            let back = (f64::from(steps.ticks(value)) - f64::from(steps.zero)) * steps.size;
            assert!((back - f64::from(value)).abs() <= steps.size * 0.5 + 1e-9, "{value}: {back}");
        }
    }
}
