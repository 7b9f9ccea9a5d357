//! E-learning of the Chronotron (Florian 2012, PLoS ONE 7(8) e40233).

use super::corrections::Correction;

/// Corrections down the gradient of a Victor-Purpura distance whose moves cost `(dt / tau_q)^2 / 2`.
///
/// `eta [sum over targets to be added of L - sum over spikes to be removed of L + gamma_r / tau_q^2 sum over moves of
/// (t - t~) L(t)]`, L being the potential that an input makes: a late spike raises weights.
pub(super) fn correct(targets: &[f64], fired: &[f64], tau_q: f64, gamma_r: f64, out: &mut Vec<Correction>) {
    for edit in edits(fired, targets, tau_q) {
        out.push(match edit {
            Edit::Remove(k) => Correction::new(fired[k], -1.0),
            Edit::Add(k) => Correction::at_target(k, targets[k], 1.0),
            Edit::Move(from, to) => {
                let late = fired[from] - targets[to];
                Correction::new(fired[from], gamma_r / (tau_q * tau_q) * late)
            }
        });
    }
}

/// One step from the fired train to the targets, by their numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Edit {
    Remove(usize),
    Add(usize),
    Move(usize, usize),
}

/// The cheapest way from `fired` to `targets`: 1 to add or to remove, `(dt / tau_q)^2 / 2` to move; of equally cheap last
/// steps the first of remove, add, move.
fn edits(fired: &[f64], targets: &[f64], tau_q: f64) -> Vec<Edit> {
    let (n, m) = (fired.len(), targets.len());
    let width = m + 1;
    let step = |cost: &[f64], i: usize, j: usize| -> (f64, Option<Edit>) {
        let mut best = if i == 0 && j == 0 { (0.0, None) } else { (f64::INFINITY, None) };
        if i > 0 {
            best = (cost[(i - 1) * width + j] + 1.0, Some(Edit::Remove(i - 1)));
        }
        if j > 0 {
            let add = cost[i * width + j - 1] + 1.0;
            if add < best.0 {
                best = (add, Some(Edit::Add(j - 1)));
            }
        }
        if i > 0 && j > 0 {
            let apart = (fired[i - 1] - targets[j - 1]) / tau_q;
            let moved = cost[(i - 1) * width + j - 1] + apart * apart / 2.0;
            if moved < best.0 {
                best = (moved, Some(Edit::Move(i - 1, j - 1)));
            }
        }
        best
    };
    let mut cost = vec![0.0; (n + 1) * width];
    for i in 0..=n {
        for j in 0..=m {
            cost[i * width + j] = step(&cost, i, j).0;
        }
    }
    let (mut i, mut j, mut way) = (n, m, Vec::new());
    while let Some(edit) = step(&cost, i, j).1 {
        way.push(edit);
        match edit {
            Edit::Remove(_) => i -= 1,
            Edit::Add(_) => j -= 1,
            Edit::Move(..) => (i, j) = (i - 1, j - 1),
        }
    }
    way.reverse();
    way
}
