//! Bounds on the weights: the same for all synapses, or one per synapse.

use serde::{Deserialize, Serialize};

use crate::allowed::{ParameterNumbers, is_weight};
use crate::{Result, problem};

/// A number that is the same for all synapses or patterns, or one for each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "must be a number, or a list of one number each")]
pub enum OneOrEach {
    /// The same for all.
    All(f64),
    /// One for each.
    Each(Vec<f64>),
}

impl ParameterNumbers for OneOrEach {
    fn each(&self, look: &mut dyn FnMut(Option<usize>, f64)) {
        match self {
            Self::All(value) => value.each(look),
            Self::Each(values) => values.each(look),
        }
    }
}

impl OneOrEach {
    /// That of synapse or pattern `n`.
    #[must_use]
    pub fn at(&self, n: usize) -> f64 {
        match self {
            Self::All(value) => *value,
            Self::Each(values) => values[n],
        }
    }

    /// All multiplied by `factor`.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        match self {
            Self::All(value) => Self::All(factor * value),
            Self::Each(values) => Self::Each(values.iter().map(|v| factor * v).collect()),
        }
    }

    /// How many there are; `None` for one that is the same for all.
    pub(crate) fn count(&self) -> Option<usize> {
        match self {
            Self::All(_) => None,
            Self::Each(values) => Some(values.len()),
        }
    }
}

/// The lower and upper bounds of all weights, mV.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    /// The lower bounds, one per train.
    pub lower: Vec<f64>,
    /// The upper bounds, one per train.
    pub upper: Vec<f64>,
}

impl Bounds {
    /// The least and the largest value of `row.w` within the bounds.
    pub(crate) fn range(&self, row: &[f64]) -> (f64, f64) {
        let ends = row.iter().zip(&self.lower).zip(&self.upper).map(|((a, l), u)| (a * l, a * u));
        ends.fold((0.0, 0.0), |sum, (l, u)| (sum.0 + l.min(u), sum.1 + l.max(u)))
    }
}

/// Checks at every synapse that both bounds are finite and that `lb` is not above `ub`; equal bounds freeze the weight.
///
/// # Errors
///
/// `Problem`, naming the synapse.
pub(crate) fn check_bounds(lb: &OneOrEach, ub: &OneOrEach) -> Result<()> {
    if let (Some(a), Some(b)) = (lb.count(), ub.count())
        && a != b
    {
        return Err(problem!("lb"; " has {a} bounds, ub has {b}: must be one per synapse, or one for all"));
    }
    let each = lb.count().or(ub.count());
    if each == Some(0) {
        return Err(problem!("bounds: the list is empty; must be one per synapse, or one for all"));
    }
    for n in 0..each.unwrap_or(1) {
        let (low, high) = (lb.at(n), ub.at(n));
        if !(is_weight(low) && is_weight(high) && low <= high) {
            let bounds = if each.is_some() { format!("bounds of synapse {n}:") } else { "bounds".to_owned() };
            return Err(problem!(
                "{bounds} {low} to {high} mV: lb must not be above ub, and both must be within 1e100"
            ));
        }
    }
    Ok(())
}

/// The bounds of `trains` synapses, mV.
///
/// # Errors
///
/// `Problem` if a list of bounds has another length.
pub(crate) fn bounds_of(lb: &OneOrEach, ub: &OneOrEach, trains: usize) -> Result<Bounds> {
    check_bounds(lb, ub)?;
    for (name, bound) in [("lb", lb), ("ub", ub)] {
        if let Some(count) = bound.count().filter(|&count| count != trains) {
            return Err(problem!("{name}: {count} bounds for {trains} trains; must be one per train, or one for all"));
        }
    }
    Ok(Bounds { lower: (0..trains).map(|n| lb.at(n)).collect(), upper: (0..trains).map(|n| ub.at(n)).collect() })
}
