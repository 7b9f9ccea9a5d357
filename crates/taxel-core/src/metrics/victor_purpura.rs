//! Victor-Purpura distance: the cheapest way to turn one spike train into another.

use crate::{Result, Stop, problem};

/// The least cost of turning `a` into `b` (ms, ascending): 1 for each spike removed or added, `q |dt|` for each one moved.
///
/// Victor and Purpura (1996), J. Neurophysiol. 76:1310; thesis 6.3.5. Time O(n m), memory O(m).
///
/// # Errors
///
/// `Problem` where times are not finite or do not ascend, or `q` (1/ms) is below 0; `Interrupted`.
pub fn victor_purpura(a: &[f64], b: &[f64], q: f64, stop: Stop<'_>) -> Result<f64> {
    if q.is_nan() || q < 0.0 {
        return Err(problem!("q is {q}/ms: must be 0 or more"));
    }
    for (name, train) in [("a", a), ("b", b)] {
        if let Some(k) = train.iter().position(|t| !t.is_finite()) {
            return Err(problem!("train {name}, spike {k}: time is {}, must be finite", train[k]));
        }
        if let Some(k) = train.windows(2).position(|w| w[1] < w[0]) {
            return Err(problem!(
                "train {name}, spike {}: {} ms comes after {} ms, times must ascend",
                k + 1,
                train[k + 1],
                train[k]
            ));
        }
    }
    let count = |n: usize| n as f64;
    if q == f64::INFINITY {
        return Ok(count(a.len() + b.len() - 2 * coincident(a, b)));
    }
    // cost[j]: from the spikes of `a` so far to the first j of `b`.
    let mut cost: Vec<f64> = (0..=b.len()).map(count).collect();
    for (i, &from) in a.iter().enumerate() {
        if i % 64 == 0 {
            stop.check()?;
        }
        let mut diagonal = cost[0];
        cost[0] = count(i + 1);
        let mut left = cost[0];
        for (&to, above) in b.iter().zip(&mut cost[1..]) {
            let moved = diagonal + q * (from - to).abs();
            diagonal = *above;
            left = moved.min(diagonal.min(left) + 1.0);
            *above = left;
        }
    }
    Ok(cost[b.len()])
}

/// How many spikes have a partner at the very same time: what is left to match where moving costs without end.
fn coincident(a: &[f64], b: &[f64]) -> usize {
    let (mut i, mut j, mut n) = (0, 0, 0);
    while i < a.len() && j < b.len() {
        if a[i] < b[j] {
            i += 1;
        } else if a[i] > b[j] {
            j += 1;
        } else {
            (i, j, n) = (i + 1, j + 1, n + 1);
        }
    }
    n
}
