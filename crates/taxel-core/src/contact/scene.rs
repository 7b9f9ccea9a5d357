//! What happens to the ball, drawn by a seed.

use rand::Rng;
use rand::SeedableRng;
use rand::rngs::StdRng;
use serde::{Deserialize, Serialize};

use super::Foam;
use crate::allowed::is_above_0;
use crate::{Array, Error, Result};

/// How far from the array's edge drawn scenes stay, mm: within it the layer's influence would be cut off.
const MARGIN_MM: f64 = 36.0;

/// A rigid ball.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ball {
    /// mm.
    pub radius_mm: f64,
    /// g.
    pub mass_g: f64,
}

/// A press by hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Press {
    /// Force while held, N.
    pub peak_n: f64,
    /// How fast the hand goes down and up, mm/s.
    pub speed_mm_s: f64,
    /// How long it holds, ms.
    pub hold_ms: f64,
    /// Between the catch and the press, ms.
    pub wait_ms: f64,
}

/// What becomes of the ball.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// A hand catches it at the top of its flight after so many impacts, presses it into the foam and lifts it.
    Caught {
        /// Impacts before the catch, the first one counted.
        after: u32,
        /// What the hand does then.
        press: Press,
    },
    /// Nobody catches it; a hand lifts it after a while.
    LeftToRest {
        /// From the drop to the lift, ms.
        rest_ms: f64,
        /// How fast the hand lifts, mm/s.
        lift_mm_s: f64,
    },
}

/// A ball dropped on the array, and what becomes of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// The ball.
    pub ball: Ball,
    /// The foam that it falls on.
    pub foam: Foam,
    /// Where, mm to the right of the first taxel.
    pub x_mm: f64,
    /// Where, mm below the first taxel.
    pub y_mm: f64,
    /// From how high above the foam, mm.
    pub drop_mm: f64,
    /// Before it is let go, ms.
    pub lead_ms: f64,
    /// What becomes of it.
    pub ending: Ending,
    /// After all is over, ms.
    pub tail_ms: f64,
}

pub(super) fn check_radius(radius_mm: f64, foam: &Foam) -> Result<()> {
    if !(radius_mm.is_finite() && radius_mm > foam.thickness_mm && radius_mm <= 60.0) {
        let thick = foam.thickness_mm;
        return Err(Error::Scene(format!(
            "ball: radius_mm is {radius_mm}: must be above {thick} (the foam), at most 60"
        )));
    }
    Ok(())
}

impl Scene {
    /// Draws scene `index` of a seed: a ball of 36 g and 25 to 35 mm radius from 0.1 to 0.2 m onto foam of 50 to 75
    /// kPa, somewhere on the array; caught after 2 to 4 impacts and pressed with 0.2 to 5 N, or left to rest.
    ///
    /// # Errors
    ///
    /// `Scene` where the array is too small to keep 36 mm from its edge.
    pub fn draw(array: &Array, seed: u64, index: u32, left_to_rest: bool) -> Result<Self> {
        let mut draw = StdRng::seed_from_u64(seed);
        // Each scene has a stretch of the stream for itself, so that it does not hang on how many are played.
        for _ in 0..index {
            draw = StdRng::from_rng(&mut draw);
        }
        let mut between = |low: f64, high: f64| draw.random_range(low..=high);
        let width = f64::from(array.columns - 1) * array.pitch_mm - 2.0 * MARGIN_MM;
        let height = f64::from(array.rows - 1) * array.pitch_mm - 2.0 * MARGIN_MM;
        if width < 0.0 || height < 0.0 {
            return Err(Error::Scene(format!(
                "array of {} x {} taxels, {} mm apart: too small for scenes that keep {MARGIN_MM} mm from its edge",
                array.rows, array.columns, array.pitch_mm
            )));
        }
        let ball = Ball { radius_mm: between(25.0, 35.0), mass_g: 36.0 };
        let foam = Foam { modulus_kpa: between(50.0, 75.0), damping_s_m: between(0.1, 0.3), ..Foam::default() };
        let (x_mm, y_mm) = (MARGIN_MM + between(0.0, width), MARGIN_MM + between(0.0, height));
        let (drop_mm, lead_ms) = (between(100.0, 200.0), between(50.0, 250.0));
        let ending = if left_to_rest {
            Ending::LeftToRest { rest_ms: between(1_500.0, 2_500.0), lift_mm_s: between(20.0, 100.0) }
        } else {
            Ending::Caught {
                after: between(2.0, 4.999) as u32,
                press: Press {
                    peak_n: between(0.2_f64.ln(), 5.0_f64.ln()).exp(),
                    speed_mm_s: between(20.0, 100.0),
                    hold_ms: between(100.0, 300.0),
                    wait_ms: between(100.0, 250.0),
                },
            }
        };
        Ok(Self { ball, foam, x_mm, y_mm, drop_mm, lead_ms, ending, tail_ms: 150.0 })
    }

    /// Checks that the scene can be played.
    ///
    /// # Errors
    ///
    /// `Scene`, naming the parameter.
    pub fn check(&self) -> Result<()> {
        self.foam.check()?;
        check_radius(self.ball.radius_mm, &self.foam)?;
        let waits = |x: f64| (0.0..=60_000.0).contains(&x);
        let wrong =
            |name: &str, value: f64, right: &str| Err(Error::Scene(format!("scene: {name} is {value}: {right}")));
        if !is_above_0(self.ball.mass_g) {
            return wrong("mass_g", self.ball.mass_g, "must be above 0");
        }
        if !(is_above_0(self.drop_mm) && self.drop_mm <= 2_000.0) {
            return wrong("drop_mm", self.drop_mm, "must be above 0, at most 2000");
        }
        for (name, place) in [("x_mm", self.x_mm), ("y_mm", self.y_mm)] {
            if !place.is_finite() {
                return wrong(name, place, "must be finite");
            }
        }
        for (name, ms) in [("lead_ms", self.lead_ms), ("tail_ms", self.tail_ms)] {
            if !waits(ms) {
                return wrong(name, ms, "must be 0 to 60000");
            }
        }
        match &self.ending {
            Ending::Caught { after, press } => {
                if *after == 0 {
                    return wrong("after", 0.0, "must be 1 impact or more");
                }
                if !(is_above_0(press.peak_n) && press.peak_n <= 100.0) {
                    return wrong("peak_n", press.peak_n, "must be above 0, at most 100");
                }
                if !(press.speed_mm_s >= 1.0 && press.speed_mm_s <= 2_000.0) {
                    return wrong("speed_mm_s", press.speed_mm_s, "must be 1 to 2000");
                }
                for (name, ms) in [("hold_ms", press.hold_ms), ("wait_ms", press.wait_ms)] {
                    if !waits(ms) {
                        return wrong(name, ms, "must be 0 to 60000");
                    }
                }
            }
            Ending::LeftToRest { rest_ms, lift_mm_s } => {
                if !waits(*rest_ms) {
                    return wrong("rest_ms", *rest_ms, "must be 0 to 60000");
                }
                if !(*lift_mm_s >= 1.0 && *lift_mm_s <= 2_000.0) {
                    return wrong("lift_mm_s", *lift_mm_s, "must be 1 to 2000");
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_draws_the_same_scene_and_others_differ() {
        let array = Array::thesis();
        let scene = |seed, index| Scene::draw(&array, seed, index, false).unwrap();
        assert_eq!(scene(5, 2), scene(5, 2));
        assert_ne!(scene(5, 2), scene(5, 3));
        assert_ne!(scene(5, 2), scene(6, 2));
    }

    #[test]
    fn every_drawn_scene_can_be_played_with_any_dashpot() {
        let array = Array::thesis();
        for index in 0..60 {
            for dashpot_ms in [0.0, 0.3, 1.0] {
                let mut scene = Scene::draw(&array, 11, index, index % 4 == 0).unwrap();
                scene.foam.dashpot_ms = dashpot_ms;
                let motion = super::super::Motion::of(&scene, 48.0).unwrap();
                assert!(motion.contacts.iter().all(|c| c.stop_us.is_finite()));
            }
        }
    }

    #[test]
    fn the_hardest_drop_does_not_bottom_out() {
        let mut scene = Scene::draw(&Array::thesis(), 1, 0, false).unwrap();
        scene.ball.radius_mm = 25.0;
        scene.drop_mm = 200.0;
        scene.foam = Foam { modulus_kpa: 50.0, damping_s_m: 0.1, dashpot_ms: 0.0, ..Foam::default() };
        super::super::Motion::of(&scene, 48.0).unwrap();
    }

    type Spoil = fn(&mut Scene);

    #[test]
    fn each_nonsense_parameter_is_named() {
        let good = Scene::draw(&Array::thesis(), 1, 0, false).unwrap();
        let wrong: [(&str, Spoil); 7] = [
            ("radius_mm", |s| s.ball.radius_mm = 5.0),
            ("mass_g", |s| s.ball.mass_g = 0.0),
            ("drop_mm", |s| s.drop_mm = -1.0),
            ("x_mm", |s| s.x_mm = f64::NAN),
            ("lead_ms", |s| s.lead_ms = -1.0),
            ("after", |s| {
                if let Ending::Caught { after, .. } = &mut s.ending {
                    *after = 0
                }
            }),
            ("peak_n", |s| {
                if let Ending::Caught { press, .. } = &mut s.ending {
                    press.peak_n = 0.0
                }
            }),
        ];
        for (name, spoil) in wrong {
            let mut scene = good.clone();
            spoil(&mut scene);
            assert!(scene.check().unwrap_err().to_string().contains(name), "{name}");
        }
        assert!(Scene::draw(&Array::new(8, 8, 2.67, "small").unwrap(), 1, 0, false).is_err());
    }
}
