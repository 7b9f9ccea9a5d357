//! Where a load counts for the centre of pressure: at its column and row, or at its taxel's place.

use std::sync::Arc;

use taxel_core::Array;
use taxel_core::array::Places;

/// Most steps from the leftmost or uppermost place to the one farthest from it.
const STEPS: f64 = 65_535.0;

/// The coordinates of each taxel as whole numbers, so that the sums of a load times its coordinates stay exact.
#[derive(Debug, Clone)]
pub(crate) struct Coordinates {
    places: Arc<[(u16, u16)]>,
    /// The place of coordinate 0, and the length of a step; `None` of channels, which have no centre.
    scale: Option<((f64, f64), f64)>,
}

impl Coordinates {
    /// Columns and rows; of a sensor with places these, in steps of their extent.
    pub(crate) fn new(array: &Array) -> Self {
        if let Some(places) = &array.places {
            return Self::of_places(array, places);
        }
        // An array has 65 535 rows and columns at most.
        let places = (0..array.rows).flat_map(|y| (0..array.columns).map(move |x| (x, y))).collect();
        Self { places, scale: (!array.is_channels()).then_some(((0.0, 0.0), 1.0)) }
    }

    fn of_places(array: &Array, Places { x, y, .. }: &Places) -> Self {
        let range = |all: &[f64]| {
            let there = all.iter().enumerate().filter(|&(taxel, _)| array.has(taxel)).map(|(_, &place)| place);
            there.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), place| (least.min(place), most.max(place)))
        };
        let ((left, right), (top, bottom)) = (range(x), range(y));
        let extent = (right - left).max(bottom - top);
        let step = if extent > 0.0 { extent / STEPS } else { 1.0 };
        let steps = |at: f64, from: f64| ((at - from) / step).round() as u16;
        let places = x.iter().zip(y).map(|(&x, &y)| (steps(x, left), steps(y, top))).collect();
        Self { places, scale: Some(((left, top), step)) }
    }

    /// The coordinates of a taxel.
    #[inline(always)]
    pub(crate) fn get(&self, taxel: usize) -> (u64, u64) {
        let (x, y) = self.places[taxel];
        (x.into(), y.into())
    }

    /// The centre of loads that sum up to this, and times their coordinates to these; NaN without any load.
    pub(crate) fn centre(&self, sum: u64, sum_x: u64, sum_y: u64) -> (f32, f32) {
        let Some(((left, top), step)) = self.scale.filter(|_| sum > 0) else { return (f32::NAN, f32::NAN) };
        let at = |from: f64, moment: u64| (from + step * (moment as f64 / sum as f64)) as f32;
        (at(left, sum_x), at(top, sum_y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_is_in_columns_and_rows_or_in_the_unit_of_the_places() {
        let grid = Coordinates::new(&Array::unmeasured(3, 4, "grid"));
        // Of 1 at column 2, row 1, and 3 at column 3, row 2.
        assert_eq!((grid.get(6), grid.get(11)), ((2, 1), (3, 2)));
        assert_eq!(grid.centre(4, 2 + 9, 1 + 6), (2.75, 1.75));
        let places = Places { x: vec![-500.0, -700.0, 1e9], y: vec![40.0, -40.0, 0.0], area: None, unit: None };
        let exists = Some(vec![true, true, false]);
        let foot = Array { places: Some(places), exists, ..Array::unmeasured(1, 3, "foot") };
        let placed = Coordinates::new(&foot);
        let ((x0, y0), (x1, y1)) = (placed.get(0), placed.get(1));
        let (x, y) = placed.centre(4, x0 + 3 * x1, y0 + 3 * y1);
        assert!((x + 650.0).abs() < 0.01 && (y + 20.0).abs() < 0.01, "{x} {y}");
        assert!(placed.centre(0, 0, 0).0.is_nan());
    }

    #[test]
    fn channels_have_no_centre() {
        assert!(Coordinates::new(&Array::unmeasured(1, 8, "foot")).centre(4, 8, 0).0.is_nan());
        assert_eq!(Coordinates::new(&Array::new(1, 8, 5.0, "line").unwrap()).centre(4, 8, 0).0, 2.0);
    }
}
