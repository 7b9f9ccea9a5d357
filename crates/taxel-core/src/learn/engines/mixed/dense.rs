//! Dense products and factors by faer, in one thread, on slices of rows.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::lu::partial_pivoting as lu;
use faer::linalg::matmul::{matmul, triangular};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, ColMut, ColRef, Mat, MatMut, MatRef, Par};

/// Rows of `width` numbers, stored one after the other, as the columns of a matrix.
fn columns(rows: &[f64], width: usize) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(rows, width, rows.len() / width.max(1))
}

/// The product of each row with `w`.
pub(super) fn times(rows: &[f64], w: &[f64]) -> Vec<f64> {
    let rows = columns(rows, w.len());
    let mut out = vec![0.0; rows.ncols()];
    let into = ColMut::from_slice_mut(&mut out);
    matmul(into.as_mat_mut(), Accum::Replace, rows.transpose(), ColRef::from_slice(w).as_mat(), 1.0, Par::Seq);
    out
}

/// Adds the sum of all rows, each times its factor, to `sum`.
pub(super) fn add_sum(rows: &[f64], factors: &[f64], sum: &mut [f64]) {
    let rows = columns(rows, sum.len());
    let into = ColMut::from_slice_mut(sum);
    matmul(into.as_mat_mut(), Accum::Add, rows, ColRef::from_slice(factors).as_mat(), 1.0, Par::Seq);
}

/// The number of columns in a block of a Gram matrix: a product of blocks is faster than one of
/// triangles.
const BLOCK: usize = 128;

/// Adds `factor rows'rows` to the lower triangle; entries above it are undefined.
pub(super) fn add_gram(rows: &[f64], width: usize, factor: f64, sum: &mut Mat<f64>) {
    let rows = columns(rows, width);
    for from in (0..width).step_by(BLOCK) {
        let (below, block) = (width - from, BLOCK.min(width - from));
        let left = rows.subrows(from, below);
        let right = rows.subrows(from, block).transpose();
        matmul(sum.as_mut().submatrix_mut(from, from, below, block), Accum::Add, left, right, factor, Par::Seq);
    }
}

/// The Cholesky factor `L` of a positive definite matrix.
pub(super) struct Cholesky(Mat<f64>);

impl Cholesky {
    /// Factors the lower triangle; `None` if the matrix is not positive definite.
    pub(super) fn new(mut matrix: Mat<f64>) -> Option<Self> {
        let n = matrix.nrows();
        let scratch = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        llt::factor::cholesky_in_place(matrix.as_mut(), Default::default(), Par::Seq, stack, Default::default())
            .ok()?;
        Some(Self(matrix))
    }

    /// The memory of the matrix, for reuse.
    pub(super) fn into_matrix(self) -> Mat<f64> {
        self.0
    }

    pub(super) fn solve(&self, right: &mut [f64]) {
        let mut right = ColMut::from_slice_mut(right).as_mat_mut();
        solve_lower_triangular_in_place(self.0.as_ref(), right.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(self.0.transpose(), right.as_mut(), Par::Seq);
    }

    /// `L^-1` times each row; the rows are stored one after the other.
    pub(super) fn multiply_by_inverse(&self, rows: &[f64]) -> Vec<f64> {
        let n = self.0.nrows();
        let mut out = rows.to_vec();
        let count = rows.len() / n.max(1);
        solve_lower_triangular_in_place(
            self.0.as_ref(),
            MatMut::from_column_major_slice_mut(&mut out, n, count),
            Par::Seq,
        );
        out
    }
}

/// The lower triangle of `rows rows'`.
pub(super) fn outer(rows: &[f64], width: usize) -> Mat<f64> {
    use triangular::BlockStructure::{Rectangular, TriangularLower};
    let rows = columns(rows, width);
    let mut out = Mat::zeros(rows.ncols(), rows.ncols());
    triangular::matmul(
        out.as_mut(),
        TriangularLower,
        Accum::Replace,
        rows.transpose(),
        Rectangular,
        rows,
        Rectangular,
        1.0,
        Par::Seq,
    );
    out
}

/// The factors `P'LU` of a square matrix.
pub(super) struct Lu {
    factors: Mat<f64>,
    order: Vec<usize>,
    back: Vec<usize>,
}

impl Lu {
    pub(super) fn new(mut matrix: Mat<f64>) -> Self {
        let n = matrix.nrows();
        let (mut order, mut back) = (vec![0_usize; n], vec![0_usize; n]);
        let scratch = lu::factor::lu_in_place_scratch::<usize, f64>(n, n, Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        lu::factor::lu_in_place(matrix.as_mut(), &mut order, &mut back, Par::Seq, stack, Default::default());
        Self { factors: matrix, order, back }
    }

    pub(super) fn solve(&self, right: &mut [f64]) {
        let n = self.factors.nrows();
        let scratch = lu::solve::solve_in_place_scratch::<usize, f64>(n, 1, Par::Seq);
        let mut memory = MemBuffer::new(scratch);
        lu::solve::solve_in_place(
            self.factors.as_ref(),
            self.factors.as_ref(),
            faer::perm::PermRef::new_checked(&self.order, &self.back, n),
            ColMut::from_slice_mut(right).as_mat_mut(),
            Par::Seq,
            MemStack::new(&mut memory),
        );
    }
}
