//! Channels in blocks, over which the compiler vectorises loops, and the prefetch of the next frame.

use crate::vectors::fetch;

/// Number of channels in a block; the compiler turns loops over a block into vector instructions.
pub(super) const BLOCK: usize = 64;

/// One value for each of [`BLOCK`] channels.
pub(super) type Block = [f32; BLOCK];

/// Number of blocks that hold `channels`.
pub(super) fn blocks(channels: usize) -> usize {
    channels.div_ceil(BLOCK)
}

/// Views values as blocks; their number must be a multiple of the block's length.
pub(super) fn in_blocks(values: &[f32]) -> &[Block] {
    values.as_chunks().0
}

/// The next frame, if it follows in memory. It is prefetched a block at a time while the current frame is read or
/// encoded: a processor has few line fill buffers, and would drop more prefetches at once.
pub(super) struct NextFrame {
    at: *const Block,
    left: usize,
}

impl NextFrame {
    /// No prefetch, because the address of the next frame is not known.
    pub(super) fn unknown() -> Self {
        Self { at: std::ptr::null(), left: 0 }
    }

    /// The frame that follows this one in memory.
    pub(super) fn after(frame: &[f32]) -> Self {
        Self { at: frame.as_ptr_range().end.cast(), left: blocks(frame.len()) }
    }

    /// Prefetches a block; returns whether there was one left.
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
