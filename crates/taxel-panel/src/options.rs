//! Options of a panel.

use std::net::SocketAddr;
use std::path::PathBuf;

/// Options of a panel.
#[derive(Debug, Clone)]
pub struct PanelOptions {
    /// Address on which it listens; port 0 finds a free one.
    pub address: SocketAddr,
    /// Folder of the recordings, old and new.
    pub folder: PathBuf,
    /// Recording of the folder to show first.
    pub open: Option<String>,
    /// Whether that one is read by the request handler even if it is a board's, as it was opened with options.
    pub open_by_handler: bool,
    /// The board's serial line, which the request handler has connected.
    pub control: Option<String>,
    /// Whether the board's registers were stated; otherwise they are assumed until they are read.
    pub registers_stated: bool,
}
