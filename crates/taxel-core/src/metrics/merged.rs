//! Two trains merged into one sequence of steps.

/// The times at which two ascending trains differ, each with the number of spikes of `a` minus that of `b`.
///
/// Spikes of both at exactly the same time cancel before any summation, so equal trains yield no steps.
pub(super) fn merge_spikes<'t>(a: &'t [f64], b: &'t [f64]) -> impl Iterator<Item = (f64, f64)> + 't {
    let (mut i, mut j) = (0, 0);
    std::iter::from_fn(move || {
        loop {
            let t = match (a.get(i), b.get(j)) {
                (Some(&x), Some(&y)) => x.min(y),
                (Some(&x), None) => x,
                (None, Some(&y)) => y,
                (None, None) => return None,
            };
            let mut more = 0.0;
            while i < a.len() && a[i] == t {
                (i, more) = (i + 1, more + 1.0);
            }
            while j < b.len() && b[j] == t {
                (j, more) = (j + 1, more - 1.0);
            }
            if more != 0.0 {
                return Some((t, more));
            }
        }
    })
}
