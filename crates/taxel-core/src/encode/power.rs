//! Computes x^alpha for a block of channels at once (equation 5.1).
//!
//! The standard library's `powf` takes one value at a time and differs between machines in the last place. This
//! function computes 2^(alpha log2 x) by series, in f64 with additions, multiplications and one division: it
//! vectorises, returns the same bits on every machine, and is within 4e-15 of the true value.

use std::f64::consts::{LN_2, SQRT_2};

use super::blocks::{BLOCK, Block};

/// Adding this constant and subtracting it again rounds a number to a whole number.
const ROUND: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52

/// Adding a whole number from 0 on to this constant stores the number in the lowest bits of the sum.
const WHOLE: f64 = 4_503_599_627_370_496.0; // 2^52

/// x^alpha for alpha > 0; values below 0 count as 0.
#[inline(always)]
pub(super) fn power(values: &Block, alpha: f64, out: &mut [f64; BLOCK]) {
    if alpha == 1.0 {
        // Exact: a difference of whole numbers is one, whose count in thresholds would else be rounded down.
        *out = values.map(|value| if value > 0.0 { f64::from(value) } else { 0.0 });
        return;
    }
    for (out, &value) in out.iter_mut().zip(values) {
        *out = power_of(f64::from(value), alpha);
    }
}

#[inline(always)]
fn power_of(x: f64, alpha: f64) -> f64 {
    let one_bits = 1.0_f64.to_bits();
    // x = 2^(biased - 1023) * m with m between sqrt(1/2) and sqrt(2); f32 values are never subnormal in f64.
    let bits = x.to_bits();
    let biased = bits.wrapping_add(one_bits - (SQRT_2 / 2.0).to_bits()) >> 52;
    let m = f64::from_bits(bits.wrapping_sub(biased << 52).wrapping_add(one_bits));
    // ln m = 2 (s + s^3/3 + s^5/5 + ...) with s = (m - 1) / (m + 1), |s| < 0.172.
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let mut series = 1.0 / 19.0;
    for k in [17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        series = series * q + 1.0 / k;
    }
    let small = alpha * (2.0 / LN_2) * s * series;
    // Converts the exponent to f64 through its bits: few machines have a vector instruction for i64 to f64.
    let integer = f64::from_bits(WHOLE.to_bits() | biased) - (WHOLE + 1023.0);
    // 2^y = 2^n * e^(f ln 2) with |f| <= 1/2.
    let large = alpha * integer;
    let shifted = (large + small) + ROUND;
    let n = shifted - ROUND;
    let f = ((large - n) + small) * LN_2;
    let mut exponential = 1.0;
    for k in [12.0, 11.0, 10.0, 9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0] {
        exponential = exponential * (f * (1.0 / k)) + 1.0;
    }
    let scale = f64::from_bits((shifted.to_bits() << 52).wrapping_add(one_bits));
    if x > 0.0 { exponential * scale } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_agree_with_the_standard_library() {
        for alpha in [0.2, 0.7, 1.0, 1.4] {
            let mut x = 1e-6_f32;
            while x < 1e7 {
                let (got, wanted) = (power_of(f64::from(x), alpha), f64::from(x).powf(alpha));
                assert!((got / wanted - 1.0).abs() < 4e-15, "{x}^{alpha}: {got} against {wanted}");
                x *= 1.000_37;
            }
        }
    }

    #[test]
    fn the_first_power_is_the_value() {
        let values: Block = std::array::from_fn(|k| k as f32 * 1.7 - 3.0);
        let mut out = [1.0; BLOCK];
        power(&values, 1.0, &mut out);
        assert_eq!(out, values.map(|value| f64::from(value.max(0.0))));
    }

    #[test]
    fn nothing_and_less_than_nothing_give_nothing() {
        let mut out = [1.0; BLOCK];
        power(&[-3.0; BLOCK], 0.7, &mut out);
        assert_eq!(out, [0.0; BLOCK]);
        power(&[0.0; BLOCK], 0.7, &mut out);
        assert_eq!(out, [0.0; BLOCK]);
    }

    #[test]
    fn the_extremes_of_f32_stay_finite() {
        for x in [f32::MIN_POSITIVE, 1e-45, f32::MAX] {
            let (got, wanted) = (power_of(f64::from(x), 1.4), f64::from(x).powf(1.4));
            assert!((got / wanted - 1.0).abs() < 1e-13, "{x}: {got} against {wanted}");
        }
    }
}
