//! What a visitor may ask at once.

/// A message of a page is no longer.
pub(super) const MOST_BYTES: usize = 1 << 16;

/// Pictures that may be on their way.
pub(super) const MOST_CREDITS: u32 = 8;
