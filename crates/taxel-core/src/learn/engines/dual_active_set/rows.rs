//! Rows of the working set, and their multipliers as a caller gets them.

/// Rows count as satisfied within this, as they were stated or scaled to length 1, whichever asks for more.
pub(super) const TOLERANCE: f64 = 5e-13;
/// The least tolerance of a long row, scaled to length 1.
const FINEST: f64 = 4e-14;
/// Names an inequality, in the order in which they were added; never given twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RowId(pub(super) usize);

impl RowId {
    /// How many inequalities had been added before it.
    #[must_use]
    pub fn index(self) -> usize {
        self.0
    }
}

/// What a row of the working set limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Free,
    Equality(usize),
    Inequality(RowId),
    Lower(usize),
    Upper(usize),
}

/// A row of the working set, scaled to length 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    pub(super) kind: Kind,
    pub(super) length: f64,
    pub(super) limit: f64,
}

impl Row {
    /// The violation up to which the row counts as satisfied.
    pub(super) fn tolerance(&self) -> f64 {
        (TOLERANCE / self.length).clamp(FINEST, TOLERANCE)
    }
}

/// Multipliers of the active rows, as they were stated (not scaled).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Multipliers {
    /// One an equality, in the order in which they were added; any sign.
    pub equalities: Vec<f64>,
    /// Of the active inequalities, 0 or more; of all others it is 0.
    pub inequalities: Vec<(RowId, f64)>,
}

/// Proof that the rows contradict each other within the bounds (Farkas).
///
/// With `g = A_eq'y + A_in'z` the rows demand `g.w <= y.value + z.limit`, but no w within the bounds gives less than
/// `sum_n min(lower_n g_n, upper_n g_n)`, which is larger.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ray {
    /// y and z.
    pub multipliers: Multipliers,
    /// By how much it is larger.
    pub gap: f64,
}
