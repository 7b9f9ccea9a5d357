//! Sending by the portable calls: one for each datagram, and the system says nothing of the path.

use std::io;
use std::net::{SocketAddr, UdpSocket};

/// The largest number of datagrams in a call.
pub(super) const TRAIN_DATAGRAMS: usize = 1;

/// No train is split.
pub(super) fn splits_trains(_: &UdpSocket) -> bool {
    false
}

/// Whether a datagram was too long is not asked.
pub(super) fn is_too_long(_: &io::Error, _is_train: bool) -> bool {
    false
}

/// The path MTU is not known.
pub(super) fn path_mtu(_from: SocketAddr, _to: SocketAddr) -> Option<usize> {
    None
}
