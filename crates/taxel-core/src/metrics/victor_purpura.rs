//! Victor-Purpura distance: the least cost of turning one spike train into another.

use serde::{Deserialize, Serialize};

use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::{Result, Stop};

/// The least cost of turning one train into the other: 1 for each spike removed or added, `q |dt|` for each spike
/// moved.
///
/// Victor and Purpura (1996), J. Neurophysiol. 76:1310; thesis 6.3.5. Spikes more than `2 / q` apart never match, so
/// only nearer pairs are considered: time O(n + m + pairs within `2 / q`), memory O(m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VictorPurpura {
    /// Cost of moving a spike by 1 ms; if infinite, only spikes at exactly the same time match.
    #[serde(deserialize_with = "number_or_name")]
    pub q: f64,
}

/// Reads a cost that may be infinite: a number, or its name as text because JSON has no infinity.
fn number_or_name<'de, D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<f64, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "must be a number")]
    enum Either {
        Number(f64),
        Name(String),
    }
    match Either::deserialize(deserializer)? {
        Either::Number(value) => Ok(value),
        Either::Name(name) => name.parse().map_err(|_| serde::de::Error::custom("must be a number")),
    }
}

impl VictorPurpura {
    ranges! {
        q: "1/ms", Range::COST;
    }

    /// The parameters with their defaults and ranges.
    #[must_use]
    pub fn described() -> Described {
        Described::by(&Self { q: 0.0 }, &["q"], Self::RANGES)
    }

    pub(super) fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    /// The distance between two ascending trains.
    pub(super) fn between(&self, a: &[f64], b: &[f64], stop: Stop<'_>) -> Result<f64> {
        let count = |n: usize| n as f64;
        if self.q == 0.0 {
            return Ok(count(a.len().abs_diff(b.len())));
        }
        if self.q == f64::INFINITY {
            return Ok(count(a.len() + b.len() - 2 * coincident(a, b)));
        }
        // Beside removing and adding all spikes, to move one by dt saves `2 - q |dt|`. `saved[j]` is the most that can be
        // saved with the spikes of `a` so far and the first j of `b`; only columns lo to hi are up to date. Earlier
        // columns have spikes too early to match and are no longer read; later ones, whose spikes are still too late
        // to match, save as much as column hi.
        let mut saved = vec![0.0; b.len() + 1];
        let (mut lo, mut hi) = (0, 0);
        let reach = 2.0 / self.q;
        for (i, &from) in a.iter().enumerate() {
            if i % 64 == 0 {
                stop.check()?;
            }
            while hi < b.len() && b[hi] <= from + reach {
                saved[hi + 1] = saved[hi];
                hi += 1;
            }
            while lo < hi && b[lo] < from - reach {
                lo += 1;
            }
            let mut diagonal = saved[lo];
            let mut left = diagonal;
            for (&to, above) in b[lo..hi].iter().zip(&mut saved[lo + 1..=hi]) {
                let moved = diagonal + (2.0 - self.q * (from - to).abs());
                diagonal = *above;
                left = greater(greater(moved, diagonal), left);
                *above = left;
            }
        }
        Ok(count(a.len() + b.len()) - saved[hi])
    }
}

/// The greater of two numbers, neither of which is NaN: a single instruction, unlike `f64::max`.
#[inline(always)]
fn greater(x: f64, y: f64) -> f64 {
    if x > y { x } else { y }
}

/// The number of spikes with a partner at exactly the same time, the only ones that match if moving has infinite cost.
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
