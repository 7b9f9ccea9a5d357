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
    /// The board's serial line, which the request handler has connected.
    pub control: Option<String>,
    /// Whether somebody stated the board's registers; otherwise they are assumed until they are read.
    pub registers_stated: bool,
    /// Labels of the readout that runs, if one does.
    pub readout: Option<Vec<String>>,
}
