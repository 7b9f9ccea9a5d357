//! A histogram of durations, of fixed size.

use serde::Serialize;

/// Number of buckets per doubling of the value: quantiles are accurate to 1 in 32.
const FINE: u32 = 32;
const BUCKETS: usize = (FINE * (64 - FINE.ilog2() + 1)) as usize;

/// A histogram of durations with buckets 3 % wide and fixed memory.
#[derive(Debug, Clone)]
pub struct Latencies {
    buckets: Box<[u64; BUCKETS]>,
    count: u64,
    max_ns: u64,
}

/// Quantiles of measured latencies, us; none if nothing was measured.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Quantiles {
    /// Number of measured durations.
    pub count: u64,
    /// Median.
    pub p50_us: Option<f64>,
    /// The 99th percentile.
    pub p99_us: Option<f64>,
    /// The maximum.
    pub max_us: Option<f64>,
}

impl Default for Latencies {
    fn default() -> Self {
        Self { buckets: Box::new([0; BUCKETS]), count: 0, max_ns: 0 }
    }
}

impl Latencies {
    /// Adds a duration, ns; a negative one, which two clocks that disagree can cause, counts as 0.
    pub fn note(&mut self, ns: i64) {
        let ns = u64::try_from(ns).unwrap_or(0);
        self.buckets[bucket(ns)] += 1;
        self.count += 1;
        self.max_ns = self.max_ns.max(ns);
    }

    /// The quantile `q` of the durations, ns.
    #[must_use]
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub fn quantile(&self, q: f64) -> u64 {
        let wanted = (q * self.count as f64).ceil().max(1.0) as u64;
        let mut sum = 0;
        for (k, &n) in self.buckets.iter().enumerate() {
            sum += n;
            if sum >= wanted {
                return top(k).min(self.max_ns);
            }
        }
        0
    }

    /// Median, 99 % and maximum.
    #[must_use]
    #[allow(clippy::cast_precision_loss)]
    pub fn quantiles(&self) -> Quantiles {
        let us = |ns: u64| (self.count > 0).then(|| ns as f64 / 1e3);
        Quantiles {
            count: self.count,
            p50_us: us(self.quantile(0.5)),
            p99_us: us(self.quantile(0.99)),
            max_us: us(self.max_ns),
        }
    }
}

/// The bucket of a value: values below [`FINE`] have one each; above, each doubling has [`FINE`] of equal width.
fn bucket(ns: u64) -> usize {
    let doublings = ns.max(1).ilog2().saturating_sub(FINE.ilog2());
    let within = ns >> doublings;
    (u64::from(doublings * FINE) + within) as usize
}

/// The largest value of a bucket.
fn top(k: usize) -> u64 {
    let fine = FINE as usize;
    let doublings = (k / fine).saturating_sub(1);
    let within = (k - doublings * fine) as u64;
    ((within + 1) << doublings).wrapping_sub(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_to_one_in_thirty_two() {
        for scale in [1_i64, 37, 1000, 123_456_789] {
            let mut latencies = Latencies::default();
            (1..=1000).for_each(|k| latencies.note(k * scale));
            for (q, truth) in [(0.5, 500), (0.99, 990), (1.0, 1000)] {
                let (got, truth) = (latencies.quantile(q), (truth * scale) as u64);
                assert!(got >= truth && got <= truth + truth / 32 + 1, "{q} of {scale}: {got}, not {truth}");
            }
        }
    }

    #[test]
    fn every_value_has_a_bucket_that_holds_it() {
        for ns in (0..64).flat_map(|s| [(1_u64 << s) - 1, 1 << s, (1 << s) + 1]).chain([u64::MAX]) {
            let k = bucket(ns);
            assert!(k < BUCKETS && top(k) >= ns && (k == 0 || top(k - 1) < ns), "{ns}: bucket {k}");
        }
    }

    #[test]
    fn nothing_measured_is_no_latency() {
        assert_eq!(Latencies::default().quantiles(), Quantiles::default());
    }
}
