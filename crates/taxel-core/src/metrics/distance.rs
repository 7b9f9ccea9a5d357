//! The interface of the metrics in the registry.

use serde::Deserialize;

use super::pairwise::{DistanceMatrix, Work};
use super::patterns::Patterns;
use crate::parameters::Described;
use crate::{Result, Stop};

/// The operations that every metric implements.
pub(super) trait Distance {
    /// The metric's parameters with their defaults and ranges.
    fn described() -> Described
    where
        Self: Sized;

    /// Checks every parameter.
    fn check(&self) -> Result<()>;

    /// Computes what all pairs of these patterns share.
    fn ready<'m>(&'m self, a: &Patterns<'_>, b: Option<&Patterns<'_>>) -> Result<Box<dyn Ready + 'm>>;
}

/// A metric with the data that all pairs share.
pub(super) trait Ready: Sync {
    /// The distance between two patterns.
    fn between(&self, a: Pattern<'_>, b: Pattern<'_>, stop: Stop<'_>) -> Result<f64>;

    /// Fills a whole matrix if there is a faster way than pair by pair, and returns whether there is.
    fn fill(&self, _: &DistanceMatrix, _: &Patterns<'_>, _: Option<&Patterns<'_>>, _: &mut Work<'_>) -> Result<bool> {
        Ok(false)
    }
}

/// One of several patterns, by its index.
pub(super) type Pattern<'p> = (&'p Patterns<'p>, usize);

/// The sum over trains of a distance between trains.
pub(super) fn sum_over_trains(
    (a, p): Pattern<'_>,
    (b, q): Pattern<'_>,
    stop: Stop<'_>,
    between: impl Fn(&[f64], &[f64]) -> Result<f64>,
) -> Result<f64> {
    let mut sum = 0.0;
    for n in 0..a.trains {
        stop.check()?;
        sum += between(a.train(p, n), b.train(q, n))?;
    }
    Ok(sum)
}

/// Reads a cost that may be infinite: a number, or its name as text because JSON has no infinity.
pub(super) fn number_or_name<'de, D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<f64, D::Error> {
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
