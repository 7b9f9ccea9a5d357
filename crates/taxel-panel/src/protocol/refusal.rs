//! How a request is refused, and the words of the page for what helps.

use taxel_core::{Hint, Reason};

/// Why a request is refused, and which register or key is at fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    pub(crate) reason: String,
    pub(crate) field: Option<String>,
}

impl Refusal {
    pub(crate) fn of_field(field: &str, reason: impl std::fmt::Display) -> Self {
        Self { reason: format!("{field}: {reason}"), field: Some(field.to_owned()) }
    }

    /// The refusal of work that panicked.
    pub(crate) fn bug(work: &str) -> Self {
        format!("{work} failed within taxel; please report it").into()
    }
}

impl From<String> for Refusal {
    fn from(reason: String) -> Self {
        Self { reason, field: None }
    }
}

impl From<&str> for Refusal {
    fn from(reason: &str) -> Self {
        reason.to_owned().into()
    }
}

impl From<taxel_live::Error> for Refusal {
    fn from(error: taxel_live::Error) -> Self {
        words(&error).into()
    }
}

/// An error as the page shows it, with its remedy.
pub(crate) fn words(error: &taxel_live::Error) -> String {
    let reason = if let taxel_live::Error::Core(core) = error { core.reason() } else { None };
    let Some(Reason { argument: Some(argument), hint: Some(hint), .. }) = reason else { return error.to_string() };
    let text = error;
    match hint {
        Hint::Give => format!("{text}; give {argument}"),
        Hint::LayOut => format!(
            "{text}; if the taxels are a grid, row by row, give {argument}, or rows and columns in a layout file"
        ),
        Hint::Pitch => format!("{text}; give {argument} with the pitch in mm, or pitch_mm in a layout file"),
    }
}

pub(crate) type Answer<T = ()> = Result<T, Refusal>;

#[cfg(test)]
mod tests {
    use taxel_core::{Error, Hint, problem};

    use super::words;

    #[test]
    fn a_remedy_names_its_argument_once_also_in_a_part() {
        for hint in [Hint::Give, Hint::LayOut, Hint::Pitch] {
            let error: Error = problem!("it needs a grid").with_hint("array", hint).in_part("encoder fa1");
            let text = words(&error.into());
            assert!(text.starts_with("encoder fa1: it needs a grid; "), "{text}");
            assert_eq!(text.matches("array").count(), 1, "{text}");
        }
        let wrong = problem!("tau"; " is 0: must be above 0").in_part("encoder fa1");
        assert_eq!(words(&wrong.into()), "encoder fa1: tau is 0: must be above 0");
    }
}
