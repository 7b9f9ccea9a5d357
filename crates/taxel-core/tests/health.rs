//! Counts of touches of few taxels on a large array.

use rand::{Rng, SeedableRng, rngs::StdRng};
use taxel_core::Array;
use taxel_core::health::{TaxelCounts, TouchCounts};
use taxel_core::rest::Value;

/// Counts by taxel index, of events of a patch whose first taxel is in this row and column.
fn of_patch(array: &Array, row: usize, column: usize, patch: (usize, usize), seed: u64) -> Vec<TaxelCounts> {
    let mut random = StdRng::seed_from_u64(seed);
    let mut counts = TouchCounts::new(array, f64::NO_REST);
    for k in 0..4000 {
        let (y, x) = (random.random_range(0..patch.0), random.random_range(0..patch.1));
        // Three touches; one taxel is dead, and one noisy.
        let pressed = k / 400 % 3 == 1;
        let ticks = if (y, x) == (4, 4) { random.random_range(0..90) } else { 50 + 40 * u16::from(pressed) };
        if (y, x) != (2, 2) {
            let taxel = (row + y) * usize::from(array.columns) + column + x;
            counts.event(1_000 * k, taxel, ticks, pressed, true);
        }
    }
    counts.advance(5_000_000);
    counts.counts().to_vec()
}

#[test]
fn a_patch_inside_a_larger_array_counts_as_the_patch_with_a_border_does() {
    let (small, large) = (Array::new(9, 10, 1.0, "").unwrap(), Array::new(200, 300, 1.0, "").unwrap());
    let (alone, inside) = (of_patch(&small, 1, 1, (7, 8), 7), of_patch(&large, 120, 200, (7, 8), 7));
    let mut outside = inside.clone();
    for row in 0..9 {
        for column in 0..10 {
            let at = (119 + row) * 300 + 199 + column;
            outside[at] = TaxelCounts::default();
            // The taxels of the border have fewer neighbours in the small array.
            if (1..8).contains(&row) && (1..9).contains(&column) {
                assert_eq!(inside[at], alone[row * 10 + column], "row {row}, column {column}");
            }
        }
    }
    assert!(outside.iter().all(|&counts| counts == TaxelCounts::default()));
    let dead = inside[122 * 300 + 202];
    assert!(dead.touches >= 3 && dead.missed == dead.touches, "{dead:?}");
}
