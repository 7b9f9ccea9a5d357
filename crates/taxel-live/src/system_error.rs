//! An error of files as the system itself would state it, with its own code.

use std::io::Error;

/// The code of Linux and its kin, and that of Windows (winerror.h).
#[cfg(unix)]
const DENIED: i32 = libc::EACCES;
#[cfg(windows)]
const DENIED: i32 = 5;

/// Access to the file is denied.
pub fn denied() -> Error {
    Error::from_raw_os_error(DENIED)
}
