//! Objectives beyond the shortest weights (l1, B and sums of terms): row generation around the augmented Lagrangian, in
//! which every row is hard.

use std::collections::HashSet;

use super::cone_r::GapMultipliers;
use super::exact::{BestWeights, Exact, MET, MOST_ROUNDS, Slopes};
use crate::learn::engines::{ACCURACY, Between, FINEST, HardRows, Reached, nearest};
use crate::learn::fit::{Left, Round};
use crate::learn::statement::{
    Bounds, FormB, Objective, Point, Program, Proof, Row, Rows, Sides, SilencePeak, Targets, largest,
};
use crate::vectors::dot;
use crate::{Result, Stop};

/// Cuts demand the full margin, but only violations of this share of it are cut.
const ASKED_SHARE: f64 = 0.999;
/// While the gap is above this, silence counts as violated above `NEAR_SHARE` of `theta_0` only.
const NEAR: f64 = 1e-3;
const NEAR_SHARE: f64 = 1e-4;
/// The share of the tolerance at which weights are moved to satisfy every row, the factor by which a smaller one is
/// asked for if they then miss the tolerance, and the least share.
const ENOUGH: f64 = 0.3;
const SMALLER: f64 = 0.1;
const LEAST: f64 = 1e-4;
/// Rows within this many times the largest violation of their limit count when weights are moved to satisfy every row.
const AT_LIMIT: f64 = 30.0;
/// A row of silence this close before a target, in `tau`, is nearly parallel to the target's row.
const BESIDE: f64 = 1e-2;
/// A row of silence this close before a target, in `tau`, comes in only after the targets and the slope there are met,
/// whose row is known to more digits.
const AT_TARGET: f64 = 1e-4;

impl Exact {
    /// Continues from weights that satisfy every row.
    pub(super) fn mix(
        &self,
        mut best: BestWeights,
        start: &[(Row, f64)],
        progress: &mut dyn FnMut(Round),
        stop: Stop<'_>,
    ) -> Result<BestWeights> {
        let scale = self.parts(&best.weights).sum();
        if scale == 0.0 {
            return Ok(best);
        }
        let objective = &self.objective.scaled(1.0 / scale).within_reach(1.0);
        let nothing = objective.nothing_of_b(&self.targets);
        let theta_0 = self.statement.neuron.theta_0;
        let trains = self.statement.trains;
        let squares = objective.b > 0.0 && objective.choice.form_b == FormB::Square;
        let gram = if squares { self.targets.gram(stop)? } else { vec![0.0; trains * trains] };
        let mut rows = Written::new(self, &best, start)?;
        let mut state = Between::at(best.weights.clone(), rows.multipliers());
        // Where the difference is `nothing`, the gap is the tolerance.
        let gap_of = |value: f64, bound: f64| {
            let gap = (value - bound).max(0.0) / value.max(nothing / self.tolerance);
            if gap.is_nan() { f64::INFINITY } else { gap }
        };
        let finest = FINEST * self.tolerance;
        let (mut value, mut aim) = (1.0, ENOUGH * self.tolerance);
        loop {
            best.rounds += 1;
            let program = Program {
                silent: Rows::Written(&rows.coefficients),
                limit: &rows.limit,
                targets: &self.targets,
                gram: &gram,
                objective,
                slopes: [[0.0, f64::INFINITY], [f64::NEG_INFINITY, f64::INFINITY], Sides::Both.slopes(objective.b)],
                theta_0,
            };
            let accuracy = ACCURACY * (value - best.least / scale).max(finest * value.max(nothing / self.tolerance));
            let Reached { point, value: reached, mut proof, state: next, stopped, .. } =
                program.round(state, accuracy, stop);
            (state, value) = (next, reached);
            proof.divide(1.0 / scale, 1.0);
            if proof.bound > best.least {
                (best.least, best.proof) = (proof.bound, rows.name(proof, &self.targets));
            }
            let gap = gap_of(value, best.least / scale);
            let ended = state.is_idle(gap) || stopped || best.rounds >= MOST_ROUNDS;
            let meets = if gap <= aim || ended { rows.meet(objective, &self.targets, &point, stop)? } else { None };
            let met = meets.as_ref().unwrap_or(&point.weights);
            let tolerance = if gap > NEAR { NEAR_SHARE * theta_0 } else { self.rounding(met) };
            let broken = self.silence.broken(met, ASKED_SHARE, tolerance);
            let objective_there = self.parts(met).sum();
            let left = Left::Broken(broken.len());
            progress(Round { round: best.rounds, rows: rows.names.len(), objective: objective_there, left });
            rows.take(&mut state.multipliers);
            let more = rows.add(self, met, &broken)?;
            state.multipliers = rows.multipliers();
            if more {
                state.least_gap = f64::INFINITY;
            }
            if !more
                && self.worst_target(met) <= MET
                && self.worst(met) <= self.rounding(met)
                && objective_there < self.parts(&best.weights).sum()
            {
                best.weights.clone_from(met);
            }
            let least = self.parts(&best.weights).sum();
            let known = gap_of(least / scale, best.least / scale) <= self.tolerance;
            if known || ended {
                // The binding rows of this objective help the next fit, although they do not bind at the shortest
                // weights.
                for (&name, &multiplier) in rows.names.iter().zip(&rows.of_rows) {
                    if multiplier > 0.0 && !best.held.iter().any(|(held, _)| *held == name) {
                        best.held.push((name, 0.0));
                    }
                }
                return Ok(best);
            }
            if !more && gap <= aim {
                aim = (SMALLER * aim).max(LEAST * self.tolerance);
            }
        }
    }
}

/// The working set, as coefficients, with the multipliers of its rows, and of the targets and the rows after them.
struct Written {
    coefficients: Vec<f64>,
    limit: Vec<f64>,
    names: Vec<Row>,
    /// The target whose row was subtracted from a row of silence beside it, and the factor of the difference.
    beside: Vec<Option<(usize, f64)>>,
    /// The keys of these rows.
    present: HashSet<(u8, usize, u64)>,
    slopes: Slopes,
    of_rows: Vec<f64>,
    of_targets: Vec<f64>,
}

impl Written {
    /// The rows that bind at the shortest weights, with the multipliers there, and those of a start.
    fn new(problem: &Exact, best: &BestWeights, start: &[(Row, f64)]) -> Result<Self> {
        let mut written = Self {
            coefficients: vec![],
            limit: vec![],
            names: vec![],
            beside: vec![],
            present: HashSet::new(),
            slopes: Slopes::new(&problem.statement)?,
            of_rows: vec![],
            of_targets: vec![0.0; problem.targets.len()],
        };
        // The multipliers are those of half the square of the weights; if the objective grew in proportion to the
        // weights, this factor would make them those of the objective, which is 1.
        let factor = 1.0 / dot(&best.weights, &best.weights);
        for &(row, multiplier) in &best.held {
            match row {
                Row::Target { pattern, target } => {
                    if let Some(k) = problem.targets.names.iter().position(|name| *name == (pattern, target)) {
                        written.of_targets[k] += factor * multiplier;
                    }
                }
                _ => written.begin(problem, row, factor * multiplier)?,
            }
        }
        for &(row, _) in start {
            if !matches!(row, Row::Target { .. }) {
                written.begin(problem, row, 0.0)?;
            }
        }
        Ok(written)
    }

    /// Adds a row that bound elsewhere; for silence at a target, the slope there.
    fn begin(&mut self, problem: &Exact, row: Row, multiplier: f64) -> Result<()> {
        let targets = &problem.targets;
        if let Row::Silence { pattern, t } = row
            && let Some(k) = targets.next(pattern, t)
            && let Some(&(slope, _)) = self.slopes.0.get(k)
            && let ahead = targets.times[k] - t
            && ahead < AT_TARGET * problem.statement.neuron.tau
        {
            self.of_targets[k] += multiplier;
            return self.push(problem, slope, multiplier * ahead);
        }
        self.push(problem, row, multiplier)
    }

    /// Adds a row of silence or of slope that the problem has and the set does not.
    fn push(&mut self, problem: &Exact, row: Row, multiplier: f64) -> Result<()> {
        let (statement, targets) = (&problem.statement, &problem.targets);
        let is_asked = match row {
            Row::Silence { pattern, t } => statement.is_asked(pattern, t),
            Row::Slope { .. } => self.slopes.0.iter().any(|s| s.0 == row),
            Row::Target { .. } => false,
        };
        if !is_asked || !self.present.insert(row.key()) {
            return Ok(());
        }
        let from = self.coefficients.len();
        self.coefficients.resize(from + statement.trains, 0.0);
        let coefficients = &mut self.coefficients[from..];
        let mut limit = statement.state_into(row, coefficients)?;
        // Near a target the two rows are parallel to within rounding. Their difference divided by the time between
        // them limits the slope instead and is as long as the other rows; it is equivalent because the target's row
        // holds with equality.
        let tau = statement.neuron.tau;
        let beside = match row {
            Row::Silence { pattern, t } => targets
                .next(pattern, t)
                .filter(|&k| targets.times[k] - t < BESIDE * tau)
                .map(|k| (k, tau / (targets.times[k] - t))),
            _ => None,
        };
        if let Some((k, steep)) = beside {
            let at = targets.row(k);
            coefficients.iter_mut().zip(at.at).for_each(|(c, at)| *c = steep * (*c - at));
            limit = steep * (limit - at.threshold);
            self.of_targets[k] += multiplier;
        }
        self.limit.push(limit);
        self.names.push(row);
        self.of_rows.push(multiplier / beside.map_or(1.0, |(_, steep)| steep));
        self.beside.push(beside);
        Ok(())
    }

    /// Adds the violated rows; returns whether any row is new.
    fn add(&mut self, problem: &Exact, weights: &[f64], broken: &[SilencePeak]) -> Result<bool> {
        let (before, targets) = (self.names.len(), &problem.targets);
        let missed = problem.worst_target(weights) > MET;
        let flat = self.slopes.broken(weights, (1.0 - ASKED_SHARE) * problem.statement.margin.slope);
        for peak in broken {
            let near = targets.next(peak.pattern, peak.t).filter(|&k| {
                targets.times[k] - peak.t < AT_TARGET * problem.statement.neuron.tau
                    && !self.slopes.0.is_empty()
                    && (missed || flat.contains(&k))
            });
            if near.is_none() {
                self.push(problem, peak.row(), 0.0)?;
            }
        }
        for k in flat {
            self.push(problem, self.slopes.0[k].0, 0.0)?;
        }
        Ok(self.names.len() > before)
    }

    fn multipliers(&self) -> Vec<f64> {
        self.of_rows.iter().chain(&self.of_targets).copied().collect()
    }

    fn take(&mut self, multipliers: &mut Vec<f64>) {
        self.of_targets = multipliers.split_off(self.names.len());
        self.of_rows = std::mem::take(multipliers);
    }

    /// The nearest weights that satisfy all rows: those that are 0 stay 0, and the sums of B that are met stay met, if
    /// that can be.
    fn meet(
        &self,
        objective: &Objective,
        targets: &Targets,
        point: &Point,
        stop: Stop<'_>,
    ) -> Result<Option<Vec<f64>>> {
        let n = point.weights.len();
        let hard = &point.excess[..self.names.len() + targets.len()];
        let worst = largest(hard.iter().copied().chain([0.0]));
        let (rows, stored) = point.excess.split_at(self.names.len());
        let after = stored[targets.len()..].iter().enumerate();
        let (mut at, mut wanted) = (targets.at.clone(), targets.thresholds.clone());
        for (k, _) in after.filter(|(_, x)| x.abs() <= AT_LIMIT * worst) {
            at.extend_from_slice(targets.row(k).behind);
            wanted.push(objective.choice.kappa * targets.thresholds[k]);
        }
        let near = |k: &usize| rows[*k] >= -AT_LIMIT * worst;
        let near: Vec<usize> = (0..self.names.len()).filter(near).collect();
        let limit: Vec<f64> = near.iter().map(|&k| self.limit[k]).collect();
        let below = Rows::Written(&self.coefficients).coefficients(&near, n);
        let alone = HardRows { equal: &targets.at, equal_to: &targets.thresholds, below: &below, limit: &limit };
        let all = HardRows { equal: &at, equal_to: &wanted, ..alone };
        let Bounds { lower, upper } = &objective.bounds;
        let held = |bounds: &[f64]| -> Vec<f64> {
            let held = bounds.iter().zip(&point.weights);
            held.map(|(&bound, &w)| if w == 0.0 && objective.l1 > 0.0 { 0.0 } else { bound }).collect()
        };
        let (low, high) = (held(lower), held(upper));
        for rows in [all, alone].iter().skip(usize::from(wanted.len() == targets.len())) {
            for (lower, upper) in [(&low, &high), (lower, upper)] {
                if let Some(found) = nearest(&point.weights, rows, lower, upper, stop)? {
                    return Ok(Some(found));
                }
            }
        }
        Ok(None)
    }

    /// The nonzero multipliers of a proof, by the names of their rows; those of a difference go to both of its rows.
    fn name(&self, proof: Proof, targets: &Targets) -> GapMultipliers {
        let Proof { mut multipliers, behind, pull, .. } = proof;
        for (k, beside) in self.beside.iter().enumerate() {
            if let Some((target, steep)) = beside {
                multipliers[k] *= steep;
                multipliers[self.names.len() + target] -= multipliers[k];
            }
        }
        let names = || targets.names.iter().copied();
        let of_targets = names().map(|(pattern, target)| Row::Target { pattern, target });
        let rows = self.names.iter().copied().chain(of_targets).zip(multipliers);
        GapMultipliers {
            rows: rows.filter(|(_, multiplier)| *multiplier != 0.0).collect(),
            behind: names().zip(behind).filter(|(_, multiplier)| *multiplier != 0.0).collect(),
            pull,
        }
    }
}
