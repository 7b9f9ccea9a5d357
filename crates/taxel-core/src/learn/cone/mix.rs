//! Objectives beyond the shortest weights (l1, B and sums of terms): row generation around the solver for small working
//! sets.

use std::collections::HashSet;
use std::sync::Arc;

use super::cone_r::GapMultipliers;
use super::exact::{BestWeights, Exact, MET, MOST_ROUNDS, Slopes};
use crate::learn::engines::mixed::{self, MixedProof, Terms};
use crate::learn::engines::{HardRows, nearest};
use crate::learn::fit::{Left, Round};
use crate::learn::statement::{Bounds, Row, SilencePeak, StatedRow, Targets, largest};
use crate::vectors::dot;
use crate::{Result, Stop};

/// Cuts demand the full margin, but only violations of this share of it are cut. The share is smaller than that for the
/// shortest weights, because nearly identical rows are harder for this solver.
const ASKED_SHARE: f64 = 0.9;
/// The first rounds only collect rows, at a loose tolerance: silence counts as violated above `NEAR_SHARE` of
/// `theta_0`, and rows that are slack by more than `SLACK_SHARE` of it are dropped.
const NEAR: f64 = 1e-3;
const NEAR_SHARE: f64 = 1e-4;
const SLACK_SHARE: f64 = 0.05;
/// The number of rounds in which rows may be dropped: later rounds only add rows, so that they terminate.
const DROPPING: usize = 10;
/// A row of silence this close before a target, in `tau`, is nearly parallel to the target's row.
const BESIDE: f64 = 1e-2;

impl Exact {
    /// Continues from weights that satisfy every row.
    pub(super) fn mix(
        &self,
        mut best: BestWeights,
        start: &[(Row, f64)],
        progress: &mut dyn FnMut(Round),
        stop: Stop<'_>,
    ) -> Result<BestWeights> {
        let objective = &self.objective;
        let wanted: Vec<f64> = self.targets.thresholds.iter().map(|threshold| objective.kappa * threshold).collect();
        let terms = Terms {
            l1: objective.l1,
            l2: objective.l2,
            norm: objective.norm,
            lift: objective.b,
            behind: &self.targets.behind,
            wanted: &wanted,
        };
        let Bounds { lower, upper } = &objective.bounds;
        let size = best.weights.iter().fold(0.0_f64, |most, w| most.max(w.abs()));
        let mut rows = Dense::new(self, best.held.iter().chain(start).map(|r| r.0))?;
        let (mut going, mut near, begun) = (None, true, best.rounds);
        loop {
            best.rounds += 1;
            let tolerance = if near { NEAR } else { self.tolerance };
            let found =
                mixed::minimise(&terms, &rows.hard(), &objective.bounds, size, going.as_ref(), tolerance, stop)?;
            if found.bound > best.least {
                (best.least, best.proof) = (found.bound, rows.name_rows(found.proof));
            }
            if found.stopped || best.rounds >= MOST_ROUNDS {
                return Ok(best);
            }
            let mut weights = found.weights;
            let met = rows.worst_row(&weights) <= 0.5 * MET;
            if !near
                && !met
                && let Some(meets) = nearest(&weights, &rows.hard(), lower, upper, stop)?
            {
                weights = meets;
            }
            let theta = self.statement.neuron.theta_0;
            let broken =
                self.broken(&weights, ASKED_SHARE, if near { NEAR_SHARE * theta } else { self.rounding(&weights) });
            let value: f64 = self.parts(&weights).sum();
            let (count, left) = (rows.names.len(), Left::Broken(broken.len()));
            progress(Round { round: best.rounds, rows: count, objective: value, left });
            let mut goes_on = found.start;
            if near && best.rounds < begun + DROPPING {
                goes_on.retain(&rows.drop_slack(&weights, &found.inequality, SLACK_SHARE * theta));
            }
            if rows.add(self, &weights, &broken)? {
                going = Some(goes_on);
                continue;
            }
            if near {
                (near, going) = (false, Some(goes_on));
                continue;
            }
            best.engine = found.engine;
            // The binding rows of this objective help the next fit, although they do not bind at the shortest weights.
            for (&name, &multiplier) in rows.names.iter().zip(&found.inequality) {
                if multiplier > 0.0 && !best.held.iter().any(|(held, _)| *held == name) {
                    best.held.push((name, 0.0));
                }
            }
            if self.worst_target(&weights) <= MET
                && self.worst(&weights) <= self.rounding(&weights)
                && value < self.parts(&best.weights).sum()
            {
                best.weights = weights;
            }
            return Ok(best);
        }
    }
}

/// The working set as dense rows.
struct Dense {
    targets: Arc<Targets>,
    below: Vec<f64>,
    limit: Vec<f64>,
    /// The names of the rows in `below`.
    names: Vec<Row>,
    /// The target whose row was subtracted from a row of silence beside it, and the factor of the difference.
    beside: Vec<Option<(usize, f64)>>,
    silent: HashSet<(usize, u64)>,
    slopes: Slopes,
}

impl Dense {
    /// All target rows, and those of the given rows that the problem has.
    fn new(problem: &Exact, rows: impl Iterator<Item = Row>) -> Result<Self> {
        let statement = &problem.statement;
        let slopes = Slopes::new(statement)?;
        let mut dense = Self {
            targets: Arc::clone(&problem.targets),
            below: vec![],
            limit: vec![],
            names: vec![],
            beside: vec![],
            silent: HashSet::new(),
            slopes,
        };
        for row in rows {
            match row {
                Row::Silence { pattern, t } if statement.is_asked(pattern, t) => {
                    dense.add_silence(problem, pattern, t)?
                }
                Row::Slope { .. } => {
                    if let Some(k) = dense.slopes.0.iter().position(|s| s.0 == row) {
                        dense.add_slope(k);
                    }
                }
                Row::Silence { .. } | Row::Target { .. } => {}
            }
        }
        Ok(dense)
    }

    fn hard(&self) -> HardRows<'_> {
        HardRows { equal: &self.targets.at, equal_to: &self.targets.thresholds, below: &self.below, limit: &self.limit }
    }

    fn add_silence(&mut self, problem: &Exact, pattern: usize, t: f64) -> Result<()> {
        if self.silent.insert((pattern, t.to_bits())) {
            let row = Row::Silence { pattern, t };
            let StatedRow { mut coefficients, mut limit } = problem.statement.state(row)?;
            // Near a target the two rows are parallel to within rounding. Their difference divided by the time between
            // them limits the slope instead and is as long as the other rows; it is equivalent because the target's row
            // holds with equality.
            let tau = problem.statement.neuron.tau;
            let near = self.targets.next(pattern, t).filter(|&k| self.targets.times[k] - t < BESIDE * tau);
            let beside = near.map(|k| (k, tau / (self.targets.times[k] - t)));
            if let Some((k, steep)) = beside {
                let at = self.targets.row(k);
                coefficients.iter_mut().zip(at.at).for_each(|(c, at)| *c = steep * (*c - at));
                limit = steep * (limit - at.threshold);
            }
            self.push(row, &coefficients, limit, beside);
        }
        Ok(())
    }

    fn add_slope(&mut self, k: usize) {
        let (row, stated) = self.slopes.0[k].clone();
        if !self.names.contains(&row) {
            self.push(row, &stated.coefficients, stated.limit, None);
        }
    }

    fn push(&mut self, row: Row, coefficients: &[f64], limit: f64, beside: Option<(usize, f64)>) {
        self.names.push(row);
        self.beside.push(beside);
        self.below.extend_from_slice(coefficients);
        self.limit.push(limit);
    }

    /// Adds the violated rows; returns whether any row is new.
    fn add(&mut self, problem: &Exact, weights: &[f64], broken: &[SilencePeak]) -> Result<bool> {
        let before = self.names.len();
        for peak in broken {
            self.add_silence(problem, peak.pattern, peak.t)?;
        }
        for k in self.slopes.broken(weights, (1.0 - ASKED_SHARE) * problem.statement.margin.slope) {
            self.add_slope(k);
        }
        Ok(self.names.len() > before)
    }

    /// Drops rows without a multiplier that are slack by more than `room`; returns which rows remain.
    fn drop_slack(&mut self, weights: &[f64], multipliers: &[f64], room: f64) -> Vec<bool> {
        let n = weights.len();
        let most = multipliers.iter().fold(0.0, |m: f64, z| m.max(*z));
        let rows = self.below.chunks_exact(n).zip(&self.limit).zip(multipliers);
        let keep: Vec<bool> =
            rows.map(|((row, limit), z)| *z > 1e-6 * most || limit - dot(row, weights) < room).collect();
        let kept = |k: &usize| keep[*k];
        self.below = (0..keep.len()).filter(kept).flat_map(|k| self.below[k * n..(k + 1) * n].to_vec()).collect();
        self.limit = (0..keep.len()).filter(kept).map(|k| self.limit[k]).collect();
        self.names = (0..keep.len()).filter(kept).map(|k| self.names[k]).collect();
        self.beside = (0..keep.len()).filter(kept).map(|k| self.beside[k]).collect();
        let silent =
            |row: &Row| if let Row::Silence { pattern, t } = row { Some((*pattern, t.to_bits())) } else { None };
        self.silent = self.names.iter().filter_map(silent).collect();
        keep
    }

    /// The nonzero multipliers of a proof, by the names of their rows; those of a difference go to both of its rows.
    fn name_rows(&self, proof: MixedProof) -> GapMultipliers {
        let MixedProof { mut equality, inequality, behind, pull } = proof;
        let mut rows = vec![];
        for ((&row, beside), z) in self.names.iter().zip(&self.beside).zip(inequality) {
            let (target, steep) = beside.map_or((None, 1.0), |(k, steep)| (Some(k), steep));
            rows.push((row, steep * z));
            if let Some(k) = target {
                equality[k] -= steep * z;
            }
        }
        let names = || self.targets.names.iter().copied();
        let targets = names().zip(equality).map(|((pattern, target), y)| (Row::Target { pattern, target }, y));
        GapMultipliers {
            rows: rows.into_iter().chain(targets).filter(|(_, multiplier)| *multiplier != 0.0).collect(),
            behind: names().zip(behind).filter(|(_, multiplier)| *multiplier != 0.0).collect(),
            pull,
        }
    }

    /// The largest violation of any row of the working set.
    fn worst_row(&self, weights: &[f64]) -> f64 {
        let n = weights.len();
        let equal = self.targets.iter().map(|row| (dot(row.at, weights) - row.threshold).abs());
        let below = self.below.chunks_exact(n).zip(&self.limit).map(|(row, limit)| dot(row, weights) - limit);
        largest(equal.chain(below).chain([0.0]))
    }
}
