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

/// `a b + c`, in one rounding where the machine has it.
#[inline(always)]
fn fused<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

#[inline(always)]
fn add_product<const FUSED: bool>(sum: &mut [f64; LANES], a: &[f64; LANES], b: &[f64; LANES]) {
    for l in 0..LANES {
        sum[l] = fused::<FUSED>(a[l], b[l], sum[l]);
    }
}

#[inline(always)]
fn add_scaled<const FUSED: bool>(sum: &mut [f64; LANES], a: f64, b: &[f64; LANES]) {
    for l in 0..LANES {
        sum[l] = fused::<FUSED>(a, b[l], sum[l]);
    }
}

#[inline(always)]
fn total(lanes: &[f64; LANES]) -> f64 {
    let [a, b, c, d, e, f, g, h] = *lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

#[inline(always)]
fn lines(numbers: &[f64]) -> &[[f64; LANES]] {
    numbers.as_chunks().0
}

#[inline(always)]
fn lines_mut(numbers: &mut [f64]) -> &mut [[f64; LANES]] {
    numbers.as_chunks_mut().0
}

/// Defines a function compiled for AVX-512 and AVX2 with fused multiply-add, taken where the machine has them.
macro_rules! kernel {
    ($(#[$about:meta])* fn $name:ident<$fused:ident>($($argument:ident: $kind:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        $(#[$about])*
        pub(super) fn $name($($argument: $kind),*) $(-> $out)? {
            #[inline(always)]
            fn plain<const $fused: bool>($($argument: $kind),*) $(-> $out)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,fma")]
                fn avx512($($argument: $kind),*) $(-> $out)? {
                    plain::<true>($($argument),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($argument: $kind),*) $(-> $out)? {
                    plain::<true>($($argument),*)
                }
                if std::arch::is_x86_feature_detected!("avx512f")
                    && std::arch::is_x86_feature_detected!("avx512vl")
                    && std::arch::is_x86_feature_detected!("avx512dq")
                    && std::arch::is_x86_feature_detected!("fma")
                {
                    // SAFETY: the machine was just asked and has these.
                    return unsafe { avx512($($argument),*) };
                }
                if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
                    // SAFETY: the machine was just asked and has these.
                    return unsafe { avx2($($argument),*) };
                }
            }
            plain::<false>($($argument),*)
        }
    };
}

kernel! {
    /// `a.b`; what does not fill a line counts too.
    fn dot<FUSED>(a: &[f64], b: &[f64]) -> f64 {
        let mut sums = [[0.0; LANES]; 4];
        let (a4, b4) = (lines(a).chunks_exact(4), lines(b).chunks_exact(4));
        for (x, y) in a4.clone().zip(b4.clone()) {
            for s in 0..4 {
                add_product::<FUSED>(&mut sums[s], &x[s], &y[s]);
            }
        }
        for (x, y) in a4.remainder().iter().zip(b4.remainder()) {
            add_product::<FUSED>(&mut sums[0], x, y);
        }
        let tail: f64 = a.as_chunks::<LANES>().1.iter().zip(b.as_chunks::<LANES>().1).map(|(x, y)| x * y).sum();
        sums.iter().map(total).sum::<f64>() + tail
    }
}

kernel! {
    /// `out[k] = rows[which[k]].x`; rows of `stride` numbers, a multiple of eight, the padding 0.
    fn rows_times<FUSED>(rows: &[f64], stride: usize, which: &[usize], x: &[f64], out: &mut [f64]) {
        let x = lines(&x[..stride]);
        for (which, out) in which.chunks(4).zip(out.chunks_mut(4)) {
            if let ([a, b, c, d], [oa, ob, oc, od]) = (which, &mut *out) {
                let row = |k: &usize| lines(&rows[k * stride..][..stride]);
                let (a, b, c, d) = (row(a), row(b), row(c), row(d));
                let mut sums = [[0.0; LANES]; 4];
                for i in 0..x.len() {
                    add_product::<FUSED>(&mut sums[0], &a[i], &x[i]);
                    add_product::<FUSED>(&mut sums[1], &b[i], &x[i]);
                    add_product::<FUSED>(&mut sums[2], &c[i], &x[i]);
                    add_product::<FUSED>(&mut sums[3], &d[i], &x[i]);
                }
                [*oa, *ob, *oc, *od] = [total(&sums[0]), total(&sums[1]), total(&sums[2]), total(&sums[3])];
            } else {
                for (k, out) in which.iter().zip(out) {
                    let mut sum = [0.0; LANES];
                    for (a, x) in lines(&rows[k * stride..][..stride]).iter().zip(x) {
                        add_product::<FUSED>(&mut sum, a, x);
                    }
                    *out = total(&sum);
                }
            }
        }
    }
}

kernel! {
    /// `out += sum of by[k] rows[which[k]]`; rows as in `rows_times`.
    fn add_rows<FUSED>(rows: &[f64], stride: usize, which: &[usize], by: &[f64], out: &mut [f64]) {
        let out = lines_mut(&mut out[..stride]);
        for (which, by) in which.chunks(8).zip(by.chunks(8)) {
            if let ([a, b, c, d, e, f, g, h], Ok(by)) = (which, <&[f64; 8]>::try_from(by)) {
                let row = |k: &usize| lines(&rows[k * stride..][..stride]);
                let (a, b, c, d, e, f, g, h) = (row(a), row(b), row(c), row(d), row(e), row(f), row(g), row(h));
                for i in 0..out.len() {
                    let mut sum = out[i];
                    add_scaled::<FUSED>(&mut sum, by[0], &a[i]);
                    add_scaled::<FUSED>(&mut sum, by[1], &b[i]);
                    add_scaled::<FUSED>(&mut sum, by[2], &c[i]);
                    add_scaled::<FUSED>(&mut sum, by[3], &d[i]);
                    add_scaled::<FUSED>(&mut sum, by[4], &e[i]);
                    add_scaled::<FUSED>(&mut sum, by[5], &f[i]);
                    add_scaled::<FUSED>(&mut sum, by[6], &g[i]);
                    add_scaled::<FUSED>(&mut sum, by[7], &h[i]);
                    out[i] = sum;
                }
            } else {
                for (k, &by) in which.iter().zip(by) {
                    for (sum, row) in out.iter_mut().zip(lines(&rows[k * stride..][..stride])) {
                        add_scaled::<FUSED>(sum, by, row);
                    }
                }
            }
        }
    }
}

kernel! {
    /// Solves `L x = x` in place; L by columns of `stride`, the first `m`; lines beyond `m` are 0.
    fn forward<FUSED>(l: &[f64], stride: usize, inverse: &[f64], m: usize, x: &mut [f64]) {
        let padded = m.next_multiple_of(LANES);
        for k in (0..m).step_by(LANES) {
            let here = (m - k).min(LANES);
            for j in k..k + here {
                x[j] *= inverse[j];
                let by = -x[j];
                for i in j + 1..k + here {
                    x[i] = fused::<FUSED>(by, l[j * stride + i], x[i]);
                }
            }
            if here == LANES && k + LANES < padded {
                let column = |j: usize| lines(&l[(k + j) * stride + k + LANES..(k + j) * stride + padded]);
                let by: [f64; LANES] = std::array::from_fn(|j| -x[k + j]);
                let (a, b, c, d) = (column(0), column(1), column(2), column(3));
                let (e, f, g, h) = (column(4), column(5), column(6), column(7));
                let rest = lines_mut(&mut x[k + LANES..padded]);
                for i in 0..rest.len() {
                    let mut sum = rest[i];
                    let mut other = [0.0; LANES];
                    add_scaled::<FUSED>(&mut sum, by[0], &a[i]);
                    add_scaled::<FUSED>(&mut other, by[1], &b[i]);
                    add_scaled::<FUSED>(&mut sum, by[2], &c[i]);
                    add_scaled::<FUSED>(&mut other, by[3], &d[i]);
                    add_scaled::<FUSED>(&mut sum, by[4], &e[i]);
                    add_scaled::<FUSED>(&mut other, by[5], &f[i]);
                    add_scaled::<FUSED>(&mut sum, by[6], &g[i]);
                    add_scaled::<FUSED>(&mut other, by[7], &h[i]);
                    for l in 0..LANES {
                        sum[l] += other[l];
                    }
                    rest[i] = sum;
                }
            }
        }
    }
}

kernel! {
    /// Solves `L' x = x` in place; L as in `forward`.
    fn backward<FUSED>(l: &[f64], stride: usize, inverse: &[f64], m: usize, x: &mut [f64]) {
        let padded = m.next_multiple_of(LANES);
        for k in (0..m).step_by(LANES).rev() {
            let here = (m - k).min(LANES);
            if here == LANES && k + LANES < padded {
                let column = |j: usize| lines(&l[(k + j) * stride + k + LANES..(k + j) * stride + padded]);
                let (a, b, c, d) = (column(0), column(1), column(2), column(3));
                let (e, f, g, h) = (column(4), column(5), column(6), column(7));
                let mut sums = [[0.0; LANES]; LANES];
                let rest = lines(&x[k + LANES..padded]);
                for i in 0..rest.len() {
                    add_product::<FUSED>(&mut sums[0], &a[i], &rest[i]);
                    add_product::<FUSED>(&mut sums[1], &b[i], &rest[i]);
                    add_product::<FUSED>(&mut sums[2], &c[i], &rest[i]);
                    add_product::<FUSED>(&mut sums[3], &d[i], &rest[i]);
                    add_product::<FUSED>(&mut sums[4], &e[i], &rest[i]);
                    add_product::<FUSED>(&mut sums[5], &f[i], &rest[i]);
                    add_product::<FUSED>(&mut sums[6], &g[i], &rest[i]);
                    add_product::<FUSED>(&mut sums[7], &h[i], &rest[i]);
                }
                for j in 0..LANES {
                    x[k + j] -= total(&sums[j]);
                }
            }
            for j in (k..k + here).rev() {
                let mut sum = x[j];
                for i in j + 1..k + here {
                    sum = fused::<FUSED>(-l[j * stride + i], x[i], sum);
                }
                x[j] = sum * inverse[j];
            }
        }
    }
}

kernel! {
    /// Turns `(x, y)` by a plane rotation: `x = c x + s y`, `y = c y - s x`.
    fn rotate<FUSED>(c: f64, s: f64, x: &mut [f64], y: &mut [f64]) {
        for (x, y) in x.iter_mut().zip(y) {
            let old = *x;
            *x = fused::<FUSED>(s, *y, c * old);
            *y = fused::<FUSED>(-s, old, c * *y);
        }
    }
}
