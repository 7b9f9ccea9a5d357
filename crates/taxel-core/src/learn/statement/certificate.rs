//! Proofs that no weights within the bounds satisfy a stated problem (Farkas), checked in plain arithmetic on restated
//! rows.
//!
//! With multipliers y of target rows (any sign) and z of all others (0 or more), every solution w satisfies
//! `g.w <= y.threshold + z.limit`, where g is the sum of the rows, each times its multiplier. If even the least value
//! of `g.w` within the bounds is larger, there is no solution. The bounds must be finite, because rounding errors are
//! bounded by them.

use std::collections::BTreeMap;

use super::bounds::Bounds;
use super::rows::{Margin, Row, Statement};
use crate::Result;
use crate::neuron::Time;
use crate::vectors::dot;

/// The multipliers that prove a problem infeasible, and an explanation in words.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    /// The rows with their multipliers.
    pub rows: Vec<(Row, f64)>,
    /// The amount by which the least value within the bounds exceeds what the rows allow, mV; larger than its rounding
    /// error.
    pub gap: f64,
    /// Whether the proof also holds with margin and slope 0: then the problem is impossible with any margin.
    pub at_all: bool,
    /// The patterns, targets and silences that conflict, in words.
    pub text: String,
}

/// The roundings that a proven gap exceeds: its own, and those of a check that computes the rows again and demands the
/// same of its gap.
const TWICE_COMPUTED: f64 = 3.0;
/// The number of rows that an explanation names, those with the largest terms first.
const NAMED: usize = 12;

impl Certificate {
    /// Checks multipliers of rows (those of rows other than targets must be 0 or more); returns `None` if they prove
    /// nothing.
    pub(crate) fn check(statement: &Statement, bounds: &Bounds, rows: Vec<(Row, f64)>) -> Result<Option<Self>> {
        let Some(proven) = gap(statement, bounds, &rows, false)? else { return Ok(None) };
        let at_all = gap(statement, bounds, &rows, true)?.is_some();
        let text = explain(statement, bounds, &rows, at_all)?;
        Ok(Some(Self { rows, gap: proven, at_all, text }))
    }

    /// Searches for a time at which the neuron must fire in one pattern and be silent in another with the same inputs
    /// up to that time: a proof of two rows that holds for any margin.
    pub(crate) fn of_same_inputs(statement: &Statement, bounds: &Bounds) -> Result<Option<Self>> {
        for (pattern, target) in statement.targets() {
            let t = statement.examples[pattern].targets[target];
            let same = |&q: &usize| statement.is_asked(q, t) && statement.is_same_before(t, pattern, q);
            if let Some(silent) = (0..statement.examples.len()).find(same) {
                let rows = vec![(Row::Target { pattern, target }, -1.0), (Row::Silence { pattern: silent, t }, 1.0)];
                return Self::check(statement, bounds, rows);
            }
        }
        Ok(None)
    }

    /// Searches for a target that no weights reach, or that all weights exceed: a proof of one row.
    pub(crate) fn of_one_target(statement: &Statement, bounds: &Bounds) -> Result<Option<Self>> {
        for (pattern, target) in statement.targets() {
            let row = Row::Target { pattern, target };
            for multiplier in [-1.0, 1.0] {
                if let Some(proof) = Self::check(statement, bounds, vec![(row, multiplier)])? {
                    return Ok(Some(proof));
                }
            }
        }
        Ok(None)
    }
}

/// The amount by which the least value of `g.w` within the bounds exceeds what the rows allow; `None` if rounding could
/// explain it. `bare` leaves out margin and slope.
///
/// In continuous time a margin is positive: rows that cancel without it and include one of silence prove infeasibility
/// for every margin.
fn gap(statement: &Statement, bounds: &Bounds, rows: &[(Row, f64)], bare: bool) -> Result<Option<f64>> {
    let trains = statement.trains;
    let [mut sum, mut size, mut row, mut terms] = std::array::from_fn(|_| vec![0.0; trains]);
    let (mut allowed, mut most, mut roundings) = (0.0, 0.0, 0.0_f64);
    for &(name, multiplier) in rows {
        if multiplier < 0.0 && !matches!(name, Row::Target { .. }) {
            return Ok(None);
        }
        let limit = statement.state_into(name, &mut row)? + if bare { statement.margin_of(name) } else { 0.0 };
        statement.sizes_into(name, &mut terms)?;
        roundings = roundings.max(statement.examples[name.key().1].roundings);
        for (((g, s), a), size) in sum.iter_mut().zip(&mut size).zip(&row).zip(&terms) {
            *g += multiplier * a;
            *s += (multiplier * size).abs();
        }
        allowed += multiplier * limit;
        most += (multiplier * limit).abs();
    }
    for ((s, l), u) in size.iter().zip(&bounds.lower).zip(&bounds.upper) {
        most += s * l.abs().max(u.abs());
    }
    let gap = bounds.range(&sum).0 - allowed;
    // Each term is rounded when it is computed, and once in each sum that includes it.
    let rounding = ((rows.len() + trains) as f64 + roundings) * f64::EPSILON * most;
    let strict = bare && statement.neuron.time == Time::Continuous;
    let cancels = strict && allowed == 0.0 && sum.iter().all(|&g| g == 0.0);
    let asks = |&(name, multiplier): &(Row, f64)| multiplier > 0.0 && matches!(name, Row::Silence { .. });
    Ok((gap > TWICE_COMPUTED * rounding || cancels && rows.iter().any(asks)).then_some(gap))
}

fn explain(statement: &Statement, bounds: &Bounds, rows: &[(Row, f64)], at_all: bool) -> Result<String> {
    let mv = |potential: f64| short(potential * statement.unit);
    let mut text = match rows {
        [(row @ Row::Target { pattern, target }, _)] => {
            let stated = statement.state(*row)?;
            let (least, most) = bounds.range(&stated.coefficients);
            let t = statement.time(*row);
            let (which, give) = if most < stated.limit { ("largest", most) } else { ("smallest", least) };
            let why = if stated.coefficients.iter().all(|&a| a == 0.0) {
                "no input before this time has an effect".to_owned()
            } else {
                let (give, threshold) = (mv(give), mv(stated.limit));
                format!("the {which} allowed weights give {give} mV at this time, but the threshold is {threshold} mV")
            };
            format!(
                "with weights within the bounds, the neuron cannot fire in pattern {pattern} at target {target} ({} \
                 ms): {why}",
                short(t)
            )
        }
        [(Row::Target { pattern, target }, fires), (Row::Silence { pattern: silent, t }, rests)]
            if -fires == *rests && statement.is_same_before(*t, *pattern, *silent) =>
        {
            format!(
                "pattern {pattern} must fire at target {target} ({} ms), but pattern {silent}, whose inputs are the \
                 same up to this time, must be silent",
                short(*t)
            )
        }
        _ => format!("no weights within the bounds can do all of this: {}", list(statement, rows)?),
    };
    let Margin { height, slope } = statement.margin.times(statement.unit);
    if at_all {
        text += ". Without a margin this is impossible too";
    } else {
        text += &format!(". This is proven for silence {height} mV below the threshold");
        if slope > 0.0 {
            text += &format!(" and a slope of {slope} mV/ms or more at targets");
        }
    }
    Ok(text)
}

/// The text for the rows with the largest terms, pattern by pattern.
fn list(statement: &Statement, rows: &[(Row, f64)]) -> Result<String> {
    let mut weighed = Vec::with_capacity(rows.len());
    for &(row, multiplier) in rows {
        let stated = statement.state(row)?;
        let length = dot(&stated.coefficients, &stated.coefficients).sqrt();
        weighed.push((multiplier.abs() * length.max(stated.limit.abs()), row));
    }
    weighed.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut by_pattern: BTreeMap<usize, Vec<String>> = BTreeMap::new();
    for &(_, row) in weighed.iter().take(NAMED) {
        let t = short(statement.time(row));
        let (pattern, asked) = match row {
            Row::Target { pattern, target } => (pattern, format!("fire at target {target} ({t} ms)")),
            Row::Slope { pattern, target } => (pattern, format!("reach target {target} ({t} ms) from below")),
            Row::Silence { pattern, .. } => (pattern, format!("be silent at {t} ms")),
        };
        by_pattern.entry(pattern).or_default().push(asked);
    }
    let parts: Vec<String> =
        by_pattern.iter().map(|(pattern, asked)| format!("pattern {pattern} must {}", asked.join(", "))).collect();
    let more = rows.len().saturating_sub(NAMED);
    Ok(if more > 0 { format!("{}; and {more} rows of less weight", parts.join("; ")) } else { parts.join("; ") })
}

fn short(x: f64) -> String {
    let text = format!("{x:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
