//! The allowed values of parameters, and the error messages for others: a table for each type that has parameters.
//!
//! The checks and their messages read the table, and so do the documentation of the Python classes and the tests of
//! invalid values.

use std::fmt;

use crate::{Error, Result, problem};

/// The least value of a parameter that must be above 0: its square and what is divided by it stay within a float.
const LEAST: f64 = 1e-100;

/// The largest weight of a neuron: no sum of weighted kernels overflows.
const LARGEST_WEIGHT: f64 = 1e100;

/// A range of values. If an infinite end is excluded, the value must be finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    pub(crate) least: f64,
    pub(crate) least_in: bool,
    pub(crate) most: f64,
    pub(crate) most_in: bool,
    /// The value must be a multiple of this; 0 if it need not be.
    step: f64,
}

impl Range {
    /// Any finite number.
    pub const FINITE: Self =
        Self { least: f64::NEG_INFINITY, least_in: false, most: f64::INFINITY, most_in: false, step: 0.0 };
    /// Above 0 and finite.
    pub const ABOVE_0: Self = Self { least: 0.0, ..Self::FINITE };
    /// 0 or more and finite.
    pub const FROM_0: Self = Self { least_in: true, ..Self::ABOVE_0 };
    /// 0 or more, including infinity.
    pub const COST: Self = Self { most_in: true, ..Self::FROM_0 };
    /// A time in ms that is a whole number of us, 1 or more.
    pub const WHOLE_US: Self = Self { least: 1e-3, step: 1e-3, ..Self::FROM_0 }.below(1e12);
    /// A time in s that is a whole number of us, 1 or more.
    pub const WHOLE_US_IN_S: Self = Self { least: 1e-6, step: 1e-6, ..Self::FROM_0 }.below(1e9);
    /// 1 or more.
    pub const FROM_1: Self = Self { least: 1.0, ..Self::FROM_0 };

    /// Above a value and finite.
    #[must_use]
    pub const fn above(least: f64) -> Self {
        Self { least, ..Self::FINITE }
    }

    /// From the first value to the second, both included.
    #[must_use]
    pub const fn within(least: f64, most: f64) -> Self {
        Self { least, least_in: true, most, most_in: true, step: 0.0 }
    }

    /// The same range with this largest value, included.
    #[must_use]
    pub const fn at_most(self, most: f64) -> Self {
        Self { most, most_in: true, ..self }
    }

    /// The same range with this upper end, excluded.
    #[must_use]
    pub const fn below(self, most: f64) -> Self {
        Self { most, most_in: false, ..self }
    }

    /// Whether a value is in the range; NaN never is, nor, where 0 is not, what is nearer to it than `LEAST`.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        self.spans(value) && (value.abs() >= LEAST || self.spans(0.0))
    }

    fn spans(&self, value: f64) -> bool {
        (if self.least_in { value >= self.least } else { value > self.least })
            && (if self.most_in { value <= self.most } else { value < self.most })
            && (self.step == 0.0 || {
                let steps = value / self.step;
                (steps - steps.round()).abs() < 1e-6 * steps.round()
            })
    }
}

/// The range as an error message writes it after "must be".
impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (least, most) = (number_text(self.least), number_text(self.most));
        let lower = if self.least_in { format!("{least} or more") } else { format!("above {least}") };
        let upper = if self.most_in { format!("at most {most}") } else { format!("below {most}") };
        match (self.least.is_finite(), self.most.is_finite()) {
            _ if self.step != 0.0 => write!(f, "a whole number of us, {lower}"),
            (false, false) => f.write_str("finite"),
            (true, false) if self.most_in => f.write_str(&lower),
            (true, false) => write!(f, "{lower} and finite"),
            (false, true) => f.write_str(&upper),
            (true, true) if self.least_in && self.most_in => write!(f, "from {least} to {most}"),
            (true, true) => write!(f, "{lower} and {upper}"),
        }
    }
}

/// A number as a person writes it.
fn number_text(value: f64) -> String {
    if value != 0.0 && value.is_finite() && !(1e-3..1e7).contains(&value.abs()) {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

/// A parameter that must lie in a range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// The name as the caller writes it.
    pub name: &'static str,
    /// The unit of the value; empty if it has none.
    pub unit: &'static str,
    /// The valid values; if the parameter is a list, those of each entry.
    pub range: Range,
}

impl Parameter {
    /// Refuses a value outside the range.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what is valid.
    pub fn check(&self, value: &dyn ParameterNumbers) -> Result<()> {
        let mut outcome = Ok(());
        value.each(&mut |index, value| {
            if outcome.is_ok() && !self.range.holds(value) {
                let entry = index.map_or(String::new(), |k| format!("[{k}]"));
                let (name, unit, range) = (self.name, self.unit, self.range);
                let near = if range.spans(value) { format!(", {LEAST:e} at least") } else { String::new() };
                let value = number_text(value);
                outcome = Err(match unit.strip_prefix('1') {
                    Some(per) => problem!(name; "{entry} is {value}{per}: must be {range}{near}"),
                    None if unit.is_empty() => problem!(name; "{entry} is {value}: must be {range}{near}"),
                    None => problem!(name; "{entry} is {value} {unit}: must be {range}{near}"),
                });
            }
        });
        outcome
    }
}

/// The numbers in a parameter, with their indices if it is a list.
pub trait ParameterNumbers {
    /// Calls `look` with each number and its index.
    fn each(&self, look: &mut dyn FnMut(Option<usize>, f64));
}

macro_rules! one_number {
    ($($kind:ty)*) => {
        $(impl ParameterNumbers for $kind {
            fn each(&self, look: &mut dyn FnMut(Option<usize>, f64)) {
                look(None, *self as f64);
            }
        })*
    };
}
one_number!(f64 f32 usize u16 u32 u64);

impl<T: ParameterNumbers> ParameterNumbers for Option<T> {
    fn each(&self, look: &mut dyn FnMut(Option<usize>, f64)) {
        if let Some(value) = self {
            value.each(look);
        }
    }
}

impl ParameterNumbers for [f64] {
    fn each(&self, look: &mut dyn FnMut(Option<usize>, f64)) {
        self.iter().enumerate().for_each(|(k, &value)| look(Some(k), value));
    }
}

impl<const N: usize> ParameterNumbers for [f64; N] {
    fn each(&self, look: &mut dyn FnMut(Option<usize>, f64)) {
        self.as_slice().each(look);
    }
}

impl ParameterNumbers for Vec<f64> {
    fn each(&self, look: &mut dyn FnMut(Option<usize>, f64)) {
        self.as_slice().each(look);
    }
}

/// Defines a type's table `RANGES`, and `check_ranges`, which reads it. A name in parentheses after a parameter is the
/// method that returns its value if the parameter is left out.
#[doc(hidden)]
#[macro_export]
macro_rules! ranges {
    ($($name:ident $(($method:ident))?: $unit:literal, $range:expr;)*) => {
        /// The valid values of its parameters.
        pub const RANGES: &'static [$crate::allowed::Parameter] = &[
            $($crate::allowed::Parameter { name: stringify!($name), unit: $unit, range: $range },)*
        ];

        pub(crate) fn check_ranges(&self) -> $crate::Result<()> {
            let mut ranges = Self::RANGES.iter();
            $(if let Some(parameter) = ranges.next() {
                parameter.check(&$crate::allowed::ranges!(@ self $name $($method)?))?;
            })*
            Ok(())
        }
    };
    (@ $self:ident $name:ident) => { $self.$name };
    (@ $self:ident $name:ident $method:ident) => { $self.$method() };
}
pub use ranges;

/// Refuses a value that is not above 0 and finite; `unit` may be empty.
///
/// # Errors
///
/// `Problem`, naming the parameter and its value.
pub fn above_0(name: &'static str, value: f64, unit: &'static str) -> Result<()> {
    Parameter { name, unit, range: Range::ABOVE_0 }.check(&value)
}

/// Whether a weight is one that a neuron can sum, mV; NaN is none.
#[must_use]
pub fn is_weight(weight: f64) -> bool {
    weight.abs() <= LARGEST_WEIGHT
}

/// Refuses weights unless there is one per train that a neuron can sum.
///
/// # Errors
///
/// `Problem`, naming the weight.
pub fn one_weight_a_train(weights: &[f64], trains: usize) -> Result<()> {
    if weights.len() != trains {
        return Err(problem!("weights"; ": {} for {trains} trains; must be one per train", weights.len()));
    }
    weights.iter().position(|&w| !is_weight(w)).map_or(Ok(()), |n| Err(weight_error(n, weights[n])))
}

/// The error of what is no weight of the train `n`.
#[must_use]
pub fn weight_error(n: usize, weight: f64) -> Error {
    let right = if weight.is_finite() {
        format!("from -{LARGEST_WEIGHT:e} to {LARGEST_WEIGHT:e}")
    } else {
        "finite".to_owned()
    };
    problem!("weights"; "[{n}] is {}: must be {right}", number_text(weight))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_says_what_it_holds() {
        for (range, text, inside, outside) in [
            (Range::FINITE, "finite", -1e300, f64::INFINITY),
            (Range::ABOVE_0, "above 0 and finite", 1e-100, 0.0),
            (Range::ABOVE_0, "above 0 and finite", 1.0, 5e-324),
            (Range::FROM_0, "0 or more and finite", 0.0, -5e-324),
            (Range::FROM_0, "0 or more and finite", 5e-324, -1.0),
            (Range::COST, "0 or more", f64::INFINITY, -1.0),
            (Range::ABOVE_0.at_most(4.0), "above 0 and at most 4", 4.0, 4.1),
            (Range::FROM_0.below(1.0), "0 or more and below 1", 0.0, 1.0),
            (Range::WHOLE_US, "a whole number of us, 0.001 or more", 0.2, 0.00025),
            (Range::within(1e-10, 0.1), "from 1e-10 to 0.1", 1e-10, 0.11),
        ] {
            assert_eq!(range.to_string(), text);
            assert!(range.holds(inside) && !range.holds(outside) && !range.holds(f64::NAN), "{text}");
        }
    }

    #[test]
    fn an_error_names_the_entry_its_value_and_unit() {
        let parameter = |unit| Parameter { name: "tau", unit, range: Range::ABOVE_0 };
        let message = |unit, value: &dyn ParameterNumbers| parameter(unit).check(value).unwrap_err().to_string();
        assert_eq!(message("ms", &-1.0), "tau is -1 ms: must be above 0 and finite");
        assert_eq!(message("", &f64::NAN), "tau is NaN: must be above 0 and finite");
        assert_eq!(message("1/ms", &-1.0), "tau is -1/ms: must be above 0 and finite");
        assert_eq!(message("mV", &[1.0, -2.0]), "tau[1] is -2 mV: must be above 0 and finite");
        assert_eq!(message("ms", &5e-324), "tau is 5e-324 ms: must be above 0 and finite, 1e-100 at least");
        assert!(parameter("ms").check(&None::<f64>).is_ok());
    }
}
