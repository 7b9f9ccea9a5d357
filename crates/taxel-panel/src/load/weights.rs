//! How much a taxel's value counts in the sum of all: by its area, so that pressures add up to a force.

use std::sync::Arc;

use taxel_core::Array;

/// The weight of the largest area, so that sums stay whole numbers.
const LARGEST: u16 = 4096;
/// Most steps of a value above its rest.
const MOST_STEPS: u64 = 65_534;
/// 1 kPa over 1 mm2, N.
const N_PER_KPA_MM2: f64 = 1e-3;

/// A weight for each taxel; by default all count alike.
#[derive(Debug, Clone, Default)]
pub(crate) struct Weights(Option<Uneven>);

/// Weights that differ.
#[derive(Debug, Clone)]
struct Uneven {
    weights: Arc<[u16]>,
    /// What the weighted sum is divided by, as the sum of all taxels has 32 bits.
    divisor: u64,
}

impl Weights {
    /// The weights of values in this unit, and the force that 1 in the sum of values is (N): of pressures where the area
    /// of each taxel is known, else `None`.
    pub(crate) fn new(array: &Array, unit: &str) -> (Self, Option<f64>) {
        let Some(areas) = array.areas_mm2().filter(|_| unit == "kPa") else { return (Self::default(), None) };
        let there = areas.iter().enumerate().filter(|&(taxel, _)| array.has(taxel)).map(|(_, &area)| area);
        let (least, largest) = there.fold((f64::INFINITY, 0.0_f64), |(least, most), a| (least.min(a), most.max(a)));
        let newtons = largest * N_PER_KPA_MM2;
        if least >= largest {
            return (Self::default(), Some(newtons));
        }
        let weights = areas.iter().map(|area| (area / largest * f64::from(LARGEST)).round() as u16).collect();
        let most = array.len().max(1) as u64 * MOST_STEPS * u64::from(LARGEST);
        let divisor = most.div_ceil(u32::MAX.into()).min(LARGEST.into());
        (Self(Some(Uneven { weights, divisor })), Some(newtons * divisor as f64 / f64::from(LARGEST)))
    }

    /// What `steps` more at a taxel add to the weighted sum, modulo 2^64.
    #[inline(always)]
    pub(crate) fn weighed(&self, taxel: usize, steps: u64) -> u64 {
        self.0.as_ref().map_or(steps, |uneven| steps.wrapping_mul(uneven.weights[taxel].into()))
    }

    /// The sum that is shown of the weighted one.
    pub(crate) fn sum(&self, weighted: u64) -> u32 {
        let sum = self.0.as_ref().map_or(weighted, |weights| (weighted + weights.divisor / 2) / weights.divisor);
        sum.min(u32::MAX.into()) as u32
    }
}

#[cfg(test)]
mod tests {
    use taxel_core::array::{PlaceUnit, Places};

    use super::*;

    fn feet(area: Option<Vec<f64>>, unit: Option<PlaceUnit>) -> Array {
        let places = Places { x: vec![0.0, 10.0, 20.0], y: vec![0.0; 3], area, unit };
        let exists = Some(vec![true, true, false]);
        Array { places: Some(places), exists, ..Array::unmeasured(1, 3, "foot") }
    }

    #[test]
    fn a_pressure_counts_by_its_taxel_s_area_where_all_are_known_and_differ() {
        let array = feet(Some(vec![50.0, 200.0, 9e9]), Some(PlaceUnit::Mm));
        let (weights, newtons) = Weights::new(&array, "kPa");
        let weighted = weights.weighed(0, 41).wrapping_add(weights.weighed(1, 5));
        // 41 kPa on 50 mm2 and 5 kPa on 200 mm2 are 3.05 N.
        let force = f64::from(weights.sum(weighted)) * newtons.expect("a force");
        assert!((force - 3.05).abs() < 1e-9, "{force}");
        for (array, unit, force) in [
            (feet(Some(vec![50.0, 50.0, 9e9]), Some(PlaceUnit::Mm)), "kPa", Some(0.05)),
            (Array::new(2, 3, 5.0, "mat").unwrap(), "kPa", Some(0.025)),
            (array, "counts", None),
            (feet(Some(vec![50.0, 200.0, 9e9]), None), "kPa", None),
            (feet(None, Some(PlaceUnit::Mm)), "kPa", None),
            (Array::unmeasured(2, 3, "mat"), "kPa", None),
        ] {
            let (weights, newtons) = Weights::new(&array, unit);
            assert_eq!((weights.weighed(1, 5), weights.sum(45), newtons), (5, 45, force));
        }
    }
}
