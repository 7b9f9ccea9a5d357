//! The input of metrics: patterns of one or more spike trains, stored as columns.

use crate::{Result, problem};

/// Several patterns with the same number of trains each; times in ms.
#[derive(Debug, Clone)]
pub struct Patterns<'a> {
    /// The caller's name for the patterns, for errors.
    pub name: &'a str,
    /// The number of patterns.
    pub count: usize,
    /// The number of trains in each pattern.
    pub trains: usize,
    /// All times, pattern after pattern, train after train.
    pub times: &'a [f64],
    /// The start of each train in `times`, and finally the end of all: `count * trains + 1` entries.
    pub offsets: &'a [usize],
    /// Whether the caller passed a list, so that errors name the entry.
    pub listed: bool,
}

impl Patterns<'_> {
    /// The times of train `n` of pattern `p`; ms.
    #[must_use]
    pub fn train(&self, p: usize, n: usize) -> &[f64] {
        let k = p * self.trains + n;
        &self.times[self.offsets[k]..self.offsets[k + 1]]
    }

    /// The name of train `n` of pattern `p` in errors.
    #[must_use]
    pub fn train_name(&self, p: usize, n: usize) -> String {
        let entry = if self.listed { format!("{}[{p}]", self.name) } else { self.name.to_owned() };
        if self.trains == 1 { format!("train {entry}") } else { format!("{entry}, train {n}") }
    }

    /// Checks offsets, finiteness and order.
    ///
    /// # Errors
    ///
    /// `Problem`, naming pattern, train and spike.
    pub fn check(&self) -> Result<()> {
        let sound = self.offsets.len() == self.count * self.trains + 1
            && self.offsets.first() == Some(&0)
            && self.offsets.last() == Some(&self.times.len())
            && self.offsets.is_sorted();
        if !sound {
            return Err(problem!("{}: offsets must ascend from 0 to the number of spikes", self.name));
        }
        for p in 0..self.count {
            for n in 0..self.trains {
                let train = self.train(p, n);
                // A branch-free pass over the spikes; values that are not finite fail it too.
                let sound = train.iter().all(|t| t.is_finite()) && train.is_sorted();
                if !sound {
                    return Err(self.fault(p, n));
                }
            }
        }
        Ok(())
    }

    /// The error for the first fault of an invalid train.
    fn fault(&self, p: usize, n: usize) -> crate::Error {
        let (train, name) = (self.train(p, n), self.train_name(p, n));
        if let Some(k) = train.iter().position(|t| !t.is_finite()) {
            return problem!("{name}, spike {k}: time is {}; must be finite", train[k]);
        }
        let k = train.windows(2).position(|w| w[1] < w[0]).unwrap_or(0);
        problem!("{name}, spike {}: {} ms comes after {} ms; times must ascend", k + 1, train[k + 1], train[k])
    }
}

/// One of several patterns, by its index.
pub(super) type Pattern<'p> = (&'p Patterns<'p>, usize);

/// The patterns of a matrix: its rows and its columns.
pub(super) struct Two<'p> {
    pub(super) rows: &'p Patterns<'p>,
    pub(super) columns: &'p Patterns<'p>,
    /// Whether rows and columns are the same patterns: then only cells above the diagonal are computed, and mirrored.
    pub(super) symmetric: bool,
}

impl<'p> Two<'p> {
    /// The patterns `a` against `b`, or against each other.
    pub(super) fn new(a: &'p Patterns<'p>, b: Option<&'p Patterns<'p>>) -> Self {
        Self { rows: a, columns: b.unwrap_or(a), symmetric: b.is_none() }
    }

    /// Checks both sides, and that their patterns have equally many trains.
    pub(super) fn check(&self) -> Result<()> {
        self.rows.check()?;
        self.columns.check()?;
        let (a, b) = (self.rows, self.columns);
        if b.trains != a.trains {
            return Err(problem!(
                "{} has {} trains, {} has {}: must be equally many",
                a.name,
                a.trains,
                b.name,
                b.trains
            ));
        }
        Ok(())
    }

    /// The number of pairs, without mirrored ones and the diagonal.
    pub(super) fn pairs(&self) -> usize {
        let (rows, columns) = (self.rows.count, self.columns.count);
        if self.symmetric { rows * rows.saturating_sub(1) / 2 } else { rows * columns }
    }

    /// The first column of row `i` to be computed.
    pub(super) fn first(&self, i: usize) -> usize {
        if self.symmetric { i + 1 } else { 0 }
    }

    /// The number of cells in a row, at least 1 so that a matrix can be divided into rows.
    pub(super) fn width(&self) -> usize {
        self.columns.count.max(1)
    }

    /// A matrix of zeros.
    pub(super) fn zeros(&self) -> Vec<f64> {
        vec![0.0; self.rows.count * self.columns.count]
    }

    /// Copies what is above the diagonal below it.
    pub(super) fn mirror(&self, distances: &mut [f64]) {
        if self.symmetric {
            for i in 0..self.rows.count {
                for j in 0..i {
                    distances[i * self.width() + j] = distances[j * self.width() + i];
                }
            }
        }
    }
}
