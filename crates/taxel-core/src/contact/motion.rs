//! A scene worked out: each body's trajectory at even steps, and all touches.

use super::trajectory::{MOST_STEPS, Track, Trajectory, too_many};
use super::{Bonded, Contact, Narrow, Push, Scene};
use crate::spikes::us;
use crate::{Array, Error, Result, Stop};

/// A scene, worked out.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    /// Each body's trajectory; all have the same number of steps.
    pub tracks: Vec<Track>,
    /// The law by which the foam pushes each body back.
    pub pushes: Vec<Push>,
    /// The touches, by time; us from the scene's start.
    pub contacts: Vec<Contact>,
    /// The narrowest of the touches that are narrower than cells resolve.
    pub narrow: Option<Narrow>,
}

impl Motion {
    /// Works a scene out in steps of `step_us`; entry k of a track holds the state k steps after its start.
    ///
    /// # Errors
    ///
    /// `Scene` where its parameters make no sense, a body bottoms out, rolls or slides off the array, is lifted before
    /// it lands, or comes to rest before it can be caught; where the scene has more than 2e7 steps. `Interrupted`.
    pub fn compute(scene: &Scene, array: &Array, step_us: f64, stop: Stop<'_>) -> Result<Self> {
        scene.check(array)?;
        check_step(scene, step_us)?;
        let mut layer = Bonded::new(&scene.foam, array, scene.cells_per_pitch, stop)?;
        Self::compute_on(scene, array, &mut layer, step_us, stop)
    }

    /// As [`Motion::compute`], of a scene that was checked, on its foam.
    ///
    /// # Errors
    ///
    /// As [`Motion::compute`].
    pub fn compute_on(scene: &Scene, array: &Array, layer: &mut Bonded, step_us: f64, stop: Stop<'_>) -> Result<Self> {
        check_step(scene, step_us)?;
        let mut trajectories = vec![];
        for (n, body) in scene.bodies.iter().enumerate() {
            let push = Push::new(&scene.foam, body, layer, stop)?;
            let mut trajectory = Trajectory::new(scene, body, push, step_us * 1e-3, stop);
            trajectory
                .run()
                .and_then(|()| trajectory.stays_on(array, step_us))
                .map_err(|error| if scene.bodies.len() > 1 { error.in_part(&format!("bodies[{n}]")) } else { error })?;
            trajectories.push(trajectory);
        }
        let over = trajectories.iter().map(Trajectory::steps).max().unwrap_or(0);
        let mut motion = Self::default();
        for mut trajectory in trajectories {
            trajectory.wait_until(over)?;
            trajectory.wait(scene.tail_ms)?;
            motion.tracks.push(trajectory.track);
            motion.pushes.push(trajectory.push);
            motion.contacts.append(&mut trajectory.contacts);
        }
        motion.contacts.sort_by(|a, b| a.start_us.total_cmp(&b.start_us));
        motion.narrow = Narrow::find(scene, array, &motion.tracks)?;
        Ok(motion)
    }

    /// How many steps there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.tracks.first().map_or(0, |track| track.force_n.len())
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Force of all bodies on the foam after `k` steps, N.
    #[must_use]
    pub fn force_n(&self, k: usize) -> f32 {
        self.tracks.iter().map(|track| track.force_n[k]).sum()
    }
}

/// Refuses a step that is none, or in so many of which the scene would be played that it would not end.
fn check_step(scene: &Scene, step_us: f64) -> Result<()> {
    if !(step_us.is_finite() && step_us > 0.0 && step_us <= 1000.0) {
        return Err(Error::scene(format!("step is {step_us} us: must be above 0, at most 1000")));
    }
    let least_us = us(scene.least_ms());
    if least_us / step_us > MOST_STEPS as f64 { Err(too_many(step_us)) } else { Ok(()) }
}
