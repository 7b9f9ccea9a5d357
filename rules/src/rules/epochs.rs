//! Learning by epochs: present each pattern, compare the output spikes with the targets, correct.

use rand::rngs::StdRng;
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};

use super::corrections::Presented;
use super::epoch_learner::{Ended, EpochLearner, Examples, Trained, Updates};
use super::rule::{Rule, add_up};
use super::stepped::{Laid, SteppedNeuron};
use taxel_core::allowed::one_weight_a_train;
use taxel_core::{Result, Stop, problem};

/// Whether output spikes are as many as targets, each within `within` ms of its own.
pub(super) fn is_right(targets: &[f64], fired: &[f64], within: f64) -> bool {
    targets.len() == fired.len() && targets.iter().zip(fired).all(|(t, f)| (t - f).abs() <= within)
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
