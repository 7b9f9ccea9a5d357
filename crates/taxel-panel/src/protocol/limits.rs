//! Limits of what a client may send.

/// Maximum size of a message, bytes: [`MOST_MARKS`] labels with names of 200 letters.
pub(crate) const MOST_BYTES: usize = 1 << 22;

/// Maximum number of labels that a request marks.
pub(crate) const MOST_MARKS: usize = 5000;

/// Maximum number of frames on their way.
pub(crate) const MOST_CREDITS: u32 = 8;
