//! One ball that moves straight up and down on columns, as the taxels sense it.

use super::super::{BodyShape, Footprint, Scene, Taxels, Track, pitch_of};
use super::groups::{GROUPS, steps_before};
use crate::{Array, Result};

/// The ball's track, where its force arrives, and which taxels it can reach, by group of lines.
#[derive(Debug)]
pub(super) struct BallOnColumns {
    pub track: Track,
    footprint: Footprint,
    reach: [Vec<Reached>; GROUPS],
    pressed: [bool; GROUPS],
    profile: Vec<f32>,
    drive: Vec<f32>,
}

/// A taxel that a ball can reach, and where it lies among the footprint's rings.
#[derive(Debug)]
struct Reached {
    index: u32,
    ring: u32,
    share: f32,
}

impl BallOnColumns {
    /// Works out the footprint, some milliseconds, and the taxels that the ball can reach.
    ///
    /// # Errors
    ///
    /// `Scene` where the body is no ball, or the foam makes no sense.
    pub fn new(scene: &Scene, track: Track, array: &Array) -> Result<Self> {
        let body = &scene.bodies[0];
        let (x_mm, y_mm) = (body.x_mm, body.y_mm);
        let BodyShape::Sphere { radius_mm } = body.shape else {
            return Err(super::super::scene::columns_take_one_ball());
        };
        let footprint = Footprint::new(&scene.foam, radius_mm)?;
        let pitch_mm = pitch_of(array)?;
        let mut reach = [const { Vec::new() }; GROUPS];
        for y in 0..array.rows {
            for x in 0..array.columns {
                let across = f64::from(x) * pitch_mm - x_mm;
                let along = f64::from(y) * pitch_mm - y_mm;
                if let Some((ring, share)) = Footprint::ring(across.hypot(along)) {
                    let group = GROUPS * usize::from(x) / usize::from(array.columns);
                    reach[group].push(Reached { index: array.index(x, y) as u32, ring: ring as u32, share });
                }
            }
        }
        Ok(Self { track, footprint, reach, pressed: [false; GROUPS], profile: vec![], drive: vec![] })
    }

    /// Writes what the board reads in a frame into `clean`.
    pub fn show(&mut self, frame: usize, frame_us: f64, taxels: &Taxels, clean: &mut [f32]) {
        for group in 0..GROUPS {
            let steps = steps_before(frame, group, frame_us);
            let (before, share) = ((steps as usize).min(self.track.force_n.len() - 2), steps.fract() as f32);
            let between = |v: &[f32]| v[before] + share * (v[before + 1] - v[before]);
            let force = between(&self.track.force_n);
            if force == 0.0 && !self.pressed[group] {
                continue;
            }
            self.pressed[group] = force > 0.0;
            self.footprint.profile(f64::from(between(&self.track.depth_mm)), &mut self.profile);
            self.drive.clear();
            self.drive.extend(self.profile.iter().map(|stress| taxels.drive(stress * force)));
            for at in &self.reach[group] {
                let (ring, index) = (at.ring as usize, at.index as usize);
                let drive = self.drive[ring] + at.share * (self.drive[ring + 1] - self.drive[ring]);
                clean[index] = taxels.ticks(index, drive);
            }
        }
    }
}
