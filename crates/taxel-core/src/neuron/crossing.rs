//! The exact time at which the potential reaches the threshold between two inputs.
//!
//! Between input spikes, potential minus threshold, `g(s) = U(s) - theta - c e^{-s/tau_rec}`, is a sum of few
//! exponentials (one with a linear factor for the alpha kernel) that tends to `-theta`. Its derivative changes sign at
//! most twice, so `g` has at most one inner maximum. Only during the rise to this maximum can the potential cross the
//! threshold from below.

use super::kernel::{Kernel, KernelSum, Shape};

/// The inner maximum of potential minus threshold, ms from now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Peak {
    /// The time at which the rise to the maximum begins.
    pub(crate) from: f64,
    /// The time of the maximum.
    pub(crate) at: f64,
}

/// The first time at which the potential reaches the threshold, ms from now, if no input follows; `rise` decays with
/// `tau_rec`.
///
/// A maximum at most `touch` mV below the threshold counts as reaching it.
pub(super) fn next_crossing(
    shape: &Shape,
    state: KernelSum,
    (theta, touch): (f64, f64),
    rise: f64,
    tau_rec: f64,
) -> Option<f64> {
    if shape.bound(state) < theta - touch {
        return None;
    }
    let risen = |s: f64| if rise == 0.0 { 0.0 } else { rise * (-s / tau_rec).exp() };
    // Potential minus threshold, and its slope.
    let above = |s: f64| {
        let (now, risen) = (shape.after(state, s), risen(s));
        (now.b - theta - risen, shape.slope(now) + risen / tau_rec)
    };
    if state.b - theta - rise >= 0.0 {
        return Some(0.0);
    }
    // `g` ends negative, so it can be positive only around its maximum.
    let peak = peak(shape, state, rise, tau_rec)?;
    let (top, _) = above(peak.at);
    if top < -touch {
        return None;
    }
    if top <= 0.0 {
        return Some(peak.at);
    }
    let (mut low, mut high) = (peak.from, peak.at);
    // There is exactly one root between `low` and `high`. Newton steps that start on its left stay there where `g` is
    // concave; a step that leaves the bracket is replaced by a bisection.
    let mut s = low;
    for _ in 0..100 {
        let (value, slope) = above(s);
        if value < 0.0 {
            low = s;
        } else {
            high = s;
        }
        let newton = s - value / slope;
        let next = if low <= newton && newton <= high { newton } else { f64::midpoint(low, high) };
        // Below this distance the rounding of the potential itself decides.
        if (next - s).abs() <= 2.0 * f64::EPSILON * next.max(shape.tau) {
            return Some(next);
        }
        s = next;
    }
    Some(s)
}

/// The inner maximum of potential minus threshold; `None` if there is none after now.
pub(crate) fn peak(shape: &Shape, state: KernelSum, rise: f64, tau_rec: f64) -> Option<Peak> {
    match shape.kernel {
        Kernel::Alpha => alpha_peak(state, shape.tau, rise, tau_rec).map(|at| Peak { from: 0.0, at }),
        Kernel::DoubleExponential => double_exponential_peak(shape, state, rise, tau_rec),
        // A sum of decaying jumps rises only while it is negative, so it has no maximum that could reach a threshold.
        Kernel::Exponential => None,
    }
}

/// The first zero of `f(s) = e^{s/tau} g'(s)`, the sum of a straight line and a convex exponential.
fn alpha_peak(state: KernelSum, tau: f64, rise: f64, tau_rec: f64) -> Option<f64> {
    let KernelSum { a, b } = state;
    let line = -a / (tau * tau);
    if rise == 0.0 {
        let s = tau * (a - b) / a;
        return (a > 0.0 && s > 0.0).then_some(s);
    }
    let rate = 1.0 / tau - 1.0 / tau_rec;
    let (height, mut s) = (rise / tau_rec, 0.0);
    let mut value = (a - b) / tau + height;
    if value <= 0.0 {
        return None;
    }
    // `f` is convex, so Newton's method from the left converges to the first zero without overshooting it.
    for _ in 0..200 {
        let exponential = height * (s * rate).exp();
        value = (a - b) / tau + line * s + exponential;
        let slope = line + rate * exponential;
        if value <= 0.0 {
            return Some(s);
        }
        if slope >= 0.0 {
            return None;
        }
        let next = s - value / slope;
        if next - s <= 4.0 * f64::EPSILON * next {
            return Some(next);
        }
        s = next;
    }
    Some(s)
}

/// The maximum by `f(s) = e^{s/tau_s} g'(s) = B/tau_s - A/tau e^{p s} + c/tau_rec e^{q s}`, which has at most one
/// extremum.
fn double_exponential_peak(shape: &Shape, state: KernelSum, rise: f64, tau_rec: f64) -> Option<Peak> {
    let Shape { tau, tau_s, scale, rate: p, .. } = *shape;
    let slow = scale * state.a;
    let (constant, fall, height, q) =
        ((slow - state.b) / tau_s, slow / tau, rise / tau_rec, 1.0 / tau_s - 1.0 / tau_rec);
    if rise == 0.0 {
        // `g` increases now and the slow term decreases it later: `f` has one zero, in closed form.
        return (fall > 0.0 && constant > fall).then(|| Peak { from: 0.0, at: (constant / fall).ln() / p });
    }
    // `f` divided by its fastest exponential has the same sign and does not overflow.
    let m = p.max(q);
    let f = |s: f64| constant * (-m * s).exp() - fall * ((p - m) * s).exp() + height * ((q - m) * s).exp();
    // The extremum of f: fall p e^{p s} = height q e^{q s}.
    let turn = ((height * q) / (fall * p)).ln() / (p - q);
    let turn = (turn.is_finite() && turn > 0.0).then_some(turn);
    let now = f(0.0);
    let (low, from) = match turn {
        // `g` increases now: its maximum is the first zero of f, before or after the extremum of f.
        _ if now > 0.0 => (0.0, 0.0),
        // `g` decreases now: it increases later only if f is positive at its extremum.
        Some(turn) if f(turn) > 0.0 => (turn, if now < 0.0 { zero(f, 0.0, turn) } else { 0.0 }),
        _ => return None,
    };
    let high = match turn {
        Some(turn) if turn > low && f(turn) < 0.0 => turn,
        // f is monotone after its extremum: double the distance until f is negative, or every term is below rounding.
        _ => {
            let mut reach = turn.unwrap_or(0.0).max(low) + tau_s;
            while f(reach) >= 0.0 {
                // Every term is below rounding here.
                if reach > 50.0 * tau.max(tau_rec) {
                    return None;
                }
                reach *= 2.0;
            }
            reach
        }
    };
    Some(Peak { from, at: zero(f, low, high) })
}

/// The zero of `f` between two points of opposite sign, by bisection down to rounding.
fn zero(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let below = f(low) < 0.0;
    for _ in 0..200 {
        let middle = f64::midpoint(low, high);
        if middle <= low || middle >= high {
            break;
        }
        if (f(middle) < 0.0) == below {
            low = middle;
        } else {
            high = middle;
        }
    }
    f64::midpoint(low, high)
}
