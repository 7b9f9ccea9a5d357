//! The shortest weights under linear rows and bounds: the dual active set of Goldfarb and Idnani on a working set.
//!
//! `min |w|^2 / 2` under `a.w = value`, `a.w <= limit` and `lower <= w <= upper`. With multipliers u of the active rows
//! A, `w = -A'u`, so everything follows from the Gram matrix `A A'` of the working set and the Cholesky factor of its
//! active part. Each state is optimal for its active rows, and the dual objective only rises, so the method terminates.
//!
//! Goldfarb and Idnani (1983), Mathematical Programming 27:1, activate one violated row after another. Here all
//! violated rows enter at once, and those whose multipliers would turn negative leave again, while that raises the dual
//! objective; single steps do the rest and detect infeasibility. Before this, a new row that hardly differs from an
//! active one replaces it.

mod certificate;
mod entering;
mod factor;
mod kernels;
mod leaving;
mod rows;
#[cfg(test)]
mod tests;
mod weights;
mod working_set;

use self::factor::CholeskyFactor;
use self::rows::{ConstraintKind, WorkingRow};
pub use self::rows::{Multipliers, Ray, RowId};
use crate::vectors::{Aligned, LANES, dot};
use crate::{Result, Stop, problem};

/// Squared pivots below which a row counts as linearly dependent: the next one is tried if no proof results.
const DEPENDENT: [f64; 4] = [1e-16, 1e-20, 1e-24, 1e-28];
/// The number of rows that are appended to the factor, or whose products are computed, at a time.
const BLOCK: usize = 64;
/// The number of rows that enter at once when each step must raise the dual.
const FEW: usize = 32;
/// With more than this many violated rows for each that could still be activated, each step must raise the dual.
const CROWD: usize = 2;
/// The number of candidates for single steps between two evaluations of all rows.
const QUEUE: usize = 16;
/// The number of block exchanges in one call of `solve`, after which single steps follow.
const EXCHANGES: usize = 60;
/// The number of evaluations of all rows in one call of `solve`, per row and bound: each raises the dual unless
/// rounding prevents it.
const MOST_ROUNDS: usize = 10;
/// How many exchanges in succession may leave the dual below its best before each must raise it.
const MOST_FALLS: usize = 3;

/// How a call of [`DualActiveSet::solve`] ended.
#[derive(Debug, Clone, PartialEq)]
pub enum SolveOutcome {
    /// The weights satisfy all rows and bounds, and no shorter weights do.
    Optimal,
    /// No weights within the bounds satisfy all rows; the proof has been checked.
    Infeasible(Ray),
    /// The caller requested a stop, or some rows cannot be distinguished from dependent ones in double precision and
    /// are neither satisfied nor refuted; the weights are optimal for the active rows.
    Stopped,
}

/// The solver with its working set; the module describes the method.
#[derive(Debug, Clone)]
pub struct DualActiveSet {
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// The rows by slot; slots of dropped rows are reused.
    rows: Vec<WorkingRow>,
    /// Coefficients by slot, `stride` numbers each.
    coefficients: Aligned,
    stride: usize,
    /// Slots in use, ascending, and free slots.
    live: Vec<usize>,
    free: Vec<usize>,
    /// Slots whose products are still to be computed.
    fresh: Vec<usize>,
    /// The products of rows by slot and slot, `gram_stride` numbers per row.
    gram: Aligned,
    gram_stride: usize,
    /// The slots of the active rows in the order of the factor, and the position of each slot in that order.
    active: Vec<usize>,
    positions: Vec<Option<usize>>,
    factor: CholeskyFactor,
    /// Multipliers by slot, 0 where not active.
    multipliers: Vec<f64>,
    weights: Vec<f64>,
    /// `a.w - limit` by slot.
    excess: Vec<f64>,
    /// The number of rows added so far.
    added: usize,
    dependent: usize,
    /// The slots of the bounds in the working set, by synapse.
    bounds: Vec<[Option<usize>; 2]>,
}

impl DualActiveSet {
    /// Starts without rows.
    ///
    /// # Errors
    ///
    /// `Problem` if bounds are not numbers, cross, or differ in number.
    pub fn new(lower: &[f64], upper: &[f64]) -> Result<Self> {
        if lower.len() != upper.len() {
            return Err(problem!(
                "bounds: {} lower and {} upper bounds; the numbers must be equal",
                lower.len(),
                upper.len()
            ));
        }
        if let Some(n) = (0..lower.len()).find(|&n| lower[n].is_nan() || upper[n].is_nan() || lower[n] > upper[n]) {
            return Err(problem!("bounds of weight {n}: {} to {}; must ascend", lower[n], upper[n]));
        }
        // Strides are not powers of two, so that rows do not map to the same cache sets.
        let stride = lower.len().next_multiple_of(LANES);
        let stride = if stride.is_multiple_of(64) { stride + LANES } else { stride };
        Ok(Self {
            lower: lower.to_vec(),
            upper: upper.to_vec(),
            rows: Vec::new(),
            coefficients: Aligned::default(),
            stride,
            live: Vec::new(),
            free: Vec::new(),
            fresh: Vec::new(),
            gram: Aligned::default(),
            gram_stride: 0,
            active: Vec::new(),
            positions: Vec::new(),
            factor: CholeskyFactor::default(),
            multipliers: Vec::new(),
            weights: vec![0.0; stride],
            excess: Vec::new(),
            added: 0,
            dependent: 0,
            bounds: vec![[None; 2]; lower.len()],
        })
    }

    /// Adds the row `coefficients.w = value`.
    ///
    /// # Errors
    ///
    /// `Problem` if the number of coefficients is wrong or one is not finite.
    pub fn equality(&mut self, coefficients: &[f64], value: f64) -> Result<RowId> {
        self.add(ConstraintKind::Equality, coefficients, value)
    }

    /// Adds the row `coefficients.w <= limit`.
    ///
    /// # Errors
    ///
    /// `Problem` if the number of coefficients is wrong or one is not finite.
    pub fn inequality(&mut self, coefficients: &[f64], limit: f64) -> Result<RowId> {
        self.add(ConstraintKind::Inequality, coefficients, limit)
    }

    /// The weights, optimal for the active rows.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights[..self.lower.len()]
    }

    /// The multipliers u: `w` minimises `|w|^2 / 2 + u.(A w)` within the bounds.
    #[must_use]
    pub fn multipliers(&self) -> Multipliers {
        self.multipliers_by_row(&self.multipliers)
    }

    /// Removes the inactive inequalities from the working set; returns their ids.
    pub fn drop_inactive(&mut self) -> Vec<RowId> {
        let mut dropped = Vec::new();
        for at in (0..self.live.len()).rev() {
            let slot = self.live[at];
            match self.rows[slot].kind {
                _ if self.positions[slot].is_some() => continue,
                ConstraintKind::Inequality(id) => dropped.push(id),
                ConstraintKind::Lower(n) => self.bounds[n][0] = None,
                ConstraintKind::Upper(n) => self.bounds[n][1] = None,
                ConstraintKind::Equality(_) | ConstraintKind::Free => continue,
            }
            self.rows[slot].kind = ConstraintKind::Free;
            self.live.remove(at);
            self.free.push(slot);
        }
        self.fresh.retain(|&slot| self.rows[slot].kind != ConstraintKind::Free);
        dropped.reverse();
        dropped
    }

    /// Starts from the multipliers of an earlier solution; rows without one start at 0.
    ///
    /// # Errors
    ///
    /// `Problem` if a row is not in the working set, or the multiplier of an inequality is negative.
    pub fn start(&mut self, from: &[(RowId, f64)]) -> Result<()> {
        let mut wanted: Vec<usize> = self.live.iter().copied().filter(|&slot| self.is_equality(slot)).collect();
        let mut slots = vec![None; self.added];
        for &slot in &self.live {
            if let ConstraintKind::Equality(id) | ConstraintKind::Inequality(id) = self.rows[slot].kind {
                slots[id.0] = Some(slot);
            }
        }
        let mut by_slot = vec![0.0; self.rows.len()];
        for &(RowId(id), u) in from {
            let Some(slot) = slots.get(id).copied().flatten() else {
                return Err(problem!("start"; ": row {id} is not in the working set"));
            };
            if !self.is_equality(slot) {
                if u.is_nan() || u < 0.0 {
                    return Err(problem!("start"; ": multiplier of inequality {id} is {u}; must be 0 or more"));
                }
                wanted.extend((u > 0.0).then_some(slot));
            }
            by_slot[slot] = u;
        }
        self.extend_gram();
        self.deactivate_all();
        self.activate(&wanted);
        for &slot in &self.active {
            self.multipliers[slot] = by_slot[slot] * self.rows[slot].length;
        }
        self.ascend();
        Ok(())
    }

    /// Continues from the active rows until all rows are satisfied, or proven infeasible.
    ///
    /// # Errors
    ///
    /// None at present; a stop is a verdict.
    pub fn solve(&mut self, stop: Stop<'_>) -> Result<SolveOutcome> {
        let fresh = self.extend_gram();
        self.replace_similar(&fresh);
        let (mut exchanges, mut falls_left) = (EXCHANGES, MOST_FALLS);
        let mut best: Option<(f64, Vec<usize>, Vec<f64>)> = None;
        let mut undecided: Vec<usize> = Vec::new();
        let mut rounds = MOST_ROUNDS * (self.live.len() + self.lower.len());
        loop {
            if stop.asked() || rounds == 0 {
                return Ok(SolveOutcome::Stopped);
            }
            rounds -= 1;
            self.update_weights(false);
            let mut candidates = self.violated();
            candidates.retain(|c| !undecided.contains(&c.0));
            if candidates.is_empty() {
                self.update_weights(true);
                return Ok(if undecided.iter().any(|&slot| !self.is_met(slot)) {
                    SolveOutcome::Stopped
                } else {
                    SolveOutcome::Optimal
                });
            }
            if let Some(ray) = self.proof(self.multipliers.clone()) {
                return Ok(SolveOutcome::Infeasible(ray));
            }
            if exchanges > 0 && candidates.len() > 1 {
                exchanges -= 1;
                let slots: Vec<usize> = candidates.iter().map(|c| c.0).collect();
                let (held, dual) = (self.active.len(), self.dual(&self.weights));
                if slots.len() > CROWD * self.lower.len().saturating_sub(held) {
                    falls_left = 0;
                }
                if falls_left > 0 {
                    if best.as_ref().is_none_or(|b| dual < b.0) {
                        best = Some((dual, self.active.clone(), self.multipliers.clone()));
                        falls_left = MOST_FALLS;
                    } else {
                        falls_left -= 1;
                    }
                    if falls_left == 0
                        && let Some((_, active, multipliers)) = best.take()
                    {
                        self.restore(&active, &multipliers);
                        continue;
                    }
                }
                self.activate(&slots[..if falls_left > 0 { slots.len() } else { slots.len().min(FEW) }]);
                if self.active.len() > held {
                    if falls_left > 0 {
                        self.drop_negative();
                    } else {
                        self.ascend();
                    }
                    continue;
                }
            }
            let reference = self.multipliers.clone();
            for &(slot, violation) in candidates.iter().take(QUEUE) {
                if stop.asked() {
                    break;
                }
                let moved: Vec<f64> = self.multipliers.iter().zip(&reference).map(|(u, was)| u - was).collect();
                let products = &self.gram[slot * self.gram_stride..][..moved.len()];
                let since = violation - dot(products, &moved);
                let (sign, violation) = match self.rows[slot].kind {
                    ConstraintKind::Equality(_) if since < 0.0 => (-1.0, -since),
                    _ => (1.0, since),
                };
                if self.positions[slot].is_some() || violation <= self.rows[slot].tolerance() {
                    continue;
                }
                if let Some(ray) = self.step(slot, sign, violation) {
                    if let Some(ray) = self.proof(ray) {
                        return Ok(SolveOutcome::Infeasible(ray));
                    }
                    if self.dependent + 1 < DEPENDENT.len() {
                        self.dependent += 1;
                        let (active, multipliers) = (self.active.clone(), self.multipliers.clone());
                        self.restore(&active, &multipliers);
                        self.ascend();
                    } else {
                        undecided.push(slot);
                    }
                    break;
                }
            }
        }
    }

    /// The negative dual objective at the multipliers that belong to `weights`; smaller is better.
    fn dual(&self, weights: &[f64]) -> f64 {
        0.5 * dot(weights, weights)
            + self.active.iter().map(|&slot| self.rows[slot].limit * self.multipliers[slot]).sum::<f64>()
    }
}
