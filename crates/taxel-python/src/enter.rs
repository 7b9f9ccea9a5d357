//! The one door: lets the GIL go, hears Ctrl-C, turns a panic into an error.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use taxel_core::Stop;

use crate::errors::{Error, IntoPyErr};

/// How often a long call asks Python whether Ctrl-C came: often enough to feel prompt, rarely enough to cost nothing.
const ASK_EVERY: Duration = Duration::from_millis(50);

/// Runs `work` without the GIL.
///
/// `work` gets a [`Stop`] that says true once Python has a signal pending; the signal's own exception is then raised.
pub(crate) fn enter<T, E>(py: Python<'_>, work: impl FnOnce(Stop<'_>) -> Result<T, E> + Send) -> PyResult<T>
where
    T: Send,
    E: IntoPyErr + Send,
{
    match guarded(py, None, work) {
        (_, Some(signal)) => Err(signal),
        (outcome, None) => outcome,
    }
}

/// As [`enter`], for work that keeps the best so far when it is stopped: by Ctrl-C, or after `max_seconds`.
///
/// Gives its result together with the signal's exception, which the caller raises once the result is kept.
pub(crate) fn enter_keeping<T, E>(
    py: Python<'_>,
    max_seconds: Option<f64>,
    work: impl FnOnce(Stop<'_>) -> Result<T, E> + Send,
) -> PyResult<(T, Option<Py<PyAny>>)>
where
    T: Send,
    E: IntoPyErr + Send,
{
    match guarded(py, max_seconds, work) {
        (Ok(value), signal) => Ok((value, signal.map(|s| s.into_value(py).into_any()))),
        (Err(_), Some(signal)) => Err(signal),
        (Err(error), None) => Err(error),
    }
}

/// What the work gave, and the exception of a signal that came meanwhile.
fn guarded<T, E>(
    py: Python<'_>,
    max_seconds: Option<f64>,
    work: impl FnOnce(Stop<'_>) -> Result<T, E> + Send,
) -> (PyResult<T>, Option<PyErr>)
where
    T: Send,
    E: IntoPyErr + Send,
{
    let signal: Mutex<Option<PyErr>> = Mutex::new(None);
    let begun = Instant::now();
    let asked = Mutex::new(begun);
    let outcome = py.detach(|| {
        let stop = || {
            if max_seconds.is_some_and(|most| begun.elapsed().as_secs_f64() >= most) {
                return true;
            }
            let Ok(mut last) = asked.try_lock() else { return false };
            if last.elapsed() < ASK_EVERY {
                return signal.lock().is_ok_and(|s| s.is_some());
            }
            *last = Instant::now();
            if let Err(error) = Python::attach(|py| py.check_signals())
                && let Ok(mut slot) = signal.lock()
            {
                *slot = Some(error);
            }
            signal.lock().is_ok_and(|s| s.is_some())
        };
        catch_unwind(AssertUnwindSafe(|| work(Stop::when(&stop))))
    });
    let outcome = match outcome {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(error.into_py_err()),
        Err(panic) => {
            let said = panic
                .downcast_ref::<&str>()
                .map(|s| (*s).to_owned())
                .or_else(|| panic.downcast_ref::<String>().cloned())
                .unwrap_or_else(|| "no message".to_owned());
            Err(Error::new_err(format!("a bug in taxel, please report it: {said}")))
        }
    };
    (outcome, signal.into_inner().unwrap_or(None))
}
