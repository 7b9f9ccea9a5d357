//! How a request is refused.

/// Why a request is refused, and which register or key is at fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    pub(crate) reason: String,
    pub(crate) field: Option<String>,
}

impl Refusal {
    pub(crate) fn of(field: &str, reason: impl std::fmt::Display) -> Self {
        Self { reason: format!("{field}: {reason}"), field: Some(field.to_owned()) }
    }

    /// Of work that panicked.
    pub(crate) fn bug(what: &str) -> Self {
        format!("{what} failed within taxel; please report it").into()
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
        error.to_string().into()
    }
}

pub(crate) type Answer<T = ()> = Result<T, Refusal>;
