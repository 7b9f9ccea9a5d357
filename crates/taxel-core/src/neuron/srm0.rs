//! The exact event-driven neuron, and the potential with given spikes.
//!
//! Between input spikes `U(s) = e^{-s/tau} (a s/tau + b)` and the threshold is `theta + c e^{-s/tau_rec}`. Then
//! `f(s) = e^{s/tau} d(U - threshold)/ds` is a straight line and a convex exponential: at most two zeros. Where `f` ends
//! above 0 the potential rises towards `-theta` below the threshold, so it can only cross before the *first* zero.

use super::{AfterSpike, Neuron, State};
use crate::SpikeTrains;

/// How far below the threshold a maximum may lie and still count as reaching it, mV: rounding of a potential that was
/// trained to touch the threshold there.
const TOUCH: f64 = 1e-12;

/// Where the potential first reaches the threshold, ms from now, if no input comes; `rise` decays with `tau_rec`.
pub(super) fn next_crossing(state: State, tau: f64, theta: f64, rise: f64, tau_rec: f64) -> Option<f64> {
    if state.bound() < theta - TOUCH {
        return None;
    }
    let above = |s: f64| state.after(s, tau).b - theta - rise * (-s / tau_rec).exp();
    if above(0.0) >= 0.0 {
        return Some(0.0);
    }
    let peak = first_maximum(state, tau, rise, tau_rec)?;
    let top = above(peak);
    if top < -TOUCH {
        return None;
    }
    if top <= 0.0 {
        return Some(peak);
    }
    // From 0 to the peak U - threshold rises: one root. Newton, kept inside the bracket.
    let (mut low, mut high, mut s) = (0.0, peak, 0.5 * peak);
    for _ in 0..100 {
        let now = state.after(s, tau);
        let risen = rise * (-s / tau_rec).exp();
        let value = now.b - theta - risen;
        if value < 0.0 {
            low = s;
        } else {
            high = s;
        }
        let newton = s - value / (now.slope(tau) + risen / tau_rec);
        let next = if low < newton && newton < high { newton } else { f64::midpoint(low, high) };
        if (next - s).abs() <= 2.0 * f64::EPSILON * next {
            return Some(next);
        }
        s = next;
    }
    Some(s)
}

/// The first maximum of potential less threshold after now, ms; `None` where it falls first or rises for ever.
fn first_maximum(state: State, tau: f64, rise: f64, tau_rec: f64) -> Option<f64> {
    let State { a, b } = state;
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
    // f is convex: from the left, Newton falls onto the first zero and never beyond it.
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

/// The potential at ascending `times` of a neuron that fired at ascending `spikes`.
pub(super) fn potential(
    neuron: &Neuron,
    weights: &[f64],
    trains: &SpikeTrains,
    times: &[f64],
    spikes: &[f64],
) -> Vec<f64> {
    let inputs = trains.by_time();
    let (mut state, mut at) = (State::default(), trains.start);
    let (mut next_input, mut next_spike, mut last) = (0, 0, None);
    let mut out = Vec::with_capacity(times.len());
    for &t in times {
        // A spike takes effect after its own time, an input from it on; at equal times the spike sees the input (as 0).
        loop {
            let spike = spikes.get(next_spike).copied().filter(|&s| s < t);
            let input = inputs.get(next_input).filter(|i| i.t <= t && spike.is_none_or(|s| i.t <= s));
            if let Some(input) = input {
                next_input += 1;
                if !neuron.loses(input.t, last) {
                    state = state.after(input.t - at, neuron.tau);
                    at = input.t;
                    state.a += weights[input.train as usize];
                }
            } else if let Some(spike) = spike {
                next_spike += 1;
                last = Some(spike);
                if neuron.after_spike == AfterSpike::Reset {
                    state = State::default();
                }
            } else {
                break;
            }
        }
        let refractory = last.is_some_and(|s| t <= s + neuron.refractory);
        out.push(if refractory { 0.0 } else { state.after((t - at).max(0.0), neuron.tau).b });
    }
    out
}
