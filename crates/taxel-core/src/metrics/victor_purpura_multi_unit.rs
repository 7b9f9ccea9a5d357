//! Victor-Purpura distance between patterns of many units, where a spike may also change its unit.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use serde::{Deserialize, Serialize};

use super::distance::{Distance, Pattern, Ready, number_or_name};
use super::patterns::Patterns;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::spikes::Ordered;
use crate::{Result, Stop};

/// The least cost of turning one pattern into the other: 1 for each spike removed or added, `q |dt|` for each spike
/// moved, `k` for each spike moved to another train.
///
/// Aronov (2003), J. Neurosci. Methods 124:175. His dynamic programming is exponential in the number of trains, but the
/// distance is the least cost of a matching between the spikes of both patterns, with `q |dt|` (`+ k`) a pair and 1 for
/// each unmatched spike. It is found exactly by shortest augmenting paths (Jonker and Volgenant 1987), spike by spike;
/// each path considers only pairs that cost less than 2, the cost of removing and adding. Time O(n (p + n log n)) at
/// worst, where p is the number of such pairs of n spikes, and O(p) if few of them compete; memory O(n).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VictorPurpuraMultiUnit {
    /// Cost of moving a spike by 1 ms; if infinite, only spikes at exactly the same time match.
    #[serde(deserialize_with = "number_or_name")]
    pub q: f64,
    /// Cost of changing a spike's train: 0 pools all trains, 2 or more keeps them separate.
    #[serde(deserialize_with = "number_or_name")]
    pub k: f64,
}

/// A spike time and its train.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Labelled {
    t: f64,
    unit: usize,
}

impl Distance for VictorPurpuraMultiUnit {
    fn described() -> Described {
        Described::by(&Self { q: 0.0, k: 0.0 }, &["q", "k"], Self::RANGES)
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    fn ready<'m>(&'m self, _: &Patterns<'_>, _: Option<&Patterns<'_>>) -> Result<Box<dyn Ready + 'm>> {
        Ok(Box::new(self))
    }
}

impl Ready for &VictorPurpuraMultiUnit {
    fn between(&self, a: Pattern<'_>, b: Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        VictorPurpuraMultiUnit::between(self, a, b, stop)
    }
}

impl VictorPurpuraMultiUnit {
    ranges! {
        q: "1/ms", Range::COST;
        k: "", Range::COST;
    }

    /// The distance between two patterns.
    pub(super) fn between(&self, (a, p): Pattern<'_>, (b, q): Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        let (mut rows, mut columns) = (Vec::new(), Vec::new());
        for unit in 0..a.trains {
            // Equal spikes of both patterns match at no cost, and some cheapest matching contains these pairs: the
            // costs satisfy the triangle inequality, so the partners of two equal spikes may be matched with each other
            // instead.
            for (t, more) in super::merged::merge_spikes(a.train(p, unit), b.train(q, unit)) {
                let side = if more > 0.0 { &mut rows } else { &mut columns };
                side.extend(std::iter::repeat_n(Labelled { t, unit }, more.abs() as usize));
            }
        }
        let by_time = |x: &Labelled, y: &Labelled| x.t.total_cmp(&y.t).then(x.unit.cmp(&y.unit));
        rows.sort_by(by_time);
        columns.sort_by(by_time);
        Matching::new(self, rows, columns).solve(stop)
    }

    /// The cost of turning one spike into another.
    fn pair(&self, x: Labelled, y: Labelled) -> f64 {
        let moved = if x.t == y.t || self.q == 0.0 { 0.0 } else { self.q * (x.t - y.t).abs() };
        if x.unit == y.unit { moved } else { moved + self.k }
    }
}

/// The cost of removing one spike and adding another instead of matching them.
const APART: f64 = 2.0;

/// A matching of least cost that grows by one row at a time.
///
/// Every row is matched with a column, or unmatched at the cost [`APART`]. `height` and `depth` are dual prices of rows
/// and columns that prove optimality: no pair costs less than its row's height plus its column's depth.
struct Matching<'m> {
    costs: &'m VictorPurpuraMultiUnit,
    rows: Vec<Labelled>,
    columns: Vec<Labelled>,
    of_row: Vec<Option<usize>>,
    of_column: Vec<Option<usize>>,
    height: Vec<f64>,
    depth: Vec<f64>,
}

impl<'m> Matching<'m> {
    fn new(costs: &'m VictorPurpuraMultiUnit, rows: Vec<Labelled>, columns: Vec<Labelled>) -> Self {
        let (n, m) = (rows.len(), columns.len());
        let (of_row, of_column) = (vec![None; n], vec![None; m]);
        Self { costs, rows, columns, of_row, of_column, height: vec![0.0; n], depth: vec![0.0; m] }
    }

    fn solve(mut self, stop: Stop<'_>) -> Result<f64> {
        let m = self.columns.len();
        // For each search: the distance of each column, its predecessor row, and whether it is finished.
        let mut far = vec![f64::INFINITY; m];
        let mut from = vec![0; m];
        let mut done = vec![false; m];
        let (mut touched, mut behind) = (Vec::new(), Vec::new());
        let mut next = BinaryHeap::new();
        for start in 0..self.rows.len() {
            stop.check()?;
            // The rows reached, with their distances.
            let mut reached = vec![(start, 0.0)];
            let mut at = 0;
            // The best end found so far: a free column, or a row that becomes unmatched.
            let (mut least, mut end) = (f64::INFINITY, PathEnd::Row(start));
            loop {
                while let Some(&(row, distance)) = reached.get(at) {
                    at += 1;
                    let base = distance - self.height[row];
                    if base + APART < least {
                        (least, end) = (base + APART, PathEnd::Row(row));
                    }
                    for column in self.near(row) {
                        let pair = self.costs.pair(self.rows[row], self.columns[column]);
                        if pair >= APART || done[column] {
                            continue;
                        }
                        let distance = base + pair - self.depth[column];
                        if distance < far[column] && distance < least {
                            if far[column] == f64::INFINITY {
                                touched.push(column);
                            }
                            (far[column], from[column]) = (distance, row);
                            if self.of_column[column].is_none() {
                                (least, end) = (distance, PathEnd::Column(column));
                            } else {
                                next.push(Reverse(Ordered(distance, column)));
                            }
                        }
                    }
                }
                let Some(Reverse(Ordered(distance, column))) = next.pop() else { break };
                if distance >= least {
                    break;
                }
                if done[column] || distance > far[column] {
                    continue;
                }
                done[column] = true;
                behind.push(column);
                if let Some(row) = self.of_column[column] {
                    reached.push((row, distance));
                }
            }
            for &(row, distance) in &reached {
                self.height[row] += least - distance;
            }
            for &column in &behind {
                self.depth[column] -= least - far[column];
            }
            self.turn(start, end, &from);
            for column in touched.drain(..) {
                (far[column], done[column]) = (f64::INFINITY, false);
            }
            behind.clear();
            next.clear();
        }
        let matched = self.of_row.iter().enumerate().filter_map(|(row, column)| column.map(|c| (row, c)));
        let (mut pairs, mut sum) = (0, 0.0);
        for (row, column) in matched {
            (pairs, sum) = (pairs + 1, sum + self.costs.pair(self.rows[row], self.columns[column]));
        }
        Ok(sum + (self.rows.len() + m - 2 * pairs) as f64)
    }

    /// The columns that may cost less than [`APART`] with this row, judged by time alone.
    fn near(&self, row: usize) -> std::ops::Range<usize> {
        let reach = APART / self.costs.q * (1.0 + 4.0 * f64::EPSILON);
        let t = self.rows[row].t;
        let first = self.columns.partition_point(|c| c.t < t - reach);
        first..first + self.columns[first..].partition_point(|c| c.t <= t + reach)
    }

    /// Exchanges partners along the path from `start` to its end.
    fn turn(&mut self, start: usize, end: PathEnd, from: &[usize]) {
        let (mut row, mut column) = match end {
            PathEnd::Row(row) => (row, self.of_row[row].take()),
            PathEnd::Column(column) => {
                let row = from[column];
                let before = self.of_row[row].replace(column);
                self.of_column[column] = Some(row);
                (row, before)
            }
        };
        while row != start {
            let Some(left) = column else { return };
            row = from[left];
            column = self.of_row[row].replace(left);
            self.of_column[left] = Some(row);
        }
    }
}

/// The end of an augmenting path.
#[derive(Debug, Clone, Copy)]
enum PathEnd {
    /// A row that becomes unmatched.
    Row(usize),
    /// A column that was unmatched.
    Column(usize),
}
