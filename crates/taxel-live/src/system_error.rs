//! Errors of files as the system itself would state them, with its own codes.

use std::io::Error;

/// The codes of Linux and its kin, and those of Windows (winerror.h).
#[cfg(unix)]
mod codes {
    pub(super) const EXISTS: i32 = libc::EEXIST;
    pub(super) const DENIED: i32 = libc::EACCES;
}
#[cfg(windows)]
mod codes {
    pub(super) const EXISTS: i32 = 80;
    pub(super) const DENIED: i32 = 5;
}

/// The file exists.
pub fn exists() -> Error {
    Error::from_raw_os_error(codes::EXISTS)
}

/// Access to the file is denied.
pub fn denied() -> Error {
    Error::from_raw_os_error(codes::DENIED)
}
