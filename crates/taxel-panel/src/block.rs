//! A block of changes, as an index stores them.

use std::sync::Arc;

use taxel_live::pipeline::TaxelChange;

/// Changes that follow one another.
#[derive(Debug, Clone, Default)]
pub struct Block {
    /// Where changes are missing before these: the values held after the gap, and the number of events up to there.
    pub held: Option<(Vec<u16>, u64)>,
    /// The changes.
    pub changes: Arc<Vec<TaxelChange>>,
    /// The rest of each taxel after these changes, where it is another from there on.
    pub rest: Option<Vec<u16>>,
}
