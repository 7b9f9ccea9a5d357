//! Targets at which the potential must not stay below the threshold by a rounding error.
//!
//! A row that is met to rounding may leave the potential at its target slightly below the threshold. The neuron then
//! fires shortly afterwards, because the potential still rises, unless an inhibitory input ends the rise first. There the
//! row is raised by its largest rounding error, so that the exact sum of kernels reaches the threshold.

use super::exact::{Exact, KEPT_SHARE};
use crate::learn::engines::{HardRows, nearest};
use crate::learn::statement::{Bounds, Row, until};
use crate::vectors::dot;
use crate::{Result, Stop};

/// The largest number of parts of the rows that are tried: each takes as long as a round of the fit. One row among 200 that
/// cannot be raised takes 16.
const MOST_PARTS: usize = 16;

/// A target's row that is to be raised: its index among the targets, the potential wanted there, and the rise to it, mV.
struct RaisedRow {
    target: usize,
    wanted: f64,
    rise: f64,
}

/// Rows that the weights meet and must go on meeting: coefficients, one row after the other, and limits.
#[derive(Default)]
struct KeptRows {
    below: Vec<f64>,
    limit: Vec<f64>,
}

impl Exact {
    /// The nearest weights of the same signs with these rows raised, which are a solution; `None` if no row needs it, or
    /// none can be raised.
    ///
    /// A row is left as it is if the neuron, with the row raised, might fire before the end of silence, 1e-6 ms before
    /// the target. Where all rows together give no solution, those of smaller and of larger rises are raised apart, and
    /// so on by halves, and those that give none are left out.
    pub(super) fn raise(&self, weights: &[f64], stop: Stop<'_>) -> Result<Option<Vec<f64>>> {
        let mut wanted = self.to_be_raised(weights)?;
        if wanted.is_empty() {
            return Ok(None);
        }
        wanted.sort_by(|a, b| a.rise.total_cmp(&b.rise));
        let rows: Vec<&RaisedRow> = wanted.iter().collect();
        let all = self.solution_with(weights, &rows, &KeptRows::default())?;
        // Weights that are no solution themselves would need more than a rise by a rounding error.
        if all.is_some() || self.find_unmet(weights)?.is_some() {
            return Ok(all);
        }
        let kept = self.kept(weights)?;
        let all = self.solution_with(weights, &rows, &kept)?;
        if all.is_some() || rows.len() == 1 {
            return Ok(all);
        }
        let (smaller, larger) = rows.split_at(rows.len() / 2);
        let (mut raised, mut best, mut untried) = (vec![], None, vec![larger, smaller]);
        for _ in 0..MOST_PARTS {
            let Some(part) = untried.pop().filter(|_| !stop.asked()) else { break };
            let with: Vec<&RaisedRow> = raised.iter().chain(part).copied().collect();
            match self.solution_with(weights, &with, &kept)? {
                Some(found) => (raised, best) = (with, Some(found)),
                None if part.len() > 1 => {
                    let (smaller, larger) = part.split_at(part.len() / 2);
                    untried.extend([larger, smaller]);
                }
                None => {}
            }
        }
        Ok(best)
    }

    /// The rows whose potential may lie below the threshold by a rounding error that no rise makes up for.
    fn to_be_raised(&self, weights: &[f64]) -> Result<Vec<RaisedRow>> {
        let statement = &self.statement;
        let (mut found, mut silent) = (vec![], vec![0.0; weights.len()]);
        let targets = self.targets.iter().zip(&self.targets.names).zip(&self.targets.times);
        for (target, ((row, &name), &t)) in targets.enumerate() {
            if self.is_grid() || !statement.is_turned_down(name, weights) {
                continue;
            }
            let (pattern, end) = (name.0, until(t));
            let rounding = statement.rounding_at(pattern, t, weights);
            let wanted = row.threshold + rounding;
            let rise = wanted - dot(row.at, weights);
            if rise <= 0.0 {
                continue;
            }
            if statement.is_asked(pattern, end) {
                let row = Row::Silence { pattern, t: end };
                let threshold = statement.state_into(row, &mut silent)? + statement.margin_of(row);
                if dot(&silent, weights) + rise + rounding > threshold {
                    continue;
                }
            }
            found.push(RaisedRow { target, wanted, rise });
        }
        Ok(found)
    }

    /// The rows of all targets, and of the ends of silence before them with the margin that a solution must keep.
    fn kept(&self, weights: &[f64]) -> Result<KeptRows> {
        let (mut kept, mut silent) = (KeptRows::default(), vec![0.0; weights.len()]);
        for ((row, name), &t) in self.targets.iter().zip(&self.targets.names).zip(&self.targets.times) {
            kept.below.extend(row.at.iter().map(|a| -a));
            kept.limit.push(-row.threshold.min(dot(row.at, weights)));
            let end = Row::Silence { pattern: name.0, t: until(t) };
            if self.statement.is_asked(name.0, until(t)) {
                let limit = self.statement.state_into(end, &mut silent)?;
                let limit = limit + (1.0 - KEPT_SHARE) * self.statement.margin_of(end);
                kept.limit.push(limit.max(dot(&silent, weights)));
                kept.below.extend(&silent);
            }
        }
        Ok(kept)
    }

    /// The nearest weights with these rows raised and those kept, if they are a solution.
    fn solution_with(&self, weights: &[f64], raise: &[&RaisedRow], kept: &KeptRows) -> Result<Option<Vec<f64>>> {
        let (mut below, mut limit) = (vec![], vec![]);
        for RaisedRow { target, wanted, .. } in raise {
            below.extend(self.targets.row(*target).at.iter().map(|a| -a));
            limit.push(-wanted);
        }
        below.extend(&kept.below);
        limit.extend(&kept.limit);
        let Bounds { lower, upper } = &self.objective.bounds;
        // An input that has no effect, or an excitatory one, must not become inhibitory.
        let lower: Vec<f64> = lower.iter().zip(weights).map(|(l, w)| if *w >= 0.0 { l.max(0.0) } else { *l }).collect();
        let upper: Vec<f64> = upper.iter().zip(weights).map(|(u, w)| if *w <= 0.0 { u.min(0.0) } else { *u }).collect();
        let rows = HardRows { below: &below, limit: &limit, ..HardRows::default() };
        let found = nearest(weights, &rows, &lower, &upper, Stop::never())?;
        Ok(match found {
            Some(found) if self.find_unmet(&found)?.is_none() => Some(found),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;
    use crate::learn::cone::{ConeX, ConeXProblem};
    use crate::learn::fit::Status;
    use crate::learn::statement::Bound;
    use crate::{Spike, SpikeKind, SpikeTrains};

    const TARGET: f64 = 50.5;

    /// Solved problems of graded patterns with two inputs `behind` ms after the target, and their weights.
    fn solved(behind: f64, lambdas: [f64; 3]) -> Vec<(Exact, Vec<f64>)> {
        let mut found = vec![];
        for seed in 0..20 {
            let mut random = StdRng::seed_from_u64(seed);
            let mut input = |t: f64, train| Spike { t, train, value: random.random_range(-2.0..2.0) };
            let mut inputs: Vec<Spike> = (0..60).map(|n| input(f64::from(n), n % 30)).collect();
            inputs.extend((0..2).map(|n| input(TARGET + behind, 7 * n)));
            let pattern = SpikeTrains::from_spikes(&inputs, 30, SpikeKind::Graded, 0.0, 70.0).unwrap();
            let cone = ConeX { lambdas, lb: Bound::All(-2.0), ub: Bound::All(2.0), ..ConeX::default() };
            let problem = ConeXProblem::new(&cone, &[pattern], &[vec![TARGET]], Stop::never()).unwrap();
            let fit = problem.fit(&[], &mut |_| (), Stop::never()).unwrap().fit;
            if fit.status == Status::Solved {
                found.push((problem.exact, fit.weights));
            }
        }
        found
    }

    #[test]
    fn weights_without_an_inhibitory_input_at_a_target_remain_as_they_are() {
        for lambdas in [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]] {
            let fits = solved(1.01e-8, lambdas);
            assert!(fits.len() > 5);
            assert!(fits.iter().all(|(exact, weights)| exact.raise(weights, Stop::never()).unwrap().is_none()));
        }
    }

    #[test]
    fn weights_just_below_the_threshold_are_raised_by_the_rounding_error() {
        let (mut raised, mut left) = (0, 0);
        for (exact, weights) in [0.0, 1e-12, 1e-8].into_iter().flat_map(|behind| solved(behind, [0.0, 1.0, 0.0])) {
            let low: Vec<f64> = weights.iter().map(|w| w * (1.0 - 1e-14)).collect();
            let Some(high) = exact.raise(&low, Stop::never()).unwrap() else {
                assert!(!exact.statement.is_turned_down((0, 0), &low));
                left += 1;
                continue;
            };
            let row = exact.targets.row(0);
            let rounding = exact.statement.rounding_at(0, TARGET, &high);
            let excess = dot(row.at, &high) - row.threshold;
            assert!(excess > 0.9 * rounding && excess < 2.0 * rounding && rounding < 1e-13, "{excess}, {rounding}");
            assert!(high.iter().zip(&low).all(|(h, l)| (h - l).abs() <= 1e-13 && h * l >= 0.0));
            raised += 1;
        }
        assert!(raised > 20 && left > 0, "{raised}, {left}");
    }
}
