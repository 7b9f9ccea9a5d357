//! Python's descriptors of open files.

use std::fs::File;
#[cfg(unix)]
use std::os::fd::BorrowedFd;
#[cfg(windows)]
use std::os::windows::io::BorrowedHandle;

use pyo3::prelude::*;

/// A copy of an open file, by its descriptor.
#[cfg(unix)]
pub(crate) fn file_of(_py: Python<'_>, descriptor: i32) -> PyResult<File> {
    // SAFETY: Python has the descriptor open as long as this call lasts; the copy is ours.
    Ok(unsafe { BorrowedFd::borrow_raw(descriptor) }.try_clone_to_owned()?.into())
}

/// A copy of an open file, by its descriptor, of which Python's own C library knows the handle.
#[cfg(windows)]
pub(crate) fn file_of(py: Python<'_>, descriptor: i32) -> PyResult<File> {
    let handle: isize = py.import("msvcrt")?.call_method1("get_osfhandle", (descriptor,))?.extract()?;
    // SAFETY: Python has the handle open as long as this call lasts; the copy is ours.
    Ok(unsafe { BorrowedHandle::borrow_raw(handle as *mut _) }.try_clone_to_owned()?.into())
}
