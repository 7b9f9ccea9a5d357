//! The Cholesky factor of the active rows' Gram matrix: rows are appended in blocks and removed by plane rotations.

use super::kernels::{backward, forward, forward_many, products, rotate};
use crate::vectors::{Aligned, LANES, dot};

/// L with `L L' = G` over the active rows, in the order of their activation.
#[derive(Debug, Clone, Default)]
pub(super) struct CholeskyFactor {
    /// L by columns; entries above the diagonal are undefined, those below the last row are 0 to the end of the line.
    l: Aligned,
    stride: usize,
    /// The reciprocals of the diagonal.
    inverse: Vec<f64>,
    /// `L^-1` times the rows' limits.
    limits: Vec<f64>,
}

impl CholeskyFactor {
    /// The number of rows in the factor.
    pub(super) fn len(&self) -> usize {
        self.inverse.len()
    }

    pub(super) fn clear(&mut self) {
        self.inverse.clear();
        self.limits.clear();
    }

    /// The length that vectors must have for `forward` and `backward`: the number of rows, padded to whole lines.
    pub(super) fn padded_length(&self) -> usize {
        self.len().next_multiple_of(LANES)
    }

    /// `x = L^-1 x`.
    pub(super) fn forward(&self, x: &mut [f64]) {
        forward(&self.l, self.stride, &self.inverse, self.len(), x);
    }

    /// `x = L^-T x`.
    pub(super) fn backward(&self, x: &mut [f64]) {
        backward(&self.l, self.stride, &self.inverse, self.len(), x);
    }

    /// `-(L L')^-1` times the limits: the multipliers if all rows were equalities.
    pub(super) fn optimum(&self) -> Vec<f64> {
        let mut x: Vec<f64> = self.limits.iter().map(|y| -y).collect();
        x.resize(self.padded_length(), 0.0);
        self.backward(&mut x);
        x.truncate(self.len());
        x
    }

    /// Appends a row with this limit, given `d = L^-1 g` and its pivot.
    pub(super) fn push(&mut self, d: &[f64], pivot: f64, limit: f64) {
        let m = self.len();
        self.reserve(m + 1);
        for (k, &d) in d[..m].iter().enumerate() {
            self.write(m, k, d);
        }
        self.write(m, m, pivot);
        self.inverse.push(1.0 / pivot);
        self.limits.push((limit - dot(&d[..m], &self.limits)) / pivot);
    }

    /// Appends rows, except those whose squared pivot is at most `least`, up to `most` rows in all; returns which were
    /// appended.
    ///
    /// `g` has a column of `stride` numbers for each new row: its products with the rows in the factor, then 0. `inner_products`
    /// has the products of the new rows with each other.
    pub(super) fn append(
        &mut self,
        g: &mut [f64],
        stride: usize,
        inner_products: &mut [f64],
        limits: &[f64],
        least: f64,
        most: usize,
    ) -> Vec<usize> {
        let (m, rows) = (self.len(), limits.len());
        self.reserve(m + rows);
        let mut limits = limits.to_vec();
        if m > 0 {
            forward_many(&self.l, self.stride, &self.inverse, m, g, stride);
            let mut products_of_d = vec![0.0; rows * rows];
            products(g, g, stride, &mut products_of_d, rows);
            for (product, d) in inner_products.iter_mut().zip(&products_of_d) {
                *product -= d;
            }
            for (limit, d) in limits.iter_mut().zip(g.chunks_exact(stride)) {
                *limit -= dot(&d[..m], &self.limits);
            }
        }
        let mut taken: Vec<usize> = Vec::with_capacity(rows);
        for k in 0..rows {
            let pivot = inner_products[k * rows + k];
            if pivot <= least || self.len() >= most {
                continue;
            }
            let pivot = pivot.sqrt();
            inner_products[k * rows + k] = pivot;
            let limit = limits[k] / pivot;
            self.inverse.push(1.0 / pivot);
            self.limits.push(limit);
            taken.push(k);
            let (before, after) = inner_products.split_at_mut((k + 1) * rows);
            let column = &mut before[k * rows + k + 1..];
            for d in &mut *column {
                *d /= pivot;
            }
            for (i, later) in after.chunks_exact_mut(rows).enumerate() {
                let by = column[i];
                limits[k + 1 + i] -= by * limit;
                for (product, d) in later[k + 1 + i..].iter_mut().zip(&column[i..]) {
                    *product -= by * d;
                }
            }
        }
        let width = self.len().next_multiple_of(LANES);
        for (j, column) in self.l.chunks_exact_mut(self.stride).take(m).enumerate() {
            for (to, &k) in column[m..width].iter_mut().zip(&taken) {
                *to = g[k * stride + j];
            }
            column[self.inverse.len()..width].fill(0.0);
        }
        for (j, (column, &row)) in self.l.chunks_exact_mut(self.stride).skip(m).zip(&taken).enumerate() {
            for (to, &k) in column[m + j..width].iter_mut().zip(&taken[j..]) {
                *to = inner_products[row * rows + k];
            }
            column[self.inverse.len()..width].fill(0.0);
        }
        taken
    }

    /// Removes the rows at these positions (ascending); `d`, the vector of a row not yet pushed, is rotated with the rest.
    pub(super) fn remove(&mut self, positions: &[usize], mut d: Option<&mut Vec<f64>>) {
        let Some(&first) = positions.first() else { return };
        let (m, stride) = (self.len(), self.stride);
        let left = m - positions.len();
        let width = m.next_multiple_of(LANES);
        for column in self.l.chunks_exact_mut(stride).take(first) {
            close_up(column, m, positions);
        }
        let mut carries: Vec<Vec<f64>> = Vec::with_capacity(positions.len());
        let mut tails = Vec::with_capacity(positions.len());
        for k in first..m {
            let column = &mut self.l[k * stride..][..width];
            if positions.get(carries.len()) == Some(&k) {
                carries.push(column.to_vec());
                tails.push((d.as_ref().map_or(0.0, |d| d[k]), self.limits[k]));
                continue;
            }
            for (carry, tail) in carries.iter_mut().zip(&mut tails) {
                let r = column[k].hypot(carry[k]);
                let (c, s) = (column[k] / r, carry[k] / r);
                let line = k - k % LANES;
                rotate(c, s, &mut column[line..], &mut carry[line..]);
                let (of_d, of_limit) = tail;
                if let Some(d) = d.as_deref_mut() {
                    (d[k], *of_d) = (c * d[k] + s * *of_d, c * *of_d - s * d[k]);
                }
                let limit = &mut self.limits[k];
                (*limit, *of_limit) = (c * *limit + s * *of_limit, c * *of_limit - s * *limit);
            }
            let to = k - carries.len();
            if let Some(d) = d.as_deref_mut() {
                d[to] = d[k];
            }
            self.limits[to] = self.limits[k];
            let diagonal = column[k];
            close_up(column, m, &positions[carries.len()..]);
            // Rows k and later must move up by `carries.len()` positions; entries above the diagonal are undefined anyway.
            let shift = carries.len();
            self.l.copy_within(k * stride + k..k * stride + m - (positions.len() - shift), to * stride + to);
            self.l[to * stride + left..][..left.next_multiple_of(LANES) - left].fill(0.0);
            self.inverse[to] = 1.0 / diagonal;
        }
        self.inverse.truncate(left);
        self.limits.truncate(left);
        if let Some(d) = d {
            d.truncate(left);
            d.resize(left.next_multiple_of(LANES), 0.0);
        }
    }

    fn write(&mut self, row: usize, column: usize, value: f64) {
        let line = &mut self.l[column * self.stride..][row..(row + 1).next_multiple_of(LANES)];
        line.fill(0.0);
        line[0] = value;
    }

    fn reserve(&mut self, rows: usize) {
        if rows <= self.stride {
            return;
        }
        // Strides are not powers of two, so that columns do not map to the same cache sets.
        let stride = (rows + rows / 2).max(64).next_multiple_of(LANES);
        let stride = if stride.is_multiple_of(64) { stride + LANES } else { stride };
        let mut l = Aligned::zeros(stride * stride);
        for (new, old) in l.chunks_exact_mut(stride).zip(self.l.chunks_exact(self.stride.max(1))).take(self.len()) {
            new[..self.stride].copy_from_slice(old);
        }
        (self.l, self.stride) = (l, stride);
    }
}

/// Removes the entries at `positions` from a column of `m` and sets the freed entries to 0.
fn close_up(column: &mut [f64], m: usize, positions: &[usize]) {
    let Some(&first) = positions.first() else { return };
    let mut to = first;
    for (i, &position) in positions.iter().enumerate() {
        let end = positions.get(i + 1).copied().unwrap_or(m);
        column.copy_within(position + 1..end, to);
        to += end - position - 1;
    }
    column[to..m].fill(0.0);
}
