//! What Python keeps of a thread that is none of its own.

use pyo3::ffi;
use pyo3::prelude::*;

/// Calls Python from a thread that calls it again and again.
///
/// Python makes a state for such a thread at each call and throws it away after, for which a callback waited 60 us. Here it
/// is kept until the thread ends, and `threading.local` with it.
pub(crate) fn attach<T>(call: impl FnOnce(Python<'_>) -> T) -> T {
    Python::attach(|py| {
        // A thread that ends has no more need of it.
        let _ = STATE.try_with(|_| ());
        call(py)
    })
}

thread_local! {
    static STATE: Kept = Kept::new();
}

/// One use of this thread's state more than there are calls.
struct Kept(ffi::PyGILState_STATE);

impl Kept {
    /// To be made while the thread is attached.
    fn new() -> Self {
        // SAFETY: the interpreter runs, as the thread is attached to it; to ensure it once more only counts one up, and
        // `drop`, in the same thread, counts it down again.
        Self(unsafe { ffi::PyGILState_Ensure() })
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        // Where the interpreter has ended, or is about to, the state went with it.
        Python::try_attach(|_| {
            // SAFETY: it is released once, in the thread that ensured it, attached as it was then.
            unsafe { ffi::PyGILState_Release(self.0) };
        });
    }
}
