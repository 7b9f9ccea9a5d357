//! Channels in blocks, over which the compiler vectorises loops.

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
