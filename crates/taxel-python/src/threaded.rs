//! Objects with threads of their own: used from any Python thread until they are ended.

use std::sync::{PoisonError, RwLock, RwLockReadGuard};

use pyo3::prelude::*;
use taxel_core::problem;

use taxel_border::enter::enter;

/// Such an object; `None` once it was ended. Locks are never waited for with the GIL: their holder may be waiting for the GIL to
/// look for Ctrl-C.
pub(crate) struct Threaded<T: Send + Sync> {
    value: RwLock<Option<T>>,
    /// The error of a call after the end.
    ended: &'static str,
}

impl<T: Send + Sync> Threaded<T> {
    /// An object; `ended` is the error of a call after its end.
    pub(crate) fn new(ended: &'static str, value: T) -> Self {
        Self { value: RwLock::new(Some(value)), ended }
    }

    /// Works with it, without the GIL.
    pub(crate) fn with<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&T) -> taxel_live::Result<R> + Send,
    ) -> PyResult<R> {
        enter(py, |_| match self.read().as_ref() {
            Some(value) => work(value),
            None => Err(self.ended()),
        })
    }

    /// The error of a call after its end.
    pub(crate) fn ended(&self) -> taxel_live::Error {
        problem!("{}", self.ended).into()
    }

    /// The object, for a caller without the GIL.
    pub(crate) fn read(&self) -> RwLockReadGuard<'_, Option<T>> {
        self.value.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes it out, to be ended, for a caller without the GIL.
    pub(crate) fn take(&self) -> Option<T> {
        self.value.write().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl<T: Send + Sync> Drop for Threaded<T> {
    fn drop(&mut self) {
        let value = self.value.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        // Its threads may be about to call a Python function: without the GIL they could not, and would never end.
        Python::attach(|py| py.detach(|| drop(value)));
    }
}
