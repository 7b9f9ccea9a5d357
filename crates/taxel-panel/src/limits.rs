//! Limits of what a client may send.

/// Maximum size of a message, bytes.
pub(super) const MOST_BYTES: usize = 1 << 16;

/// Maximum number of labels that a request marks.
pub(super) const MOST_MARKS: usize = 5000;

/// Maximum number of pictures on their way.
pub(super) const MOST_CREDITS: u32 = 8;
