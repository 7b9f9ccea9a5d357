//! How bodies move, and when they really touched.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::body::{Along, Body, Ending, Move, Press};
use super::bonded::most_cells;
use super::shape::turned;
use super::{Bonded, Push, Scene, Surface};
use crate::spikes::us;
use crate::{Array, Error, Result};

/// Gravity, mm/ms^2.
const GRAVITY: f64 = 9.81e-3;
/// The ball's own steps inside one that is handed out: 6 us at 5208 frames/s, where energy is kept to 0.2 %.
const INNER: u32 = 8;
/// How far above the foam a hand begins and ends a press, mm.
const CLEAR_MM: f64 = 2.0;
/// How fast a hand sets down and lifts what is to roll or slide, mm/ms.
const SET_DOWN: f64 = 0.05;
/// A body that is still bouncing, or has come to rest, this long after it was let go is not caught any more, ms.
const PATIENCE_MS: f64 = 5_000.0;

/// What kind of touch it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TouchKind {
    /// The first impact after the drop.
    First,
    /// A later impact.
    Bounce,
    /// Pressed by hand, and lifted.
    Hand,
    /// An impact after which the ball stayed until a hand lifted it.
    Rest,
    /// Set down, rolling, and lifted.
    Roll,
    /// Set down, sliding, and lifted.
    Slide,
    /// Pictures laid over the array.
    Pictures,
}

impl TouchKind {
    /// As it is written in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Bounce => "bounce",
            Self::Hand => "hand",
            Self::Rest => "rest",
            Self::Roll => "roll",
            Self::Slide => "slide",
            Self::Pictures => "pictures",
        }
    }
}

/// One touch: from the moment when force leaves zero to that when it returns there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// What kind.
    pub kind: TouchKind,
    /// Force leaves zero, us.
    pub start_us: f64,
    /// Force returns to zero, us.
    pub stop_us: f64,
    /// How fast it began, m/s.
    pub speed_m_s: f64,
    /// The largest force, N; 0 where it is not known.
    pub peak_n: f64,
}

/// A body's way, at even steps.
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

/// A scene, worked out.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    /// Each body's way; all have the same number of steps.
    pub tracks: Vec<Track>,
    /// How each body is pushed back.
    pub pushes: Vec<Push>,
    /// The touches, by time; us from the scene's start.
    pub contacts: Vec<Contact>,
    /// Of touches that are narrower than cells resolve, the narrowest.
    pub narrow: Option<Narrow>,
}

/// A touch that is narrow even at its deepest: its force is too small.
#[derive(Debug, Clone, PartialEq)]
pub struct Narrow {
    /// Of which body.
    pub body: usize,
    /// How wide it is, mm.
    pub width_mm: f64,
    /// From one cell to the next, mm.
    pub cell_mm: f64,
    /// Cells along the pitch of taxels that would do, and the most that there may be.
    pub cells_per_pitch: u16,
    /// The most.
    pub most: u16,
}

/// From so many cells across on the mean force of a touch is within 6 % of that on far finer ones (measured: balls,
/// cylinders, edges).
const ACROSS: f64 = 1.5;

impl Narrow {
    fn of(scene: &Scene, array: &Array, tracks: &[Track]) -> Option<Self> {
        let most = most_cells(&scene.foam, array);
        let of_body = |(n, track): (usize, &Track)| {
            // Whether it was felt or not: between cells the narrowest touch makes no force at all.
            let deepest = track.depth_mm.iter().fold(0.0_f32, |deepest, depth| deepest.max(*depth));
            let width_mm = scene.bodies[n].shape.width_mm(f64::from(deepest));
            let enough = (ACROSS * array.pitch_mm / width_mm).ceil();
            (width_mm > 0.0 && enough > f64::from(scene.cells_per_pitch)).then(|| Self {
                body: n,
                width_mm,
                cell_mm: array.pitch_mm / f64::from(scene.cells_per_pitch),
                cells_per_pitch: enough as u16,
                most,
            })
        };
        tracks.iter().enumerate().filter_map(of_body).min_by(|a, b| a.width_mm.total_cmp(&b.width_mm))
    }
}

impl fmt::Display for Narrow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { body, width_mm, cell_mm, cells_per_pitch, most } = self;
        write!(
            f,
            "bodies[{body}]: its touch is {width_mm:.2} mm wide at its deepest, less than {ACROSS} cells of {cell_mm:.2} mm"
        )?;
        write!(f, ": its force is too small; cells_per_pitch = {cells_per_pitch} would do")?;
        if cells_per_pitch > most {
            write!(f, ", but {most} is the most: take a smaller array.pitch_mm")
        } else {
            Ok(())
        }
    }
}

impl Motion {
    /// Plays a scene in steps of `step_us`; entry k of a track holds the state k steps after its start.
    ///
    /// # Errors
    ///
    /// `Scene` where its parameters make no sense, a body bottoms out, rolls or slides off the array, is lifted before
    /// it lands, or comes to rest before it can be caught.
    pub fn of(scene: &Scene, array: &Array, step_us: f64) -> Result<Self> {
        scene.check(array)?;
        Self::on(scene, array, Self::layer(scene, array)?.as_mut(), step_us)
    }

    /// The scene's foam, bonded, where it is reckoned so.
    ///
    /// # Errors
    ///
    /// `Scene` where the foam makes no sense.
    pub fn layer(scene: &Scene, array: &Array) -> Result<Option<Bonded>> {
        match scene.surface {
            Surface::Layer => Bonded::new(&scene.foam, array, scene.cells_per_pitch).map(Some),
            Surface::Columns => Ok(None),
        }
    }

    /// As [`Motion::of`], of a scene that was checked, on its foam.
    ///
    /// # Errors
    ///
    /// As [`Motion::of`].
    pub fn on(scene: &Scene, array: &Array, mut layer: Option<&mut Bonded>, step_us: f64) -> Result<Self> {
        if !(step_us.is_finite() && step_us > 0.0 && step_us <= 1000.0) {
            return Err(Error::Scene(format!("step is {step_us} us: must be above 0, at most 1000")));
        }
        let mut players = vec![];
        for (n, body) in scene.bodies.iter().enumerate() {
            let push = Push::of(&scene.foam, body, layer.as_deref_mut())?;
            let mut player = Player::new(scene, body, push, step_us * 1e-3);
            player.play().and_then(|()| player.stays_on(array, step_us)).map_err(|error| match error {
                Error::Scene(text) if scene.bodies.len() > 1 => Error::Scene(format!("bodies[{n}]: {text}")),
                other => other,
            })?;
            players.push(player);
        }
        let over = players.iter().map(|player| player.now).max().unwrap_or(0);
        let mut motion = Self::default();
        for mut player in players {
            player.wait_steps(u64::from(over - player.now));
            player.wait(scene.tail_ms);
            motion.tracks.push(player.track);
            motion.pushes.push(player.push);
            motion.contacts.append(&mut player.contacts);
        }
        motion.contacts.sort_by(|a, b| a.start_us.total_cmp(&b.start_us));
        if scene.surface == Surface::Layer {
            motion.narrow = Narrow::of(scene, array, &motion.tracks);
        }
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

struct Player<'a> {
    scene: &'a Scene,
    body: &'a Body,
    push: Push,
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
    place: [f64; 2],
    along: [f64; 2],
    turning: [f64; 2],
    track: Track,
    contacts: Vec<Contact>,
}

impl<'a> Player<'a> {
    fn new(scene: &'a Scene, body: &'a Body, push: Push, step_ms: f64) -> Self {
        let inner_ms = step_ms / f64::from(INNER);
        let height = match &body.motion {
            Move::Dropped { height_mm, .. } => height_mm * scene.slant_deg.to_radians().cos(),
            _ => CLEAR_MM,
        };
        let mut player = Self {
            scene,
            body,
            push,
            inner_ms,
            now: 0,
            depth: -height,
            speed: 0.0,
            raw: 0.0,
            touching: false,
            place: [body.x_mm, body.y_mm],
            along: [0.0; 2],
            turning: [0.0; 2],
            track: Track::default(),
            contacts: vec![],
        };
        player.hand_out();
        player
    }

    fn play(&mut self) -> Result<()> {
        self.wait(self.scene.lead_ms + self.body.after_ms);
        let body = self.body;
        match &body.motion {
            Move::Dropped { height_mm, ending } => {
                self.let_go(*height_mm);
                match ending {
                    Ending::Caught { after, press } => {
                        self.fall_until_caught(*after)?;
                        self.press(press)?;
                    }
                    Ending::LeftToRest { rest_ms, lift_mm_s } => {
                        self.fall_for(*rest_ms)?;
                        if self.contacts.is_empty() {
                            let fall_ms = (2.0 * height_mm / GRAVITY).sqrt();
                            return Err(Error::Scene(format!(
                                "the body is lifted {rest_ms} ms after it was let go, before it lands: it falls for {fall_ms:.0} ms; rest_ms must be more"
                            )));
                        }
                        // The touch that a hand is about to end, if the body lies still by then.
                        if self.touching
                            && let Some(last) = self.contacts.last_mut()
                        {
                            last.kind = TouchKind::Rest;
                        }
                        self.hand(self.depth, -CLEAR_MM, lift_mm_s * 1e-3, TouchKind::Rest);
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
        self.wait(press.wait_ms);
        let speed = press.speed_mm_s * 1e-3;
        let deep = match (press.peak_n, press.depth_mm) {
            (Some(force), _) => self.push.down_mm(force),
            (None, depth) => self.push.down_of_depth_mm(depth.unwrap_or(0.0)),
        };
        self.reachable(deep)?;
        self.hand(-CLEAR_MM, deep, speed, TouchKind::Hand);
        self.hand(deep, deep, press.hold_ms, TouchKind::Hand);
        self.hand(deep, -CLEAR_MM, speed, TouchKind::Hand);
        Ok(())
    }

    /// Sets the body down, lets it go or pushes it along, and lifts it.
    fn go(&mut self, along: &Along, kind: TouchKind) -> Result<()> {
        let weight = self.mass() * GRAVITY * self.scene.slant_deg.to_radians().cos();
        let deep = self.push.down_mm(along.press_n.unwrap_or(weight));
        self.reachable(deep)?;
        self.hand(-CLEAR_MM, deep, SET_DOWN, kind);
        self.speed = 0.0;
        let (sin, cos) = along.toward_deg.to_radians().sin_cos();
        self.along = [cos, sin].map(|part| part * along.speed_mm_s * 1e-3);
        if along.press_n.is_some() {
            self.hand(deep, deep, along.for_ms, kind);
        } else {
            if kind == TouchKind::Roll {
                // What rolls does not slip where it can turn: a ball each way, a cylinder across its axis.
                let (ball, _, axis_deg) = self.body.shape.turns();
                let free = if ball > 0.0 { self.along } else { only_across(self.along, axis_deg) };
                self.turning = free.map(|part| -part);
            }
            self.fall_for(along.for_ms)?;
        }
        self.along = [0.0; 2];
        self.hand(self.depth, -CLEAR_MM, SET_DOWN, kind);
        Ok(())
    }

    /// Refuses a course that leads off the array; what falls may glance off a tilted one.
    fn stays_on(&self, array: &Array, step_us: f64) -> Result<()> {
        let does = match self.body.motion {
            Move::Rolled(_) => "rolls",
            Move::Slid(_) => "slides",
            _ => return Ok(()),
        };
        let on = |at: f32, count: u16| (-0.01..=f64::from(count - 1) * array.pitch_mm + 0.01).contains(&f64::from(at));
        let track = &self.track;
        let touches = |k: &usize| track.force_n[*k] > 0.0;
        let off = (0..track.force_n.len())
            .filter(touches)
            .find(|&k| !(on(track.x_mm[k], array.columns) && on(track.y_mm[k], array.rows)));
        match (off, self.contacts.first()) {
            (Some(k), Some(first)) => Err(Error::Scene(format!(
                "the body {does} off the array {:.0} ms after it was set down, at x {:.0} mm, y {:.0} mm; begin further in, or stop earlier (for_ms)",
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
        Err(Error::Scene(format!(
            "the body is to be pressed through all of the {} mm of foam; press it less, or take stiffer foam",
            self.scene.foam.thickness_mm
        )))
    }

    fn mass(&self) -> f64 {
        self.body.mass_g().unwrap_or(0.0)
    }

    fn hand_out(&mut self) {
        let Self { track, push, .. } = self;
        track.x_mm.push(self.place[0] as f32);
        track.y_mm.push(self.place[1] as f32);
        track.depth_mm.push(push.depth_mm(self.depth) as f32);
        track.force_n.push(self.raw.max(0.0) as f32);
    }

    /// Holds the body clear of the foam.
    fn wait(&mut self, ms: f64) {
        self.wait_steps((ms / self.inner_ms).round() as u64);
    }

    fn wait_steps(&mut self, steps: u64) {
        self.depth = -CLEAR_MM;
        self.speed = 0.0;
        (self.along, self.turning) = ([0.0; 2], [0.0; 2]);
        for _ in 0..steps {
            self.arrive(self.depth, 0.0, TouchKind::Hand);
        }
    }

    /// Lets the body go so high above where it will touch.
    fn let_go(&mut self, height_mm: f64) {
        let (sin, cos) = self.scene.slant_deg.to_radians().sin_cos();
        let (down_y, down_x) = self.scene.downhill_deg.to_radians().sin_cos();
        self.depth = -height_mm * cos;
        self.speed = 0.0;
        self.place = [self.body.x_mm - height_mm * sin * down_x, self.body.y_mm - height_mm * sin * down_y];
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
                return Err(Error::Scene(format!(
                    "the body comes to rest after {} impacts: it cannot be caught after {after}; drop it from higher or catch it earlier",
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

    /// One step of a body that nothing holds: semi-implicit, the losses implicit in speed.
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
            return Err(Error::Scene(format!(
                "the body bottoms out: {:?} g at {:.2} m/s crush {} mm of foam at {} kPa; drop it from lower, or take stiffer foam",
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
        self.rub(dt * self.raw.max(0.0) / mass);
        self.arrive(depth, speed, kind);
        Ok(())
    }

    /// Friction, where the normal force changes speed by `push` in this step: of sliding, against the slip and as much as
    /// stops it at most, then of rolling.
    fn rub(&mut self, push: f64) {
        if push <= 0.0 {
            return;
        }
        let (first, second, axis_deg) = self.body.shape.turns();
        let turns = [first, second];
        let by_axis = |v: [f64; 2]| <[f64; 2]>::from(turned(v[0], v[1], axis_deg));
        let (along, turning) = (by_axis(self.along), by_axis(self.turning));
        let slip: [f64; 2] = std::array::from_fn(|k| along[k] + turning[k]);
        let stop: [f64; 2] = std::array::from_fn(|k| -slip[k] / (1.0 + turns[k]));
        let most = self.body.friction * push;
        let rub: [f64; 2] = if stop[0].hypot(stop[1]) <= most {
            stop
        } else {
            // Against the slip, not along `stop`: a cylinder is turned sooner than it is braked along its axis.
            let share = most / slip[0].hypot(slip[1]);
            std::array::from_fn(|k| -slip[k] * share.min(1.0 / (1.0 + turns[k])))
        };
        let mut along: [f64; 2] = std::array::from_fn(|k| along[k] + rub[k]);
        let mut turning: [f64; 2] = std::array::from_fn(|k| turning[k] + turns[k] * rub[k]);
        let speed = along[0].hypot(along[1]);
        if first + second > 0.0 && speed > 0.0 {
            let left = (1.0 - self.body.rolling_friction * push / speed).max(0.0);
            along = along.map(|v| v * left);
            turning = turning.map(|v| v * left);
        }
        let back = |v: [f64; 2]| <[f64; 2]>::from(turned(v[0], v[1], -axis_deg));
        (self.along, self.turning) = (back(along), back(turning));
    }

    /// Moves the body by hand from one depth to another at a speed in mm/ms; where both are one, holds it for `pace` ms.
    fn hand(&mut self, from: f64, to: f64, pace: f64, kind: TouchKind) {
        let ms = if from == to { pace } else { (to - from).abs() / pace };
        let steps = (ms / self.inner_ms).round().max(1.0) as u64;
        let speed = (to - from) / (steps as f64 * self.inner_ms);
        for k in 1..=steps {
            self.arrive(from + (to - from) * k as f64 / steps as f64, speed, kind);
        }
    }

    /// Elastic force at a depth, N, and loss for each mm/ms of speed, N ms/mm.
    fn foam(&self, depth: f64) -> (f64, f64) {
        let (elastic, stiffness) = self.push.force(depth);
        (elastic, self.scene.foam.damping_s_m * elastic + self.scene.foam.dashpot_ms * stiffness)
    }

    /// Takes the state at the end of a step, and notes when force left zero or returned there.
    fn arrive(&mut self, depth: f64, speed: f64, kind: TouchKind) {
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
        self.place[0] += self.inner_ms * self.along[0];
        self.place[1] += self.inner_ms * self.along[1];
        self.now += 1;
        if self.now.is_multiple_of(INNER) {
            self.hand_out();
        }
    }
}

/// The part of a velocity across an axis.
fn only_across(velocity: [f64; 2], axis_deg: f64) -> [f64; 2] {
    let (_, across) = turned(velocity[0], velocity[1], axis_deg);
    turned(0.0, across, -axis_deg).into()
}

#[cfg(test)]
mod tests {
    use super::super::{Foam, Shape};
    use super::*;

    const QUARTER_US: f64 = 48.0;

    fn body(shape: Shape, mass_g: f64, motion: Move) -> Body {
        Body {
            shape,
            x_mm: 80.0,
            y_mm: 80.0,
            mass_g: Some(mass_g),
            material: None,
            stiffness_n_mm: None,
            friction: 0.6,
            rolling_friction: 0.0,
            after_ms: 0.0,
            motion,
        }
    }

    fn alone(surface: Surface, foam: Foam, body: Body) -> Scene {
        let bodies = vec![body];
        Scene {
            surface,
            cells_per_pitch: 1,
            foam,
            bodies,
            slant_deg: 0.0,
            downhill_deg: 0.0,
            lead_ms: 20.0,
            tail_ms: 20.0,
        }
    }

    fn dropped(foam: Foam, radius_mm: f64, height_mm: f64, after: u32) -> Scene {
        let press = Press { peak_n: Some(1.0), depth_mm: None, speed_mm_s: 50.0, hold_ms: 100.0, wait_ms: 50.0 };
        let motion = Move::Dropped { height_mm, ending: Ending::Caught { after, press } };
        alone(Surface::Columns, foam, body(Shape::Sphere { radius_mm }, 36.0, motion))
    }

    fn play(scene: &Scene, step_us: f64) -> Result<Motion> {
        Motion::of(scene, &Array::thesis(), step_us)
    }

    fn undamped() -> Foam {
        Foam { damping_s_m: 0.0, dashpot_ms: 0.0, modulus_kpa: 75.0, ..Foam::default() }
    }

    #[test]
    fn without_losses_the_ball_comes_back_as_fast_as_it_fell() {
        let motion = play(&dropped(undamped(), 30.0, 120.0, 3), QUARTER_US).unwrap();
        let speeds: Vec<f64> = motion.contacts[..3].iter().map(|c| c.speed_m_s).collect();
        let fallen = (2.0 * GRAVITY * 120.0_f64).sqrt();
        for speed in speeds {
            assert!((speed / fallen - 1.0).abs() < 0.02, "{speed} of {fallen} m/s");
        }
    }

    #[test]
    fn damping_takes_the_share_of_speed_that_it_should() {
        // Ranges of the model over radii, drops and moduli.
        for (chi, low, high) in [(0.25, 0.72, 0.81), (0.5, 0.56, 0.66), (1.0, 0.37, 0.47)] {
            for (radius, drop, modulus) in [(25.0, 100.0, 60.0), (35.0, 200.0, 60.0), (30.0, 150.0, 100.0)] {
                let foam = Foam { damping_s_m: chi, dashpot_ms: 0.0, modulus_kpa: modulus, ..Foam::default() };
                let motion = play(&dropped(foam, radius, drop, 2), QUARTER_US).unwrap();
                let ratio = motion.contacts[1].speed_m_s / motion.contacts[0].speed_m_s;
                assert!((low..=high).contains(&ratio), "chi {chi}, R {radius}: {ratio}");
            }
        }
    }

    #[test]
    fn an_impact_is_as_long_deep_and_hard_as_the_model_says() {
        // E 60 kPa, 36 g: contact 14 to 19 ms, depth 7.2 to 9.8 of 10 mm, peak 12 N to 70 where the solid is pressed.
        for (radius, drop) in [(25.0, 100.0), (25.0, 200.0), (35.0, 100.0), (35.0, 200.0)] {
            let foam = Foam { dashpot_ms: 0.0, ..Foam::default() };
            let motion = play(&dropped(foam, radius, drop, 2), QUARTER_US).unwrap();
            let first = &motion.contacts[0];
            let ms = 1e-3 * (first.stop_us - first.start_us);
            let deepest = motion.tracks[0].depth_mm.iter().fold(0.0_f32, |a, b| a.max(*b));
            assert!((13.0..19.5).contains(&ms), "{ms} ms");
            assert!((7.2..9.8).contains(&deepest), "{deepest} mm");
            assert!((11.0..75.0).contains(&first.peak_n), "{} N", first.peak_n);
        }
    }

    #[test]
    fn truth_does_not_hang_on_the_step() {
        let scene = dropped(Foam::default(), 28.0, 150.0, 4);
        let (coarse, fine) = (play(&scene, 48.0).unwrap(), play(&scene, 6.0).unwrap());
        for (a, b) in coarse.contacts.iter().zip(&fine.contacts).take(2) {
            assert!((a.start_us - b.start_us).abs() < 40.0 && (a.stop_us - b.stop_us).abs() < 40.0, "{a:?} {b:?}");
        }
        let fallen_us = 1e3 * (2.0 * 150.0 / GRAVITY).sqrt();
        assert!((fine.contacts[0].start_us - 20_000.0 - fallen_us).abs() < 3.0);
    }

    #[test]
    fn force_is_zero_outside_touches_and_only_there() {
        let motion = play(&dropped(Foam::default(), 30.0, 150.0, 3), QUARTER_US).unwrap();
        assert_eq!(motion.contacts.iter().filter(|c| c.kind == TouchKind::Hand).count(), 1);
        for (k, force) in motion.tracks[0].force_n.iter().enumerate() {
            let at = k as f64 * QUARTER_US;
            let inside = motion.contacts.iter().any(|c| c.start_us < at && at < c.stop_us);
            assert_eq!(*force > 0.0, inside, "at {at} us: {force} N");
        }
    }

    #[test]
    fn the_dashpot_frees_the_ball_before_it_is_out_of_the_foam() {
        let motion = play(&dropped(Foam::default(), 30.0, 150.0, 2), QUARTER_US).unwrap();
        let left = (motion.contacts[0].stop_us / QUARTER_US) as usize;
        assert!(motion.tracks[0].depth_mm[left] > 0.2, "{}", motion.tracks[0].depth_mm[left]);
    }

    #[test]
    fn a_ball_left_alone_comes_to_rest_at_its_weight() {
        let ending = Ending::LeftToRest { rest_ms: 1500.0, lift_mm_s: 50.0 };
        let mut scene = dropped(Foam::default(), 30.0, 120.0, 2);
        scene.bodies[0].motion = Move::Dropped { height_mm: 120.0, ending };
        let motion = play(&scene, QUARTER_US).unwrap();
        let last = motion.contacts.last().unwrap();
        assert_eq!(last.kind, TouchKind::Rest);
        let still = ((20.0 + 1400.0) * 1e3 / QUARTER_US) as usize;
        assert!(
            (f64::from(motion.tracks[0].force_n[still]) - 36.0 * GRAVITY).abs() < 2e-3,
            "{} N",
            motion.tracks[0].force_n[still]
        );
    }

    #[test]
    fn a_press_reaches_its_force() {
        let motion = play(&dropped(Foam::default(), 30.0, 120.0, 2), QUARTER_US).unwrap();
        let hand = motion.contacts.last().unwrap();
        assert!((1.0..1.3).contains(&hand.peak_n), "{}", hand.peak_n);
        assert!((hand.speed_m_s - 0.05).abs() < 1e-3);
    }

    #[test]
    fn what_cannot_be_played_is_said() {
        let soft = Foam { modulus_kpa: 5.0, ..Foam::default() };
        let text = play(&dropped(soft, 30.0, 400.0, 2), QUARTER_US).unwrap_err().to_string();
        assert!(text.contains("bottoms out"), "{text}");
        let tired = Foam { damping_s_m: 5.0, ..Foam::default() };
        let text = play(&dropped(tired, 30.0, 100.0, 9), QUARTER_US).unwrap_err().to_string();
        assert!(text.contains("comes to rest"), "{text}");
        assert!(play(&dropped(Foam::default(), 30.0, 100.0, 2), f64::NAN).is_err());
    }

    #[test]
    fn a_course_that_leads_off_the_array_and_a_lift_before_the_landing_are_said() {
        for (motion, word) in [
            (Move::Rolled(Along { speed_mm_s: 300.0, ..along(2_000.0) }), "rolls off the array 3"),
            (Move::Slid(Along { speed_mm_s: 300.0, press_n: Some(1.0), ..along(2_000.0) }), "slides off the array 3"),
        ] {
            let mut scene = alone(Surface::Layer, Foam::default(), ball(motion));
            scene.bodies[0].rolling_friction = 0.0;
            let text = play(&scene, QUARTER_US).unwrap_err().to_string();
            assert!(text.contains(word), "{text}");
        }
        let early = Ending::LeftToRest { rest_ms: 150.0, lift_mm_s: 50.0 };
        let scene =
            alone(Surface::Layer, Foam::default(), ball(Move::Dropped { height_mm: 120.0, ending: early.clone() }));
        let text = play(&scene, QUARTER_US).unwrap_err().to_string();
        assert!(text.contains("lifted 150 ms after") && text.contains("falls for 156 ms"), "{text}");
        let heavy = body(Shape::Sphere { radius_mm: 20.0 }, 1e300, Move::Dropped { height_mm: 50.0, ending: early });
        let text = play(&alone(Surface::Columns, Foam::default(), heavy), QUARTER_US).unwrap_err().to_string();
        assert!(text.contains("the body bottoms out: 1e300 g"), "{text}");
    }

    fn ball(motion: Move) -> Body {
        body(Shape::Sphere { radius_mm: 20.0 }, 36.0, motion)
    }

    fn along(for_ms: f64) -> Along {
        Along { speed_mm_s: 60.0, toward_deg: 30.0, for_ms, press_n: None }
    }

    /// Speed along the foam so long after the scene's start, over 5 ms, mm/s.
    fn speed_at(scene: &Scene, ms: f64) -> f64 {
        let motion = play(scene, QUARTER_US).unwrap();
        let track = &motion.tracks[0];
        let end = (ms * 1e3 / QUARTER_US) as usize;
        let moved = |v: &[f32]| f64::from(v[end] - v[end - 100]);
        1e3 * moved(&track.x_mm).hypot(moved(&track.y_mm)) / (0.1 * QUARTER_US)
    }

    #[test]
    fn a_ball_that_slides_ends_rolling_at_five_sevenths_of_its_speed() {
        // Whatever the friction: angular momentum about the point of contact is kept.
        for friction in [0.1, 0.6] {
            let mut scene = alone(Surface::Columns, Foam::default(), ball(Move::Slid(along(400.0))));
            scene.surface = Surface::Layer;
            scene.bodies[0].friction = friction;
            let speed = speed_at(&scene, 365.0);
            assert!((speed / 60.0 - 5.0 / 7.0).abs() < 2e-3, "{friction}: {speed} mm/s");
        }
    }

    #[test]
    fn a_block_that_slides_stops_where_coulomb_says() {
        let flat = Shape::HeightMap { heights_mm: vec![vec![0.0; 2]; 2], pitch_mm: 20.0 };
        let mut scene = alone(Surface::Layer, Foam::default(), body(flat, 80.0, Move::Slid(along(200.0))));
        scene.bodies[0].friction = 0.3;
        let motion = play(&scene, QUARTER_US).unwrap();
        let track = &motion.tracks[0];
        let moved = |v: &[f32]| f64::from(v[v.len() - 1] - v[0]);
        let way = moved(&track.x_mm).hypot(moved(&track.y_mm));
        let coulomb = 0.06_f64.powi(2) / (2.0 * 0.3 * GRAVITY);
        assert!((way / coulomb - 1.0).abs() < 0.03, "{way} mm, {coulomb}");
        assert!((moved(&track.y_mm) / moved(&track.x_mm) - 30f64.to_radians().tan()).abs() < 1e-3);
    }

    #[test]
    fn a_ball_rolls_down_a_slant_at_five_sevenths_of_gravity_and_slides_down_a_slippery_one() {
        for (friction, share) in [(0.6, 5.0 / 7.0), (0.0, 1.0)] {
            let mut scene =
                alone(Surface::Layer, Foam::default(), ball(Move::Rolled(Along { speed_mm_s: 1.0, ..along(300.0) })));
            (scene.slant_deg, scene.downhill_deg, scene.bodies[0].friction) = (5.0, 30.0, friction);
            let speed = speed_at(&scene, 350.0) - speed_at(&scene, 150.0);
            let expected = 1e3 * share * GRAVITY * 5f64.to_radians().sin() * 200.0;
            assert!((speed / expected - 1.0).abs() < 0.01, "{friction}: {speed} of {expected} mm/s");
        }
    }

    #[test]
    fn a_cylinder_rolls_across_its_axis_and_slides_along_it() {
        let shape = Shape::Cylinder { radius_mm: 15.0, length_mm: 30.0, axis_deg: 120.0 };
        let scene = |toward_deg| {
            let along = Along { toward_deg, ..along(120.0) };
            alone(Surface::Layer, Foam::default(), body(shape.clone(), 60.0, Move::Rolled(along)))
        };
        assert!((speed_at(&scene(30.0), 165.0) / 60.0 - 1.0).abs() < 1e-3, "{}", speed_at(&scene(30.0), 165.0));
        assert!(speed_at(&scene(120.0), 165.0) < 0.1);
    }

    #[test]
    fn friction_acts_against_the_slip_of_a_cylinder_that_slides_aslant() {
        // Along the axis friction only brakes, across it it also turns: slip there is lost three times as fast.
        let (friction, steps, dt) = (0.3, 1_400, 1e-3 * QUARTER_US);
        let shape = Shape::Cylinder { radius_mm: 10.0, length_mm: 30.0, axis_deg: 45.0 };
        let course = Along { speed_mm_s: 500.0, toward_deg: 0.0, for_ms: 80.0, press_n: None };
        let mut scene = alone(Surface::Layer, Foam::default(), body(shape, 100.0, Move::Slid(course)));
        (scene.bodies[0].friction, scene.bodies[0].x_mm) = (friction, 60.0);
        let motion = play(&scene, QUARTER_US).unwrap();
        let track = &motion.tracks[0];
        let began = (0..track.x_mm.len()).find(|k| track.x_mm[*k] > 60.0).unwrap() - 1;
        let (mut speed, mut at): ([f64; 2], [f64; 2]) = (turned(0.5, 0.0, 45.0).into(), [0.0; 2]);
        let mut slip = speed;
        for _ in 0..steps {
            let loss = slip.map(|part| friction * GRAVITY * dt * part / slip[0].hypot(slip[1]));
            at = std::array::from_fn(|k| at[k] + dt * (speed[k] - loss[k] / 2.0));
            speed = [speed[0] - loss[0], speed[1] - loss[1]];
            slip = [slip[0] - loss[0], slip[1] - 3.0 * loss[1]];
        }
        assert!(slip[0].hypot(slip[1]) > 0.05, "it slips until then");
        let (x, y) = turned(at[0], at[1], -45.0);
        let (right, down) = (track.x_mm[began + steps] - 60.0, track.y_mm[began + steps] - 80.0);
        assert!((f64::from(right) - x).abs() < 0.1 && (f64::from(down) - y).abs() < 0.1, "{right} {down}, {x} {y}");
    }

    #[test]
    fn a_fall_on_a_slant_meets_it_where_it_should() {
        let mut scene =
            alone(Surface::Layer, Foam::default(), ball(Move::Dropped { height_mm: 100.0, ending: Ending::default() }));
        (scene.slant_deg, scene.downhill_deg) = (25.0, 90.0);
        let motion = play(&scene, QUARTER_US).unwrap();
        let first = &motion.contacts[0];
        assert!((first.start_us - 20e3 - 1e3 * (2.0 * 100.0 / GRAVITY).sqrt()).abs() < 300.0, "{first:?}");
        let normal = (2.0 * GRAVITY * 100.0).sqrt() * 25f64.to_radians().cos();
        assert!((first.speed_m_s / normal - 1.0).abs() < 5e-3, "{first:?}");
        let k = (first.start_us / QUARTER_US) as usize;
        assert!((motion.tracks[0].y_mm[k] - 80.0).abs() < 0.5 && (motion.tracks[0].x_mm[k] - 80.0).abs() < 1e-3);
    }

    #[test]
    fn a_ball_that_gives_is_off_sooner_and_without_bottoming_out() {
        // A tennis ball: 56 g from 0.6 m. A rigid one would press the solid.
        let motion = Move::Dropped { height_mm: 600.0, ending: Ending::LeftToRest { rest_ms: 420.0, lift_mm_s: 50.0 } };
        let mut scene = alone(Surface::Layer, Foam::default(), body(Shape::Sphere { radius_mm: 33.0 }, 56.0, motion));
        let rigid = play(&scene, QUARTER_US).unwrap().contacts[0].peak_n;
        scene.bodies[0].stiffness_n_mm = Some(25.0);
        let motion = play(&scene, QUARTER_US).unwrap();
        let first = &motion.contacts[0];
        let ms = 1e-3 * (first.stop_us - first.start_us);
        assert!((4.0..16.0).contains(&ms) && first.peak_n < 0.8 * rigid, "{first:?}, rigid {rigid} N");
        assert!(motion.tracks[0].depth_mm.iter().all(|d| *d <= 10.0));
    }

    #[test]
    fn a_touch_that_is_too_narrow_is_told_how_many_cells_would_do() {
        // What needs more than there may be is told so; a wide touch is told nothing.
        let press = Press { peak_n: None, depth_mm: Some(0.05), speed_mm_s: 50.0, hold_ms: 2.0, wait_ms: 0.0 };
        let shape = Shape::Edge { slope_deg: 45.0, length_mm: 20.0, axis_deg: 0.0 };
        let mut scene = alone(Surface::Layer, undamped(), body(shape, 36.0, Move::Pressed(press)));
        assert!(play(&scene, 200.0).unwrap().narrow.unwrap().to_string().contains("16 is the most"));
        scene.bodies[0].shape = Shape::Sphere { radius_mm: 60.0 };
        assert_eq!(play(&scene, 200.0).unwrap().narrow, None);
    }

    #[test]
    fn columns_and_layer_agree_where_columns_are_allowed() {
        let columns = dropped(Foam::default(), 30.0, 120.0, 2);
        let layer = Scene { surface: Surface::Layer, ..columns.clone() };
        let (a, b) = (play(&columns, QUARTER_US).unwrap(), play(&layer, QUARTER_US).unwrap());
        assert_eq!(a.contacts.len(), b.contacts.len(), "{:?} {:?}", a.contacts, b.contacts);
        let long = |c: &Contact| c.stop_us - c.start_us;
        for (a, b) in a.contacts.iter().zip(&b.contacts).take(2) {
            assert!((long(a) / long(b) - 1.0).abs() < 0.1 && (a.peak_n / b.peak_n - 1.0).abs() < 0.25, "{a:?} {b:?}");
        }
    }
}
