//! A message of a file.

use crate::recording::Topic;

/// One message of a file, undecoded.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// Channel of the message.
    pub topic: Topic,
    /// Arrival number of a datagram.
    pub number: u64,
    /// Time by the host's clock, ns since 1970.
    pub at_ns: i64,
    /// Content of the message.
    pub data: &'a [u8],
}
