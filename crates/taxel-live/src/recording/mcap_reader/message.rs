//! A message of a file.

use crate::recording::Topic;

/// One message as it stands in the file.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// Its channel.
    pub topic: Topic,
    /// Our arrival number, of datagrams.
    pub number: u64,
    /// The host's clock, ns since 1970.
    pub at_ns: i64,
    /// The content.
    pub data: &'a [u8],
}
