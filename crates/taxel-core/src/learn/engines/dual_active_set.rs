//! The shortest weights under linear rows and bounds: the dual active set of Goldfarb and Idnani on a working set.
//!
//! `min |w|^2 / 2` under `a.w = value`, `a.w <= limit` and `lower <= w <= upper`. With multipliers u of the rows A that
//! are held, `w = -A'u`, so everything happens in the Gram matrix `A A'` of the working set and the Cholesky factor of
//! its active part. Each state is optimal for the rows that it holds; the dual objective only rises, hence it ends.
//!
//! Goldfarb and Idnani (1983), Mathematical Programming 27:1, take in one violated row after another. Here all violated
//! rows enter at once, and those whose multiplier would turn negative leave again, as long as that raises the dual
//! objective; single steps do the rest, and decide what cannot be met. A new row that hardly differs from one that is held
//! takes its place before all that.

mod factor;
mod kernels;

use self::factor::Factor;
use self::kernels::{add_rows, products, rows_times};
use crate::vectors::{Aligned, LANES, dot};
use crate::{Result, Stop, problem};

/// Rows count as met within this, as they were stated or scaled to length 1, whichever asks for more.
const TOLERANCE: f64 = 5e-13;
/// What is asked of a long row, scaled to length 1, at most.
const FINEST: f64 = 4e-14;
/// Active rows are refined until they are met to this, as they were stated or scaled to length 1.
const REFINED: f64 = 2e-14;
/// A squared pivot below this is computed again from the vector itself: `1 - |d|^2` has lost its digits.
const DOUBTFUL: f64 = 1e-5;
/// Squared pivots at which a row counts as dependent: the next one where no proof comes of it.
const DEPENDENT: [f64; 4] = [1e-16, 1e-20, 1e-24, 1e-28];
/// Rows that memory is laid out for at first, where so many could be held: more of them move what is there.
const AT_FIRST: usize = 1024;
/// Rows appended to the factor in one go.
const BLOCK: usize = 64;
/// Rows that enter at once when each step must raise the dual.
const FEW: usize = 32;
/// Rows that enter for each that could still be held, beyond which each step must raise the dual.
const CROWD: usize = 2;
/// The product from which on two rows, scaled to length 1, hardly differ.
const ALIKE: f64 = 0.999;
/// Candidates for single steps between two looks at all rows.
const QUEUE: usize = 16;
/// Block exchanges in one call of `solve`, after which single steps go on.
const EXCHANGES: usize = 60;
/// Looks at all rows in one call of `solve`, of each row and bound: each raises the dual, unless rounding is in the way.
const MOST_ROUNDS: usize = 10;
/// How many of them in a row may leave the dual below its best before they look where they step.
const BOLD: usize = 3;

/// Names an inequality, in the order in which they were added; never given twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RowId(usize);

impl RowId {
    /// How many inequalities had been added before it.
    #[must_use]
    pub fn index(self) -> usize {
        self.0
    }
}

/// Multipliers of the rows that are held, as they were stated (not scaled).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Multipliers {
    /// One an equality, in the order in which they were added; any sign.
    pub equalities: Vec<f64>,
    /// Of the inequalities that are held, 0 or more; of all others it is 0.
    pub inequalities: Vec<(RowId, f64)>,
}

/// Proof that the rows contradict each other within the bounds (Farkas).
///
/// With `g = A_eq'y + A_in'z` the rows demand `g.w <= y.value + z.limit`, but no w within the bounds gives less than
/// `sum_n min(lower_n g_n, upper_n g_n)`, which is larger.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ray {
    /// y and z.
    pub multipliers: Multipliers,
    /// By how much it is larger.
    pub gap: f64,
}

/// How a call of [`DualActiveSet::solve`] ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// All rows and bounds are met, and no shorter weights do so.
    Optimal,
    /// No weights within the bounds meet all rows; checked.
    Infeasible(Ray),
    /// The caller asked to stop, or rows that double precision cannot tell from dependent ones are neither met nor
    /// refuted; the weights are optimal for the rows that are held.
    Stopped,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Free,
    Equality(usize),
    Inequality(RowId),
    Lower(usize),
    Upper(usize),
}

/// A row of the working set, scaled to length 1.
#[derive(Debug, Clone, Copy)]
struct Row {
    kind: Kind,
    length: f64,
    limit: f64,
}

impl Row {
    /// How far off it may be and still count as met.
    fn tolerance(&self) -> f64 {
        (TOLERANCE / self.length).clamp(FINEST, TOLERANCE)
    }
}

/// The solver, with its working set; see the module.
#[derive(Debug, Clone)]
pub struct DualActiveSet {
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// By slot; slots of rows that were dropped are taken again.
    rows: Vec<Row>,
    /// Coefficients by slot, `stride` numbers each.
    coefficients: Aligned,
    stride: usize,
    /// Slots in use, ascending, and those free to be taken.
    live: Vec<usize>,
    free: Vec<usize>,
    /// Rows whose products are still to be computed.
    fresh: Vec<usize>,
    /// Products by slot and slot, `gram_stride` numbers a row.
    gram: Aligned,
    gram_stride: usize,
    /// Slots of the active rows in the order of the factor, and the other way round.
    active: Vec<usize>,
    place: Vec<Option<usize>>,
    factor: Factor,
    /// Multipliers by slot, 0 where not active.
    multipliers: Vec<f64>,
    weights: Vec<f64>,
    /// `a.w - limit` by slot.
    excess: Vec<f64>,
    equalities: Vec<usize>,
    inequalities: usize,
    dependent: usize,
    /// Slots by synapse of the bounds that are held.
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
            return Err(problem!("bounds: {} lower and {} upper ones", lower.len(), upper.len()));
        }
        if let Some(n) = (0..lower.len()).find(|&n| lower[n].is_nan() || upper[n].is_nan() || lower[n] > upper[n]) {
            return Err(problem!("bounds of weight {n}: {} to {}, must ascend", lower[n], upper[n]));
        }
        // Strides that are no power of two, so that rows do not fall into the same cache sets.
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
            place: Vec::new(),
            factor: Factor::default(),
            multipliers: Vec::new(),
            weights: vec![0.0; stride],
            excess: Vec::new(),
            equalities: Vec::new(),
            inequalities: 0,
            dependent: 0,
            bounds: vec![[None; 2]; lower.len()],
        })
    }

    /// Adds the row `coefficients.w = value`.
    ///
    /// # Errors
    ///
    /// `Problem` if the number of coefficients is wrong or one is not finite.
    pub fn equality(&mut self, coefficients: &[f64], value: f64) -> Result<()> {
        let slot = self.add(Kind::Equality(self.equalities.len()), coefficients, value)?;
        self.equalities.push(slot);
        Ok(())
    }

    /// Adds the row `coefficients.w <= limit`.
    ///
    /// # Errors
    ///
    /// As [`DualActiveSet::equality`].
    pub fn inequality(&mut self, coefficients: &[f64], limit: f64) -> Result<RowId> {
        let id = RowId(self.inequalities);
        self.add(Kind::Inequality(id), coefficients, limit)?;
        self.inequalities += 1;
        Ok(id)
    }

    /// The weights, optimal for the rows that are held.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights[..self.lower.len()]
    }

    /// The multipliers: `w` minimises `|w|^2 / 2 + y.(A_eq w) + z.(A_in w)` within the bounds.
    #[must_use]
    pub fn multipliers(&self) -> Multipliers {
        self.stated(&self.multipliers)
    }

    /// Takes every inequality that is not held out of the working set; gives what was taken out.
    pub fn drop_inactive(&mut self) -> Vec<RowId> {
        let mut dropped = Vec::new();
        for at in (0..self.live.len()).rev() {
            let slot = self.live[at];
            match self.rows[slot].kind {
                _ if self.place[slot].is_some() => continue,
                Kind::Inequality(id) => dropped.push(id),
                Kind::Lower(n) => self.bounds[n][0] = None,
                Kind::Upper(n) => self.bounds[n][1] = None,
                Kind::Equality(_) | Kind::Free => continue,
            }
            self.rows[slot].kind = Kind::Free;
            self.live.remove(at);
            self.free.push(slot);
        }
        self.fresh.retain(|&slot| self.rows[slot].kind != Kind::Free);
        dropped.reverse();
        dropped
    }

    /// Begins from multipliers of an earlier solution; rows that they do not name begin at 0.
    ///
    /// # Errors
    ///
    /// `Problem` if an inequality is not in the working set or its multiplier is negative, or the number of equalities differs.
    pub fn start(&mut self, from: &Multipliers) -> Result<()> {
        if from.equalities.len() != self.equalities.len() {
            return Err(problem!(
                "start: {} multipliers of equalities, there are {}",
                from.equalities.len(),
                self.equalities.len()
            ));
        }
        let mut wanted = self.equalities.clone();
        let mut slots = vec![None; self.inequalities];
        for &slot in &self.live {
            if let Kind::Inequality(id) = self.rows[slot].kind {
                slots[id.0] = Some(slot);
            }
        }
        for &(id, z) in &from.inequalities {
            let Some(slot) = slots.get(id.0).copied().flatten() else {
                return Err(problem!("start: inequality {} is not in the working set", id.0));
            };
            if z.is_nan() || z < 0.0 {
                return Err(problem!("start: multiplier of inequality {} is {z}, must be 0 or more", id.0));
            }
            if z > 0.0 {
                wanted.push(slot);
            }
        }
        self.extend_gram();
        self.release();
        self.take(&wanted);
        for k in 0..self.active.len() {
            let slot = self.active[k];
            let u = match self.rows[slot].kind {
                Kind::Equality(k) => from.equalities[k],
                Kind::Inequality(id) => from.inequalities.iter().find(|(i, _)| *i == id).map_or(0.0, |(_, z)| *z),
                _ => 0.0,
            };
            self.multipliers[slot] = u * self.rows[slot].length;
        }
        self.settle();
        Ok(())
    }

    /// Goes on from the rows that are held until all are met, or proven to be beyond reach.
    ///
    /// # Errors
    ///
    /// None so far; a stop is a verdict.
    pub fn solve(&mut self, stop: Stop<'_>) -> Result<Verdict> {
        let fresh = self.extend_gram();
        self.exchange(&fresh);
        let (mut exchanges, mut bold) = (EXCHANGES, BOLD);
        let mut best: Option<(f64, Vec<usize>, Vec<f64>)> = None;
        let mut undecided: Vec<usize> = Vec::new();
        let mut rounds = MOST_ROUNDS * (self.live.len() + self.lower.len());
        loop {
            if stop.asked() || rounds == 0 {
                return Ok(Verdict::Stopped);
            }
            rounds -= 1;
            self.measure(false);
            let mut candidates = self.violated();
            candidates.retain(|c| !undecided.contains(&c.0));
            if candidates.is_empty() {
                self.measure(true);
                return Ok(if undecided.iter().any(|&slot| !self.is_met(slot)) {
                    Verdict::Stopped
                } else {
                    Verdict::Optimal
                });
            }
            if let Some(ray) = self.proof(self.multipliers.clone()) {
                return Ok(Verdict::Infeasible(ray));
            }
            if exchanges > 0 && candidates.len() > 1 {
                exchanges -= 1;
                let slots: Vec<usize> = candidates.iter().map(|c| c.0).collect();
                let (held, here) = (self.active.len(), self.dual(&self.weights));
                if slots.len() > CROWD * self.lower.len().saturating_sub(held) {
                    bold = 0;
                }
                if bold > 0 {
                    if best.as_ref().is_none_or(|b| here < b.0) {
                        best = Some((here, self.active.clone(), self.multipliers.clone()));
                        bold = BOLD;
                    } else {
                        bold -= 1;
                    }
                    if bold == 0
                        && let Some((_, active, multipliers)) = best.take()
                    {
                        self.release();
                        self.hold(&active, &multipliers);
                        continue;
                    }
                }
                self.take(&slots[..if bold > 0 { slots.len() } else { slots.len().min(FEW) }]);
                if self.active.len() > held {
                    if bold > 0 {
                        self.project();
                    } else {
                        self.settle();
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
                    Kind::Equality(_) if since < 0.0 => (-1.0, -since),
                    _ => (1.0, since),
                };
                if self.place[slot].is_some() || violation <= self.rows[slot].tolerance() {
                    continue;
                }
                if let Some(ray) = self.step(slot, sign, violation) {
                    if let Some(ray) = self.proof(ray) {
                        return Ok(Verdict::Infeasible(ray));
                    }
                    if self.dependent + 1 < DEPENDENT.len() {
                        self.dependent += 1;
                        let (active, multipliers) = (self.active.clone(), self.multipliers.clone());
                        self.release();
                        self.hold(&active, &multipliers);
                        self.settle();
                    } else {
                        undecided.push(slot);
                    }
                    break;
                }
            }
        }
    }

    fn add(&mut self, kind: Kind, coefficients: &[f64], limit: f64) -> Result<usize> {
        if coefficients.len() != self.lower.len() {
            return Err(problem!("row: {} coefficients for {} weights", coefficients.len(), self.lower.len()));
        }
        if !(limit.is_finite() && coefficients.iter().all(|a| a.is_finite())) {
            return Err(problem!("row: holds a coefficient or limit that is not finite"));
        }
        let length = dot(coefficients, coefficients).sqrt();
        let length = if length > 0.0 { length } else { 1.0 };
        let slot = self.slot(Row { kind, length, limit: limit / length });
        for (to, a) in self.coefficients[slot * self.stride..].iter_mut().zip(coefficients) {
            *to = a / length;
        }
        self.fresh.push(slot);
        Ok(slot)
    }

    /// Takes a slot for a row; its coefficients are 0.
    fn slot(&mut self, row: Row) -> usize {
        let slot = self.free.pop().unwrap_or(self.rows.len());
        if slot == self.rows.len() {
            self.rows.push(row);
            self.place.push(None);
            self.multipliers.push(0.0);
            self.excess.push(0.0);
            if self.coefficients.len() < self.rows.len() * self.stride {
                let mut coefficients = Aligned::zeros(self.roomy(self.rows.len()) * self.stride);
                coefficients[..self.coefficients.len()].copy_from_slice(&self.coefficients);
                self.coefficients = coefficients;
            }
        } else {
            self.coefficients[slot * self.stride..][..self.stride].fill(0.0);
        }
        self.rows[slot] = row;
        let at = self.live.partition_point(|&s| s < slot);
        self.live.insert(at, slot);
        slot
    }

    /// How many slots to lay out memory for where so many are in use.
    fn roomy(&self, slots: usize) -> usize {
        (slots + slots / 2 + 64).max(self.lower.len().min(AT_FIRST))
    }

    /// Makes room in the Gram matrix for every slot.
    fn room(&mut self) {
        let slots = self.rows.len();
        if slots <= self.gram_stride {
            return;
        }
        let stride = self.roomy(slots).next_multiple_of(LANES);
        let stride = if stride.is_multiple_of(64) { stride + LANES } else { stride };
        let mut gram = Aligned::zeros(stride * stride);
        for (new, old) in gram.chunks_exact_mut(stride).zip(self.gram.chunks_exact(self.gram_stride.max(1))) {
            new[..self.gram_stride].copy_from_slice(old);
        }
        (self.gram, self.gram_stride) = (gram, stride);
    }

    /// Computes the products of the fresh rows with all others, in one matrix product; gives those rows.
    fn extend_gram(&mut self) -> Vec<usize> {
        self.room();
        let fresh = std::mem::take(&mut self.fresh);
        let (slots, stride) = (self.rows.len(), self.stride);
        for fresh in fresh.chunks(4 * BLOCK) {
            let mut rows = Aligned::zeros(fresh.len() * stride);
            for (row, &slot) in rows.chunks_exact_mut(stride).zip(fresh) {
                row.copy_from_slice(&self.coefficients[slot * stride..][..stride]);
            }
            let mut sums = vec![0.0; fresh.len() * slots];
            products(&rows, &self.coefficients[..slots * stride], stride, &mut sums, slots);
            for (&slot, sums) in fresh.iter().zip(sums.chunks_exact(slots)) {
                self.gram[slot * self.gram_stride..][..slots].copy_from_slice(sums);
            }
            for other in 0..slots {
                for (k, &slot) in fresh.iter().enumerate() {
                    self.gram[other * self.gram_stride + slot] = sums[k * slots + other];
                }
            }
        }
        fresh
    }

    /// Holds fresh rows in the place of held ones that they hardly differ from.
    ///
    /// Cuts at a peak that moves a little from round to round would enter and leave by turns before they are told apart.
    /// The dual may fall, but no row is lost by it: `solve` ends above where it began.
    fn exchange(&mut self, fresh: &[usize]) {
        let mut entering = Vec::new();
        let mut leaves = vec![false; self.active.len()];
        for &slot in fresh.iter().filter(|slot| !self.is_equality(**slot)) {
            let products = &self.gram[slot * self.gram_stride..][..self.rows.len()];
            let others = self.active.iter().enumerate().filter(|(k, other)| !leaves[*k] && !self.is_equality(**other));
            let nearest = others.max_by(|a, b| products[*a.1].total_cmp(&products[*b.1]));
            if let Some((k, _)) = nearest.filter(|(_, other)| products[**other] >= ALIKE) {
                leaves[k] = true;
                entering.push(slot);
            }
        }
        if entering.is_empty() {
            return;
        }
        let leaving: Vec<usize> = (0..leaves.len()).filter(|&k| leaves[k]).collect();
        self.leave(&leaving, None);
        self.take(&entering);
        self.project();
    }

    /// The slot of a bound's row, taken if it has none yet.
    fn bound(&mut self, n: usize, upper: bool) -> usize {
        if let Some(slot) = self.bounds[n][usize::from(upper)] {
            return slot;
        }
        let (kind, sign, limit) =
            if upper { (Kind::Upper(n), 1.0, self.upper[n]) } else { (Kind::Lower(n), -1.0, -self.lower[n]) };
        let slot = self.slot(Row { kind, length: 1.0, limit });
        self.bounds[n][usize::from(upper)] = Some(slot);
        self.coefficients[slot * self.stride + n] = sign;
        self.room();
        for other in 0..self.rows.len() {
            let product = sign * self.coefficients[other * self.stride + n];
            self.gram[slot * self.gram_stride + other] = product;
            self.gram[other * self.gram_stride + slot] = product;
        }
        self.excess[slot] = sign * self.weights[n] - limit;
        slot
    }

    fn is_equality(&self, slot: usize) -> bool {
        matches!(self.rows[slot].kind, Kind::Equality(_))
    }

    fn violation(&self, slot: usize) -> f64 {
        if self.is_equality(slot) { self.excess[slot].abs() } else { self.excess[slot] }
    }

    fn is_met(&self, slot: usize) -> bool {
        self.violation(slot) <= self.rows[slot].tolerance()
    }

    /// `-A'u` over the active rows.
    fn combined(&self) -> Vec<f64> {
        let by: Vec<f64> = self.active.iter().map(|&slot| -self.multipliers[slot]).collect();
        let mut weights = vec![0.0; self.stride];
        add_rows(&self.coefficients, self.stride, &self.active, &by, &mut weights);
        weights
    }

    /// Excess of the active rows, in their order, to the end of the line.
    fn residuals(&self, weights: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.factor.padded()];
        rows_times(&self.coefficients, self.stride, &self.active, weights, &mut out[..self.active.len()]);
        for (value, &slot) in out.iter_mut().zip(&self.active) {
            *value -= self.rows[slot].limit;
        }
        out
    }

    /// Computes weights and every row's excess; refines the active rows where they need it, or to the end.
    fn measure(&mut self, last: bool) {
        let enough = if last { REFINED } else { 0.1 * TOLERANCE };
        let mut worst = f64::INFINITY;
        for round in 0..4 {
            self.weights = self.combined();
            self.price();
            let off = |&slot: &usize| self.excess[slot].abs() * self.rows[slot].length.max(1.0);
            let now = self.active.iter().map(off).fold(0.0, f64::max);
            if now <= enough || now > 0.5 * worst || round == 3 {
                break;
            }
            worst = now;
            self.refine();
        }
        if last {
            self.project_weights();
        }
    }

    /// Moves the weights onto the active rows: with large multipliers their sum is rounded to more than the rows allow.
    fn project_weights(&mut self) {
        let lengths: Vec<f64> = self.active.iter().map(|&slot| self.rows[slot].length.max(1.0)).collect();
        let off = |residuals: &[f64]| residuals.iter().zip(&lengths).map(|(r, l)| r.abs() * l).fold(0.0, f64::max);
        let mut change = self.residuals(&self.weights);
        let mut now = off(&change);
        for _ in 0..4 {
            if now <= REFINED {
                break;
            }
            self.factor.forward(&mut change);
            self.factor.backward(&mut change);
            let by: Vec<f64> = change[..self.active.len()].iter().map(|change| -change).collect();
            let mut weights = self.weights.clone();
            add_rows(&self.coefficients, self.stride, &self.active, &by, &mut weights);
            change = self.residuals(&weights);
            let then = off(&change);
            if then >= now {
                break;
            }
            (self.weights, now) = (weights, then);
        }
        self.price();
    }

    /// Computes every row's excess.
    fn price(&mut self) {
        let mut values = vec![0.0; self.live.len()];
        rows_times(&self.coefficients, self.stride, &self.live, &self.weights, &mut values);
        for (value, &slot) in values.iter().zip(&self.live) {
            self.excess[slot] = value - self.rows[slot].limit;
        }
    }

    /// Rows and bounds that are not met, with their excess, worst first.
    fn violated(&mut self) -> Vec<(usize, f64)> {
        let mut found: Vec<(usize, f64)> = Vec::new();
        for n in 0..self.lower.len() {
            for upper in [false, true] {
                let over = if upper { self.weights[n] - self.upper[n] } else { self.lower[n] - self.weights[n] };
                if over > TOLERANCE && self.bounds[n][usize::from(upper)].is_none() {
                    self.bound(n, upper);
                }
            }
        }
        for &slot in &self.live {
            if self.place[slot].is_none() && !self.is_met(slot) {
                found.push((slot, self.excess[slot]));
            }
        }
        found.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        found
    }

    /// Products of a row with the active ones, in their order, to the end of the line.
    fn products(&self, slot: usize) -> Vec<f64> {
        let row = &self.gram[slot * self.gram_stride..][..self.gram_stride];
        let mut out = vec![0.0; self.factor.padded()];
        for (value, &slot) in out.iter_mut().zip(&self.active) {
            *value = row[slot];
        }
        out
    }

    /// Holds these rows with multiplier 0, but not those that (nearly) depend on others.
    fn take(&mut self, slots: &[usize]) {
        for block in slots.chunks(BLOCK) {
            let block: Vec<usize> = block.iter().copied().filter(|&slot| self.place[slot].is_none()).collect();
            let stride = self.factor.padded();
            let mut g = vec![0.0; stride * block.len()];
            let mut own = vec![0.0; block.len() * block.len()];
            for (k, &slot) in block.iter().enumerate() {
                let row = &self.gram[slot * self.gram_stride..][..self.gram_stride];
                for (value, &slot) in g[k * stride..].iter_mut().zip(&self.active) {
                    *value = row[slot];
                }
                for (value, &slot) in own[k * block.len()..].iter_mut().zip(&block) {
                    *value = row[slot];
                }
            }
            let limits: Vec<f64> = block.iter().map(|&slot| self.rows[slot].limit).collect();
            for k in self.factor.append(&mut g, stride, &mut own, &limits, DOUBTFUL, self.lower.len()) {
                self.place[block[k]] = Some(self.active.len());
                self.active.push(block[k]);
            }
        }
    }

    /// Lets go of every row.
    fn release(&mut self) {
        for slot in std::mem::take(&mut self.active) {
            self.place[slot] = None;
            self.multipliers[slot] = 0.0;
        }
        self.factor.clear();
    }

    /// Lets go of the rows at these places (ascending).
    fn leave(&mut self, places: &[usize], d: Option<&mut Vec<f64>>) {
        self.factor.remove(places, d);
        for &place in places {
            let slot = self.active[place];
            self.place[slot] = None;
            self.multipliers[slot] = 0.0;
        }
        let place = &self.place;
        self.active.retain(|&slot| place[slot].is_some());
        for (place, &slot) in self.active.iter().enumerate() {
            self.place[slot] = Some(place);
        }
    }

    /// Holds these rows with their multipliers: in blocks, then one by one, with exact pivots, those that nearly depend.
    fn hold(&mut self, slots: &[usize], multipliers: &[f64]) {
        self.take(slots);
        for &slot in slots {
            if self.place[slot].is_none() {
                let mut d = self.products(slot);
                self.factor.forward(&mut d);
                let (pivot, _) = self.pivot(slot, &d);
                if pivot > DEPENDENT[self.dependent] && self.active.len() < self.lower.len() {
                    self.factor.push(&d, pivot.sqrt(), self.rows[slot].limit);
                    self.place[slot] = Some(self.active.len());
                    self.active.push(slot);
                }
            }
        }
        for &slot in &self.active {
            self.multipliers[slot] = multipliers[slot];
        }
    }

    /// The squared pivot of a row whose `L^-1 g` is `d`, and its coordinates r in the active rows.
    fn pivot(&self, slot: usize, d: &[f64]) -> (f64, Vec<f64>) {
        let mut r = d.to_vec();
        self.factor.backward(&mut r);
        let length = self.gram[slot * self.gram_stride + slot];
        let pivot = length - dot(d, d);
        if pivot >= DOUBTFUL || self.active.is_empty() {
            return (pivot, r);
        }
        let rest = |r: &[f64]| {
            let mut z = self.coefficients[slot * self.stride..][..self.stride].to_vec();
            let by: Vec<f64> = r[..self.active.len()].iter().map(|r| -r).collect();
            add_rows(&self.coefficients, self.stride, &self.active, &by, &mut z);
            z
        };
        let mut z = rest(&r);
        for _ in 0..2 {
            let mut change = vec![0.0; self.factor.padded()];
            rows_times(&self.coefficients, self.stride, &self.active, &z, &mut change[..self.active.len()]);
            self.factor.forward(&mut change);
            self.factor.backward(&mut change);
            for (r, change) in r.iter_mut().zip(&change) {
                *r += change;
            }
            z = rest(&r);
        }
        (dot(&z, &z), r)
    }

    /// One step of Goldfarb and Idnani: takes in a violated row, lets go of those that stand against it.
    ///
    /// Gives a ray by slot where neither is possible.
    fn step(&mut self, slot: usize, sign: f64, mut violation: f64) -> Option<Vec<f64>> {
        let mut d = self.products(slot);
        self.factor.forward(&mut d);
        loop {
            let (pivot, r) = self.pivot(slot, &d);
            let dependent = pivot <= DEPENDENT[self.dependent] || self.active.len() >= self.lower.len();
            let mut length = if dependent { f64::INFINITY } else { violation / pivot };
            let mut against = None;
            let largest = r.iter().fold(0.0, |largest: f64, r| largest.max(r.abs()));
            for (place, (&held, r)) in self.active.iter().zip(&r).enumerate() {
                let r = sign * r;
                if r > 1e-13 * largest && !self.is_equality(held) {
                    let until = self.multipliers[held].max(0.0) / r;
                    if until < length {
                        (length, against) = (until, Some(place));
                    }
                }
            }
            if length.is_infinite() {
                let mut ray = vec![0.0; self.rows.len()];
                for (&held, r) in self.active.iter().zip(&r) {
                    ray[held] = if self.is_equality(held) { -sign * r } else { (-sign * r).max(0.0) };
                }
                ray[slot] = sign;
                return Some(ray);
            }
            for (&held, r) in self.active.iter().zip(&r) {
                self.multipliers[held] -= length * sign * r;
            }
            self.multipliers[slot] += length * sign;
            let Some(place) = against else {
                self.factor.push(&d, pivot.sqrt(), self.rows[slot].limit);
                self.place[slot] = Some(self.active.len());
                self.active.push(slot);
                return None;
            };
            violation -= length * pivot;
            self.leave(&[place], Some(&mut d));
        }
    }

    /// Finds an optimum of some of the active rows: lets go of all whose multiplier would turn negative, again and again.
    fn project(&mut self) {
        loop {
            let optimum = self.factor.optimum();
            let negative = |&k: &usize| optimum[k] < 0.0 && !self.is_equality(self.active[k]);
            let negative: Vec<usize> = (0..optimum.len()).filter(negative).collect();
            if negative.is_empty() {
                for (&slot, u) in self.active.iter().zip(optimum) {
                    self.multipliers[slot] = u;
                }
                return;
            }
            self.leave(&negative, None);
        }
    }

    /// As `project`, but no further at a time than to where the first multiplier turns 0, so that the dual only rises.
    fn settle(&mut self) {
        loop {
            let optimum = self.factor.optimum();
            let mut length: f64 = 1.0;
            for (&slot, &to) in self.active.iter().zip(&optimum) {
                let from = self.multipliers[slot];
                if to < 0.0 && !self.is_equality(slot) {
                    length = length.min(from / (from - to));
                }
            }
            let mut falling = Vec::new();
            for (k, (&slot, &to)) in self.active.iter().zip(&optimum).enumerate() {
                let from = self.multipliers[slot];
                self.multipliers[slot] = from + length * (to - from);
                if to < 0.0 && !self.is_equality(slot) && from / (from - to) <= length {
                    falling.push(k);
                }
            }
            if falling.is_empty() {
                return;
            }
            self.leave(&falling, None);
        }
    }

    /// Corrects the active multipliers by what the active rows are off, and lets go of those that turn negative.
    fn refine(&mut self) {
        let mut change = self.residuals(&self.weights);
        self.factor.forward(&mut change);
        self.factor.backward(&mut change);
        for (&slot, change) in self.active.iter().zip(&change) {
            self.multipliers[slot] += change;
        }
        let negative = |&k: &usize| self.multipliers[self.active[k]] < 0.0 && !self.is_equality(self.active[k]);
        let negative: Vec<usize> = (0..self.active.len()).filter(negative).collect();
        self.leave(&negative, None);
    }

    /// The dual at the multipliers that gave `weights`; less is better.
    fn dual(&self, weights: &[f64]) -> f64 {
        0.5 * dot(weights, weights)
            + self.active.iter().map(|&slot| self.rows[slot].limit * self.multipliers[slot]).sum::<f64>()
    }

    /// Multipliers by slot as multipliers of the rows as stated.
    fn stated(&self, by_slot: &[f64]) -> Multipliers {
        let mut out = Multipliers { equalities: vec![0.0; self.equalities.len()], inequalities: Vec::new() };
        for &slot in &self.live {
            let u = by_slot[slot] / self.rows[slot].length;
            match self.rows[slot].kind {
                Kind::Equality(k) => out.equalities[k] = u,
                Kind::Inequality(id) if u > 0.0 => out.inequalities.push((id, u)),
                _ => {}
            }
        }
        out.inequalities.sort_by_key(|&(id, _)| id);
        out
    }

    /// The ray as a proof, if it is one: bounds are left out, the box pays for that and for rounding.
    fn proof(&self, by_slot: Vec<f64>) -> Option<Ray> {
        let bounds = |slot: usize| matches!(self.rows[slot].kind, Kind::Lower(_) | Kind::Upper(_));
        let slots: Vec<usize> = self.live.iter().copied().filter(|&s| by_slot[s] != 0.0 && !bounds(s)).collect();
        let by: Vec<f64> =
            slots.iter().map(|&s| if self.is_equality(s) { by_slot[s] } else { by_slot[s].max(0.0) }).collect();
        let mut g = vec![0.0; self.stride];
        add_rows(&self.coefficients, self.stride, &slots, &by, &mut g);
        let (mut least, mut size, mut widest) = (0.0, 0.0, 0.0_f64);
        for (n, &g) in g[..self.lower.len()].iter().enumerate().filter(|(_, g)| **g != 0.0) {
            let (low, high) = (self.lower[n] * g, self.upper[n] * g);
            least += low.min(high);
            size += low.abs().max(high.abs());
            widest = widest.max(self.lower[n].abs()).max(self.upper[n].abs());
        }
        let mut rounding = 0.0;
        for (&slot, &by) in slots.iter().zip(&by) {
            least -= by * self.rows[slot].limit;
            size += (by * self.rows[slot].limit).abs();
            rounding += by.abs();
        }
        rounding *= f64::EPSILON * widest * (self.lower.len() as f64).sqrt();
        (least > 1e-12 * size + rounding).then(|| Ray { multipliers: self.stated(&by_slot), gap: least })
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    /// Rows as they were stated, to check verdicts by plain sums.
    #[derive(Default)]
    struct Stated {
        equalities: Vec<(Vec<f64>, f64)>,
        inequalities: Vec<(Vec<f64>, f64)>,
        bound: f64,
    }

    impl Stated {
        fn random(random: &mut StdRng, n: usize, equalities: usize, inequalities: usize, bound: f64) -> Self {
            let mut row = |value: f64| {
                let scale = 10f64.powf(random.random_range(-2.0..2.0));
                ((0..n).map(|_| scale * random.random_range(-0.5..1.0)).collect(), scale * value)
            };
            Self {
                equalities: (0..equalities).map(|_| row(0.3)).collect(),
                inequalities: (0..inequalities).map(|k| row(0.2 - 0.1 * (k % 3) as f64)).collect(),
                bound,
            }
        }

        fn solver(&self) -> DualActiveSet {
            let n = self.equalities.first().or(self.inequalities.first()).unwrap().0.len();
            let mut solver = DualActiveSet::new(&vec![-self.bound; n], &vec![self.bound; n]).unwrap();
            for (a, value) in &self.equalities {
                solver.equality(a, *value).unwrap();
            }
            solver
        }

        fn solve(&self) -> (DualActiveSet, Verdict) {
            let mut solver = self.solver();
            for (a, limit) in &self.inequalities {
                solver.inequality(a, *limit).unwrap();
            }
            let verdict = solver.solve(Stop::never()).unwrap();
            (solver, verdict)
        }

        fn combine(&self, m: &Multipliers) -> Vec<f64> {
            let n = self.equalities.first().or(self.inequalities.first()).unwrap().0.len();
            let mut g = vec![0.0; n];
            let equalities = self.equalities.iter().zip(&m.equalities).map(|((a, _), &y)| (a, y));
            let inequalities = m.inequalities.iter().map(|&(id, z)| (&self.inequalities[id.index()].0, z));
            for (a, y) in equalities.chain(inequalities) {
                for (g, a) in g.iter_mut().zip(a) {
                    *g += y * a;
                }
            }
            g
        }

        /// The conditions of Karush, Kuhn and Tucker, sufficient as the problem is convex.
        fn assert_optimal(&self, solver: &DualActiveSet) {
            let w = solver.weights();
            let dot = |a: &[f64]| a.iter().zip(w).map(|(a, w)| a * w).sum::<f64>();
            let length = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>().sqrt();
            let m = solver.multipliers();
            for (a, value) in &self.equalities {
                assert!((dot(a) - value).abs() < 1e-13 * (1.0 + length(a)), "equality off by {}", dot(a) - value);
            }
            for (a, limit) in &self.inequalities {
                assert!(dot(a) - limit < 1e-12 * length(a), "inequality off by {}", dot(a) - limit);
            }
            for &(id, z) in &m.inequalities {
                let (a, limit) = &self.inequalities[id.index()];
                assert!(z > 0.0 && (dot(a) - limit).abs() < 1e-13 * (1.0 + length(a)), "held but not met");
            }
            for (n, (w, g)) in w.iter().zip(self.combine(&m)).enumerate() {
                let slope = w + g;
                assert!(w.abs() < self.bound + 1e-12, "weight {n} beyond its bound");
                let at = if slope < 0.0 { self.bound - w } else { w + self.bound };
                assert!(slope.abs() < 1e-9 || at < 1e-12, "weight {n}: slope {slope} at {at} from the bound");
            }
        }

        fn assert_refuted(&self, ray: &Ray) {
            assert!(ray.multipliers.inequalities.iter().all(|(_, z)| *z >= 0.0));
            let least: f64 = self.combine(&ray.multipliers).iter().map(|g| -self.bound * g.abs()).sum();
            let demanded = self
                .equalities
                .iter()
                .zip(&ray.multipliers.equalities)
                .map(|((_, b), y)| b * y)
                .sum::<f64>()
                + ray.multipliers.inequalities.iter().map(|&(id, z)| self.inequalities[id.index()].1 * z).sum::<f64>();
            assert!(least - demanded > 0.0, "ray proves nothing: {least} against {demanded}");
        }
    }

    #[test]
    fn random_problems_end_optimal_or_refuted() {
        let mut random = StdRng::seed_from_u64(1);
        let mut counts = [0; 2];
        for trial in 0..600 {
            let n = random.random_range(2..30);
            let equalities = random.random_range(0..=n / 2);
            let inequalities = random.random_range(1..3 * n);
            let bound = [0.1, 0.5, 5.0][trial % 3];
            let stated = Stated::random(&mut random, n, equalities, inequalities, bound);
            match stated.solve() {
                (solver, Verdict::Optimal) => stated.assert_optimal(&solver),
                (_, Verdict::Infeasible(ray)) => stated.assert_refuted(&ray),
                (_, Verdict::Stopped) => panic!("problem {trial} is undecided"),
            }
            counts[usize::from(matches!(stated.solve().1, Verdict::Optimal))] += 1;
        }
        assert!(counts[0] > 100 && counts[1] > 100, "{counts:?}");
    }

    #[test]
    fn equalities_that_repeat_others_are_met_or_refuted() {
        let mut random = StdRng::seed_from_u64(2);
        let mut stated = Stated::random(&mut random, 12, 4, 6, 9.0);
        let sum: Vec<f64> = (0..12).map(|n| stated.equalities[0].0[n] - 2.0 * stated.equalities[1].0[n]).collect();
        let value = stated.equalities[0].1 - 2.0 * stated.equalities[1].1;
        for off in [0.0, 1e-6, -1e-6, 1.0] {
            stated.equalities.truncate(4);
            stated.equalities.push((sum.clone(), value + off));
            match (stated.solve(), off == 0.0) {
                ((solver, Verdict::Optimal), true) => stated.assert_optimal(&solver),
                ((_, Verdict::Infeasible(ray)), false) => stated.assert_refuted(&ray),
                ((_, verdict), _) => panic!("off by {off}: {verdict:?}"),
            }
        }
        stated.equalities.truncate(4);
        stated.equalities.push((vec![0.0; 12], 0.3));
        match stated.solve().1 {
            Verdict::Infeasible(ray) => stated.assert_refuted(&ray),
            verdict => panic!("a target without inputs: {verdict:?}"),
        }
    }

    #[test]
    fn cuts_that_are_nearly_parallel_are_told_apart() {
        let mut random = StdRng::seed_from_u64(3);
        for apart in [1e-3, 1e-5, 1e-6, 1e-7] {
            let mut stated = Stated::random(&mut random, 20, 3, 8, 9.0);
            for k in 0..8 {
                let (a, limit) = stated.inequalities[k].clone();
                let length = a.iter().map(|a| a * a).sum::<f64>().sqrt();
                let near: Vec<f64> = a.iter().map(|a| a + apart * length * random.random_range(-1.0..1.0)).collect();
                stated.inequalities.push((near, limit - 0.01 * apart * length));
            }
            match stated.solve() {
                (solver, Verdict::Optimal) => stated.assert_optimal(&solver),
                (_, verdict) => panic!("{apart} apart: {verdict:?}"),
            }
        }
    }

    /// A row that hardly differs.
    fn beside(random: &mut StdRng, a: &[f64]) -> Vec<f64> {
        let length = a.iter().map(|a| a * a).sum::<f64>().sqrt();
        a.iter().map(|a| a + 3e-3 * length * random.random_range(-1.0..1.0)).collect()
    }

    #[test]
    fn a_cut_takes_the_place_of_one_that_it_hardly_differs_from() {
        let mut random = StdRng::seed_from_u64(6);
        let mut stated = Stated::random(&mut random, 20, 3, 0, 9.0);
        let mut solver = stated.solver();
        assert_eq!(solver.solve(Stop::never()).unwrap(), Verdict::Optimal);
        let a: Vec<f64> = (0..20).map(|_| random.random_range(0.0..1.0)).collect();
        let limit = dot(&a, solver.weights()) - 0.3;
        let near = beside(&mut random, &a);
        let mut held = Vec::new();
        for (row, limit, exchanged) in [(a, limit, false), (near, limit - 0.1, true)] {
            held.push(solver.inequality(&row, limit).unwrap());
            stated.inequalities.push((row, limit));
            let fresh = solver.extend_gram();
            solver.exchange(&fresh);
            assert_eq!(solver.place[fresh[0]].is_some(), exchanged, "it is held at once where one is near");
            assert_eq!(solver.active.len(), 3 + usize::from(exchanged), "in the place of that");
            assert_eq!(solver.solve(Stop::never()).unwrap(), Verdict::Optimal);
        }
        assert_eq!(solver.multipliers().inequalities.iter().map(|(id, _)| *id).collect::<Vec<_>>(), held[1..]);
        stated.assert_optimal(&solver);
    }

    #[test]
    fn rows_in_rounds_give_what_all_rows_at_once_give() {
        let mut random = StdRng::seed_from_u64(4);
        for trial in 0..20 {
            let mut stated = Stated::random(&mut random, 40, 6, 60, 0.5);
            // Every other time each with one beside it, which the rounds exchange for each other.
            for k in 0..if trial % 2 == 0 { 0 } else { 60 } {
                let (a, limit) = stated.inequalities[k].clone();
                stated.inequalities.push((beside(&mut random, &a), limit));
            }
            let (whole, verdict) = stated.solve();
            let mut solver = stated.solver();
            let (mut names, mut round) = (Vec::new(), 0);
            let last = loop {
                let verdict = solver.solve(Stop::never()).unwrap();
                let w = solver.weights().to_vec();
                solver.drop_inactive();
                let held: Vec<RowId> = solver.multipliers().inequalities.iter().map(|(id, _)| *id).collect();
                let mut added = false;
                for (k, (a, limit)) in stated.inequalities.iter().enumerate() {
                    let over = a.iter().zip(&w).map(|(a, w)| a * w).sum::<f64>() - limit;
                    if over > 1e-11 * a.iter().map(|a| a * a).sum::<f64>().sqrt() {
                        assert!(!held.iter().any(|id| names[id.index()] == k), "a held row is violated");
                        assert_eq!(solver.inequality(a, *limit).unwrap().index(), names.len());
                        names.push(k);
                        added = true;
                    }
                }
                round += 1;
                if !added || verdict != Verdict::Optimal {
                    break verdict;
                }
                assert!(round < 100);
            };
            match verdict {
                Verdict::Optimal => {
                    assert_eq!(last, Verdict::Optimal);
                    for (a, b) in whole.weights().iter().zip(solver.weights()) {
                        assert!((a - b).abs() < 1e-9);
                    }
                }
                _ => assert!(matches!(last, Verdict::Infeasible(_))),
            }
        }
    }

    #[test]
    fn a_start_from_multipliers_ends_where_a_cold_one_does() {
        let mut random = StdRng::seed_from_u64(5);
        let mut stated = Stated::random(&mut random, 30, 5, 40, 3.0);
        let (cold, verdict) = stated.solve();
        assert_eq!(verdict, Verdict::Optimal);
        let mut warm = stated.solver();
        for (a, limit) in &stated.inequalities {
            warm.inequality(a, *limit).unwrap();
        }
        warm.start(&cold.multipliers()).unwrap();
        for (a, b) in cold.weights().iter().zip(warm.combined()) {
            assert!((a - b).abs() < 1e-10, "the start alone is not there");
        }
        for (_, limit) in &mut stated.inequalities {
            *limit -= 1e-3;
        }
        let mut warm = stated.solver();
        for (a, limit) in &stated.inequalities {
            warm.inequality(a, *limit).unwrap();
        }
        warm.start(&cold.multipliers()).unwrap();
        assert_eq!(warm.solve(Stop::never()).unwrap(), Verdict::Optimal);
        stated.assert_optimal(&warm);
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(DualActiveSet::new(&[0.0], &[-1.0]).is_err());
        assert!(DualActiveSet::new(&[0.0, 0.0], &[1.0]).is_err());
        assert!(DualActiveSet::new(&[f64::NAN], &[1.0]).is_err());
        let mut solver = DualActiveSet::new(&[-1.0; 2], &[1.0; 2]).unwrap();
        assert!(solver.equality(&[1.0], 0.0).is_err());
        assert!(solver.equality(&[1.0, f64::NAN], 0.0).is_err());
        assert!(solver.inequality(&[1.0, 1.0], f64::INFINITY).is_err());
        let id = solver.inequality(&[1.0, 1.0], -1.0).unwrap();
        let start = |equalities: Vec<f64>, z: f64| Multipliers { equalities, inequalities: vec![(id, z)] };
        assert!(solver.start(&start(vec![1.0], 1.0)).is_err());
        assert!(solver.start(&start(vec![], -1.0)).is_err());
        assert!(solver.start(&start(vec![], 1.0)).is_ok());
        assert_eq!(solver.solve(Stop::when(&|| true)).unwrap(), Verdict::Stopped);
    }
}
