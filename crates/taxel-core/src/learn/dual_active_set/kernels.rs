//! The loops that the time goes into, compiled once a width of vectors.

/// Numbers on a cache line's border, so that no vector straddles two lines.
#[derive(Debug, Clone, Default)]
pub(super) struct Aligned(Vec<Line>);

#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Line([f64; LANES]);

/// Numbers a vector of the widest kind, and to which strides are rounded.
pub(super) const LANES: usize = 8;

impl Aligned {
    pub(super) fn zeros(len: usize) -> Self {
        Self(vec![Line([0.0; LANES]); len.div_ceil(LANES)])
    }
}

impl std::ops::Deref for Aligned {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        // SAFETY: a `Line` is eight f64 and nothing else (repr(C), 64 bytes), so n of them are 8 n f64 in a row.
        unsafe { std::slice::from_raw_parts(self.0.as_ptr().cast(), self.0.len() * LANES) }
    }
}

impl std::ops::DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f64] {
        // SAFETY: as above, and the borrow is the only one.
        unsafe { std::slice::from_raw_parts_mut(self.0.as_mut_ptr().cast(), self.0.len() * LANES) }
    }
}

/// Eight numbers in the machine's registers.
trait Vector: Copy {
    fn splat(value: f64) -> Self;
    fn load(from: &[f64; LANES]) -> Self;
    fn store(self, to: &mut [f64; LANES]);
    /// `a b + self`.
    fn add_product(self, a: Self, b: Self) -> Self;
    fn total(self) -> f64;
}

impl Vector for [f64; LANES] {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        [value; LANES]
    }
    #[inline(always)]
    fn load(from: &[f64; LANES]) -> Self {
        *from
    }
    #[inline(always)]
    fn store(self, to: &mut [f64; LANES]) {
        *to = self;
    }
    #[inline(always)]
    fn add_product(self, a: Self, b: Self) -> Self {
        std::array::from_fn(|l| a[l] * b[l] + self[l])
    }
    #[inline(always)]
    fn total(self) -> f64 {
        let [a, b, c, d, e, f, g, h] = self;
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::{LANES, Vector};

    /// A vector of AVX-512; made only in functions compiled for it.
    #[derive(Clone, Copy)]
    pub(super) struct Zmm(__m512d);

    impl Vector for Zmm {
        #[inline(always)]
        fn splat(value: f64) -> Self {
            // SAFETY: `kernel!` names this type only where the machine has AVX-512F.
            Self(unsafe { _mm512_set1_pd(value) })
        }
        #[inline(always)]
        fn load(from: &[f64; LANES]) -> Self {
            // SAFETY: as above; eight numbers are read.
            Self(unsafe { _mm512_loadu_pd(from.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, to: &mut [f64; LANES]) {
            // SAFETY: as above; eight numbers are written.
            unsafe { _mm512_storeu_pd(to.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn add_product(self, a: Self, b: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm512_fmadd_pd(a.0, b.0, self.0) })
        }
        #[inline(always)]
        fn total(self) -> f64 {
            // SAFETY: as above.
            unsafe { _mm512_reduce_add_pd(self.0) }
        }
    }

    /// Two vectors of AVX2; made only in functions compiled for it.
    #[derive(Clone, Copy)]
    pub(super) struct Ymm(__m256d, __m256d);

    impl Vector for Ymm {
        #[inline(always)]
        fn splat(value: f64) -> Self {
            // SAFETY: `kernel!` names this type only where the machine has AVX2 and FMA.
            let one = unsafe { _mm256_set1_pd(value) };
            Self(one, one)
        }
        #[inline(always)]
        fn load(from: &[f64; LANES]) -> Self {
            // SAFETY: as above; eight numbers are read.
            unsafe { Self(_mm256_loadu_pd(from.as_ptr()), _mm256_loadu_pd(from[4..].as_ptr())) }
        }
        #[inline(always)]
        fn store(self, to: &mut [f64; LANES]) {
            // SAFETY: as above; eight numbers are written.
            unsafe {
                _mm256_storeu_pd(to.as_mut_ptr(), self.0);
                _mm256_storeu_pd(to[4..].as_mut_ptr(), self.1);
            }
        }
        #[inline(always)]
        fn add_product(self, a: Self, b: Self) -> Self {
            // SAFETY: as above.
            unsafe { Self(_mm256_fmadd_pd(a.0, b.0, self.0), _mm256_fmadd_pd(a.1, b.1, self.1)) }
        }
        #[inline(always)]
        fn total(self) -> f64 {
            let mut lanes = [0.0; LANES];
            self.store(&mut lanes);
            lanes.total()
        }
    }
}

#[inline(always)]
fn lines(numbers: &[f64]) -> &[[f64; LANES]] {
    numbers.as_chunks().0
}

#[inline(always)]
fn lines_mut(numbers: &mut [f64]) -> &mut [[f64; LANES]] {
    numbers.as_chunks_mut().0
}

/// Defines a function over vectors `V`, compiled for AVX-512, for AVX2 and plainly; the machine's widest is taken.
macro_rules! kernel {
    ($(#[$about:meta])* fn $name:ident<$vector:ident>($($argument:ident: $kind:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        $(#[$about])*
        pub(super) fn $name($($argument: $kind),*) $(-> $out)? {
            #[inline(always)]
            fn plain<$vector: Vector>($($argument: $kind),*) $(-> $out)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,fma")]
                fn avx512($($argument: $kind),*) $(-> $out)? {
                    plain::<x86::Zmm>($($argument),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($argument: $kind),*) $(-> $out)? {
                    plain::<x86::Ymm>($($argument),*)
                }
                if std::arch::is_x86_feature_detected!("avx512f") && std::arch::is_x86_feature_detected!("fma") {
                    // SAFETY: the machine was just asked and has these.
                    return unsafe { avx512($($argument),*) };
                }
                if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
                    // SAFETY: the machine was just asked and has these.
                    return unsafe { avx2($($argument),*) };
                }
            }
            plain::<[f64; LANES]>($($argument),*)
        }
    };
}

kernel! {
    /// `a.b`; what does not fill a line counts too.
    fn dot<V>(a: &[f64], b: &[f64]) -> f64 {
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

/// Products of S rows with x, by vectors.
#[inline(always)]
fn times<V: Vector, const S: usize>(rows: [&[[f64; LANES]]; S], x: &[[f64; LANES]]) -> [f64; S] {
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

/// `sum += by[0] rows[0] + ..`, by vectors.
#[inline(always)]
fn add<V: Vector, const S: usize>(rows: [&[[f64; LANES]]; S], by: [f64; S], sum: &mut [[f64; LANES]]) {
    let rows = rows.map(|row| &row[..sum.len()]);
    let by = by.map(V::splat);
    for (i, sum) in sum.iter_mut().enumerate() {
        let mut here = V::load(sum);
        for s in 0..S {
            here = here.add_product(by[s], V::load(&rows[s][i]));
        }
        here.store(sum);
    }
}

kernel! {
    /// `out[k] = rows[which[k]].x`; rows of `stride` numbers, a multiple of eight, the padding 0.
    fn rows_times<V>(rows: &[f64], stride: usize, which: &[usize], x: &[f64], out: &mut [f64]) {
        let x = lines(&x[..stride]);
        let row = |k: usize| lines(&rows[k * stride..][..stride]);
        for (which, out) in which.chunks(LANES).zip(out.chunks_mut(LANES)) {
            if let Ok(which) = <[usize; LANES]>::try_from(which) {
                out.copy_from_slice(&times::<V, LANES>(which.map(row), x));
            } else {
                for (&k, out) in which.iter().zip(out) {
                    [*out] = times::<V, 1>([row(k)], x);
                }
            }
        }
    }
}

kernel! {
    /// `out += sum of by[k] rows[which[k]]`; rows as in `rows_times`.
    fn add_rows<V>(rows: &[f64], stride: usize, which: &[usize], by: &[f64], out: &mut [f64]) {
        let out = lines_mut(&mut out[..stride]);
        let row = |k: usize| lines(&rows[k * stride..][..stride]);
        for (which, by) in which.chunks(LANES).zip(by.chunks(LANES)) {
            if let (Ok(which), Ok(by)) = (<[usize; LANES]>::try_from(which), by.try_into()) {
                add::<V, LANES>(which.map(row), by, out);
            } else {
                for (&k, &by) in which.iter().zip(by) {
                    add::<V, 1>([row(k)], [by], out);
                }
            }
        }
    }
}

/// Solves for the unknowns k to k + here of `L x = x`, those before being out of it.
#[inline(always)]
fn triangle(l: &[f64], stride: usize, inverse: &[f64], k: usize, here: usize, x: &mut [f64]) {
    for j in k..k + here {
        x[j] *= inverse[j];
        for i in j + 1..k + here {
            x[i] -= x[j] * l[j * stride + i];
        }
    }
}

/// The eight columns from k on, below the rows that they solve.
#[inline(always)]
fn below(l: &[f64], stride: usize, k: usize, padded: usize) -> [&[[f64; LANES]]; LANES] {
    std::array::from_fn(|j| lines(&l[(k + j) * stride + k + LANES..(k + j) * stride + padded]))
}

kernel! {
    /// Solves `L x = x` in place; L by columns of `stride`, the first `m`; lines beyond `m` are 0.
    fn forward<V>(l: &[f64], stride: usize, inverse: &[f64], m: usize, x: &mut [f64]) {
        let padded = m.next_multiple_of(LANES);
        for k in (0..m).step_by(LANES) {
            triangle(l, stride, inverse, k, (m - k).min(LANES), x);
            if k + LANES < padded {
                let by = std::array::from_fn(|j| -x[k + j]);
                add::<V, LANES>(below(l, stride, k, padded), by, lines_mut(&mut x[k + LANES..padded]));
            }
        }
    }
}

kernel! {
    /// Solves `L' x = x` in place; L as in `forward`.
    fn backward<V>(l: &[f64], stride: usize, inverse: &[f64], m: usize, x: &mut [f64]) {
        let padded = m.next_multiple_of(LANES);
        for k in (0..m).step_by(LANES).rev() {
            if k + LANES < padded {
                let sums = times::<V, LANES>(below(l, stride, k, padded), lines(&x[k + LANES..padded]));
                for j in 0..LANES {
                    x[k + j] -= sums[j];
                }
            }
            let here = (m - k).min(LANES);
            for j in (k..k + here).rev() {
                for i in j + 1..k + here {
                    x[j] -= l[j * stride + i] * x[i];
                }
                x[j] *= inverse[j];
            }
        }
    }
}

/// The inverse of the eight by eight triangle at k, by columns.
#[inline(always)]
fn inverted(l: &[f64], stride: usize, inverse: &[f64], k: usize) -> [[f64; LANES]; LANES] {
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

/// Right sides that L passes by at once, and lines of them that stay in the nearest cache.
const SIDES: usize = 16;
const NEAR: usize = 16;

kernel! {
    /// `forward` for many right sides, columns of `x_stride` numbers each.
    fn forward_many<V>(l: &[f64], stride: usize, inverse: &[f64], m: usize, x: &mut [f64], x_stride: usize) {
        let padded = m.next_multiple_of(LANES);
        for x in x.chunks_mut(SIDES * x_stride) {
            for k in (0..m).step_by(LANES) {
                if k + LANES > m {
                    for x in x.chunks_exact_mut(x_stride) {
                        triangle(l, stride, inverse, k, m - k, x);
                    }
                    continue;
                }
                let own = inverted(l, stride, inverse, k);
                for x in x.chunks_exact_mut(x_stride) {
                    let here = &mut lines_mut(&mut x[k..k + LANES])[0];
                    let (mut even, mut odd) = (V::splat(0.0), V::splat(0.0));
                    for j in (0..LANES).step_by(2) {
                        even = even.add_product(V::splat(here[j]), V::load(&own[j]));
                        odd = odd.add_product(V::splat(here[j + 1]), V::load(&own[j + 1]));
                    }
                    even.add_product(V::splat(1.0), odd).store(here);
                }
                for from in (k + LANES..padded).step_by(NEAR * LANES) {
                    let to = (from + NEAR * LANES).min(padded);
                    let columns: [_; LANES] = std::array::from_fn(|j| lines(&l[(k + j) * stride + from..(k + j) * stride + to]));
                    for x in x.chunks_mut(2 * x_stride) {
                        if x.len() < 2 * x_stride {
                            let by = std::array::from_fn(|j| -x[k + j]);
                            add::<V, LANES>(columns, by, lines_mut(&mut x[from..to]));
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

/// Rows of the left and of the right whose products are summed at once, and how many coefficients of each.
const LEFT: usize = 4;
const RIGHT: usize = 6;
const DEEP: usize = 512;

kernel! {
    /// `out[i][j] += left[i].right[j]`: all products of two sets of rows, of `stride` numbers each; `out` by rows of `width`.
    fn products<V>(left: &[f64], right: &[f64], stride: usize, out: &mut [f64], width: usize) {
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
    /// Turns `(x, y)` by a plane rotation: `x = c x + s y`, `y = c y - s x`; both of whole lines.
    fn rotate<V>(c: f64, s: f64, x: &mut [f64], y: &mut [f64]) {
        let (c, s, minus, zero) = (V::splat(c), V::splat(s), V::splat(-s), V::splat(0.0));
        for (x, y) in lines_mut(x).iter_mut().zip(lines_mut(y)) {
            let (a, b) = (V::load(x), V::load(y));
            zero.add_product(c, a).add_product(s, b).store(x);
            zero.add_product(c, b).add_product(minus, a).store(y);
        }
    }
}
