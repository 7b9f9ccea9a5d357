//! Knocks at the door, so that tests can see what it does with a panic, with Ctrl-C and with each kind of error.

use std::time::Duration;

use pyo3::prelude::*;
use taxel_core::Error;

use crate::enter::enter;
use crate::errors::ProblemError;

/// Does what `what` names behind the door: an error of a kind, a panic, or a wait of a minute that hears Ctrl-C.
#[pyfunction]
fn knock(py: Python<'_>, what: &str) -> PyResult<()> {
    let error = match what {
        "format" => Error::Format("file, byte 0: said by knock".to_owned()),
        "problem" => Error::Problem("argument: said by knock".to_owned()),
        "device" => Error::Device("register: said by knock".to_owned()),
        "scene" => Error::Scene("ball: said by knock".to_owned()),
        "interrupted" => Error::Interrupted,
        #[allow(clippy::panic)]
        "panic" => return enter(py, |_| -> Result<(), Error> { panic!("said by knock") }),
        "wait" => {
            return enter(py, |stop| {
                for _ in 0..60_000 {
                    std::thread::sleep(Duration::from_millis(1));
                    stop.check()?;
                }
                Ok::<(), Error>(())
            });
        }
        other => return Err(ProblemError::new_err(format!("what is {other:?}: knows no such knock"))),
    };
    enter(py, |_| Err::<(), _>(error))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(knock, module)?)
}
