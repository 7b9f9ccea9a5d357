//! What only tests call: work that panics, waits for Ctrl-C or returns an error of each kind, to see what [`enter`] makes of it.
//! Built with the feature `test-hooks` alone.

use std::time::Duration;

use pyo3::prelude::*;
use taxel_core::{Error, Hint, Place};

use taxel_border::enter::enter;
use taxel_border::errors::ProblemError;

/// Does what `hook` names without the GIL: returns an error of a kind, panics, or waits a minute for Ctrl-C.
#[pyfunction]
pub fn test_hook(py: Python<'_>, hook: &str) -> PyResult<()> {
    let error = match hook {
        "format" => Error::format("raised by a test hook").at(Place::byte(0)).with_hint("array", Hint::Give),
        "problem" => Error::argument("tau", ": raised by a test hook"),
        "device" => Error::device("register: raised by a test hook"),
        "scene" => Error::scene("ball: raised by a test hook"),
        "interrupted" => Error::Interrupted,
        "panic" => return enter(py, |_| -> Result<(), Error> { panic!("raised by a test hook") }),
        "wait" => {
            return enter(py, |stop| {
                for _ in 0..60_000 {
                    std::thread::sleep(Duration::from_millis(1));
                    stop.check()?;
                }
                Ok::<(), Error>(())
            });
        }
        other => return Err(ProblemError::new_err(format!("what is {other:?}: there is no such test hook"))),
    };
    enter(py, |_| Err::<(), _>(error))
}
