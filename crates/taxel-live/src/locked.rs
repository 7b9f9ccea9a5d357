//! A lock whose guarded value is always valid.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks a mutex. No holder of these locks can panic half-way through a change, so a poisoned lock still guards a valid
/// value.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
