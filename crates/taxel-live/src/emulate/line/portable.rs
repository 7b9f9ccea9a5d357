//! A system without pseudo-terminals.

use std::fs::File;
use std::path::Path;

use taxel_core::problem;

use crate::Result;

/// Refuses the line.
///
/// # Errors
///
/// `Core(Problem)`, which names what this system has.
pub(super) fn open(link: &Path) -> Result<(File, File)> {
    let link = link.display();
    Err(problem!("{link}: this system has no pseudo-terminals; the board's commands work over TCP (--control PORT)")
        .into())
}
