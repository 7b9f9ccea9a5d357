//! Acts played one after the other into the frames that the board reads.

use serde::{Deserialize, Serialize};

use super::bonded::MOST_SWEPT;
use super::push::Sinking;
use super::{Bonded, Contact, Footprint, Motion, Narrow, Scene, Shape, Taxels, TouchKind, Track};
use crate::spikes::us;
use crate::{Array, Error, Result};

/// Pictures laid over the array: what a recording of another sensor would have done to this one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pictures {
    /// Picture after picture, row by row: the share of the way from rest to the ramp's end, 0 to 1.
    pub values: Vec<f32>,
    /// From one picture to the next, us; between them each taxel follows a straight line.
    pub period_us: f64,
}

/// One stretch of what the board is shown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Act {
    /// Nothing touches the array.
    Silence {
        /// ms.
        ms: f64,
    },
    /// Bodies touch it.
    Scene(Scene),
    /// Pictures are laid over it.
    Pictures(Pictures),
}

/// The board's lines are read in four groups a frame, each as the touch then is.
const GROUPS: usize = 4;

/// The fabric answers so much later, us (thesis 4.4.1).
const FABRIC_US: f64 = 50.0;

/// Acts, made ready to be played frame by frame.
///
/// A group of lines, read during a quarter of a frame, shows the force that was in the quarter's middle less the fabric's
/// delay. Lines are read from left to right (a driven line is a column of the sensor).
#[derive(Debug)]
pub struct Stage {
    taxels: Taxels,
    frame_us: f64,
    parts: Vec<Part>,
    contacts: Vec<Contact>,
    narrow: Vec<(usize, Narrow)>,
    /// Part and frame within it that come next.
    part: usize,
    frame: usize,
    clean: Vec<f32>,
    profile: Vec<f32>,
    drive: Vec<f32>,
}

/// An act made ready: worked out wherever there is time for it, then given to a [`Stage`].
#[derive(Debug)]
pub struct Prepared {
    part: Part,
    contacts: Vec<Contact>,
    narrow: Option<Narrow>,
}

impl Prepared {
    /// Makes an act ready: motion, touches and footprint, some milliseconds for a ball.
    ///
    /// # Errors
    ///
    /// `Scene` where the act cannot be played.
    pub fn of(array: &Array, frame_us: f64, act: &Act) -> Result<Self> {
        part(array, frame_us, act)
    }
}

#[derive(Debug)]
struct Part {
    frames: usize,
    what: What,
}

#[derive(Debug)]
enum What {
    Silence,
    Columns { track: Track, footprint: Footprint, reach: [Vec<Reached>; GROUPS], pressed: [bool; GROUPS] },
    Layer(Box<Felt>),
    Pictures { pictures: Pictures, count: usize },
}

/// A taxel that a ball can reach, and where it lies among the footprint's rings.
#[derive(Debug)]
struct Reached {
    index: u32,
    ring: u32,
    share: f32,
}

impl Stage {
    /// Makes acts ready: motion, touches and footprints are worked out here, some milliseconds for each ball.
    ///
    /// # Errors
    ///
    /// `Scene` where an act cannot be played (it is numbered from 0), or taxels and array differ in size.
    pub fn new(array: &Array, taxels: Taxels, frame_us: f64, acts: &[Act]) -> Result<Self> {
        if taxels.len() != array.len() {
            return Err(Error::Scene(format!("{} taxels: the array has {}", taxels.len(), array.len())));
        }
        if !(frame_us.is_finite() && frame_us > 0.0 && frame_us <= 4_000.0) {
            return Err(Error::Scene(format!("frame is {frame_us} us: must be above 0, at most 4000")));
        }
        let clean = (0..taxels.len()).map(|k| taxels.ticks(k, 0.0)).collect();
        let (parts, contacts, narrow, profile, drive) = (vec![], vec![], vec![], vec![], vec![]);
        let mut stage = Self { taxels, frame_us, parts, contacts, narrow, part: 0, frame: 0, clean, profile, drive };
        for (n, act) in acts.iter().enumerate() {
            stage.push(Prepared::of(array, frame_us, act).map_err(|error| match error {
                Error::Scene(text) => Error::Scene(format!("act {n}: {text}")),
                other => other,
            })?);
        }
        Ok(stage)
    }

    /// Adds an act, to be played when all before it are over.
    pub fn push(&mut self, act: Prepared) {
        let offset = self.frames() as f64 * self.frame_us;
        self.contacts.extend(act.contacts.into_iter().map(|c| Contact {
            start_us: c.start_us + offset,
            stop_us: c.stop_us + offset,
            ..c
        }));
        self.narrow.extend(act.narrow.map(|narrow| (self.parts.len(), narrow)));
        self.parts.push(act.part);
    }

    /// Whether all frames of all acts so far have been played.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.parts[self.part.min(self.parts.len())..].iter().map(|part| part.frames).sum::<usize>() == self.frame
    }

    /// All touches of all acts, by time; us from the first frame's start.
    #[must_use]
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// The acts, numbered from 0, with a touch that is narrower than their cells resolve.
    #[must_use]
    pub fn narrow(&self) -> &[(usize, Narrow)] {
        &self.narrow
    }

    /// How many frames there are in all.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.parts.iter().map(|p| p.frames).sum()
    }

    /// Force at each frame's start, N; 0 under pictures, whose force nobody knows.
    #[must_use]
    pub fn force_n(&self) -> Vec<f32> {
        let mut force = Vec::with_capacity(self.frames());
        for part in &self.parts {
            match &part.what {
                What::Columns { track, .. } => force.extend((0..part.frames).map(|k| track.force_n[GROUPS * k])),
                What::Layer(felt) => force.extend((0..part.frames).map(|k| felt.motion.force_n(GROUPS * k))),
                What::Silence | What::Pictures { .. } => force.resize(force.len() + part.frames, 0.0),
            }
        }
        force
    }

    /// Puts the next frame's ticks, by taxel, into `ticks`; false, and nothing done, after the last.
    ///
    /// # Errors
    ///
    /// `Scene` where `ticks` has another length than the array.
    pub fn frame(&mut self, ticks: &mut [u16]) -> Result<bool> {
        if ticks.len() != self.clean.len() {
            return Err(Error::Scene(format!("room for {} ticks: must be {}", ticks.len(), self.clean.len())));
        }
        while self.parts.get(self.part).is_some_and(|p| self.frame == p.frames) {
            // Its tables are not needed any more; how long it was is.
            self.parts[self.part].what = What::Silence;
            self.part += 1;
            self.frame = 0;
        }
        let Some(part) = self.parts.get_mut(self.part) else { return Ok(false) };
        match &mut part.what {
            What::Silence => {}
            What::Columns { track, footprint, reach, pressed } => {
                for group in 0..GROUPS {
                    let place = place(self.frame, group, self.frame_us);
                    let (before, share) = ((place as usize).min(track.force_n.len() - 2), place.fract() as f32);
                    let between = |v: &[f32]| v[before] + share * (v[before + 1] - v[before]);
                    let force = between(&track.force_n);
                    if force == 0.0 && !pressed[group] {
                        continue;
                    }
                    pressed[group] = force > 0.0;
                    footprint.profile(f64::from(between(&track.depth_mm)), &mut self.profile);
                    self.drive.clear();
                    self.drive.extend(self.profile.iter().map(|stress| self.taxels.drive(stress * force)));
                    for at in &reach[group] {
                        let (ring, index) = (at.ring as usize, at.index as usize);
                        let drive = self.drive[ring] + at.share * (self.drive[ring + 1] - self.drive[ring]);
                        self.clean[index] = self.taxels.ticks(index, drive);
                    }
                }
            }
            What::Layer(felt) => {
                for group in 0..GROUPS {
                    let place = place(self.frame, group, self.frame_us);
                    felt.show(group, place, &self.taxels, &mut self.clean);
                }
            }
            What::Pictures { pictures, count } => {
                let place = self.frame as f64 * self.frame_us / pictures.period_us;
                let (k, share) = ((place as usize).min(*count - 1), place.fract() as f32);
                let size = self.clean.len();
                let now = &pictures.values[k * size..(k + 1) * size];
                let next = if k + 1 < *count { &pictures.values[(k + 1) * size..(k + 2) * size] } else { now };
                let top = f32::from(self.taxels.ramp());
                for (index, clean) in self.clean.iter_mut().enumerate() {
                    let rest = self.taxels.ticks(index, 0.0);
                    *clean = rest + (now[index] + share * (next[index] - now[index])) * (top - rest);
                }
            }
        }
        self.frame += 1;
        self.taxels.convert(&self.clean, ticks);
        Ok(true)
    }
}

/// When a group of lines is read that shows the touch of `GROUPS` steps a frame.
fn place(frame: usize, group: usize, frame_us: f64) -> f64 {
    let lag = FABRIC_US / (frame_us / GROUPS as f64) - 0.5;
    ((GROUPS * frame + group) as f64 - lag).max(0.0)
}

/// One ball that moves straight up and down on columns.
fn straight(scene: &Scene, track: Track, array: &Array) -> Result<What> {
    let body = &scene.bodies[0];
    let (x_mm, y_mm) = (body.x_mm, body.y_mm);
    let Shape::Sphere { radius_mm } = body.shape else { return Err(super::scene::columns_take_one_ball()) };
    let footprint = Footprint::new(&scene.foam, radius_mm)?;
    let mut reach = [const { Vec::new() }; GROUPS];
    for y in 0..array.rows {
        for x in 0..array.columns {
            let across = f64::from(x) * array.pitch_mm - x_mm;
            let along = f64::from(y) * array.pitch_mm - y_mm;
            if let Some((ring, share)) = Footprint::ring(across.hypot(along)) {
                let group = GROUPS * usize::from(x) / usize::from(array.columns);
                reach[group].push(Reached { index: array.index(x, y) as u32, ring: ring as u32, share });
            }
        }
    }
    Ok(What::Columns { track, footprint, reach, pressed: [false; GROUPS] })
}

/// Bodies on the bonded layer, as the taxels feel them.
///
/// The layer is solved at even steps, one a frame for a ball or two, fewer where more taxels are touched than sweeps
/// solve in time; between them stress follows straight lines.
#[derive(Debug)]
struct Felt {
    layer: Bonded,
    shapes: Vec<Shape>,
    motion: Motion,
    sinking: Sinking,
    /// From one solution to the next, in steps of the motion.
    every: usize,
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

/// So many frames lie between two solutions where a whole array is touched.
const SELDOM: usize = 4;

impl Felt {
    fn new(scene: &Scene, layer: Bonded, motion: Motion, array: &Array) -> Self {
        let shapes: Vec<Shape> = scene.bodies.iter().map(|body| body.shape.clone()).collect();
        let mut felt = Self {
            layer,
            shapes,
            motion,
            sinking: Sinking::default(),
            every: GROUPS,
            solved: vec![],
            pressure: vec![],
            pressed: [false; GROUPS],
            columns: usize::from(array.columns),
        };
        let most = (0..felt.motion.len()).step_by(50 * GROUPS).map(|k| felt.sink(k)).max().unwrap_or(0);
        if most > MOST_SWEPT {
            felt.every = SELDOM * GROUPS;
        }
        felt.layer.forget();
        felt
    }

    /// Finds the cells that are touched after `k` steps; how many there are.
    fn sink(&mut self, k: usize) -> usize {
        let bodies: Vec<(&Shape, (f64, f64), f64)> = self
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

    /// The solution of a number, solved where it is not known yet; the one after it may be asked for next.
    fn solve(&mut self, number: usize) {
        if self.solved.iter().any(|solved| solved.number == number) {
            return;
        }
        let mut solved = if self.solved.len() < 3 { Solved::default() } else { self.solved.remove(0) };
        let k = (number * self.every).min(self.motion.len() - 1);
        solved.number = number;
        solved.touches = self.sink(k) > 0;
        if solved.touches {
            // What is lost on the way raises the force above that of a body at rest.
            let gain: Vec<f64> = (0..self.shapes.len())
                .map(|n| {
                    let track = &self.motion.tracks[n];
                    let rest = self.motion.pushes[n].force_at_depth(f64::from(track.depth_mm[k]));
                    if rest > 0.0 { f64::from(track.force_n[k]) / rest } else { 0.0 }
                })
                .collect();
            self.pressure.clear();
            let pressed = self.layer.press(&self.sinking.cells);
            self.pressure.extend(pressed.iter().zip(&self.sinking.whose).map(|(p, n)| p * gain[*n as usize]));
            self.layer.arrive(&self.sinking.cells, &self.pressure, &mut solved.base);
        } else {
            self.layer.forget();
            solved.base.clear();
            solved.base.resize(self.layer.taxels(), 0.0);
        }
        self.solved.push(solved);
    }

    /// Puts what a group of lines reads, `place` steps after the start, into `clean`.
    fn show(&mut self, group: usize, place: f64, taxels: &Taxels, clean: &mut [f32]) {
        let number = place as usize / self.every;
        let share = (place / self.every as f64 - number as f64) as f32;
        self.solve(number);
        self.solve(number + 1);
        let of = |number: usize| self.solved.iter().find(|solved| solved.number == number).expect("solved above");
        let (now, next) = (of(number), of(number + 1));
        if !now.touches && !next.touches && !self.pressed[group] {
            return;
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
    }
}

/// Stress that no taxel feels, MPa: a millionth of a newton on it, a hundred-thousandth of what the thesis could tell.
const FAINT_MPA: f32 = 2e-7;

fn part(array: &Array, frame_us: f64, act: &Act) -> Result<Prepared> {
    match act {
        Act::Silence { ms } => {
            if !(0.0..=86_400_000.0).contains(ms) {
                return Err(Error::Scene(format!("silence of {ms} ms: must be 0 to a day")));
            }
            let part = Part { frames: (us(*ms) / frame_us).round() as usize, what: What::Silence };
            Ok(Prepared { part, contacts: vec![], narrow: None })
        }
        Act::Scene(scene) => {
            scene.check(array)?;
            let mut layer = Motion::layer(scene, array)?;
            let mut motion = Motion::on(scene, array, layer.as_mut(), frame_us / GROUPS as f64)?;
            if motion.len() < 2 {
                return Err(Error::Scene(format!("scene: shorter than a quarter of a frame, {frame_us} us")));
            }
            let (contacts, narrow) = (std::mem::take(&mut motion.contacts), motion.narrow.take());
            let frames = motion.len().div_ceil(GROUPS);
            let what = match layer {
                Some(layer) => What::Layer(Box::new(Felt::new(scene, layer, motion, array))),
                None => straight(scene, motion.tracks.swap_remove(0), array)?,
            };
            Ok(Prepared { part: Part { frames, what }, contacts, narrow })
        }
        Act::Pictures(pictures) => {
            let size = array.len();
            let count = pictures.values.len() / size;
            if count == 0 || pictures.values.len() != count * size {
                return Err(Error::Scene(format!(
                    "{} values: must be whole pictures of {size}",
                    pictures.values.len()
                )));
            }
            if let Some(value) = pictures.values.iter().find(|v| !(0.0..=1.0).contains(*v)) {
                return Err(Error::Scene(format!("picture value {value}: must be a share of the ramp, 0 to 1")));
            }
            if !(pictures.period_us.is_finite() && pictures.period_us >= frame_us) {
                let period = pictures.period_us;
                return Err(Error::Scene(format!("pictures each {period} us: must be {frame_us} (a frame) or more")));
            }
            let frames = (count as f64 * pictures.period_us / frame_us).ceil() as usize;
            let contacts = touched(pictures, count, size);
            let part = Part { frames, what: What::Pictures { pictures: pictures.clone(), count } };
            Ok(Prepared { part, contacts, narrow: None })
        }
    }
}

/// The touch of pictures: from the last empty one before to the first empty one after all that are not.
fn touched(pictures: &Pictures, count: usize, size: usize) -> Vec<Contact> {
    let loaded = |k: usize| pictures.values[k * size..(k + 1) * size].iter().any(|v| *v > 0.0);
    let Some(first) = (0..count).find(|k| loaded(*k)) else { return vec![] };
    let last = (0..count).rev().find(|k| loaded(*k)).unwrap_or(first);
    vec![Contact {
        kind: TouchKind::Pictures,
        start_us: first.saturating_sub(1) as f64 * pictures.period_us,
        stop_us: (last + 1) as f64 * pictures.period_us,
        speed_m_s: 0.0,
        peak_n: 0.0,
    }]
}

#[cfg(test)]
mod tests {
    use super::super::Sensor;
    use super::*;

    const FRAME_US: f64 = 192.0;

    fn stage(sensor: &Sensor, acts: &[Act]) -> Stage {
        let array = Array::thesis();
        Stage::new(&array, Taxels::new(sensor, array.len(), 150, 3).unwrap(), FRAME_US, acts).unwrap()
    }

    fn quiet() -> Sensor {
        Sensor { noise_ticks: 0.0, gain_spread: 0.0, offset_mv: 0.0, ..Sensor::default() }
    }

    fn ball(index: u32) -> Act {
        Act::Scene(Scene::draw(&Array::thesis(), 1, index, false).unwrap())
    }

    #[test]
    fn taxels_rise_within_a_frame_of_a_touch_and_return_after_it() {
        let mut stage = stage(&quiet(), &[Act::Silence { ms: 100.0 }, ball(0)]);
        let contacts = stage.contacts().to_vec();
        let mut ticks = vec![0; 4096];
        let mut rest = vec![];
        let mut loaded = vec![];
        while stage.frame(&mut ticks).unwrap() {
            if rest.is_empty() {
                rest.clone_from(&ticks);
            }
            loaded.push(ticks.iter().zip(&rest).filter(|(a, b)| a > b).count());
        }
        assert_eq!(loaded.len(), stage.frames());
        let first = contacts[0].start_us / FRAME_US;
        let before = first as usize;
        assert!(loaded[..before].iter().all(|n| *n == 0));
        assert!(loaded[before + 2] > 20, "{:?}", &loaded[before..before + 4]);
        for contact in &contacts {
            let after = (contact.stop_us / FRAME_US) as usize + 2;
            assert_eq!(loaded[after], 0, "{contact:?}");
        }
    }

    #[test]
    fn force_and_touches_agree() {
        let stage = stage(&quiet(), &[ball(0), Act::Silence { ms: 20.0 }, ball(1)]);
        let force = stage.force_n();
        assert_eq!(force.len(), stage.frames());
        for (k, force) in force.iter().enumerate() {
            let at = k as f64 * FRAME_US;
            let inside = stage.contacts().iter().any(|c| c.start_us < at && at < c.stop_us);
            assert_eq!(*force > 0.0, inside, "frame {k}");
        }
    }

    #[test]
    fn the_same_seed_plays_the_same_frames() {
        let play = || {
            let mut stage = stage(&Sensor::default(), &[Act::Silence { ms: 3.0 }, ball(2)]);
            let mut ticks = vec![0; 4096];
            for _ in 0..1_200 {
                assert!(stage.frame(&mut ticks).unwrap());
            }
            ticks
        };
        assert_eq!(play(), play());
    }

    #[test]
    fn pictures_are_reached_in_straight_lines() {
        let mut values = vec![0.0; 3 * 4096];
        values[4096 + 70] = 1.0;
        let act = Act::Pictures(Pictures { values, period_us: 1920.0 });
        let mut stage = stage(&quiet(), &[act]);
        let mut seen = vec![];
        let mut ticks = vec![0; 4096];
        while stage.frame(&mut ticks).unwrap() {
            seen.push(ticks[70]);
        }
        assert_eq!(seen.len(), 30);
        assert_eq!(seen[10], 150);
        let halfway = f64::midpoint(f64::from(seen[0]), 150.0);
        assert!((f64::from(seen[5]) - halfway).abs() <= 1.0 && (f64::from(seen[15]) - halfway).abs() <= 1.0);
        assert_eq!(stage.contacts()[0].start_us, 0.0);
        assert_eq!(stage.contacts()[0].stop_us, 3840.0);
    }

    #[test]
    fn an_act_that_cannot_be_played_is_named() {
        let array = Array::thesis();
        let taxels = Taxels::new(&quiet(), 4096, 150, 0).unwrap();
        let text = |acts: &[Act]| Stage::new(&array, taxels.clone(), FRAME_US, acts).unwrap_err().to_string();
        assert!(text(&[Act::Silence { ms: 1.0 }, Act::Silence { ms: f64::NAN }]).contains("act 1"));
        assert!(text(&[Act::Pictures(Pictures { values: vec![0.0; 5], period_us: 2e3 })]).contains("whole pictures"));
        assert!(text(&[Act::Pictures(Pictures { values: vec![2.0; 4096], period_us: 2e3 })]).contains("share"));
        assert!(text(&[Act::Pictures(Pictures { values: vec![0.0; 4096], period_us: 1.0 })]).contains("a frame"));
        let few = Taxels::new(&quiet(), 7, 150, 0).unwrap();
        assert!(Stage::new(&array, few, FRAME_US, &[]).is_err());
    }
}
