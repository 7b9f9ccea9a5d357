//! Rows of the working set, and their multipliers in the caller's terms.

/// The tolerance of a row, as stated or scaled to length 1, whichever is stricter.
pub(super) const TOLERANCE: f64 = 5e-13;
/// The smallest tolerance of a long row, scaled to length 1.
const FINEST: f64 = 4e-14;
/// Identifies a row by the order of its addition; never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RowId(pub(super) usize);

impl RowId {
    /// The number of rows that had been added before this one.
    #[must_use]
    pub fn index(self) -> usize {
        self.0
    }
}

/// What a row of the working set constrains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ConstraintKind {
    Free,
    Equality(RowId),
    Inequality(RowId),
    Lower(usize),
    Upper(usize),
}

/// A row of the working set, scaled to length 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct WorkingRow {
    pub(super) kind: ConstraintKind,
    pub(super) length: f64,
    pub(super) limit: f64,
}

impl WorkingRow {
    /// The violation up to which the row counts as satisfied.
    pub(super) fn tolerance(&self) -> f64 {
        (TOLERANCE / self.length).clamp(FINEST, TOLERANCE)
    }
}

/// The multipliers of the active rows as stated (not scaled), in the order of their addition: of equalities of any sign,
/// of inequalities 0 or more; that of every other row is 0.
pub type Multipliers = Vec<(RowId, f64)>;

/// Proof that the rows contradict each other within the bounds (Farkas).
///
/// With `g = A'u` the rows require `g.w <= u.limit`, but the least value of `g.w` within the
/// bounds, `sum_n min(lower_n g_n, upper_n g_n)`, is larger.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ray {
    /// u.
    pub multipliers: Multipliers,
    /// The difference between that least value and what the rows allow.
    pub gap: f64,
}
