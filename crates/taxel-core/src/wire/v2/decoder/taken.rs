//! Datagrams that were decoded in one go; none on a machine without the instructions for it.

/// How many there were, and the time and promise of the last.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::wire::v2) struct Taken {
    /// How many.
    pub(in crate::wire::v2) datagrams: usize,
    /// Their bytes, without the lengths that stand before them in a stream.
    pub(in crate::wire::v2) bytes: usize,
    /// When the last one began, us.
    pub(super) base: i64,
    /// What it promises, us.
    pub(super) span: u16,
}
