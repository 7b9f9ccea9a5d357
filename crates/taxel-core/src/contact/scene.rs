//! A scene: bodies over the array and their motions, written by hand or drawn by a seed.

use rand::Rng;
use rand::SeedableRng;
use rand::rngs::StdRng;
use serde::{Deserialize, Serialize};

use super::body::WAIT;
use super::bonded::check_cells;
use super::{Body, BodyShape, Ending, Foam, Move, Press, pitch_of, within};
use crate::allowed::Range;
use crate::{Array, Error, Result};

/// How far from the array's edge drawn scenes stay, mm: nearer to it the layer's influence would be cut off.
const MARGIN_MM: f64 = 36.0;

/// Bodies over the array, the foam that they touch, and their motions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// How many cells of the layer lie along the pitch of taxels: more than one where a touch is narrower than some two
    /// taxels.
    #[serde(default = "one_cell", skip_serializing_if = "is_one")]
    pub cells_per_pitch: u16,
    /// The foam on the array.
    #[serde(default)]
    pub foam: Foam,
    /// The bodies; where several lie over a taxel, the lowest one touches.
    pub bodies: Vec<Body>,
    /// How far the array is tilted, degrees: what falls on it falls by its slant.
    #[serde(default)]
    pub slant_deg: f64,
    /// Which way is downhill: from the rows' direction (x) towards the columns' (y), degrees.
    #[serde(default)]
    pub downhill_deg: f64,
    /// Before anything happens, ms.
    #[serde(default)]
    pub lead_ms: f64,
    /// After all is over, ms.
    #[serde(default)]
    pub tail_ms: f64,
}

fn one_cell() -> u16 {
    1
}

fn is_one(value: &u16) -> bool {
    *value == 1
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
        // Each scene has its own part of the random stream, so that it does not depend on how many are played.
        for _ in 0..index {
            draw = StdRng::from_rng(&mut draw);
        }
        let mut between = |low: f64, high: f64| draw.random_range(low..=high);
        let pitch_mm = pitch_of(array)?;
        let width = f64::from(array.columns - 1) * pitch_mm - 2.0 * MARGIN_MM;
        let height = f64::from(array.rows - 1) * pitch_mm - 2.0 * MARGIN_MM;
        if width < 0.0 || height < 0.0 {
            return Err(Error::scene(format!(
                "array of {} x {} taxels, {pitch_mm} mm apart: is too small; drawn scenes need a margin of \
                 {MARGIN_MM} mm to its edges",
                array.rows, array.columns
            )));
        }
        let shape = BodyShape::Sphere { radius_mm: between(25.0, 35.0) };
        let foam = Foam { modulus_kpa: between(50.0, 75.0), damping_s_m: between(0.1, 0.3), ..Foam::default() };
        let (x_mm, y_mm) = (MARGIN_MM + between(0.0, width), MARGIN_MM + between(0.0, height));
        let (height_mm, lead_ms) = (between(100.0, 200.0), between(50.0, 250.0));
        let ending = if left_to_rest {
            Ending::LeftToRest { rest_ms: between(1_500.0, 2_500.0), lift_mm_s: between(20.0, 100.0) }
        } else {
            Ending::Caught {
                after: between(2.0, 4.999) as u32,
                press: Press {
                    peak_n: Some(between(0.2_f64.ln(), 5.0_f64.ln()).exp()),
                    depth_mm: None,
                    speed_mm_s: between(20.0, 100.0),
                    hold_ms: between(100.0, 300.0),
                    wait_ms: between(100.0, 250.0),
                },
            }
        };
        let body = Body {
            shape,
            x_mm,
            y_mm,
            mass_g: Some(36.0),
            material: None,
            stiffness_n_mm: None,
            friction: 0.6,
            rolling_friction: 0.03,
            after_ms: 0.0,
            motion: Move::Dropped { height_mm, ending },
        };
        Ok(Self {
            cells_per_pitch: 1,
            foam,
            bodies: vec![body],
            slant_deg: 0.0,
            downhill_deg: 0.0,
            lead_ms,
            tail_ms: 150.0,
        })
    }

    /// The least time that the scene lasts, ms, as known before its motion is computed.
    pub(super) fn least_ms(&self) -> f64 {
        let longest = self.bodies.iter().map(Body::least_ms).fold(0.0, f64::max);
        self.lead_ms + longest + self.tail_ms
    }

    /// Checks that the scene can be played on an array.
    ///
    /// # Errors
    ///
    /// `Scene`, naming the parameter.
    pub fn check(&self, array: &Array) -> Result<()> {
        self.foam.check()?;
        let pitch_mm = pitch_of(array)?;
        check_cells(&self.foam, array, self.cells_per_pitch)?;
        within("scene", "lead_ms", self.lead_ms, "ms", WAIT)?;
        within("scene", "tail_ms", self.tail_ms, "ms", WAIT)?;
        within("scene", "slant_deg", self.slant_deg, "degrees", Range::within(0.0, 80.0))?;
        within("scene", "downhill_deg", self.downhill_deg, "degrees", Range::FINITE)?;
        if self.bodies.is_empty() {
            return Err(Error::scene("scene: bodies is empty: must contain one body or more"));
        }
        for (n, body) in self.bodies.iter().enumerate() {
            let path = format!("bodies[{n}]");
            body.check(&path)?;
            let last = |count: u16| Range::within(0.0, f64::from(count - 1) * pitch_mm);
            let off = |error: Error| Error::scene(format!("{error} (the body is off the array)"));
            within(&path, "x_mm", body.x_mm, "mm", last(array.columns)).map_err(off)?;
            within(&path, "y_mm", body.y_mm, "mm", last(array.rows)).map_err(off)?;
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
                let motion = super::super::Motion::compute(&scene, &array, 48.0, crate::Stop::never()).unwrap();
                assert!(motion.contacts.iter().all(|c| c.stop_us.is_finite()));
            }
        }
    }

    #[test]
    fn the_hardest_drop_does_not_bottom_out() {
        let mut scene = Scene::draw(&Array::thesis(), 1, 0, false).unwrap();
        scene.bodies[0].shape = BodyShape::Sphere { radius_mm: 25.0 };
        if let Move::Dropped { height_mm, .. } = &mut scene.bodies[0].motion {
            *height_mm = 200.0;
        }
        scene.foam = Foam { modulus_kpa: 50.0, damping_s_m: 0.1, dashpot_ms: 0.0, ..Foam::default() };
        super::super::Motion::compute(&scene, &Array::thesis(), 48.0, crate::Stop::never()).unwrap();
    }

    fn dropped(scene: &mut Scene) -> (&mut f64, &mut u32, &mut Press) {
        match &mut scene.bodies[0].motion {
            Move::Dropped { height_mm, ending: Ending::Caught { after, press } } => (height_mm, after, press),
            other => panic!("{other:?}"),
        }
    }

    type Spoil = fn(&mut Scene);

    #[test]
    fn each_nonsense_parameter_is_named() {
        let good = Scene::draw(&Array::thesis(), 1, 0, false).unwrap();
        good.check(&Array::thesis()).unwrap();
        let wrong: [(&str, Spoil); 11] = [
            ("radius_mm", |s| s.bodies[0].shape = BodyShape::Sphere { radius_mm: -5.0 }),
            ("slant_deg", |s| s.slant_deg = 90.0),
            ("mass_g", |s| s.bodies[0].mass_g = Some(0.0)),
            ("mass_g", |s| s.bodies[0].mass_g = None),
            ("height_mm", |s| *dropped(s).0 = -1.0),
            ("x_mm", |s| s.bodies[0].x_mm = f64::NAN),
            ("off the array", |s| s.bodies[0].y_mm = 169.0),
            ("lead_ms", |s| s.lead_ms = -1.0),
            ("after", |s| *dropped(s).1 = 0),
            ("peak_n", |s| dropped(s).2.peak_n = Some(0.0)),
            ("depth_mm", |s| dropped(s).2.depth_mm = Some(1.0)),
        ];
        for (name, spoil) in wrong {
            let mut scene = good.clone();
            spoil(&mut scene);
            let text = scene.check(&Array::thesis()).unwrap_err().to_string();
            assert!(text.contains(name), "{name}: {text}");
        }
        assert!(Scene::draw(&Array::new(8, 8, 2.67, "small").unwrap(), 1, 0, false).is_err());
    }
}
