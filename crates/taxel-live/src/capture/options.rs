//! The options of a receiver.

/// The options of a [`Receiver`](super::Receiver).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReceiverOptions {
    /// Requested size of the kernel's own queue, bytes;
    /// [`Counts::kernel_buffer_bytes`](super::CaptureCounts::kernel_buffer_bytes) is the size that the kernel granted.
    pub kernel_buffer_bytes: usize,
    /// Capacity of taxel's queue, bytes; memory is bounded by twice this.
    pub queue_bytes: usize,
    /// Receive several datagrams in one call if the kernel can (`UDP_GRO`).
    pub gro: bool,
}

impl Default for ReceiverOptions {
    /// 32 MiB in the kernel and 64 MiB here: 0.9 s at the sensor's worst case of 107 MB/s.
    fn default() -> Self {
        Self { kernel_buffer_bytes: 32 << 20, queue_bytes: 64 << 20, gro: true }
    }
}
