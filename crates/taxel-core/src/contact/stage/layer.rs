//! Bodies on the bonded layer, as the taxels sense them.

use super::super::bonded::MOST_SWEPT;
use super::super::push::Sinking;
use super::super::{BodyShape, Bonded, Motion, Scene, Taxels};
use crate::{Array, Result, Stop};

/// The board's lines are read in four groups a frame, each as the touch then is.
pub(super) const GROUPS: usize = 4;

/// The delay of the fabric's response, us (thesis 4.4.1).
const FABRIC_US: f64 = 50.0;

/// Stress that no taxel senses, MPa: a millionth of a newton on it, a hundred-thousandth of what the thesis could detect.
const FAINT_MPA: f32 = 2e-7;

/// The layer, the bodies' motion, and the latest solutions.
///
/// The layer is solved at even steps, one per frame for a ball or two, fewer where more taxels are touched than sweeps
/// solve in time; between them stress follows straight lines.
#[derive(Debug)]
pub(super) struct LayerScene {
    layer: Bonded,
    shapes: Vec<BodyShape>,
    pub motion: Motion,
    sinking: Sinking,
    /// From one solution to the next, in steps of the motion.
    interval: usize,
    /// The latest solutions, by their number; the newest last.
    solved: Vec<Solved>,
    pressure: Vec<f64>,
    pressed: [bool; GROUPS],
    columns: usize,
}

#[derive(Debug, Default)]
struct Solved {
    number: usize,
    touches: bool,
    /// Stress at the base by taxel, MPa.
    base: Vec<f32>,
}

/// Number of frames between two solutions where a whole array is touched.
const SELDOM: usize = 4;

impl LayerScene {
    /// Finds how many cells the bodies touch at most, and so how often the layer is solved.
    pub fn new(scene: &Scene, layer: Bonded, motion: Motion, array: &Array) -> Self {
        let shapes: Vec<BodyShape> = scene.bodies.iter().map(|body| body.shape.clone()).collect();
        let mut stress = Self {
            layer,
            shapes,
            motion,
            sinking: Sinking::default(),
            interval: GROUPS,
            solved: vec![],
            pressure: vec![],
            pressed: [false; GROUPS],
            columns: usize::from(array.columns),
        };
        let most = (0..stress.motion.len()).step_by(50 * GROUPS).map(|k| stress.sink(k)).max().unwrap_or(0);
        if most > MOST_SWEPT {
            stress.interval = SELDOM * GROUPS;
        }
        stress.layer.forget();
        stress
    }

    /// Finds the cells that are touched after `k` steps; how many there are.
    fn sink(&mut self, k: usize) -> usize {
        let bodies: Vec<(&BodyShape, (f64, f64), f64)> = self
            .shapes
            .iter()
            .zip(&self.motion.tracks)
            .map(|(shape, track)| {
                let depth = if track.force_n[k] > 0.0 { f64::from(track.depth_mm[k]) } else { 0.0 };
                (shape, (f64::from(track.x_mm[k]), f64::from(track.y_mm[k])), depth)
            })
            .collect();
        self.sinking.find(&self.layer, &bodies);
        self.sinking.cells.len()
    }

    /// Solves the layer at one of the even steps, where that is not known yet.
    fn solve(&mut self, number: usize, stop: Stop<'_>) -> Result<()> {
        if self.solved.iter().any(|solved| solved.number == number) {
            return Ok(());
        }
        let mut solved = if self.solved.len() < 3 { Solved::default() } else { self.solved.remove(0) };
        let k = (number * self.interval).min(self.motion.len() - 1);
        solved.number = number;
        solved.touches = self.sink(k) > 0;
        if solved.touches {
            // Losses raise the force of a moving body above that of one at rest.
            let gain: Vec<f64> = (0..self.shapes.len())
                .map(|n| {
                    let track = &self.motion.tracks[n];
                    let rest = self.motion.pushes[n].force_at_depth(f64::from(track.depth_mm[k]));
                    if rest > 0.0 { f64::from(track.force_n[k]) / rest } else { 0.0 }
                })
                .collect();
            self.pressure.clear();
            let pressed = self.layer.press(&self.sinking.cells, stop)?;
            self.pressure.extend(pressed.iter().zip(&self.sinking.whose).map(|(p, n)| p * gain[*n as usize]));
            self.layer.arrive(&self.sinking.cells, &self.pressure, &mut solved.base, stop)?;
        } else {
            self.layer.forget();
            solved.base.clear();
            solved.base.resize(self.layer.taxels(), 0.0);
        }
        self.solved.push(solved);
        Ok(())
    }

    /// Writes what the board reads in a frame into `clean`.
    ///
    /// # Errors
    ///
    /// `Interrupted`.
    pub fn show(
        &mut self,
        frame: usize,
        frame_us: f64,
        taxels: &Taxels,
        clean: &mut [f32],
        stop: Stop<'_>,
    ) -> Result<()> {
        (0..GROUPS).try_for_each(|group| self.group(group, steps_before(frame, group, frame_us), taxels, clean, stop))
    }

    /// Writes what a group of lines reads, `steps` steps after the start, into `clean`.
    fn group(&mut self, group: usize, steps: f64, taxels: &Taxels, clean: &mut [f32], stop: Stop<'_>) -> Result<()> {
        let number = steps as usize / self.interval;
        let share = (steps / self.interval as f64 - number as f64) as f32;
        self.solve(number, stop)?;
        self.solve(number + 1, stop)?;
        let frame = |number: usize| self.solved.iter().find(|solved| solved.number == number).expect("solved above");
        let (now, next) = (frame(number), frame(number + 1));
        if !now.touches && !next.touches && !self.pressed[group] {
            return Ok(());
        }
        self.pressed[group] = now.touches || next.touches;
        let edge = |group: usize| (group * self.columns).div_ceil(GROUPS);
        let lines = edge(group)..edge(group + 1);
        let by_row = now.base.chunks_exact(self.columns).zip(next.base.chunks_exact(self.columns));
        for (row, ((now, next), clean)) in by_row.zip(clean.chunks_exact_mut(self.columns)).enumerate() {
            for column in lines.clone() {
                let stress = now[column] + share * (next[column] - now[column]);
                let drive = if stress > FAINT_MPA { taxels.drive(stress) } else { 0.0 };
                clean[column] = taxels.ticks(row * self.columns + column, drive);
            }
        }
        Ok(())
    }
}

/// When a group of lines is read that shows the touch of `GROUPS` steps a frame.
fn steps_before(frame: usize, group: usize, frame_us: f64) -> f64 {
    let lag = FABRIC_US / (frame_us / GROUPS as f64) - 0.5;
    ((GROUPS * frame + group) as f64 - lag).max(0.0)
}
