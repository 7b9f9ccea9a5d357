//! The rows that are stored: those at the targets (6.9a), and those of B shortly after them (6.10).

use super::rows::{Row, Statement};
use crate::vectors::add;
use crate::{Result, Stop};

/// The rows of all targets, stored one after the other.
#[derive(Debug, Clone)]
pub(crate) struct Targets {
    trains: usize,
    /// Pattern and number of each target.
    pub(crate) names: Vec<(usize, usize)>,
    /// The time of each target, ms.
    pub(crate) times: Vec<f64>,
    /// The threshold at each target, mV.
    pub(crate) thresholds: Vec<f64>,
    /// Coefficients at the targets.
    pub(crate) at: Vec<f64>,
    /// Coefficients `delta_t` later, as if the neuron had not fired at the target.
    pub(crate) behind: Vec<f64>,
}

/// The rows at one target.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TargetRow<'a> {
    pub(crate) threshold: f64,
    pub(crate) at: &'a [f64],
    pub(crate) behind: &'a [f64],
}

impl Targets {
    /// No targets yet.
    pub(crate) fn none(trains: usize) -> Self {
        Self { trains, names: vec![], times: vec![], thresholds: vec![], at: vec![], behind: vec![] }
    }

    /// The target rows of all patterns of a statement, and the rows `delta_t` ms after them.
    pub(crate) fn new(statement: &Statement, delta_t: f64, stop: Stop<'_>) -> Result<Self> {
        let mut targets = Self::none(statement.trains);
        for pattern in 0..statement.examples.len() {
            targets.append(Self::of_pattern(statement, pattern, delta_t, stop)?);
        }
        Ok(targets)
    }

    /// The rows of one pattern.
    pub(crate) fn of_pattern(statement: &Statement, pattern: usize, delta_t: f64, stop: Stop<'_>) -> Result<Self> {
        let mut row = vec![0.0; statement.trains];
        let mut new = Self::none(statement.trains);
        for (target, &time) in statement.examples[pattern].targets.iter().enumerate() {
            stop.check()?;
            new.names.push((pattern, target));
            new.times.push(time);
            new.thresholds.push(statement.state_into(Row::Target { pattern, target }, &mut row)?);
            new.at.extend_from_slice(&row);
            statement.behind_into(pattern, target, delta_t, &mut row)?;
            new.behind.extend_from_slice(&row);
        }
        Ok(new)
    }

    /// Adds the rows of another pattern.
    pub(crate) fn append(&mut self, mut new: Self) {
        self.names.append(&mut new.names);
        self.times.append(&mut new.times);
        self.thresholds.append(&mut new.thresholds);
        self.at.append(&mut new.at);
        self.behind.append(&mut new.behind);
    }

    /// `B'B` of the rows after the targets, by columns.
    pub(crate) fn gram(&self, stop: Stop<'_>) -> Result<Vec<f64>> {
        let mut gram = vec![0.0; self.trains * self.trains];
        for k in 0..self.len() {
            stop.check()?;
            self.add_square(k, 1.0, &mut gram);
        }
        Ok(gram)
    }

    /// Adds the part of the row after target `k` to `B'B`, or subtracts it if `sign` is -1.
    pub(crate) fn add_square(&self, k: usize, sign: f64, gram: &mut [f64]) {
        let row = self.row(k).behind;
        for (column, &v) in gram.chunks_exact_mut(self.trains).zip(row) {
            add(column, sign * v, row);
        }
    }

    /// Removes the rows of the first pattern; the others are renumbered from 0.
    pub(crate) fn drop_first(&mut self) {
        let gone = self.count_of_first();
        self.names.drain(..gone);
        self.names.iter_mut().for_each(|(pattern, _)| *pattern -= 1);
        self.times.drain(..gone);
        self.thresholds.drain(..gone);
        self.at.drain(..gone * self.trains);
        self.behind.drain(..gone * self.trains);
    }

    /// The number of targets in the first pattern.
    pub(crate) fn count_of_first(&self) -> usize {
        self.names.partition_point(|name| name.0 == 0)
    }

    pub(crate) fn len(&self) -> usize {
        self.names.len()
    }

    pub(crate) fn row(&self, k: usize) -> TargetRow<'_> {
        let columns = k * self.trains..(k + 1) * self.trains;
        TargetRow { threshold: self.thresholds[k], at: &self.at[columns.clone()], behind: &self.behind[columns] }
    }

    /// The number of the pattern's first target at or after `t`.
    pub(crate) fn next(&self, pattern: usize, t: f64) -> Option<usize> {
        self.names.iter().zip(&self.times).position(|(name, &time)| name.0 == pattern && time >= t)
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = TargetRow<'_>> + Clone {
        (0..self.len()).map(|k| self.row(k))
    }
}
