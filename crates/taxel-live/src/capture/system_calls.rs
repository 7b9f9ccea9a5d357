//! The system's calls by which datagrams are received and sent: those of Linux, or those that all systems have.

use std::ffi::OsString;

use taxel_core::problem;

use crate::Result;

/// The environment variable that selects the portable calls on Linux, to test and to measure them there.
const VARIABLE: &str = "TAXEL_CAPTURE";

/// Which calls of the system are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SystemCalls {
    /// Linux receives and sends trains of datagrams in one call, stamps arrivals and counts what it drops.
    #[cfg(target_os = "linux")]
    Linux,
    /// A call for each datagram; the system neither stamps arrivals nor counts drops.
    Portable,
}

impl SystemCalls {
    /// Those of this system, unless `TAXEL_CAPTURE` selects the portable ones.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if the variable has another value.
    pub(super) fn selected() -> Result<Self> {
        Self::of_value(std::env::var_os(VARIABLE))
    }

    fn of_value(value: Option<OsString>) -> Result<Self> {
        match value {
            Some(value) if value == "portable" => Ok(Self::Portable),
            Some(value) if !value.is_empty() => {
                Err(problem!("environment variable {VARIABLE} is {value:?}: must be \"portable\", or not set").into())
            }
            #[cfg(target_os = "linux")]
            _ => Ok(Self::Linux),
            #[cfg(not(target_os = "linux"))]
            _ => Ok(Self::Portable),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_portable_calls_are_selected_by_name_and_another_name_is_refused() {
        let value = |text: &str| SystemCalls::of_value(Some(text.into()));
        assert_eq!(value("portable").unwrap(), SystemCalls::Portable);
        let usual = SystemCalls::of_value(None).unwrap();
        assert_eq!((value("").unwrap(), usual == SystemCalls::Portable), (usual, !cfg!(target_os = "linux")));
        assert_eq!(
            value("quick").unwrap_err().to_string(),
            "environment variable TAXEL_CAPTURE is \"quick\": must be \"portable\", or not set"
        );
    }
}
