//! The Chronotron's two rules (Florian 2012, PLoS ONE 7(8) e40233).

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::epochs::{Correction, Presented, Rule};
use super::source::Source;
use super::stepped::{Kernels, SteppedNeuron};
use taxel_core::allowed::{Range, ranges};
use taxel_core::{Result, problem};

/// E-learning: down the gradient of a Victor-Purpura distance whose moves cost `(dt / tau_q)^2 / 2`.
///
/// `eta [sum over targets to be added of L - sum over spikes to be removed of L + gamma_r / tau_q^2 sum over moves of
/// (t - t~) L(t)]`, L being the potential that an input makes: a late spike raises weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ELearning {
    /// Scale of the cost of a move, ms: pairs up to `2 tau_q` apart are moved.
    pub tau_q: f64,
    /// Weight of the moves, ms.
    pub gamma_r: f64,
}

/// I-learning: the synaptic currents at targets less those at output spikes, each with the sign of its weight.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ILearning {}

/// The defaults of its source, and of public code where the source could not be read.
pub(super) const SOURCE: Source = Source {
    name: "chronotron",
    of_rule: &["rule", "tau_q", "gamma_r"],
    ranges: &[ELearning::RANGES],
    defaults: || json!({ "tau": 15.0, "tau_s": null, "after_spike": null, "tau_q": null, "gamma_r": null }),
    arrange: |parameters| {
        let i_learning = match parameters["rule"].as_str() {
            Some("E") => false,
            Some("I") => true,
            _ => return Err(problem!("rule"; " is {}: must be \"E\" or \"I\"", parameters["rule"])),
        };
        let Some(tau) = parameters["tau"].as_f64() else {
            return Err(problem!("tau"; " is {}: must be a number", parameters["tau"]));
        };
        let mut fill = |name: &str, value: Value| {
            if parameters[name].is_null() {
                parameters.insert(name.to_owned(), value);
            }
        };
        fill("tau_s", json!(tau / 4.0));
        fill("after_spike", json!(if i_learning { "membrane" } else { "subtract" }));
        fill("tau_q", json!(tau));
        let (tau_q, gamma_r) = (parameters["tau_q"].clone(), parameters["gamma_r"].clone());
        let gamma_r = if gamma_r.is_null() { tau_q.clone() } else { gamma_r };
        let e_learning = json!({ "e_learning": { "tau_q": tau_q, "gamma_r": gamma_r } });
        parameters.insert("constants".into(), if i_learning { json!({ "i_learning": {} }) } else { e_learning });
        Ok(())
    },
};

pub(super) struct ERule {
    kernels: Kernels,
    tau_q: f64,
    gamma_r: f64,
}

pub(super) struct IRule(Kernels);

impl ELearning {
    ranges! {
        tau_q: "ms", Range::ABOVE_0;
        gamma_r: "ms", Range::ABOVE_0;
    }

    pub(super) fn rule(&self, neuron: &SteppedNeuron) -> Result<ERule> {
        self.check_ranges()?;
        Ok(ERule { kernels: neuron.kernels(), tau_q: self.tau_q, gamma_r: self.gamma_r })
    }
}

impl ILearning {
    pub(super) fn rule(&self, neuron: &SteppedNeuron) -> Result<IRule> {
        Ok(IRule(neuron.kernels()))
    }
}

impl Rule for ERule {
    fn factor(&self, since: f64) -> f64 {
        self.kernels.value(since)
    }

    fn correct(&self, presented: &Presented<'_>, _: &[f64], fired: &[f64], out: &mut Vec<Correction>) {
        for edit in edits(fired, presented.targets, self.tau_q) {
            out.push(match edit {
                Edit::Remove(k) => Correction::new(fired[k], -1.0),
                Edit::Add(k) => Correction::at_target(k, presented.targets[k], 1.0),
                Edit::Move(from, to) => {
                    let late = fired[from] - presented.targets[to];
                    Correction::new(fired[from], self.gamma_r / (self.tau_q * self.tau_q) * late)
                }
            });
        }
    }
}

impl Rule for IRule {
    fn factor(&self, since: f64) -> f64 {
        self.0.current(since)
    }

    fn by_sign(&self) -> bool {
        true
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
