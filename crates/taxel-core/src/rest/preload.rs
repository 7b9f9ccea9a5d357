//! The preload of a sensor: a load during the quiet stretch that its rest was first taken from, which was removed later.

use super::tracked::TOUCHED_TOGETHER;

/// A taxel lay under a load if its rest was later less by more than so many ticks.
pub const LOADED_TICKS: f64 = 8.0;

/// Returns the preload of each taxel, given by how much less it rested later (NaN where it had no rest): the values above a
/// bound that have neighbours; 0 elsewhere, for channels, and where so many taxels rested less that it is drift.
#[must_use]
pub fn preload(less: &[f64], columns: usize, above: f64) -> Vec<f64> {
    let rows = less.len() / columns.max(1);
    let loaded = |y: usize, x: usize| less[y * columns + x] > above;
    let around = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
    let together = |y, x| {
        let near = around(y, rows).flat_map(|y| around(x, columns).map(move |x| (y, x)));
        near.filter(|&(y, x)| loaded(y, x)).count() >= TOUCHED_TOGETHER
    };
    let mut found = vec![0.0; less.len()];
    if rows.min(columns) >= TOUCHED_TOGETHER {
        for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
            if loaded(y, x) && together(y, x) {
                found[y * columns + x] = less[y * columns + x];
            }
        }
    }
    let known = less.iter().filter(|less| !less.is_nan()).count();
    if 2 * found.iter().filter(|&&load| load > 0.0).count() > known {
        found.fill(0.0);
    }
    found
}

/// Describes the rows and columns of the preload of a sensor whose first taxel is in this row and column, and its maximum;
/// empty without a preload.
#[must_use]
pub fn preload_text(preload: &[f64], columns: usize, corner: (usize, usize)) -> String {
    let loaded = || (0..preload.len()).filter(|&k| preload[k] > 0.0);
    let span = |name: &str, indices: &mut dyn Iterator<Item = usize>| {
        let (least, most) = indices.fold((usize::MAX, 0), |(least, most), at| (least.min(at), most.max(at)));
        if least == most { format!("{name} {least}") } else { format!("{name}s {least} to {most}") }
    };
    let most = preload.iter().copied().fold(0.0, f64::max);
    if most == 0.0 {
        return String::new();
    }
    let down = span("row", &mut loaded().map(|k| corner.0 + k / columns));
    let across = span("column", &mut loaded().map(|k| corner.1 + k % columns));
    // Three digits that count.
    let digits = (2.0 - most.log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{down}, {across} (up to {} above rest)", format!("{most:.digits$}").parse().unwrap_or(most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taxels_that_rested_higher_together_are_found_and_bad_ones_and_drift_are_not() {
        let text_of = |less: &[f64], columns| preload_text(&preload(less, columns, LOADED_TICKS), columns, (0, 0));
        let with = |loaded: &[(usize, usize)], load: f64| {
            let mut all = vec![0.0; 48];
            loaded.iter().for_each(|&(y, x)| all[y * 8 + x] = load);
            text_of(&all, 8)
        };
        assert_eq!(
            with(&[(2, 5), (3, 5), (3, 6), (0, 0)], 41.23),
            "rows 2 to 3, columns 5 to 6 (up to 41.2 above rest)"
        );
        assert_eq!(with(&[(1, 5), (1, 6), (1, 7)], 9.0), "row 1, column 6 (up to 9 above rest)");
        assert_eq!(with(&[(1, 5), (1, 6)], 90.0), "", "a pair is bad");
        assert_eq!(with(&[(2, 5), (3, 5), (3, 6)], 8.0), "", "no more than noise and drift");
        assert_eq!(text_of(&[20.0; 48], 8), "", "all drift");
        assert_eq!(text_of(&[f64::NAN; 48], 8), "");
        assert_eq!(text_of(&[20.0; 4], 4), "");
    }

    #[test]
    fn places_count_from_the_corner_and_loads_have_three_digits() {
        let preload = [0.0, 0.0, 0.0, 0.0, 0.012_345, 0.0];
        assert_eq!(preload_text(&preload, 3, (10, 20)), "row 11, column 21 (up to 0.0123 above rest)");
        assert_eq!(preload_text(&preload.map(|load| load * 1e5), 3, (0, 0)), "row 1, column 1 (up to 1234 above rest)");
    }
}
