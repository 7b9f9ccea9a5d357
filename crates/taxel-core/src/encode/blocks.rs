//! Channels in blocks, over which the compiler's loops are vector instructions, and the prefetch of the next picture.

use crate::vectors::fetch;

/// Channels that are looked at together; the compiler turns loops over a block into vector instructions.
pub(super) const BLOCK: usize = 64;

/// One value a channel, for [`BLOCK`] channels.
pub(super) type Block = [f32; BLOCK];

/// How many blocks hold `channels`.
pub(super) fn blocks(channels: usize) -> usize {
    channels.div_ceil(BLOCK)
}

/// Values as blocks, of which they fill a whole number.
pub(super) fn in_blocks(values: &[f32]) -> &[Block] {
    values.as_chunks().0
}

/// The next picture, where it follows in memory. It is prefetched a block at a time while this one is read or encoded, as the
/// processor has few line fill buffers: more prefetches at once would be dropped.
pub(super) struct Next {
    at: *const Block,
    left: usize,
}

impl Next {
    /// The address of the next picture is not known.
    pub(super) fn unknown() -> Self {
        Self { at: std::ptr::null(), left: 0 }
    }

    /// What follows a picture.
    pub(super) fn after(picture: &[f32]) -> Self {
        Self { at: picture.as_ptr_range().end.cast(), left: blocks(picture.len()) }
    }

    /// Prefetches a block; returns whether there was one.
    #[inline(always)]
    pub(super) fn fetch(&mut self) -> bool {
        if self.left == 0 {
            return false;
        }
        fetch(self.at);
        (self.at, self.left) = (self.at.wrapping_add(1), self.left - 1);
        true
    }
}
