//! Python's state of a thread that Rust began.

use pyo3::ffi;
use pyo3::prelude::*;

/// Calls Python from a thread that calls it again and again.
///
/// Python makes a state for such a thread at each call and discards it after, which took 60 us of each callback. Here the state
/// lives until the thread ends, and with it `threading.local`.
pub(crate) fn attach<T>(call: impl FnOnce(Python<'_>) -> T) -> T {
    Python::attach(|py| {
        // A thread that is ending may have dropped its state already, and needs none.
        let _ = STATE.try_with(|_| ());
        call(py)
    })
}

thread_local! {
    static STATE: ThreadState = ThreadState::new();
}

/// One more reference to this thread's state than there are calls.
struct ThreadState(ffi::PyGILState_STATE);

impl ThreadState {
    /// To be made while the thread is attached.
    fn new() -> Self {
        // SAFETY: the interpreter runs, as the thread is attached to it; to ensure it once more only counts one up, and
        // `drop`, in the same thread, counts it down again.
        Self(unsafe { ffi::PyGILState_Ensure() })
    }
}

impl Drop for ThreadState {
    fn drop(&mut self) {
        // Where the interpreter has ended, or is about to, the state went with it.
        Python::try_attach(|_| {
            // SAFETY: it is released once, in the thread that ensured it, attached as it was then.
            unsafe { ffi::PyGILState_Release(self.0) };
        });
    }
}
