//! Pseudo-terminals of Linux.

use std::fs::File;
use std::io;
use std::os::fd::{AsRawFd, FromRawFd};
use std::path::Path;

use crate::{Error, Result, system_error};

/// Opens a pseudo-terminal and creates a link to it; returns our end, and the other one, which keeps the line up.
///
/// # Errors
///
/// `File` if no pseudo-terminal is available, or something other than a link exists at `link`.
pub(super) fn open(link: &Path) -> Result<(File, File)> {
    let (mut ours, mut client) = (-1, -1);
    let mut name = [0 as libc::c_char; 128];
    // SAFETY: openpty writes two descriptors and a name of some 12 bytes into the buffers given; no settings are
    // passed.
    let opened =
        unsafe { libc::openpty(&raw mut ours, &raw mut client, name.as_mut_ptr(), std::ptr::null(), std::ptr::null()) };
    if opened != 0 {
        return Err(Error::file(link)(io::Error::last_os_error()));
    }
    // SAFETY: both descriptors are open and owned by this function alone; the name ends within its buffer.
    let (ours, client, name) = unsafe {
        let name = std::ffi::CStr::from_ptr(name.as_ptr()).to_string_lossy().into_owned();
        (File::from_raw_fd(ours), File::from_raw_fd(client), name)
    };
    // Set to raw mode before a program can open it: otherwise the board's output would be echoed back to it.
    // SAFETY: a descriptor that we own, and settings on our stack.
    let ready = unsafe {
        let mut settings = std::mem::zeroed();
        libc::tcgetattr(client.as_raw_fd(), &raw mut settings) == 0
            && {
                libc::cfmakeraw(&raw mut settings);
                libc::tcsetattr(client.as_raw_fd(), libc::TCSANOW, &raw const settings) == 0
            }
            && libc::fcntl(ours.as_raw_fd(), libc::F_SETFL, libc::O_NONBLOCK) == 0
    };
    if !ready {
        return Err(Error::file(link)(io::Error::last_os_error()));
    }
    if std::fs::symlink_metadata(link).is_ok_and(|metadata| !metadata.file_type().is_symlink()) {
        return Err(Error::file(link)(system_error::exists()));
    }
    // The link is created under another name and renamed, so that a valid link exists at all times.
    let mut temporary = link.as_os_str().to_owned();
    temporary.push(format!(".{}", std::process::id()));
    let made = std::os::unix::fs::symlink(&name, &temporary).and_then(|()| std::fs::rename(&temporary, link));
    made.map_err(Error::file(link))?;
    Ok((ours, client))
}
