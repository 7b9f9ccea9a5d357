//! The options of a receiver.

/// How a [`Receiver`](super::Receiver) works.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReceiverOptions {
    /// Asked of the kernel for its own queue, bytes; [`Counts::kernel_buffer_bytes`](super::Counts::kernel_buffer_bytes) is what it gave.
    pub kernel_buffer_bytes: usize,
    /// How much may wait in taxel's queue, bytes; memory is bounded by twice this.
    pub queue_bytes: usize,
    /// Take trains of datagrams in one call where the kernel can (`UDP_GRO`).
    pub gro: bool,
}

impl Default for ReceiverOptions {
    /// 32 MiB in the kernel and 64 MiB here: 0.9 s at the sensor's worst case of 107 MB/s.
    fn default() -> Self {
        Self { kernel_buffer_bytes: 32 << 20, queue_bytes: 64 << 20, gro: true }
    }
}
