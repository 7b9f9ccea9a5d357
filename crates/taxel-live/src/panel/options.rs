//! What a panel is started with.

use std::net::SocketAddr;
use std::path::PathBuf;

/// How a panel works.
#[derive(Debug, Clone)]
pub struct PanelOptions {
    /// Where it listens; port 0 finds a free one.
    pub address: SocketAddr,
    /// Where recordings are, and new ones go.
    pub folder: PathBuf,
    /// The recording of the folder to show first.
    pub open: Option<String>,
    /// The board's serial line, which the office has connected.
    pub control: Option<String>,
    /// The labels of the readout that listens, if one does.
    pub readout: Option<Vec<String>>,
}
