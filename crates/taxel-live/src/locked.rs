//! A lock whose holder never leaves half of a change behind.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// No holder of these locks can panic half-way through a change, so a poisoned lock still guards a sound state.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
