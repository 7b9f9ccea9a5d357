//! Acts played one after the other into the frames that the board reads.

use super::{Act, Bonded, Contact, FrameSequence, Motion, Narrow, Taxels};
use crate::spikes::us;
use crate::{Array, Error, Result, Stop};

mod layer;

use layer::{GROUPS, LayerScene};

/// The most frames whose forces are listed: 10 hours of the preset "5.2 kHz", and 800 MB.
const MOST_FORCES: usize = 200_000_000;

/// Acts, made ready to be played frame by frame.
///
/// A group of lines, read during a quarter of a frame, shows the force that was in the quarter's middle less the fabric's
/// delay. Lines are read from left to right (a driven line is a column of the sensor).
#[derive(Debug)]
pub struct Stage {
    taxels: Taxels,
    frame_us: f64,
    parts: Vec<ScenePart>,
    contacts: Vec<Contact>,
    narrow: Vec<(usize, Narrow)>,
    /// Part and frame within it that come next.
    part: usize,
    frame: usize,
    clean: Vec<f32>,
}

/// An act made ready, in any thread, for a [`Stage`] to play.
#[derive(Debug)]
pub struct Prepared {
    part: ScenePart,
    contacts: Vec<Contact>,
    narrow: Option<Narrow>,
}

impl Prepared {
    /// Makes an act ready: motion, touches and footprint, some milliseconds for a ball.
    ///
    /// # Errors
    ///
    /// `Scene` where the act cannot be played; `Interrupted`.
    pub fn new(array: &Array, frame_us: f64, act: &Act, stop: Stop<'_>) -> Result<Self> {
        match act {
            Act::Silence { ms } => {
                if !(0.0..=86_400_000.0).contains(ms) {
                    return Err(Error::scene(format!("silence of {ms} ms: must be from 0 ms to a day")));
                }
                let part = ScenePart { frames: (us(*ms) / frame_us).round() as usize, kind: ScenePartKind::Silence };
                Ok(Self { part, contacts: vec![], narrow: None })
            }
            Act::Scene(scene) => {
                scene.check(array)?;
                let mut layer = Bonded::new(&scene.foam, array, scene.cells_per_pitch, stop)?;
                let mut motion = Motion::compute_on(scene, array, &mut layer, frame_us / GROUPS as f64, stop)?;
                if motion.len() < 2 {
                    return Err(Error::scene(format!(
                        "scene: is shorter than a quarter of a frame; a frame lasts {frame_us} us"
                    )));
                }
                let (contacts, narrow) = (std::mem::take(&mut motion.contacts), motion.narrow.take());
                let frames = motion.len().div_ceil(GROUPS);
                let kind = ScenePartKind::Layer(Box::new(LayerScene::new(scene, layer, motion, array)));
                Ok(Self { part: ScenePart { frames, kind }, contacts, narrow })
            }
            Act::Frames(sequence) => {
                let size = array.len();
                let count = sequence.count(size, frame_us)?;
                let frames = (count as f64 * sequence.period_us / frame_us).ceil() as usize;
                let contacts = sequence.contacts(count, size);
                let part = ScenePart { frames, kind: ScenePartKind::Frames { sequence: sequence.clone(), count } };
                Ok(Self { part, contacts, narrow: None })
            }
        }
    }
}

#[derive(Debug)]
struct ScenePart {
    frames: usize,
    kind: ScenePartKind,
}

#[derive(Debug)]
enum ScenePartKind {
    Silence,
    Layer(Box<LayerScene>),
    Frames { sequence: FrameSequence, count: usize },
}

impl Stage {
    /// Makes acts ready: motion, touches and footprints are worked out here, some milliseconds for each ball.
    ///
    /// # Errors
    ///
    /// `Scene` where an act cannot be played (it is numbered from 0), or taxels and array differ in size; `Interrupted`.
    pub fn new(array: &Array, taxels: Taxels, frame_us: f64, acts: &[Act], stop: Stop<'_>) -> Result<Self> {
        if taxels.len() != array.len() {
            return Err(Error::scene(format!("{} taxels: the array has {}", taxels.len(), array.len())));
        }
        if !(frame_us.is_finite() && frame_us > 0.0 && frame_us <= 4_000.0) {
            return Err(Error::scene(format!("frame is {frame_us} us: must be above 0, at most 4000")));
        }
        let clean = (0..taxels.len()).map(|k| taxels.ticks(k, 0.0)).collect();
        let (parts, contacts, narrow) = (vec![], vec![], vec![]);
        let mut stage = Self { taxels, frame_us, parts, contacts, narrow, part: 0, frame: 0, clean };
        for (n, act) in acts.iter().enumerate() {
            stage.push(Prepared::new(array, frame_us, act, stop).map_err(|error| error.in_part(&format!("act {n}")))?);
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

    /// Force at each frame's start, N; 0 under a sequence of frames, whose force is not known.
    ///
    /// # Errors
    ///
    /// `Scene` of more than 2e8 frames.
    pub fn force_n(&self) -> Result<Vec<f32>> {
        if self.frames() > MOST_FORCES {
            let frames = self.frames();
            return Err(Error::scene(format!(
                "acts last {frames} frames: must be at most {MOST_FORCES}; split the acts"
            )));
        }
        let mut force = Vec::with_capacity(self.frames());
        for part in &self.parts {
            match &part.kind {
                ScenePartKind::Layer(layer) => force.extend((0..part.frames).map(|k| layer.motion.force_n(GROUPS * k))),
                ScenePartKind::Silence | ScenePartKind::Frames { .. } => force.resize(force.len() + part.frames, 0.0),
            }
        }
        Ok(force)
    }

    /// Puts the next frame's ticks, by taxel, into `ticks`; false, and nothing done, after the last.
    ///
    /// # Errors
    ///
    /// `Scene` where `ticks` has another length than the array; `Interrupted`.
    pub fn frame(&mut self, ticks: &mut [u16], stop: Stop<'_>) -> Result<bool> {
        if ticks.len() != self.clean.len() {
            return Err(Error::scene(format!("room for {} ticks: must be {}", ticks.len(), self.clean.len())));
        }
        while self.parts.get(self.part).is_some_and(|p| self.frame == p.frames) {
            // The tables of a part that is over are freed; its number of frames is still needed.
            self.parts[self.part].kind = ScenePartKind::Silence;
            self.part += 1;
            self.frame = 0;
        }
        let Some(part) = self.parts.get_mut(self.part) else { return Ok(false) };
        match &mut part.kind {
            ScenePartKind::Silence => {}
            ScenePartKind::Layer(layer) => {
                layer.show(self.frame, self.frame_us, &self.taxels, &mut self.clean, stop)?
            }
            ScenePartKind::Frames { sequence, count } => {
                let steps = self.frame as f64 * self.frame_us / sequence.period_us;
                let (k, share) = ((steps as usize).min(*count - 1), steps.fract() as f32);
                let size = self.clean.len();
                let now = &sequence.values[k * size..(k + 1) * size];
                let next = if k + 1 < *count { &sequence.values[(k + 1) * size..(k + 2) * size] } else { now };
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

#[cfg(test)]
mod tests {
    use super::super::{Scene, Sensor};
    use super::*;

    const FRAME_US: f64 = 192.0;

    fn stage(sensor: &Sensor, acts: &[Act]) -> Stage {
        let array = Array::thesis();
        Stage::new(&array, Taxels::new(sensor, array.len(), 150, 3).unwrap(), FRAME_US, acts, Stop::never()).unwrap()
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
        while stage.frame(&mut ticks, Stop::never()).unwrap() {
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
        let force = stage.force_n().unwrap();
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
                assert!(stage.frame(&mut ticks, Stop::never()).unwrap());
            }
            ticks
        };
        assert_eq!(play(), play());
    }

    #[test]
    fn the_frames_of_a_sequence_are_reached_in_straight_lines() {
        let mut values = vec![0.0; 3 * 4096];
        values[4096 + 70] = 1.0;
        let act = Act::Frames(FrameSequence { values, period_us: 1920.0 });
        let mut stage = stage(&quiet(), &[act]);
        let mut values = vec![];
        let mut ticks = vec![0; 4096];
        while stage.frame(&mut ticks, Stop::never()).unwrap() {
            values.push(ticks[70]);
        }
        assert_eq!(values.len(), 30);
        assert_eq!(values[10], 150);
        let halfway = f64::midpoint(f64::from(values[0]), 150.0);
        assert!((f64::from(values[5]) - halfway).abs() <= 1.0 && (f64::from(values[15]) - halfway).abs() <= 1.0);
        assert_eq!(stage.contacts()[0].start_us, 0.0);
        assert_eq!(stage.contacts()[0].stop_us, 3840.0);
    }

    #[test]
    fn an_act_that_cannot_be_played_is_named() {
        let array = Array::thesis();
        let taxels = Taxels::new(&quiet(), 4096, 150, 0).unwrap();
        let frames = |values, period_us| Act::Frames(FrameSequence { values, period_us });
        for act in [
            Act::Silence { ms: f64::NAN },
            frames(vec![0.0; 5], 2e3),
            frames(vec![2.0; 4096], 2e3),
            frames(vec![0.0; 4096], 1.0),
        ] {
            let error = Stage::new(&array, taxels.clone(), FRAME_US, &[Act::Silence { ms: 1.0 }, act], Stop::never());
            assert!(error.unwrap_err().to_string().starts_with("act 1"));
        }
        let few = Taxels::new(&quiet(), 7, 150, 0).unwrap();
        assert!(Stage::new(&array, few, FRAME_US, &[], Stop::never()).is_err());
    }
}
