//! FP-learning: finite precision (Memmesheimer, Rubin, Ölveczky and Sompolinsky 2014, Neuron 82:925).

use super::corrections::Correction;
use super::stepped::Kernels;

/// Only the *first* error of a trial changes weights, by the potential that each input makes there; the trial then ends.
///
/// An output spike farther than `window` from its target, or a second one at it, lowers at its time; a target whose
/// window ends without a spike raises at the window's end.
pub(super) struct Fp {
    pub(super) kernels: Kernels,
    /// How far from its target a spike may lie, ms.
    pub(super) window: f64,
    /// Whether an output spike discards all inputs before it.
    pub(super) forgets: bool,
}

impl Fp {
    pub(super) fn correct(&self, targets: &[f64], fired: &[f64], out: &mut Vec<Correction>) {
        let Some((t, amount)) = first_error(targets, fired, self.window) else { return };
        let before = fired.iter().copied().take_while(|&f| f < t).last();
        let after = before.filter(|_| self.forgets).unwrap_or(f64::NEG_INFINITY);
        out.push(Correction { after, ..Correction::new(t, amount) });
    }
}

/// The time of the first error of a trial, and the sign of its correction.
fn first_error(targets: &[f64], fired: &[f64], window: f64) -> Option<(f64, f64)> {
    let mut k = 0;
    for &f in fired {
        match targets.get(k) {
            Some(&t) if f > t + window => return Some((t + window, 1.0)),
            Some(&t) if f >= t - window => k += 1,
            _ => return Some((f, -1.0)),
        }
    }
    targets.get(k).map(|&t| (t + window, 1.0))
}
