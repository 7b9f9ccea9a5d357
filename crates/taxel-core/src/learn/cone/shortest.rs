//! The shortest weights that satisfy every row: row generation around the dual active set.

use std::collections::HashMap;

use super::cone_r::GapMultipliers;
use super::exact::{Exact, MOST_ROUNDS, Slopes};
use crate::learn::engines::{DualActiveSet, Multipliers, RowId, SolveOutcome};
use crate::learn::fit::{Left, Round};
use crate::learn::statement::{Bounds, Certificate, Norm, Row, SilencePeak};
use crate::vectors::{add, dot};
use crate::{Result, Stop, problem};

/// Cuts demand the full margin, but only violations of this share of it are cut: a cut then also settles the instants
/// next to it, so the rounds terminate.
const ASKED_SHARE: f64 = 0.999;
/// This share of the violated rows, but at least `ENTER_LEAST` of them, enters at once, worst first: weights that
/// satisfy the worst rows often satisfy the others.
const ENTER_SHARE: f64 = 0.4;
const ENTER_LEAST: usize = 100;
/// A row of silence this close before a target, in `tau`, is nearly parallel to the target's row.
const BESIDE: f64 = 1e-4;
/// Proofs of at most this many rows are reduced until every row is needed.
const FEW: usize = 60;

/// How row generation for the shortest weights ended.
pub(super) enum RowGenerationEnd {
    Met,
    Infeasible(Certificate),
    Stopped,
}

/// The result of row generation for the shortest weights.
pub(super) struct Shortest {
    pub(super) weights: Vec<f64>,
    pub(super) held: Vec<(Row, f64)>,
    pub(super) rounds: usize,
    pub(super) end: RowGenerationEnd,
}

impl Exact {
    /// Generates rows around the dual active set until none is violated.
    pub(super) fn shortest(
        &self,
        start: &[(Row, f64)],
        progress: &mut dyn FnMut(Round),
        stop: Stop<'_>,
    ) -> Result<Shortest> {
        let mut working = Working::new(self, start)?;
        let (mut rounds, mut weights) = (0, vec![]);
        loop {
            rounds += 1;
            let verdict = working.engine.solve(stop)?;
            let before = std::mem::replace(&mut weights, working.engine.weights().to_vec());
            let proof = match &verdict {
                SolveOutcome::Infeasible(ray) => self.refutation(working.name_rows(&ray.multipliers), stop)?,
                _ => None,
            };
            let end = match proof {
                Some(proof) => RowGenerationEnd::Infeasible(proof),
                None if stop.asked() && verdict != SolveOutcome::Optimal || weights.iter().any(|w| !w.is_finite()) => {
                    RowGenerationEnd::Stopped
                }
                // Where rounding leaves some rows undecided, others may refute the problem; `report` checks all.
                None => {
                    let broken = self.silence.broken(&weights, ASKED_SHARE, self.rounding(&weights));
                    let rows = working.present.len();
                    let objective = self.parts(&weights).sum();
                    progress(Round { round: rounds, rows, objective, left: Left::Broken(broken.len()) });
                    let flat = working.flat(&weights, (1.0 - ASKED_SHARE) * self.statement.margin.slope);
                    let ended = rounds == MOST_ROUNDS || stop.asked();
                    if !ended && weights != before && working.cut(&broken, &flat)? {
                        continue;
                    }
                    // Row generation ends once rounds no longer change the weights; `report` checks whether the rows
                    // are satisfied.
                    if verdict == SolveOutcome::Optimal && (!ended || (broken.is_empty() && flat.is_empty())) {
                        RowGenerationEnd::Met
                    } else {
                        RowGenerationEnd::Stopped
                    }
                }
            };
            let held = working.name_rows(&working.engine.multipliers());
            return Ok(Shortest { weights, held, rounds, end });
        }
    }

    /// The proof of infeasibility, with as few rows as can be found quickly.
    fn refutation(&self, rows: Vec<(Row, f64)>, stop: Stop<'_>) -> Result<Option<Certificate>> {
        let Some(proof) = Certificate::check(&self.statement, &self.objective.bounds, rows.clone())? else {
            return Ok(None);
        };
        if rows.len() > FEW {
            return Ok(Some(proof));
        }
        // Rows that explain least to a reader are removed first.
        let worth = |row: &Row| match row {
            Row::Slope { .. } => 0,
            Row::Silence { .. } => 1,
            Row::Target { .. } => 2,
        };
        let mut kept: Vec<Row> = rows.iter().map(|r| r.0).collect();
        kept.sort_by_key(worth);
        let (mut fewest, mut needed) = (proof.clone(), 0);
        // All rows before `needed` are needed: without any one of them the others can be satisfied.
        while needed < kept.len() && !stop.asked() {
            let others = kept.iter().enumerate().filter(|(k, _)| *k != needed).map(|(_, row)| *row).collect::<Vec<_>>();
            match self.conflict(&others, stop)? {
                // A proof that holds without any margin must not be replaced by one that needs the margin.
                Some(fewer) if fewer.at_all || !proof.at_all => {
                    kept.retain(|row| fewer.rows.iter().any(|r| r.0 == *row));
                    fewest = fewer;
                }
                _ => needed += 1,
            }
        }
        Ok(Some(fewest))
    }

    /// A proof that no weights satisfy these rows together.
    fn conflict(&self, rows: &[Row], stop: Stop<'_>) -> Result<Option<Certificate>> {
        let mut engine = DualActiveSet::new(&self.objective.bounds.lower, &self.objective.bounds.upper)?;
        for &row in rows {
            let stated = self.statement.state(row)?;
            match row {
                Row::Target { .. } => engine.equality(&stated.coefficients, stated.limit)?,
                Row::Silence { .. } | Row::Slope { .. } => engine.inequality(&stated.coefficients, stated.limit)?,
            };
        }
        let SolveOutcome::Infeasible(ray) = engine.solve(stop)? else { return Ok(None) };
        let mut named: Vec<(Row, f64)> = ray.multipliers.iter().map(|&(id, u)| (rows[id.index()], u)).collect();
        named.sort_by_key(|(row, _)| !matches!(row, Row::Target { .. }));
        Certificate::check(&self.statement, &self.objective.bounds, named)
    }

    /// A lower bound on the l2 term by any multipliers, from the minimum of the Lagrangian of `|w|^2 / 2` within the
    /// bounds, and the multipliers that prove it: the tangent of the l2 term touches at that minimum.
    pub(super) fn bound_of_length(&self, held: &[(Row, f64)]) -> Result<(f64, GapMultipliers)> {
        let trains = self.statement.trains;
        let (mut sum, mut row, mut allowed) = (vec![0.0; trains], vec![0.0; trains], 0.0);
        for &(name, multiplier) in held {
            let limit = self.statement.state_into(name, &mut row)?;
            sum.iter_mut().zip(&row).for_each(|(g, a)| *g += multiplier * a);
            allowed += multiplier * limit;
        }
        let Bounds { lower, upper } = &self.objective.bounds;
        let least: Vec<f64> = sum.iter().zip(lower.iter().zip(upper)).map(|(g, (l, u))| (-g).clamp(*l, *u)).collect();
        let square = dot(&least, &least);
        let bound = self.objective.l2_term((2.0 * (0.5 * square + dot(&sum, &least) - allowed)).max(0.0));
        let factor = match self.objective.choice.norm {
            Norm::Norm if square > 0.0 => self.objective.l2 / square.sqrt(),
            Norm::Norm => 0.0,
            Norm::Square => 2.0 * self.objective.l2,
        };
        let times = |(row, multiplier): &(Row, f64)| (*row, factor * multiplier);
        let rows = if factor > 0.0 { held.iter().map(times).collect() } else { vec![] };
        Ok((bound, GapMultipliers { rows, behind: vec![], pull: least.iter().map(|w| factor * w).collect() }))
    }
}

/// The dual active set with the names of its rows.
struct Working<'a> {
    problem: &'a Exact,
    engine: DualActiveSet,
    /// The name of each row added so far, by its number; the targets are first.
    names: Vec<Row>,
    /// The target whose row was subtracted from a row of silence, by the number of that row.
    beside: HashMap<RowId, usize>,
    /// The keys of the rows in the working set, with their numbers.
    present: HashMap<(u8, usize, u64), RowId>,
    slopes: Slopes,
    row: Vec<f64>,
}

impl<'a> Working<'a> {
    fn new(problem: &'a Exact, start: &[(Row, f64)]) -> Result<Self> {
        let Exact { statement, targets, .. } = problem;
        let bounds = &problem.objective.bounds;
        let mut working = Self {
            problem,
            engine: DualActiveSet::new(&bounds.lower, &bounds.upper)?,
            names: vec![],
            beside: HashMap::new(),
            present: HashMap::new(),
            slopes: Slopes::new(statement)?,
            row: vec![0.0; statement.trains],
        };
        for ((pattern, target), stated) in statement.targets().zip(targets.iter()) {
            let id = working.engine.equality(stated.at, stated.threshold)?;
            working.name(Row::Target { pattern, target }, id);
        }
        for k in 0..working.slopes.0.len() {
            working.add_slope(k)?;
        }
        if !start.is_empty() {
            working.start(start)?;
        }
        Ok(working)
    }

    fn start(&mut self, start: &[(Row, f64)]) -> Result<()> {
        let mut multipliers = Multipliers::new();
        let mut of_targets = vec![0.0; self.problem.targets.len()];
        for &(row, multiplier) in start {
            if !multiplier.is_finite() {
                return Err(problem!("start"; ": a multiplier is {multiplier}; must be finite"));
            }
            let id = match (self.present.get(&row.key()), row) {
                (Some(&id), _) => id,
                (None, Row::Silence { pattern, t }) if self.problem.statement.is_asked(pattern, t) => {
                    self.add(pattern, t)?
                }
                // Rows that this problem does not have are skipped.
                _ => continue,
            };
            match row {
                Row::Target { .. } => of_targets[id.index()] += multiplier,
                _ => multipliers.push((id, multiplier.max(0.0))),
            }
            if let Some(&k) = self.beside.get(&id) {
                of_targets[k] += multiplier.max(0.0);
            }
        }
        multipliers.extend(self.names.iter().zip(of_targets).map(|(name, u)| (self.present[&name.key()], u)));
        self.engine.start(&multipliers)
    }

    /// Adds a row of silence.
    ///
    /// Just before a target it is nearly parallel to the target's row: their difference, which is equivalent because
    /// the target's row holds with equality, keeps its digits when it is scaled to length 1.
    fn add(&mut self, pattern: usize, t: f64) -> Result<RowId> {
        let Exact { statement, targets, .. } = self.problem;
        let row = Row::Silence { pattern, t };
        let mut limit = statement.state_into(row, &mut self.row)?;
        let near = |k: &usize| targets.times[*k] - t < BESIDE * statement.neuron.tau;
        let beside = targets.next(pattern, t).filter(near);
        if let Some(k) = beside {
            let target = targets.row(k);
            add(&mut self.row, -1.0, target.at);
            limit -= target.threshold;
        }
        let id = self.engine.inequality(&self.row, limit)?;
        self.name(row, id);
        self.beside.extend(beside.map(|k| (id, k)));
        Ok(id)
    }

    fn add_slope(&mut self, k: usize) -> Result<()> {
        let (name, stated) = &self.slopes.0[k];
        let (name, id) = (*name, self.engine.inequality(&stated.coefficients, stated.limit)?);
        self.name(name, id);
        Ok(())
    }

    fn name(&mut self, row: Row, id: RowId) {
        self.names.push(row);
        self.present.insert(row.key(), id);
    }

    /// The slope rows outside the working set that are violated even when their limit is relaxed by `left_out`.
    fn flat(&self, weights: &[f64], left_out: f64) -> Vec<usize> {
        let mut broken = self.slopes.broken(weights, left_out);
        broken.retain(|&k| !self.present.contains_key(&self.slopes.0[k].0.key()));
        broken
    }

    /// Drops rows that are not binding and adds the worst of the violated ones; returns whether any row is new.
    fn cut(&mut self, broken: &[SilencePeak], flat: &[usize]) -> Result<bool> {
        let mut new: Vec<&SilencePeak> =
            broken.iter().filter(|peak| !self.present.contains_key(&peak.row().key())).collect();
        new.sort_by(|a, b| b.excess.total_cmp(&a.excess));
        new.truncate(((ENTER_SHARE * new.len() as f64) as usize).max(ENTER_LEAST));
        if new.is_empty() && flat.is_empty() {
            return Ok(false);
        }
        for id in self.engine.drop_inactive() {
            self.present.remove(&self.names[id.index()].key());
        }
        for peak in new {
            self.add(peak.pattern, peak.t)?;
        }
        flat.iter().try_for_each(|&k| self.add_slope(k))?;
        Ok(true)
    }

    /// The multipliers with the names of their rows; those of a difference go to both of its rows.
    fn name_rows(&self, multipliers: &[(RowId, f64)]) -> Vec<(Row, f64)> {
        let mut of_targets = vec![0.0; self.problem.targets.len()];
        for (id, u) in multipliers {
            match self.beside.get(id) {
                Some(&k) => of_targets[k] -= u,
                None if id.index() < of_targets.len() => of_targets[id.index()] += u,
                None => {}
            }
        }
        let others = multipliers.iter().filter(|(id, _)| id.index() >= of_targets.len());
        let named = of_targets.iter().enumerate().filter(|(_, u)| **u != 0.0).map(|(k, &u)| (self.names[k], u));
        named.chain(others.map(|&(id, u)| (self.names[id.index()], u))).collect()
    }
}
