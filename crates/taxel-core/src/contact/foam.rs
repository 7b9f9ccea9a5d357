//! Open-cell foam: stress of a strain in a column.

use serde::{Deserialize, Serialize};

use super::{of_scene, within};
use crate::Result;
use crate::allowed::Range;
use crate::parameters::parameters;

parameters! {
    /// Open-cell foam: elastic, then collapsing, then dense (Gibson and Ashby, *Cellular Solids*, chapter 5).
    ///
    /// Stress is `E e` up to the yield strain, then `E e_y ((e_D - e_y) / (e_D - e))^m`, and from 0.02 before `e_D`,
    /// where the solid itself is pressed, straight on. Two losses come on top: Hunt and Crossley's `F (1 + chi v)`, and
    /// a dashpot in each column, `F + eta v dF/dd`.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Foam {
        /// Young's modulus E, kPa. A guess: makers' foams lie between 20 and 100.
        pub modulus_kpa: f64 = 60.0, "kPa", Range::ABOVE_0;
        /// The thickness of the layer, mm (thesis 4.3.1).
        pub thickness_mm: f64 = 10.0, "mm", Range::ABOVE_0;
        /// Poisson's ratio in compression.
        pub poisson: f64 = 0.0, "", Range::FROM_0.below(0.5);
        /// Strain e_y at which cells collapse.
        pub yield_strain: f64 = 0.05;
        /// Strain e_D at which the walls all touch.
        pub densification_strain: f64 = 0.95, "", Range::ABOVE_0.at_most(1.0);
        /// Exponent m of the stress between collapse and e_D, between 1 and 2.
        pub exponent: f64 = 1.2, "", Range::above(1.0).below(2.0);
        /// chi, s/m: loss that grows with speed. 0.25 sends a ball back at about three quarters of its speed.
        pub damping_s_m: f64 = 0.25, "s/m", Range::FROM_0;
        /// eta, ms: the dashpot's time. A guess, on which the demo's delays depend.
        pub dashpot_ms: f64 = 1.0, "ms", Range::FROM_0;
    }
}

/// How far before e_D the law goes straight on: the slope there, some 15 MPa, is that of solid polyurethane.
const SOLID: f64 = 0.02;

impl Foam {
    /// Checks that the law makes sense.
    ///
    /// # Errors
    ///
    /// `Scene`, naming the parameter.
    pub fn check(&self) -> Result<()> {
        of_scene("foam", self.check_ranges())?;
        let below_solid = Range::ABOVE_0.below(self.densification_strain - SOLID);
        within("foam", "yield_strain", self.yield_strain, "", below_solid)
    }

    /// The deepest that anything can sink: the layer's thickness, mm.
    #[must_use]
    pub fn floor_mm(&self) -> f64 {
        self.thickness_mm
    }

    /// The law's middle part, without its end.
    fn collapse_kpa(&self, strain: f64) -> f64 {
        let left = self.densification_strain - self.yield_strain;
        self.modulus_kpa * self.yield_strain * (left / (self.densification_strain - strain)).powf(self.exponent)
    }

    /// Where the solid begins: strain, stress in kPa, slope in kPa.
    fn solid(&self) -> (f64, f64, f64) {
        let strain = self.densification_strain - SOLID;
        let stress = self.collapse_kpa(strain);
        (strain, stress, self.exponent * stress / SOLID)
    }

    /// Stress of a strain at rest, kPa; 0 where the column is not pressed.
    #[must_use]
    pub fn stress_kpa(&self, strain: f64) -> f64 {
        if strain <= self.yield_strain {
            return self.modulus_kpa * strain.max(0.0);
        }
        if strain <= self.densification_strain - SOLID {
            return self.collapse_kpa(strain);
        }
        let (begins, stress, slope) = self.solid();
        stress + slope * (strain - begins)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stress_rises_without_a_jump() {
        let foam = Foam::default();
        let stresses: Vec<f64> = (0..9_490).map(|k| foam.stress_kpa(f64::from(k) * 1e-4)).collect();
        assert!(stresses.windows(2).all(|w| w[1] >= w[0] && w[1] - w[0] < 0.03 * (1.0 + w[1])));
        assert!(foam.stress_kpa(-1.0) == 0.0);
    }

    type Spoil = fn(&mut Foam);

    #[test]
    fn each_nonsense_parameter_is_named() {
        let wrong: [(&str, Spoil); 7] = [
            ("modulus_kpa", |f| f.modulus_kpa = 0.0),
            ("thickness_mm", |f| f.thickness_mm = f64::NAN),
            ("poisson", |f| f.poisson = 0.5),
            ("yield_strain", |f| f.yield_strain = 0.96),
            ("densification_strain", |f| f.densification_strain = 1.1),
            ("exponent", |f| f.exponent = 1.0),
            ("dashpot_ms", |f| f.dashpot_ms = -0.1),
        ];
        for (name, spoil) in wrong {
            let mut foam = Foam::default();
            spoil(&mut foam);
            assert!(foam.check().unwrap_err().to_string().contains(name), "{name}");
        }
        Foam::default().check().unwrap();
    }
}
