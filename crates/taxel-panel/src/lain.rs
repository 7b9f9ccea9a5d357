//! What lay on a sensor in the quiet stretch that its rest was first taken from, and was taken away later.
//!
//! It is said of events as `taxel.recording.rest` says it of pictures.

use taxel_core::Array;
use taxel_core::tracked_rest::TOUCHED_TOGETHER;

/// A taxel lay under a load if its rest was later less by more than so many ticks.
const LOADED_TICKS: f64 = 8.0;

/// Where something lay, for people, by how much the rest of each taxel was later less, ticks (not a number where it has
/// none); empty where nothing did, of a sensor without three rows and columns, and where so much is less that it is drift.
#[must_use]
pub(crate) fn lain(less: &[f64], array: &Array) -> String {
    let (rows, columns) = (usize::from(array.rows), usize::from(array.columns));
    if rows.min(columns) < TOUCHED_TOGETHER || less.len() < array.len() {
        return String::new();
    }
    let loaded = |y: usize, x: usize| less[y * columns + x] > LOADED_TICKS;
    let around = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
    let together = |y, x| {
        let near = around(y, rows).flat_map(|y| around(x, columns).map(move |x| (y, x)));
        near.filter(|&(y, x)| loaded(y, x)).count() >= TOUCHED_TOGETHER
    };
    let all = (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x)));
    let on: Vec<(usize, usize)> = all.filter(|&(y, x)| loaded(y, x) && together(y, x)).collect();
    if on.is_empty() || 2 * on.len() > less.iter().filter(|less| !less.is_nan()).count() {
        return String::new();
    }
    let span = |name: &str, places: &mut dyn Iterator<Item = usize>| {
        let (least, most) = places.fold((usize::MAX, 0), |(least, most), at| (least.min(at), most.max(at)));
        if least == most { format!("{name} {least}") } else { format!("{name}s {least} to {most}") }
    };
    let (down, across) = (span("row", &mut on.iter().map(|at| at.0)), span("column", &mut on.iter().map(|at| at.1)));
    let most = on.iter().map(|&(y, x)| less[y * columns + x]).fold(0.0, f64::max);
    format!("{down}, {across} (up to {most:.0} above rest)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taxels_that_rested_higher_together_are_said_and_bad_ones_and_drift_are_not() {
        let array = Array::unmeasured(6, 8, "mat");
        let with = |places: &[(usize, usize)], less: f64| {
            let mut all = vec![0.0; array.len()];
            places.iter().for_each(|&(y, x)| all[y * 8 + x] = less);
            lain(&all, &array)
        };
        assert_eq!(with(&[(2, 5), (3, 5), (3, 6), (0, 0)], 41.2), "rows 2 to 3, columns 5 to 6 (up to 41 above rest)");
        assert_eq!(with(&[(1, 5), (1, 6), (1, 7)], 9.0), "row 1, column 6 (up to 9 above rest)");
        assert_eq!(with(&[(1, 5), (1, 6)], 90.0), "", "a pair is bad");
        assert_eq!(with(&[(2, 5), (3, 5), (3, 6)], 8.0), "", "no more than noise and drift");
        assert_eq!(lain(&vec![20.0; array.len()], &array), "", "all drift");
        assert_eq!(lain(&[f64::NAN; 48], &array), "");
        assert_eq!(lain(&[20.0; 4], &Array::unmeasured(1, 4, "row")), "");
    }
}
