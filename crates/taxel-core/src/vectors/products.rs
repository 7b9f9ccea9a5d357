//! Sums of products.

use super::eight::{LANES, Vector, lines, lines_mut};
use super::instructions::kernel;

kernel! {
    /// The dot product `a.b`, including an incomplete last group.
    pub fn dot<V>(a: &[f64], b: &[f64]) -> f64 {
        let mut sums = [V::splat(0.0); 4];
        let (a4, b4) = (lines(a).chunks_exact(4), lines(b).chunks_exact(4));
        for (x, y) in a4.clone().zip(b4.clone()) {
            for s in 0..4 {
                sums[s] = sums[s].add_product(V::load(&x[s]), V::load(&y[s]));
            }
        }
        for (x, y) in a4.remainder().iter().zip(b4.remainder()) {
            sums[0] = sums[0].add_product(V::load(x), V::load(y));
        }
        let tail: f64 = a.as_chunks::<LANES>().1.iter().zip(b.as_chunks::<LANES>().1).map(|(x, y)| x * y).sum();
        (sums[0].total() + sums[1].total()) + (sums[2].total() + sums[3].total()) + tail
    }
}

/// The dot products of S rows with x.
#[inline(always)]
pub(crate) fn times<V: Vector, const S: usize>(rows: [&[[f64; LANES]]; S], x: &[[f64; LANES]]) -> [f64; S] {
    let rows = rows.map(|row| &row[..x.len()]);
    let mut sums = [V::splat(0.0); S];
    for (i, x) in x.iter().enumerate() {
        let x = V::load(x);
        for s in 0..S {
            sums[s] = sums[s].add_product(V::load(&rows[s][i]), x);
        }
    }
    sums.map(V::total)
}

/// `sum += by[0] rows[0] + by[1] rows[1] + ..`.
#[inline(always)]
pub(crate) fn add_lines<V: Vector, const S: usize>(rows: [&[[f64; LANES]]; S], by: [f64; S], sum: &mut [[f64; LANES]]) {
    let rows = rows.map(|row| &row[..sum.len()]);
    let by = by.map(V::splat);
    for (i, sum) in sum.iter_mut().enumerate() {
        let mut lanes = V::load(sum);
        for s in 0..S {
            lanes = lanes.add_product(by[s], V::load(&rows[s][i]));
        }
        lanes.store(sum);
    }
}

kernel! {
    /// `sum += factor row`.
    pub(crate) fn add<V>(sum: &mut [f64], factor: f64, row: &[f64]) {
        if factor == 0.0 {
            return;
        }
        let all = sum.len().min(row.len());
        let full = all - all % LANES;
        add_lines::<V, 1>([lines(&row[..full])], [factor], lines_mut(&mut sum[..full]));
        for (sum, row) in sum[full..all].iter_mut().zip(&row[full..all]) {
            *sum += factor * row;
        }
    }
}
