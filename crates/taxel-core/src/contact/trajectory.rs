//! The trajectory of one body: it waits, falls, bounces, is pressed, rolls or slides, and is lifted.

use super::body::{Along, Body, Ending, Move, Press};
use super::{Contact, Push, Scene, TouchKind, pitch_of};
use crate::spikes::us;
use crate::{Array, Error, Result, Stop};

mod friction;
#[cfg(test)]
mod tests;

/// Gravity, mm/ms^2.
const GRAVITY: f64 = 9.81e-3;
/// Steps of the integrator in one that is recorded: 6 us at 5208 frames/s, where energy is kept to 0.2 %.
const INNER: u32 = 8;
/// How far above the foam a hand begins and ends a press, mm.
const CLEAR_MM: f64 = 2.0;
/// How fast a hand sets down and lifts what is to roll or slide, mm/ms.
const SET_DOWN: f64 = 0.05;
/// A body that is still bouncing, or has come to rest, this long after it was let go is not caught any more, ms.
const PATIENCE_MS: f64 = 5_000.0;
/// Between two checks whether to stop, steps: a millisecond of work or less.
const LOOK_EVERY: usize = 1_000;

/// The most steps of a scene: 16 minutes in quarters of a frame of 5208 Hz, and 320 MB for each body.
pub(super) const MOST_STEPS: usize = 20_000_000;

/// A body's trajectory, sampled at even steps.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// Where its middle is, mm right of the first taxel.
    pub x_mm: Vec<f32>,
    /// Where, mm below the first taxel.
    pub y_mm: Vec<f32>,
    /// Depth of its lowest point below the foam's face, mm; negative above it.
    pub depth_mm: Vec<f32>,
    /// Force on the foam, N.
    pub force_n: Vec<f32>,
}

/// The error of a scene that has more than [`MOST_STEPS`].
pub(super) fn too_many(step_us: f64) -> Error {
    Error::scene(format!("step is {step_us} us: must be longer, because the scene has more than {MOST_STEPS} steps"))
}

/// A body's state, and what of it has been recorded since the scene's start.
pub(super) struct Trajectory<'a> {
    scene: &'a Scene,
    body: &'a Body,
    stop: Stop<'a>,
    pub push: Push,
    inner_ms: f64,
    /// Steps of `inner_ms` since the start.
    now: u32,
    /// How far its middle is below where it would touch, mm: the depth of one that does not give.
    depth: f64,
    speed: f64,
    /// Force before it is cut off at 0, N.
    raw: f64,
    touching: bool,
    /// Its middle, mm; its speed along the foam, and that of its lowest point by its turning, mm/ms.
    position: [f64; 2],
    along: [f64; 2],
    turning: [f64; 2],
    pub track: Track,
    pub contacts: Vec<Contact>,
}

impl<'a> Trajectory<'a> {
    /// The body at rest above the foam, before the first step.
    pub fn new(scene: &'a Scene, body: &'a Body, push: Push, step_ms: f64, stop: Stop<'a>) -> Self {
        let inner_ms = step_ms / f64::from(INNER);
        let height = match &body.motion {
            Move::Dropped { height_mm, .. } => height_mm * scene.slant_deg.to_radians().cos(),
            _ => CLEAR_MM,
        };
        let mut trajectory = Self {
            scene,
            body,
            stop,
            push,
            inner_ms,
            now: 0,
            depth: -height,
            speed: 0.0,
            raw: 0.0,
            touching: false,
            position: [body.x_mm, body.y_mm],
            along: [0.0; 2],
            turning: [0.0; 2],
            track: Track::default(),
            contacts: vec![],
        };
        trajectory.record();
        trajectory
    }

    /// Moves the body through the whole of its motion.
    pub fn run(&mut self) -> Result<()> {
        self.wait(self.scene.lead_ms + self.body.after_ms)?;
        let body = self.body;
        match &body.motion {
            Move::Dropped { height_mm, ending } => {
                self.release_body(*height_mm);
                match ending {
                    Ending::Caught { after, press } => {
                        self.fall_until_caught(*after)?;
                        self.press(press)?;
                    }
                    Ending::LeftToRest { rest_ms, lift_mm_s } => {
                        self.fall_for(*rest_ms)?;
                        if self.contacts.is_empty() {
                            let fall_ms = (2.0 * height_mm / GRAVITY).sqrt();
                            return Err(Error::scene(format!(
                                "the body is lifted {rest_ms} ms after it was let go, before it lands: it falls for \
                                 {fall_ms:.0} ms; rest_ms must be larger"
                            )));
                        }
                        // If the body lies still by now, the hand ends this touch.
                        if self.touching
                            && let Some(last) = self.contacts.last_mut()
                        {
                            last.kind = TouchKind::Rest;
                        }
                        self.move_by_hand(self.depth, -CLEAR_MM, lift_mm_s * 1e-3, TouchKind::Rest)?;
                    }
                }
                Ok(())
            }
            Move::Pressed(press) => self.press(press),
            Move::Rolled(along) => self.go(along, TouchKind::Roll),
            Move::Slid(along) => self.go(along, TouchKind::Slide),
        }
    }

    /// Waits, then presses by hand and lifts.
    fn press(&mut self, press: &Press) -> Result<()> {
        self.wait(press.wait_ms)?;
        let speed = press.speed_mm_s * 1e-3;
        let deep = match (press.peak_n, press.depth_mm) {
            (Some(force), _) => self.push.down_mm(force),
            (None, depth) => self.push.down_of_depth_mm(depth.unwrap_or(0.0)),
        };
        self.reachable(deep)?;
        self.move_by_hand(-CLEAR_MM, deep, speed, TouchKind::Hand)?;
        self.move_by_hand(deep, deep, press.hold_ms, TouchKind::Hand)?;
        self.move_by_hand(deep, -CLEAR_MM, speed, TouchKind::Hand)
    }

    /// Sets the body down, lets it go or pushes it along, and lifts it.
    fn go(&mut self, along: &Along, kind: TouchKind) -> Result<()> {
        let weight = self.mass() * GRAVITY * self.scene.slant_deg.to_radians().cos();
        let deep = self.push.down_mm(along.press_n.unwrap_or(weight));
        self.reachable(deep)?;
        self.move_by_hand(-CLEAR_MM, deep, SET_DOWN, kind)?;
        self.speed = 0.0;
        let (sin, cos) = along.toward_deg.to_radians().sin_cos();
        self.along = [cos, sin].map(|part| part * along.speed_mm_s * 1e-3);
        if along.press_n.is_some() {
            self.move_by_hand(deep, deep, along.for_ms, kind)?;
        } else {
            if kind == TouchKind::Roll {
                // What rolls does not slip where it can turn: a ball each way, a cylinder across its axis.
                let (ball, _, axis_deg) = self.body.shape.turns();
                let free = if ball > 0.0 { self.along } else { friction::across_axis(self.along, axis_deg) };
                self.turning = free.map(|part| -part);
            }
            self.fall_for(along.for_ms)?;
        }
        self.along = [0.0; 2];
        self.move_by_hand(self.depth, -CLEAR_MM, SET_DOWN, kind)
    }

    /// Refuses a course that leads off the array; a body that falls may glance off a tilted one.
    pub fn stays_on(&self, array: &Array, step_us: f64) -> Result<()> {
        let does = match self.body.motion {
            Move::Rolled(_) => "rolls",
            Move::Slid(_) => "slides",
            _ => return Ok(()),
        };
        let pitch_mm = pitch_of(array)?;
        let is_inside = |at: f32, count: u16| (-0.01..=f64::from(count - 1) * pitch_mm + 0.01).contains(&f64::from(at));
        let track = &self.track;
        let touches = |k: &usize| track.force_n[*k] > 0.0;
        let off = (0..track.force_n.len())
            .filter(touches)
            .find(|&k| !(is_inside(track.x_mm[k], array.columns) && is_inside(track.y_mm[k], array.rows)));
        match (off, self.contacts.first()) {
            (Some(k), Some(first)) => Err(Error::scene(format!(
                "the body {does} off the array {:.0} ms after it was set down, at x {:.0} mm, y {:.0} mm; begin \
                 further inside, or stop earlier (for_ms)",
                1e-3 * (k as f64 * step_us - first.start_us),
                track.x_mm[k],
                track.y_mm[k]
            ))),
            _ => Ok(()),
        }
    }

    fn reachable(&self, deep: f64) -> Result<()> {
        if deep < self.push.floor_mm() {
            return Ok(());
        }
        Err(Error::scene(format!(
            "the scene presses the body through all {} mm of the foam; press it less, or use stiffer foam",
            self.scene.foam.thickness_mm
        )))
    }

    fn mass(&self) -> f64 {
        self.body.mass_g().unwrap_or(0.0)
    }

    /// Appends the present state to the track.
    fn record(&mut self) {
        let Self { track, push, .. } = self;
        track.x_mm.push(self.position[0] as f32);
        track.y_mm.push(self.position[1] as f32);
        track.depth_mm.push(push.depth_mm(self.depth) as f32);
        track.force_n.push(self.raw.max(0.0) as f32);
    }

    /// Holds the body clear of the foam.
    pub fn wait(&mut self, ms: f64) -> Result<()> {
        self.wait_steps((ms / self.inner_ms).round() as u64)
    }

    /// Steps of the integrator since the scene's start.
    pub fn steps(&self) -> u32 {
        self.now
    }

    /// Holds the body clear of the foam up to a step.
    pub fn wait_until(&mut self, step: u32) -> Result<()> {
        self.wait_steps(u64::from(step - self.now))
    }

    fn wait_steps(&mut self, steps: u64) -> Result<()> {
        self.depth = -CLEAR_MM;
        self.speed = 0.0;
        (self.along, self.turning) = ([0.0; 2], [0.0; 2]);
        for _ in 0..steps {
            self.step_to(self.depth, 0.0, TouchKind::Hand)?;
        }
        Ok(())
    }

    /// Lets the body go so high above where it will touch.
    fn release_body(&mut self, height_mm: f64) {
        let (sin, cos) = self.scene.slant_deg.to_radians().sin_cos();
        let (down_y, down_x) = self.scene.downhill_deg.to_radians().sin_cos();
        self.depth = -height_mm * cos;
        self.speed = 0.0;
        self.position = [self.body.x_mm - height_mm * sin * down_x, self.body.y_mm - height_mm * sin * down_y];
    }

    fn fall_until_caught(&mut self, after: u32) -> Result<()> {
        let began = self.now;
        loop {
            let rising = self.speed < 0.0;
            self.fall()?;
            let bounced = self.contacts.len() >= after as usize && !self.touching;
            if bounced && rising && self.speed >= 0.0 && self.depth < 0.0 {
                return Ok(());
            }
            if f64::from(self.now - began) * self.inner_ms > PATIENCE_MS {
                return Err(Error::scene(format!(
                    "the body comes to rest after {} impacts, so it cannot be caught after {after} impacts; drop it \
                     from higher, or catch it earlier",
                    self.contacts.len()
                )));
            }
        }
    }

    fn fall_for(&mut self, ms: f64) -> Result<()> {
        for _ in 0..(ms / self.inner_ms).round() as u64 {
            self.fall()?;
        }
        Ok(())
    }

    /// One step of a free body: semi-implicit Euler, the losses implicit in speed.
    fn fall(&mut self) -> Result<()> {
        let (dt, mass) = (self.inner_ms, self.mass());
        let (tilt_sin, tilt_cos) = self.scene.slant_deg.to_radians().sin_cos();
        // N/g is mm/ms^2.
        let (elastic, loss) = self.foam(self.depth);
        let gravity = GRAVITY * tilt_cos;
        let mut speed = (self.speed + dt * (gravity - elastic / mass)) / (1.0 + dt * loss / mass);
        if elastic + loss * speed <= 0.0 {
            speed = self.speed + dt * gravity;
        }
        let depth = self.depth + dt * speed;
        if depth >= self.push.floor_mm() {
            return Err(Error::scene(format!(
                "the body reaches the bottom of the foam: {:?} g at {:.2} m/s are too much for {} mm of foam of {} \
                 kPa; drop it from lower, or use stiffer foam",
                (10.0 * mass).round() / 10.0,
                speed,
                self.scene.foam.thickness_mm,
                self.scene.foam.modulus_kpa
            )));
        }
        let kind = if self.contacts.is_empty() { TouchKind::First } else { TouchKind::Bounce };
        let (down_y, down_x) = self.scene.downhill_deg.to_radians().sin_cos();
        self.along[0] += dt * GRAVITY * tilt_sin * down_x;
        self.along[1] += dt * GRAVITY * tilt_sin * down_y;
        friction::act(self.body, dt * self.raw.max(0.0) / mass, &mut self.along, &mut self.turning);
        self.step_to(depth, speed, kind)
    }

    /// Moves the body by hand from one depth to another at a speed in mm/ms; where both are one, holds it for `pace` ms.
    fn move_by_hand(&mut self, from: f64, to: f64, pace: f64, kind: TouchKind) -> Result<()> {
        let ms = if from == to { pace } else { (to - from).abs() / pace };
        let steps = (ms / self.inner_ms).round().max(1.0) as u64;
        let speed = (to - from) / (steps as f64 * self.inner_ms);
        for k in 1..=steps {
            self.step_to(from + (to - from) * k as f64 / steps as f64, speed, kind)?;
        }
        Ok(())
    }

    /// Elastic force at a depth, N, and loss for each mm/ms of speed, N ms/mm.
    fn foam(&self, depth: f64) -> (f64, f64) {
        let (elastic, stiffness) = self.push.force(depth);
        (elastic, self.scene.foam.damping_s_m * elastic + self.scene.foam.dashpot_ms * stiffness)
    }

    /// Ends a step in a state, and records when force left zero or returned there.
    fn step_to(&mut self, depth: f64, speed: f64, kind: TouchKind) -> Result<()> {
        let (elastic, loss) = self.foam(depth);
        let raw = elastic + loss * speed;
        let touching = depth > 0.0 && raw > 0.0;
        if touching != self.touching {
            // Force crosses zero with depth where the ball is at the foam's face, else inside, where the dashpot frees it.
            let (before, after) = if self.depth <= 0.0 || depth <= 0.0 { (self.depth, depth) } else { (self.raw, raw) };
            let share = if after == before { 1.0 } else { (-before / (after - before)).clamp(0.0, 1.0) };
            let at = us(self.inner_ms) * (f64::from(self.now) + share);
            if touching {
                let (start_us, stop_us) = (at, f64::INFINITY);
                self.contacts.push(Contact { kind, start_us, stop_us, speed_m_s: speed, peak_n: 0.0 });
            } else if let Some(contact) = self.contacts.last_mut() {
                contact.stop_us = at;
            }
        }
        if touching && let Some(contact) = self.contacts.last_mut() {
            contact.peak_n = contact.peak_n.max(raw);
        }
        (self.depth, self.speed, self.raw, self.touching) =
            (depth, speed, if depth > 0.0 { raw } else { 0.0 }, touching);
        self.position[0] += self.inner_ms * self.along[0];
        self.position[1] += self.inner_ms * self.along[1];
        self.now += 1;
        if self.now.is_multiple_of(INNER) {
            self.record();
            let steps = self.track.force_n.len();
            if steps > MOST_STEPS {
                return Err(too_many(us(f64::from(INNER) * self.inner_ms)));
            }
            if steps.is_multiple_of(LOOK_EVERY) {
                self.stop.check()?;
            }
        }
        Ok(())
    }
}
