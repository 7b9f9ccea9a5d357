//! Sense lines whose source is at its limit: an amplifier that saturates no longer holds its line's voltage.

use super::dense::{Matrix, too_far_apart};
use crate::Result;

/// The voltages between which a source works; beyond, `ohm` connects its line to the nearer one.
///
/// An amplifier has its rails as these voltages, and its feedback resistor as `ohm`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// The lower voltage, above that of the idle lines, V.
    pub least_v: f64,
    /// The upper one, likewise.
    pub most_v: f64,
    /// The resistance between it and the line, ohm: more than the source's own.
    pub ohm: f64,
}

/// The limit that a source is at, if any.
#[derive(Debug, Clone, Copy, PartialEq)]
enum RangeEnd {
    Within,
    Least,
    Most,
}

impl Limit {
    /// Takes sources at their limits into account.
    ///
    /// `currents` are those of sources without limits, of `sense_v` behind `sense_ohm`, in ampere, `[row * columns +
    /// column]`, and are corrected; `response` gives by how much a volt more at one source moves each current, S, for all
    /// pairs, where that is needed. A source at its limit is one with so much less, or more, voltage `e`: in each column
    /// those at a limit obey `(P + 1 / (ohm - sense_ohm)) e = limit - current`, P their response to each other. Which
    /// these are is found by exchange: that matrix is positive definite, so there is one answer.
    ///
    /// # Errors
    ///
    /// `Problem` where it is not so in float64; as `response` fails.
    pub(super) fn apply(
        &self,
        sense_ohm: f64,
        sense_v: &[f64],
        currents: &mut [f64],
        response: impl FnOnce() -> Result<Vec<f64>>,
    ) -> Result<()> {
        let (rows, between) = (sense_v.len(), self.ohm - sense_ohm);
        let columns = currents.len() / rows.max(1);
        let limits: Vec<[f64; 2]> =
            sense_v.iter().map(|source| [self.least_v, self.most_v].map(|v| (v - source) / between)).collect();
        let past = |row: usize, current: f64| match limits[row] {
            [_, most] if current > most + 1e-12 * most.abs() => RangeEnd::Most,
            [least, _] if current < least - 1e-12 * least.abs() => RangeEnd::Least,
            _ => RangeEnd::Within,
        };
        let within =
            |(row, of_row): (usize, &[f64])| of_row.iter().all(|&current| past(row, current) == RangeEnd::Within);
        if currents.chunks_exact(columns.max(1)).enumerate().all(within) {
            return Ok(());
        }
        let response = response()?;
        for column in 0..columns {
            let unlimited: Vec<f64> = (0..rows).map(|row| currents[row * columns + column]).collect();
            let mut ends = vec![RangeEnd::Within; rows];
            let mut now = unlimited.clone();
            let mut moved = vec![0.0; rows];
            for round in 0.. {
                let wanted = |row: usize| match (ends[row], moved[row]) {
                    (RangeEnd::Within, _) => past(row, now[row]),
                    // A source that would have to give more than without limits is at none.
                    (RangeEnd::Most, e) if e > 0.0 => RangeEnd::Within,
                    (RangeEnd::Least, e) if e < 0.0 => RangeEnd::Within,
                    (end, _) => end,
                };
                let changes: Vec<(usize, RangeEnd)> =
                    (0..rows).map(|row| (row, wanted(row))).filter(|&(row, end)| end != ends[row]).collect();
                if changes.is_empty() {
                    break;
                }
                if round > 50 * rows {
                    return Err(too_far_apart());
                }
                // All at once is quick; one at a time, the first, is sure to end (Murty 1974).
                let at_once = if round < rows { changes.len() } else { 1 };
                changes[..at_once].iter().for_each(|&(row, end)| ends[row] = end);
                let at: Vec<usize> = (0..rows).filter(|&row| ends[row] != RangeEnd::Within).collect();
                let mut matrix = Matrix::zeros(at.len(), at.len());
                let mut right = Matrix::zeros(at.len(), 1);
                for (i, &row) in at.iter().enumerate() {
                    for (j, &limited) in at.iter().enumerate() {
                        *matrix.at_mut(i, j) = response[row * rows + limited];
                    }
                    *matrix.at_mut(i, i) += between.recip();
                    *right.at_mut(i, 0) = limits[row][usize::from(ends[row] == RangeEnd::Most)] - unlimited[row];
                }
                matrix.factor()?.solve(&mut right);
                moved.fill(0.0);
                at.iter().enumerate().for_each(|(i, &row)| moved[row] = right.at(i, 0));
                for (row, now) in now.iter_mut().enumerate() {
                    *now = unlimited[row]
                        + at.iter().map(|&limited| response[row * rows + limited] * moved[limited]).sum::<f64>();
                }
            }
            (0..rows).for_each(|row| currents[row * columns + column] = now[row]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stop;
    use crate::circuit::{Crossbar, Idle};

    /// Rows of amplifiers at 1.3 V whose rails lie at 0 and 5 V, 47 kOhm.
    fn grid(rows: usize, columns: usize, sense_ohm: f64, wire_ohm: f64) -> Crossbar {
        let limit = Some(Limit { least_v: -1.3, most_v: 3.7, ohm: 47e3 });
        Crossbar { rows, columns, sense_ohm, drive_ohm: 20.0, wire_ohm, idle: Idle::Held, limit }
    }

    #[test]
    fn a_taxel_by_itself_hangs_on_the_rail_by_the_feedback_resistor() {
        for (conductance, taxel_ohm) in [(1e3, 1e3), (1e6, 1.0), (1e-2, 1e8)] {
            let got = grid(1, 1, 0.0, 0.0).currents_ua(&[conductance], -1.3, &[0.0], Stop::never()).unwrap()[0];
            let held = 1.3e6 / (20.0 + taxel_ohm);
            let wanted = if held * 47e-3 > 3.7 { 5e6 / (47e3 + 20.0 + taxel_ohm) } else { held };
            assert!((got - wanted).abs() < 1e-9 * wanted, "{conductance}: {got} {wanted}");
        }
    }

    #[test]
    fn each_source_is_within_its_limits_or_at_one_whatever_the_network() {
        // By what each line's current and voltage are: of the network alone, without what the limit was solved by.
        let mut ends = [0; 3];
        for (seed, sense_ohm, wire_ohm) in [(1, 0.0, 0.0), (2, 47.0, 0.0), (3, 470.0, 3.0), (4, 0.5, 0.0)] {
            let (n, m) = (6, 5);
            let grid = grid(n, m, sense_ohm, wire_ohm);
            let draw = |at: usize| ((at + seed * 17) * 2_654_435_761 % 1009) as f64 / 1009.0;
            let g: Vec<f64> = (0..n * m).map(|at| 10f64.powf(5.0 * draw(at) - 1.0)).collect();
            // Offsets so large that some rows end at the lower rail.
            let sense_v: Vec<f64> = (0..n).map(|i| 3.0 * (draw(100 + i) - 0.7)).collect();
            let got = grid.currents_ua(&g, -1.3, &sense_v, Stop::never()).unwrap();
            for column in 0..m {
                let current = |i: usize| 1e-6 * got[i * m + column];
                // What the sources' voltages must have been, by the law of each, where it is.
                let source: Vec<f64> = (0..n)
                    .map(|i| {
                        let [least, most] = [-1.3, 3.7].map(|v| (v - sense_v[i]) / (47e3 - sense_ohm));
                        let (end, from) = if current(i) > most * (1.0 + 1e-9) {
                            (2, Some(3.7))
                        } else if current(i) < least - 1e-9 * least.abs() {
                            (0, Some(-1.3))
                        } else {
                            (1, None)
                        };
                        ends[end] += 1;
                        from.map_or(sense_v[i], |v| v - (47e3 - sense_ohm) * current(i))
                    })
                    .collect();
                let free = Crossbar { limit: None, ..grid };
                let again = free.currents_ua(&g, -1.3, &source, Stop::never()).unwrap();
                for i in 0..n {
                    let (a, b) = (got[i * m + column], again[i * m + column]);
                    assert!((a - b).abs() < 1e-7 * a.abs().max(1.0), "{seed}, row {i}: {a} {b}");
                }
            }
        }
        assert!(ends.iter().all(|&count| count > 5), "{ends:?}");
    }
}
