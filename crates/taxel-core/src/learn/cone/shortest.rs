//! The shortest weights that satisfy every row: row generation around the dual active set.

use std::collections::HashSet;

use super::cone_r::GapMultipliers;
use super::exact::{Exact, MOST_ROUNDS, Slopes};
use crate::learn::engines::{DualActiveSet, Multipliers, RowId, SolveOutcome};
use crate::learn::fit::{Left, Round};
use crate::learn::statement::{Bounds, Certificate, Norm, Row, SilencePeak, Statement};
use crate::vectors::dot;
use crate::{Result, Stop, problem};

/// Cuts demand the full margin, but only violations of this share of it are cut: a cut then also settles the instants
/// next to it, so the rounds terminate.
const ASKED_SHARE: f64 = 0.999;
/// This share of the violated rows, but at least `ENTER_LEAST` of them, enters at once, worst first: weights that
/// satisfy the worst rows often satisfy the others.
const ENTER_SHARE: f64 = 0.4;
const ENTER_LEAST: usize = 100;
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
            let end = match verdict {
                SolveOutcome::Infeasible(ray) => self
                    .refutation(working.name_rows(&ray.multipliers), stop)?
                    .map_or(RowGenerationEnd::Stopped, RowGenerationEnd::Infeasible),
                SolveOutcome::Stopped => RowGenerationEnd::Stopped,
                SolveOutcome::Optimal => {
                    let broken = self.broken(&weights, ASKED_SHARE, self.rounding(&weights));
                    let rows = working.rows();
                    let objective = self.parts(&weights).sum();
                    progress(Round { round: rounds, rows, objective, left: Left::Broken(broken.len()) });
                    let flat = working.flat(&weights, (1.0 - ASKED_SHARE) * self.statement.margin.slope);
                    let ended = rounds == MOST_ROUNDS || stop.asked();
                    if !ended && weights != before && working.cut(&self.statement, &broken, &flat)? {
                        continue;
                    }
                    // Row generation ends once rounds no longer change the weights; `report` checks whether the rows
                    // are satisfied.
                    if !ended || (broken.is_empty() && flat.is_empty()) {
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
        let (mut targets, mut others) = (vec![], vec![]);
        for &row in rows {
            let stated = self.statement.state(row)?;
            if let Row::Target { .. } = row {
                engine.equality(&stated.coefficients, stated.limit)?;
                targets.push(row);
            } else {
                engine.inequality(&stated.coefficients, stated.limit)?;
                others.push(row);
            }
        }
        let SolveOutcome::Infeasible(ray) = engine.solve(stop)? else { return Ok(None) };
        Certificate::check(&self.statement, &self.objective.bounds, name_rows(&targets, &others, &ray.multipliers))
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
        let factor = match self.objective.norm {
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
struct Working {
    engine: DualActiveSet,
    targets: Vec<Row>,
    /// The names of the inequalities, by their number.
    names: Vec<Row>,
    /// Silent rows in the working set, by pattern and time.
    silent: HashSet<(usize, u64)>,
    slopes: Slopes,
    /// The number of each slope row in the working set.
    ids: Vec<Option<RowId>>,
    row: Vec<f64>,
}

impl Working {
    fn new(problem: &Exact, start: &[(Row, f64)]) -> Result<Self> {
        let Exact { statement, targets, .. } = problem;
        let bounds = &problem.objective.bounds;
        let mut working = Self {
            engine: DualActiveSet::new(&bounds.lower, &bounds.upper)?,
            targets: statement.targets().map(|(pattern, target)| Row::Target { pattern, target }).collect(),
            names: vec![],
            silent: HashSet::new(),
            slopes: Slopes::new(statement)?,
            ids: vec![],
            row: vec![0.0; statement.trains],
        };
        for target in targets.iter() {
            working.engine.equality(target.at, target.threshold)?;
        }
        for (name, stated) in &working.slopes.0 {
            working.ids.push(Some(working.engine.inequality(&stated.coefficients, stated.limit)?));
            working.names.push(*name);
        }
        if !start.is_empty() {
            working.start(statement, start)?;
        }
        Ok(working)
    }

    fn start(&mut self, statement: &Statement, start: &[(Row, f64)]) -> Result<()> {
        let mut multipliers = Multipliers { equalities: vec![0.0; self.targets.len()], inequalities: vec![] };
        for &(row, multiplier) in start {
            if !multiplier.is_finite() {
                return Err(problem!("start"; ": a multiplier is {multiplier}; must be finite"));
            }
            match row {
                Row::Target { .. } => {
                    if let Some(k) = self.targets.iter().position(|r| *r == row) {
                        multipliers.equalities[k] = multiplier;
                    }
                }
                Row::Slope { .. } => {
                    if let Some(id) = self.slopes.0.iter().position(|s| s.0 == row).and_then(|k| self.ids[k]) {
                        multipliers.inequalities.push((id, multiplier.max(0.0)));
                    }
                }
                // Rows that this problem does not have are skipped.
                Row::Silence { pattern, t } => {
                    if statement.is_asked(pattern, t) && !self.silent.contains(&(pattern, t.to_bits())) {
                        let id = self.add(statement, row)?;
                        multipliers.inequalities.push((id, multiplier.max(0.0)));
                    }
                }
            }
        }
        self.engine.start(&multipliers)
    }

    /// Adds a row of silence.
    fn add(&mut self, statement: &Statement, row: Row) -> Result<RowId> {
        let limit = statement.state_into(row, &mut self.row)?;
        let id = self.engine.inequality(&self.row, limit)?;
        self.names.push(row);
        if let Row::Silence { pattern, t } = row {
            self.silent.insert((pattern, t.to_bits()));
        }
        Ok(id)
    }

    /// The slope rows outside the working set that are violated even when their limit is relaxed by `left_out`.
    fn flat(&self, weights: &[f64], left_out: f64) -> Vec<usize> {
        let mut broken = self.slopes.broken(weights, left_out);
        broken.retain(|&k| self.ids[k].is_none());
        broken
    }

    fn rows(&self) -> usize {
        self.targets.len() + self.silent.len()
    }

    /// Drops rows that are not binding and adds the worst of the violated ones; returns whether any row is new.
    fn cut(&mut self, statement: &Statement, broken: &[SilencePeak], flat: &[usize]) -> Result<bool> {
        let mut new: Vec<&SilencePeak> =
            broken.iter().filter(|p| !self.silent.contains(&(p.pattern, p.t.to_bits()))).collect();
        new.sort_by(|a, b| b.excess.total_cmp(&a.excess));
        new.truncate(((ENTER_SHARE * new.len() as f64) as usize).max(ENTER_LEAST));
        if new.is_empty() && flat.is_empty() {
            return Ok(false);
        }
        for id in self.engine.drop_inactive() {
            match self.names[id.index()] {
                Row::Silence { pattern, t } => drop(self.silent.remove(&(pattern, t.to_bits()))),
                _ => self.ids.iter_mut().filter(|known| **known == Some(id)).for_each(|known| *known = None),
            }
        }
        for peak in new {
            self.add(statement, peak.row())?;
        }
        for &k in flat {
            let (name, stated) = &self.slopes.0[k];
            self.ids[k] = Some(self.engine.inequality(&stated.coefficients, stated.limit)?);
            self.names.push(*name);
        }
        Ok(true)
    }

    fn name_rows(&self, multipliers: &Multipliers) -> Vec<(Row, f64)> {
        name_rows(&self.targets, &self.names, multipliers)
    }
}

/// The multipliers with the names of their rows.
fn name_rows(targets: &[Row], others: &[Row], multipliers: &Multipliers) -> Vec<(Row, f64)> {
    let targets = targets.iter().copied().zip(multipliers.equalities.iter().copied());
    let others = multipliers.inequalities.iter().map(|&(id, z)| (others[id.index()], z));
    targets.chain(others).filter(|(_, u)| *u != 0.0).collect()
}
