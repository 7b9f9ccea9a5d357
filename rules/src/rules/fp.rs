//! FP-learning: finite precision (Memmesheimer, Rubin, Ölveczky and Sompolinsky 2014, Neuron 82:925).

use super::corrections::{Correction, Presented};

/// Only the *first* error of a trial changes weights, by the potential that each input makes there; the trial then ends.
///
/// An output spike farther than `window` (ms) from its target, or a second one at it, lowers at its time; a target whose
/// window ends without a spike raises at the window's end.
pub(super) fn correct(presented: &Presented<'_>, fired: &[f64], window: f64, out: &mut Vec<Correction>) {
    if let Some((t, amount)) = first_error(presented.targets, fired, window) {
        out.push(Correction { after: presented.lost_up_to(fired, t), ..Correction::new(t, amount) });
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
