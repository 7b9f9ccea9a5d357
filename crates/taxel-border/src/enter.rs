//! The one way from Python into long work: releases the GIL, checks for Ctrl-C, reports progress, turns a panic into an error.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use taxel_core::Stop;

use crate::errors::{Error, IntoPyErr};

/// How often a long call asks Python for pending signals: often enough to be prompt, rarely enough to cost nothing.
const ASK_EVERY: Duration = Duration::from_millis(50);

/// Runs `work` without the GIL.
///
/// `work` gets a [`Stop`] that asks it to stop once Python has a signal pending; the signal's own exception is then raised.
pub fn enter<T, E>(py: Python<'_>, work: impl FnOnce(Stop<'_>) -> Result<T, E> + Send) -> PyResult<T>
where
    T: Send,
    E: IntoPyErr + Send,
{
    enter_with_progress(py, |stop, _| work(stop))
}

/// As [`enter`], for work that calls Python functions with its progress.
pub fn enter_with_progress<T, E>(
    py: Python<'_>,
    work: impl FnOnce(Stop<'_>, ProgressCaller<'_>) -> Result<T, E> + Send,
) -> PyResult<T>
where
    T: Send,
    E: IntoPyErr + Send,
{
    match guarded(py, None, work) {
        (_, Some(raised)) => Err(raised),
        (outcome, None) => outcome,
    }
}

/// As [`enter_with_progress`], for work that returns its best result so far when it is stopped: by Ctrl-C, by an exception of a progress
/// function, or after `max_seconds`.
///
/// Returns the result together with the exception that stopped the work, which the caller raises once the result is stored.
pub fn enter_keeping<T, E>(
    py: Python<'_>,
    max_seconds: Option<f64>,
    work: impl FnOnce(Stop<'_>, ProgressCaller<'_>) -> Result<T, E> + Send,
) -> PyResult<(T, Option<Py<PyAny>>)>
where
    T: Send,
    E: IntoPyErr + Send,
{
    match guarded(py, max_seconds, work) {
        (Ok(value), raised) => {
            // A Ctrl-C since the last check would be raised before the caller has stored the result.
            let raised = raised.or_else(|| py.check_signals().err());
            Ok((value, raised.map(|r| r.into_value(py).into_any())))
        }
        (Err(_), Some(raised)) => Err(raised),
        (Err(error), None) => Err(error),
    }
}

/// Calls Python functions with the progress of work. An exception of one ends the work, as Ctrl-C does, and is raised again; no
/// function is called after it.
#[derive(Clone, Copy)]
pub struct ProgressCaller<'a>(&'a Mutex<Option<PyErr>>);

impl ProgressCaller<'_> {
    /// Calls a function, where there is one.
    pub fn call(self, function: Option<&Py<PyAny>>, call: impl FnOnce(Python<'_>, &Py<PyAny>) -> PyResult<Py<PyAny>>) {
        let Some(function) = function else { return };
        if !self.raised()
            && let Err(error) = Python::attach(|py| call(py, function).map(drop))
        {
            self.store_first(error);
        }
    }

    fn raised(self) -> bool {
        unpoisoned(self.0).is_some()
    }

    fn store_first(self, error: PyErr) {
        unpoisoned(self.0).get_or_insert(error);
    }
}

/// An object that several Python threads may use: one at a time, and the others wait without the GIL.
pub struct Exclusive<T>(Mutex<T>);

impl<T: Send> Exclusive<T> {
    /// The value, which no thread uses yet.
    pub fn new(value: T) -> Self {
        Self(Mutex::new(value))
    }

    /// Long work, as [`enter`].
    pub fn enter<R, E>(&self, py: Python<'_>, work: impl FnOnce(&mut T, Stop<'_>) -> Result<R, E> + Send) -> PyResult<R>
    where
        R: Send,
        E: IntoPyErr + Send,
    {
        enter(py, |stop| work(&mut self.lock(), stop))
    }

    /// A short read or change: also without the GIL, since the thread that holds the lock may be waiting for the GIL.
    pub fn with<R: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut T) -> R + Send) -> R {
        py.detach(|| work(&mut self.lock()))
    }

    /// The value itself, to be called without the GIL.
    pub fn lock(&self) -> MutexGuard<'_, T> {
        unpoisoned(&self.0)
    }
}

/// The value of a mutex, also after a panic: [`enter`] reports that, and the value is no worse than after an error.
fn unpoisoned<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The outcome of the work, and the exception that was raised meanwhile: by a signal, or by a progress function.
fn guarded<T, E>(
    py: Python<'_>,
    max_seconds: Option<f64>,
    work: impl FnOnce(Stop<'_>, ProgressCaller<'_>) -> Result<T, E> + Send,
) -> (PyResult<T>, Option<PyErr>)
where
    T: Send,
    E: IntoPyErr + Send,
{
    let raised: Mutex<Option<PyErr>> = Mutex::new(None);
    let caller = ProgressCaller(&raised);
    let begun = Instant::now();
    let asked = Mutex::new(begun);
    let outcome = py.detach(|| {
        let stop = || {
            if max_seconds.is_some_and(|most| begun.elapsed().as_secs_f64() >= most) {
                return true;
            }
            if let Ok(mut last) = asked.try_lock()
                && last.elapsed() >= ASK_EVERY
            {
                *last = Instant::now();
                if let Err(error) = Python::attach(|py| py.check_signals()) {
                    caller.store_first(error);
                }
            }
            caller.raised()
        };
        catch_unwind(AssertUnwindSafe(|| work(Stop::when(&stop), caller)))
    });
    let outcome = match outcome {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(error.into_py_err()),
        Err(panic) => {
            let message = panic
                .downcast_ref::<&str>()
                .map(|s| (*s).to_owned())
                .or_else(|| panic.downcast_ref::<String>().cloned())
                .unwrap_or_else(|| "no message".to_owned());
            Err(Error::new_err(format!("a bug in taxel, please report it: {message}")))
        }
    };
    (outcome, raised.into_inner().unwrap_or_else(PoisonError::into_inner))
}
