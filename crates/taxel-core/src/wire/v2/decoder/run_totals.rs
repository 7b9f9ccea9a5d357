//! Totals of the datagrams decoded in one run; zero on a machine without the instructions for it.

/// Number of datagrams, and the time and promise of the last one.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::wire::v2) struct RunTotals {
    /// Number of datagrams.
    pub(in crate::wire::v2) datagrams: usize,
    /// Number of their bytes, without the lengths that precede them in a stream.
    pub(in crate::wire::v2) bytes: usize,
    /// Base time of the last datagram, us.
    pub(super) base: i64,
    /// Span of the last datagram, us.
    pub(super) span: u16,
}
