//! Python's descriptors of open files.

use std::fs::File;
#[cfg(unix)]
use std::os::fd::{BorrowedFd, IntoRawFd};
#[cfg(windows)]
use std::os::windows::io::{BorrowedHandle, IntoRawHandle};

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

/// The descriptor of an open file, which is Python's from now on.
#[cfg(unix)]
#[allow(clippy::unnecessary_wraps)]
pub(crate) fn into_descriptor(_py: Python<'_>, file: File) -> PyResult<i32> {
    Ok(file.into_raw_fd())
}

/// The descriptor of an open file, which is Python's from now on, to read bytes.
#[cfg(windows)]
pub(crate) fn into_descriptor(py: Python<'_>, file: File) -> PyResult<i32> {
    let flags: i32 = py.import("os")?.getattr("O_BINARY")?.extract()?;
    py.import("msvcrt")?.call_method1("open_osfhandle", (file.into_raw_handle() as isize, flags))?.extract()
}
