//! What a parameter may be, and what is said where it is not.

use crate::{Result, problem};

/// Whether a value is above 0 and finite.
#[must_use]
pub fn is_above_0(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

/// Whether a value is 0 or more and finite.
#[must_use]
pub fn is_at_least_0(value: f64) -> bool {
    value.is_finite() && value >= 0.0
}

/// Refuses a value that is not above 0 and finite; `unit` may be empty.
///
/// # Errors
///
/// `Problem`, naming the parameter and its value.
pub fn above_0(name: &str, value: f64, unit: &str) -> Result<()> {
    require(is_above_0(value), name, value, unit, "above 0 and finite")
}

/// Refuses a value that is below 0 or not finite; `unit` may be empty.
///
/// # Errors
///
/// `Problem`, naming the parameter and its value.
pub fn at_least_0(name: &str, value: f64, unit: &str) -> Result<()> {
    require(is_at_least_0(value), name, value, unit, "0 or more and finite")
}

fn require(met: bool, name: &str, value: f64, unit: &str, what: &str) -> Result<()> {
    if met {
        return Ok(());
    }
    let space = if unit.is_empty() { "" } else { " " };
    Err(problem!("{name} is {value}{space}{unit}: must be {what}"))
}

/// Refuses weights that are not one a train, each finite.
///
/// # Errors
///
/// `Problem`, naming the weight.
pub fn one_weight_a_train(weights: &[f64], trains: usize) -> Result<()> {
    if weights.len() != trains {
        return Err(problem!("weights: {} for {trains} trains, must be one a train", weights.len()));
    }
    if let Some(n) = weights.iter().position(|w| !w.is_finite()) {
        return Err(problem!("weights[{n}] is {}: must be finite", weights[n]));
    }
    Ok(())
}
