//! The loops that take most of the time, over rows and columns of whole lines.

use crate::vectors::{LANES, add_lines, kernel, lines, lines_mut, times};

kernel! {
    /// `out[k] = rows[which[k]].x`; each row has `stride` numbers, a multiple of eight, padded with 0.
    pub(super) fn rows_times<V>(rows: &[f64], stride: usize, chosen: &[usize], x: &[f64], out: &mut [f64]) {
        let x = lines(&x[..stride]);
        let row = |k: usize| lines(&rows[k * stride..][..stride]);
        for (chosen, out) in chosen.chunks(LANES).zip(out.chunks_mut(LANES)) {
            if let Ok(chosen) = <[usize; LANES]>::try_from(chosen) {
                out.copy_from_slice(&times::<V, LANES>(chosen.map(row), x));
            } else {
                for (&k, out) in chosen.iter().zip(out) {
                    [*out] = times::<V, 1>([row(k)], x);
                }
            }
        }
    }
}

kernel! {
    /// `out += sum of by[k] rows[which[k]]`; rows as in `rows_times`.
    pub(super) fn add_rows<V>(rows: &[f64], stride: usize, chosen: &[usize], by: &[f64], out: &mut [f64]) {
        let out = lines_mut(&mut out[..stride]);
        let row = |k: usize| lines(&rows[k * stride..][..stride]);
        for (chosen, by) in chosen.chunks(LANES).zip(by.chunks(LANES)) {
            if let (Ok(chosen), Ok(by)) = (<[usize; LANES]>::try_from(chosen), by.try_into()) {
                add_lines::<V, LANES>(chosen.map(row), by, out);
            } else {
                for (&k, &by) in chosen.iter().zip(by) {
                    add_lines::<V, 1>([row(k)], [by], out);
                }
            }
        }
    }
}

/// Solves `L x = x` for the unknowns k to k + here, after the contributions of earlier unknowns have been subtracted.
#[inline(always)]
fn triangle(l: &[f64], stride: usize, inverse: &[f64], k: usize, count: usize, x: &mut [f64]) {
    for j in k..k + count {
        x[j] *= inverse[j];
        for i in j + 1..k + count {
            x[i] -= x[j] * l[j * stride + i];
        }
    }
}

/// The eight columns from k on, below the rows for which they solve.
#[inline(always)]
fn below(l: &[f64], stride: usize, k: usize, padded: usize) -> [&[[f64; LANES]]; LANES] {
    std::array::from_fn(|j| lines(&l[(k + j) * stride + k + LANES..(k + j) * stride + padded]))
}

kernel! {
    /// Solves `L x = x` in place; L is stored by columns of `stride`, of which the first `m` count; entries beyond `m`
    /// are 0.
    pub(super) fn forward<V>(l: &[f64], stride: usize, inverse: &[f64], m: usize, x: &mut [f64]) {
        let padded = m.next_multiple_of(LANES);
        for k in (0..m).step_by(LANES) {
            triangle(l, stride, inverse, k, (m - k).min(LANES), x);
            if k + LANES < padded {
                let by = std::array::from_fn(|j| -x[k + j]);
                add_lines::<V, LANES>(below(l, stride, k, padded), by, lines_mut(&mut x[k + LANES..padded]));
            }
        }
    }
}

kernel! {
    /// Solves `L' x = x` in place; L is stored as in `forward`.
    pub(super) fn backward<V>(l: &[f64], stride: usize, inverse: &[f64], m: usize, x: &mut [f64]) {
        let padded = m.next_multiple_of(LANES);
        for k in (0..m).step_by(LANES).rev() {
            if k + LANES < padded {
                let sums = times::<V, LANES>(below(l, stride, k, padded), lines(&x[k + LANES..padded]));
                for j in 0..LANES {
                    x[k + j] -= sums[j];
                }
            }
            let count = (m - k).min(LANES);
            for j in (k..k + count).rev() {
                for i in j + 1..k + count {
                    x[j] -= l[j * stride + i] * x[i];
                }
                x[j] *= inverse[j];
            }
        }
    }
}

/// The inverse of the eight by eight triangle at k, by columns.
#[inline(always)]
fn inverse_triangle(l: &[f64], stride: usize, inverse: &[f64], k: usize) -> [[f64; LANES]; LANES] {
    let mut columns = [[0.0; LANES]; LANES];
    for (j, column) in columns.iter_mut().enumerate() {
        column[j] = inverse[k + j];
        for i in j + 1..LANES {
            let sum: f64 = (j..i).map(|h| l[(k + h) * stride + k + i] * column[h]).sum();
            column[i] = -sum * inverse[k + i];
        }
    }
    columns
}

/// The number of right-hand sides for which L is read once, and of their lines that stay in the nearest cache.
const SIDES: usize = 16;
const NEAR: usize = 16;

kernel! {
    /// `forward` for many right-hand sides, columns of `x_stride` numbers each.
    pub(super) fn forward_many<V>(l: &[f64], stride: usize, inverse: &[f64], m: usize, x: &mut [f64], x_stride: usize) {
        let padded = m.next_multiple_of(LANES);
        for x in x.chunks_mut(SIDES * x_stride) {
            for k in (0..m).step_by(LANES) {
                if k + LANES > m {
                    for x in x.chunks_exact_mut(x_stride) {
                        triangle(l, stride, inverse, k, m - k, x);
                    }
                    continue;
                }
                let inverse_block = inverse_triangle(l, stride, inverse, k);
                for x in x.chunks_exact_mut(x_stride) {
                    let unknowns = &mut lines_mut(&mut x[k..k + LANES])[0];
                    let (mut even, mut odd) = (V::splat(0.0), V::splat(0.0));
                    for j in (0..LANES).step_by(2) {
                        even = even.add_product(V::splat(unknowns[j]), V::load(&inverse_block[j]));
                        odd = odd.add_product(V::splat(unknowns[j + 1]), V::load(&inverse_block[j + 1]));
                    }
                    even.add_product(V::splat(1.0), odd).store(unknowns);
                }
                for from in (k + LANES..padded).step_by(NEAR * LANES) {
                    let to = (from + NEAR * LANES).min(padded);
                    let columns: [_; LANES] = std::array::from_fn(|j| lines(&l[(k + j) * stride + from..(k + j) * stride + to]));
                    for x in x.chunks_mut(2 * x_stride) {
                        if x.len() < 2 * x_stride {
                            let by = std::array::from_fn(|j| -x[k + j]);
                            add_lines::<V, LANES>(columns, by, lines_mut(&mut x[from..to]));
                            continue;
                        }
                        let (a, b) = x.split_at_mut(x_stride);
                        let of_a: [V; LANES] = std::array::from_fn(|j| V::splat(-a[k + j]));
                        let of_b: [V; LANES] = std::array::from_fn(|j| V::splat(-b[k + j]));
                        let (a, b) = (lines_mut(&mut a[from..to]), lines_mut(&mut b[from..to]));
                        let columns = columns.map(|column| &column[..a.len()]);
                        for (i, (a, b)) in a.iter_mut().zip(b).enumerate() {
                            let (mut sum_a, mut sum_b) = (V::load(a), V::load(b));
                            for j in 0..LANES {
                                let column = V::load(&columns[j][i]);
                                sum_a = sum_a.add_product(of_a[j], column);
                                sum_b = sum_b.add_product(of_b[j], column);
                            }
                            sum_a.store(a);
                            sum_b.store(b);
                        }
                    }
                }
            }
        }
    }
}

/// The size of a tile: left rows, right rows, and the number of coefficients of each that are summed at a time.
const LEFT: usize = 4;
const RIGHT: usize = 6;
const DEEP: usize = 512;

kernel! {
    /// `out[i][j] += left[i].right[j]` for two sets of rows of `stride` numbers each; `out` has rows of `width`.
    pub(super) fn products<V>(left: &[f64], right: &[f64], stride: usize, out: &mut [f64], width: usize) {
        for from in (0..stride).step_by(DEEP) {
            let to = (from + DEEP).min(stride);
            for (left, out) in left.chunks(128 * stride).zip(out.chunks_mut(128 * width)) {
                for (r, right) in right.chunks(RIGHT * stride).enumerate() {
                    for (left, out) in left.chunks(LEFT * stride).zip(out.chunks_mut(LEFT * width)) {
                        if left.len() == LEFT * stride && right.len() == RIGHT * stride {
                            let a: [_; LEFT] = std::array::from_fn(|i| lines(&left[i * stride + from..i * stride + to]));
                            let b: [_; RIGHT] = std::array::from_fn(|j| lines(&right[j * stride + from..j * stride + to]));
                            let mut sums = [[V::splat(0.0); RIGHT]; LEFT];
                            for k in 0..(to - from) / LANES {
                                let b: [V; RIGHT] = std::array::from_fn(|j| V::load(&b[j][k]));
                                for i in 0..LEFT {
                                    let a = V::load(&a[i][k]);
                                    for j in 0..RIGHT {
                                        sums[i][j] = sums[i][j].add_product(a, b[j]);
                                    }
                                }
                            }
                            for i in 0..LEFT {
                                for j in 0..RIGHT {
                                    out[i * width + r * RIGHT + j] += sums[i][j].total();
                                }
                            }
                        } else {
                            for (i, left) in left.chunks_exact(stride).enumerate() {
                                for (j, right) in right.chunks_exact(stride).enumerate() {
                                    let [sum] = times::<V, 1>([lines(&left[from..to])], lines(&right[from..to]));
                                    out[i * width + r * RIGHT + j] += sum;
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

kernel! {
    /// Rotates `(x, y)` in the plane: `x = c x + s y`, `y = c y - s x`; both have whole lines.
    pub(super) fn rotate<V>(c: f64, s: f64, x: &mut [f64], y: &mut [f64]) {
        let (c, s, minus, zero) = (V::splat(c), V::splat(s), V::splat(-s), V::splat(0.0));
        for (x, y) in lines_mut(x).iter_mut().zip(lines_mut(y)) {
            let (a, b) = (V::load(x), V::load(y));
            zero.add_product(c, a).add_product(s, b).store(x);
            zero.add_product(c, b).add_product(minus, a).store(y);
        }
    }
}
