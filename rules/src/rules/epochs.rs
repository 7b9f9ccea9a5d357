//! Learning by epochs: present each pattern, compare the output spikes with the targets, correct.

use rand::rngs::StdRng;
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

use super::epoch_learner::EpochLearner;
use super::rule::Rule;
use super::stepped::{Laid, SteppedNeuron};
use taxel_core::allowed::one_weight_a_train;
use taxel_core::{Result, SpikeTrains, Stop, problem};

/// When weights change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Updates {
    /// Once an epoch, by the sum over its patterns (Gardner and Grüning 2016).
    Batch,
    /// After each pattern, in an order drawn anew each epoch.
    Pattern,
}

/// How training ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// Every pattern was right.
    Right,
    /// All epochs were used up.
    Epochs,
    /// The caller requested a stop.
    Stopped,
}

/// The result of training.
#[derive(Debug, Clone)]
pub struct Trained {
    /// The weights with most patterns right, the latest such; mV.
    pub weights: Vec<f64>,
    /// The share of patterns right after 0, 1, 2 ... epochs.
    pub right: Vec<f64>,
    /// After how many epochs the weights were those.
    pub best_epoch: usize,
    /// How it ended.
    pub ended: Ended,
}

/// One correction of all weights: `amount (constant + sum over inputs of factor(t - t_ij))`, by the rule's own factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Correction {
    /// When, ms.
    pub t: f64,
    /// By how much; above 0 it raises weights.
    pub amount: f64,
    /// Only inputs after this count, ms.
    pub after: f64,
    /// The number of its target, where it is at one: the factors there are the same each epoch.
    pub target: Option<usize>,
}

/// The patterns and targets to learn, and the first weights.
pub(super) struct Examples<'a> {
    pub patterns: &'a [SpikeTrains],
    pub targets: &'a [Vec<f64>],
    pub start: Option<&'a [f64]>,
}

/// One pattern, presented to one neuron.
pub(super) struct Presented<'a> {
    pub neuron: &'a SteppedNeuron,
    pub laid: &'a Laid,
    pub trains: &'a SpikeTrains,
    pub targets: &'a [f64],
}

impl Correction {
    /// A correction that all earlier inputs share in.
    pub(super) fn new(t: f64, amount: f64) -> Self {
        Self { t, amount, after: f64::NEG_INFINITY, target: None }
    }

    /// The same at target `k`.
    pub(super) fn at_target(k: usize, t: f64, amount: f64) -> Self {
        Self { target: Some(k), ..Self::new(t, amount) }
    }
}

/// Whether output spikes are as many as targets, each within `within` ms of its own.
pub(super) fn is_right(targets: &[f64], fired: &[f64], within: f64) -> bool {
    targets.len() == fired.len() && targets.iter().zip(fired).all(|(t, f)| (t - f).abs() <= within)
}

/// The change of weights by one presentation, over the learning rate, and the output spikes in it.
pub(super) fn change_of(
    rule: &Rule,
    neuron: &SteppedNeuron,
    weights: &[f64],
    pattern: &SpikeTrains,
    targets: &[f64],
) -> Result<(Vec<f64>, Vec<f64>)> {
    let laid = neuron.lay_out(pattern, Stop::never())?;
    let presented = Presented { neuron, laid: &laid, trains: pattern, targets };
    let (mut fired, mut corrections, mut change) = (Vec::new(), Vec::new(), vec![0.0; weights.len()]);
    neuron.fire(weights, &laid, &mut fired);
    rule.correct(&presented, weights, &fired, &mut corrections);
    add_up(rule, &presented, weights, &corrections, &mut vec![None; targets.len()], &mut change);
    Ok((change, fired))
}

/// Sums corrections, synapse by synapse. Factors at targets are computed once.
fn add_up(
    rule: &Rule,
    presented: &Presented<'_>,
    weights: &[f64],
    corrections: &[Correction],
    at_targets: &mut [Option<Vec<f64>>],
    change: &mut [f64],
) {
    let factor = |n: usize, t: f64, after: f64| {
        let inputs = presented.trains.train(n).iter().filter(|&&input| input > after);
        rule.constant() + inputs.map(|input| rule.factor(t - input)).sum::<f64>()
    };
    let signed = |n: usize, value: f64| if rule.by_sign() && weights[n] < 0.0 { -value } else { value };
    for c in corrections {
        match c.target {
            Some(k) => {
                let factors =
                    at_targets[k].get_or_insert_with(|| (0..change.len()).map(|n| factor(n, c.t, c.after)).collect());
                for (n, change) in change.iter_mut().enumerate() {
                    *change += signed(n, c.amount * factors[n]);
                }
            }
            None => {
                for (n, change) in change.iter_mut().enumerate() {
                    *change += signed(n, c.amount * factor(n, c.t, c.after));
                }
            }
        }
    }
}

fn step(weights: &mut [f64], eta: f64, change: &[f64]) {
    for (w, c) in weights.iter_mut().zip(change) {
        *w += eta * c;
    }
}

impl EpochLearner {
    /// Trains a rule's neuron. Calls `report` with the number of epochs done and the share of patterns right.
    pub(super) fn train(
        &self,
        rule: &Rule,
        neuron: &SteppedNeuron,
        Examples { patterns, targets, start }: Examples<'_>,
        report: &mut dyn FnMut(usize, f64),
        stop: Stop<'_>,
    ) -> Result<Trained> {
        let trains = patterns[0].len();
        let mut random = StdRng::seed_from_u64(self.seed);
        let eta = self
            .eta
            .or_else(|| rule.published_eta(trains, targets.iter().map(Vec::len).sum()))
            .ok_or_else(|| problem!("eta"; ": no learning rate was published for this rule; give one"))?;
        let mut weights = match start {
            Some(start) => {
                one_weight_a_train(start, trains)?;
                start.to_vec()
            }
            None => {
                let [low, high] = self.initial.or_else(|| rule.published_initial(trains)).ok_or_else(
                    || problem!("initial"; ": no first weights were published for this rule; give a range"),
                )?;
                (0..trains).map(|_| low + (high - low) * random.random::<f64>()).collect()
            }
        };
        let laid = patterns.iter().map(|p| neuron.lay_out(p, stop)).collect::<Result<Vec<Laid>>>()?;
        let shown = |p: usize| Presented { neuron, laid: &laid[p], trains: &patterns[p], targets: &targets[p] };
        let mut at_targets: Vec<Vec<Option<Vec<f64>>>> = targets.iter().map(|t| vec![None; t.len()]).collect();
        let mut order: Vec<usize> = (0..patterns.len()).collect();
        let (mut fired, mut corrections, mut change) = (Vec::new(), Vec::new(), vec![0.0; trains]);
        let mut best = weights.clone();
        let (mut right, mut best_epoch) = (Vec::new(), 0);
        for epoch in 0..=self.epochs {
            let mut count = 0;
            change.fill(0.0);
            for p in 0..patterns.len() {
                if stop.asked() {
                    return Ok(Trained { weights: best, right, best_epoch, ended: Ended::Stopped });
                }
                corrections.clear();
                neuron.fire(&weights, &laid[p], &mut fired);
                count += usize::from(is_right(&targets[p], &fired, self.within_ms));
                if self.updates == Updates::Batch && epoch < self.epochs {
                    rule.correct(&shown(p), &weights, &fired, &mut corrections);
                    add_up(rule, &shown(p), &weights, &corrections, &mut at_targets[p], &mut change);
                }
            }
            let share = count as f64 / patterns.len() as f64;
            if right.iter().all(|&r| r <= share) {
                best.copy_from_slice(&weights);
                best_epoch = epoch;
            }
            right.push(share);
            report(epoch, share);
            if self.until_right && count == patterns.len() {
                return Ok(Trained { weights: best, right, best_epoch, ended: Ended::Right });
            }
            if epoch == self.epochs {
                break;
            }
            match self.updates {
                Updates::Batch => step(&mut weights, eta, &change),
                Updates::Pattern => {
                    order.shuffle(&mut random);
                    for &p in &order {
                        if stop.asked() {
                            return Ok(Trained { weights: best, right, best_epoch, ended: Ended::Stopped });
                        }
                        corrections.clear();
                        neuron.fire(&weights, &laid[p], &mut fired);
                        rule.correct(&shown(p), &weights, &fired, &mut corrections);
                        if corrections.is_empty() {
                            continue;
                        }
                        change.fill(0.0);
                        add_up(rule, &shown(p), &weights, &corrections, &mut at_targets[p], &mut change);
                        step(&mut weights, eta, &change);
                    }
                }
            }
            if weights.iter().any(|w| !w.is_finite()) {
                return Err(problem!("eta"; " is {eta}: the weights grew without limit; give a smaller eta"));
            }
        }
        let ended = if right.last() == Some(&1.0) { Ended::Right } else { Ended::Epochs };
        Ok(Trained { weights: best, right, best_epoch, ended })
    }
}
