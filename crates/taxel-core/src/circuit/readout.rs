//! How lines are driven, and the voltage that the current of a sense line gives.

use rand::SeedableRng;
use rand::rngs::StdRng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::grid::Crossbar;
use crate::Result;
use crate::allowed::Range;
use crate::parameters::parameters;

/// Resistances of switches, ohm.
const SWITCH: Range = Range::FROM_0.at_most(1e9);

parameters! {
    /// Rows held by transimpedance amplifiers and columns by switches, all at one voltage; the read column is at ground
    /// (thesis 4.3.2). Ideal it gives `V = V_trans (1 + R_f G)` of each taxel by itself.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct VirtualGround {
        /// Voltage of the lines, V (thesis 4.4.1).
        pub v_trans: f64 = 1.3, "V", Range::ABOVE_0.at_most(1e3);
        /// Feedback resistor, kOhm (thesis 4.3.2).
        pub feedback_kohm: f64 = 47.0, "kOhm", Range::ABOVE_0.at_most(1e6);
        /// Open-loop gain of the amplifiers; nothing: without bound. A guess.
        pub gain: Option<f64> = Some(1e5), "", Range::FROM_1;
        /// How far the amplifiers' offsets differ: standard deviation, mV.
        pub offset_mv: f64 = 0.0, "mV", Range::FROM_0.at_most(1e6);
        /// A column's switch, ohm: an ADG734's (typical).
        pub switch_ohm: f64 = 2.5, "ohm", SWITCH;
        /// Where the amplifiers saturate, V; the lines of those that do count as held.
        pub rail_v: f64 = 5.0, "V", Range::ABOVE_0;
        /// The seed of the offsets.
        pub seed: u64 = 0;
    }
}

impl VirtualGround {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    /// The amplifier's voltage for one taxel by itself, V, without its rails.
    #[must_use]
    pub fn volts_alone(&self, conductance_us: f64) -> f64 {
        self.v_trans * (1.0 + 1e-3 * self.feedback_kohm * conductance_us)
    }

    /// The conductance of a taxel by itself at this voltage of the amplifier, uS: the inverse of the former.
    #[must_use]
    pub fn conductance_us_alone(&self, volts: f64) -> f64 {
        (volts / self.v_trans - 1.0) / (1e-3 * self.feedback_kohm)
    }

    /// Each amplifier's voltage while each column is read, V, `[row * columns + column]`, as the conductances are.
    ///
    /// # Errors
    ///
    /// As [`Crossbar::currents_ua`].
    pub fn volts(&self, rows: usize, columns: usize, conductance_us: &[f64]) -> Result<Vec<f64>> {
        let feedback_ohm = 1e3 * self.feedback_kohm;
        // An amplifier's input is its source V_trans A / (1 + A) behind R_f / (1 + A).
        let share = self.gain.map_or(0.0, |gain| (1.0 + gain).recip());
        let grid = Crossbar { rows, columns, sense_ohm: feedback_ohm * share, drive_ohm: self.switch_ohm };
        let mut draw = StdRng::seed_from_u64(self.seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut draw) };
        let offsets = (0..rows).map(|_| 1e-3 * self.offset_mv * normal());
        let source: Vec<f64> = offsets.map(|offset| offset * (1.0 - share) - self.v_trans * share).collect();
        let mut volts = grid.currents_ua(conductance_us, -self.v_trans, &source)?;
        let per_ua = 1e-6 * (feedback_ohm - grid.sense_ohm);
        for (row, source) in volts.chunks_exact_mut(columns.max(1)).zip(&source) {
            for volts in row {
                *volts = (self.v_trans + source + per_ua * *volts).clamp(0.0, self.rail_v);
            }
        }
        Ok(volts)
    }
}

parameters! {
    /// Rows that resistors pull to ground, one driven line at the supply, the others at ground: no amplifier, and crosstalk between taxels
    /// (thesis 3.4.2; Appendix 1, figure 1.1).
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Divider {
        /// Voltage of the driven line, V (thesis 3.4.2).
        pub supply_v: f64 = 5.0, "V", Range::ABOVE_0.at_most(1e3);
        /// The other half of the divider, kOhm. A guess.
        pub resistor_kohm: f64 = 10.0, "kOhm", Range::ABOVE_0.at_most(1e6);
        /// A driven line's switch, ohm.
        pub switch_ohm: f64 = 0.0, "ohm", SWITCH;
    }
}

impl Divider {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// As [`VirtualGround::check`].
    pub fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    /// The divider's voltage for one taxel by itself, V.
    #[must_use]
    pub fn volts_alone(&self, conductance_us: f64) -> f64 {
        let ratio = 1e-3 * self.resistor_kohm * conductance_us;
        self.supply_v * ratio / (1.0 + ratio)
    }

    /// Each sense line's voltage while each driven line is at the supply, V, as [`VirtualGround::volts`].
    ///
    /// # Errors
    ///
    /// As [`Crossbar::currents_ua`].
    pub fn volts(&self, rows: usize, columns: usize, conductance_us: &[f64]) -> Result<Vec<f64>> {
        let sense_ohm = 1e3 * self.resistor_kohm;
        let grid = Crossbar { rows, columns, sense_ohm, drive_ohm: self.switch_ohm };
        let currents = grid.currents_ua(conductance_us, self.supply_v, &vec![0.0; rows])?;
        Ok(currents.iter().map(|current| -1e-6 * sense_ohm * current).collect())
    }
}
