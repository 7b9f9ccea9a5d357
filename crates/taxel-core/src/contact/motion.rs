//! How the ball moves, and when it really touched.

use serde::{Deserialize, Serialize};

use super::scene::{Ending, Scene};
use crate::spikes::us;
use crate::{Error, Result};

/// Gravity, mm/ms^2.
const GRAVITY: f64 = 9.81e-3;
/// The ball's own steps inside one that is handed out: 6 us at 5208 frames/s, where energy is kept to 0.2 %.
const INNER: u32 = 8;
/// How far above the foam a hand begins and ends a press, mm.
const CLEAR_MM: f64 = 2.0;
/// A ball that is still bouncing, or has come to rest, this long after it was let go is not caught any more, ms.
const PATIENCE_MS: f64 = 5_000.0;

/// What kind of touch it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The first impact after the drop.
    First,
    /// A later impact.
    Bounce,
    /// Pressed by hand, and lifted.
    Hand,
    /// An impact after which the ball stayed until a hand lifted it.
    Rest,
    /// Pictures laid over the array.
    Pictures,
}

impl Kind {
    /// As it is written in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Bounce => "bounce",
            Self::Hand => "hand",
            Self::Rest => "rest",
            Self::Pictures => "pictures",
        }
    }
}

/// One touch: from the moment when force leaves zero to that when it returns there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// What kind.
    pub kind: Kind,
    /// Force leaves zero, us.
    pub start_us: f64,
    /// Force returns to zero, us.
    pub stop_us: f64,
    /// How fast it began, m/s.
    pub speed_m_s: f64,
    /// The largest force, N; 0 where it is not known.
    pub peak_n: f64,
}

/// A scene, worked out: depth and force at even steps, and the touches in it.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    /// Depth below the foam's face, mm; negative above it.
    pub depth_mm: Vec<f32>,
    /// Force on the foam, N.
    pub force_n: Vec<f32>,
    /// The touches, by time; us from the scene's start.
    pub contacts: Vec<Contact>,
}

impl Motion {
    /// Plays a scene in steps of `step_us`; entry k holds the state k steps after its start.
    ///
    /// # Errors
    ///
    /// `Scene` where its parameters make no sense, the ball bottoms out, or comes to rest before it can be caught.
    pub fn of(scene: &Scene, step_us: f64) -> Result<Self> {
        scene.check()?;
        if !(step_us.is_finite() && step_us > 0.0 && step_us <= 1000.0) {
            return Err(Error::Scene(format!("step is {step_us} us: must be above 0, at most 1000")));
        }
        let mut play = Player::new(scene, step_us * 1e-3);
        play.wait(scene.lead_ms);
        play.let_go();
        match &scene.ending {
            Ending::Caught { after, press } => {
                play.fall_until_caught(*after)?;
                play.wait(press.wait_ms);
                let (speed, deep) = (press.speed_mm_s * 1e-3, scene.foam.depth_of(scene.ball.radius_mm, press.peak_n));
                play.hand(-CLEAR_MM, deep, speed, Kind::Hand);
                play.hand(deep, deep, press.hold_ms, Kind::Hand);
                play.hand(deep, -CLEAR_MM, speed, Kind::Hand);
            }
            Ending::LeftToRest { rest_ms, lift_mm_s } => {
                play.fall_for(*rest_ms)?;
                play.hand(play.depth, -CLEAR_MM, lift_mm_s * 1e-3, Kind::Rest);
            }
        }
        play.wait(scene.tail_ms);
        Ok(play.motion)
    }
}

struct Player<'a> {
    scene: &'a Scene,
    inner_ms: f64,
    /// Steps of `inner_ms` since the start.
    now: u32,
    depth: f64,
    speed: f64,
    /// Force before it is cut off at 0, N.
    raw: f64,
    touching: bool,
    motion: Motion,
}

impl<'a> Player<'a> {
    fn new(scene: &'a Scene, step_ms: f64) -> Self {
        let motion = Motion::default();
        let inner_ms = step_ms / f64::from(INNER);
        let mut player =
            Self { scene, inner_ms, now: 0, depth: -scene.drop_mm, speed: 0.0, raw: 0.0, touching: false, motion };
        player.hand_out();
        player
    }

    fn hand_out(&mut self) {
        self.motion.depth_mm.push(self.depth as f32);
        self.motion.force_n.push(self.raw.max(0.0) as f32);
    }

    /// Holds the ball clear of the foam.
    fn wait(&mut self, ms: f64) {
        self.depth = -CLEAR_MM;
        self.speed = 0.0;
        for _ in 0..(ms / self.inner_ms).round() as u64 {
            self.arrive(self.depth, 0.0, Kind::Hand);
        }
    }

    fn let_go(&mut self) {
        self.depth = -self.scene.drop_mm;
        self.speed = 0.0;
    }

    fn fall_until_caught(&mut self, after: u32) -> Result<()> {
        let began = self.now;
        loop {
            let rising = self.speed < 0.0;
            self.fall()?;
            let bounced = self.motion.contacts.len() >= after as usize && !self.touching;
            if bounced && rising && self.speed >= 0.0 && self.depth < 0.0 {
                return Ok(());
            }
            if f64::from(self.now - began) * self.inner_ms > PATIENCE_MS {
                return Err(Error::Scene(format!(
                    "the ball comes to rest after {} impacts: it cannot be caught after {after}; drop it from higher or catch it earlier",
                    self.motion.contacts.len()
                )));
            }
        }
    }

    fn fall_for(&mut self, ms: f64) -> Result<()> {
        for _ in 0..(ms / self.inner_ms).round() as u64 {
            self.fall()?;
        }
        // The touch that a hand is about to end, if the ball lies still by then.
        if self.touching
            && let Some(last) = self.motion.contacts.last_mut()
        {
            last.kind = Kind::Rest;
        }
        Ok(())
    }

    /// One step of a ball that nothing holds: semi-implicit, the losses implicit in speed.
    fn fall(&mut self) -> Result<()> {
        let (dt, mass) = (self.inner_ms, self.scene.ball.mass_g);
        // N/g is mm/ms^2.
        let (elastic, loss) = self.foam(self.depth);
        let mut speed = (self.speed + dt * (GRAVITY - elastic / mass)) / (1.0 + dt * loss / mass);
        if elastic + loss * speed <= 0.0 {
            speed = self.speed + dt * GRAVITY;
        }
        let depth = self.depth + dt * speed;
        if depth >= self.scene.foam.floor_mm() {
            return Err(Error::Scene(format!(
                "the ball bottoms out: {:.0} g at {:.2} m/s crush {} mm of foam at {} kPa; drop it from lower, or take stiffer foam",
                mass, speed, self.scene.foam.thickness_mm, self.scene.foam.modulus_kpa
            )));
        }
        let kind = if self.motion.contacts.is_empty() { Kind::First } else { Kind::Bounce };
        self.arrive(depth, speed, kind);
        Ok(())
    }

    /// Moves the ball by hand from one depth to another at a speed in mm/ms; where both are one, holds it for `pace` ms.
    fn hand(&mut self, from: f64, to: f64, pace: f64, kind: Kind) {
        let ms = if from == to { pace } else { (to - from).abs() / pace };
        let steps = (ms / self.inner_ms).round().max(1.0) as u64;
        let speed = (to - from) / (steps as f64 * self.inner_ms);
        for k in 1..=steps {
            self.arrive(from + (to - from) * k as f64 / steps as f64, speed, kind);
        }
    }

    /// Elastic force at a depth, N, and loss for each mm/ms of speed, N ms/mm.
    fn foam(&self, depth: f64) -> (f64, f64) {
        let (elastic, stiffness) = self.scene.foam.force(self.scene.ball.radius_mm, depth);
        (elastic, self.scene.foam.damping_s_m * elastic + self.scene.foam.dashpot_ms * stiffness)
    }

    /// Takes the state at the end of a step, and notes when force left zero or returned there.
    fn arrive(&mut self, depth: f64, speed: f64, kind: Kind) {
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
                self.motion.contacts.push(Contact { kind, start_us, stop_us, speed_m_s: speed, peak_n: 0.0 });
            } else if let Some(contact) = self.motion.contacts.last_mut() {
                contact.stop_us = at;
            }
        }
        if touching && let Some(contact) = self.motion.contacts.last_mut() {
            contact.peak_n = contact.peak_n.max(raw);
        }
        (self.depth, self.speed, self.raw, self.touching) =
            (depth, speed, if depth > 0.0 { raw } else { 0.0 }, touching);
        self.now += 1;
        if self.now.is_multiple_of(INNER) {
            self.hand_out();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Ball, Foam, Press};
    use super::*;

    const QUARTER_US: f64 = 48.0;

    fn dropped(foam: Foam, radius_mm: f64, drop_mm: f64, after: u32) -> Scene {
        Scene {
            ball: Ball { radius_mm, mass_g: 36.0 },
            foam,
            x_mm: 80.0,
            y_mm: 80.0,
            drop_mm,
            lead_ms: 20.0,
            ending: Ending::Caught {
                after,
                press: Press { peak_n: 1.0, speed_mm_s: 50.0, hold_ms: 100.0, wait_ms: 50.0 },
            },
            tail_ms: 20.0,
        }
    }

    fn undamped() -> Foam {
        Foam { damping_s_m: 0.0, dashpot_ms: 0.0, modulus_kpa: 75.0, ..Foam::default() }
    }

    #[test]
    fn without_losses_the_ball_comes_back_as_fast_as_it_fell() {
        let motion = Motion::of(&dropped(undamped(), 30.0, 120.0, 3), QUARTER_US).unwrap();
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
                let motion = Motion::of(&dropped(foam, radius, drop, 2), QUARTER_US).unwrap();
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
            let motion = Motion::of(&dropped(foam, radius, drop, 2), QUARTER_US).unwrap();
            let first = &motion.contacts[0];
            let ms = 1e-3 * (first.stop_us - first.start_us);
            let deepest = motion.depth_mm.iter().fold(0.0_f32, |a, b| a.max(*b));
            assert!((13.0..19.5).contains(&ms), "{ms} ms");
            assert!((7.2..9.8).contains(&deepest), "{deepest} mm");
            assert!((11.0..75.0).contains(&first.peak_n), "{} N", first.peak_n);
        }
    }

    #[test]
    fn truth_does_not_hang_on_the_step() {
        let scene = dropped(Foam::default(), 28.0, 150.0, 4);
        let (coarse, fine) = (Motion::of(&scene, 48.0).unwrap(), Motion::of(&scene, 6.0).unwrap());
        for (a, b) in coarse.contacts.iter().zip(&fine.contacts).take(2) {
            assert!((a.start_us - b.start_us).abs() < 40.0 && (a.stop_us - b.stop_us).abs() < 40.0, "{a:?} {b:?}");
        }
        let fallen_us = 1e3 * (2.0 * 150.0 / GRAVITY).sqrt();
        assert!((fine.contacts[0].start_us - 20_000.0 - fallen_us).abs() < 3.0);
    }

    #[test]
    fn force_is_zero_outside_touches_and_only_there() {
        let motion = Motion::of(&dropped(Foam::default(), 30.0, 150.0, 3), QUARTER_US).unwrap();
        assert_eq!(motion.contacts.iter().filter(|c| c.kind == Kind::Hand).count(), 1);
        for (k, force) in motion.force_n.iter().enumerate() {
            let at = k as f64 * QUARTER_US;
            let inside = motion.contacts.iter().any(|c| c.start_us < at && at < c.stop_us);
            assert_eq!(*force > 0.0, inside, "at {at} us: {force} N");
        }
    }

    #[test]
    fn the_dashpot_frees_the_ball_before_it_is_out_of_the_foam() {
        let motion = Motion::of(&dropped(Foam::default(), 30.0, 150.0, 2), QUARTER_US).unwrap();
        let left = (motion.contacts[0].stop_us / QUARTER_US) as usize;
        assert!(motion.depth_mm[left] > 0.2, "{}", motion.depth_mm[left]);
    }

    #[test]
    fn a_ball_left_alone_comes_to_rest_at_its_weight() {
        let scene = Scene {
            ending: Ending::LeftToRest { rest_ms: 1500.0, lift_mm_s: 50.0 },
            ..dropped(Foam::default(), 30.0, 120.0, 2)
        };
        let motion = Motion::of(&scene, QUARTER_US).unwrap();
        let last = motion.contacts.last().unwrap();
        assert_eq!(last.kind, Kind::Rest);
        let still = ((20.0 + 1400.0) * 1e3 / QUARTER_US) as usize;
        assert!((f64::from(motion.force_n[still]) - 36.0 * GRAVITY).abs() < 2e-3, "{} N", motion.force_n[still]);
    }

    #[test]
    fn a_press_reaches_its_force() {
        let motion = Motion::of(&dropped(Foam::default(), 30.0, 120.0, 2), QUARTER_US).unwrap();
        let hand = motion.contacts.last().unwrap();
        assert!((1.0..1.3).contains(&hand.peak_n), "{}", hand.peak_n);
        assert!((hand.speed_m_s - 0.05).abs() < 1e-3);
    }

    #[test]
    fn what_cannot_be_played_is_said() {
        let soft = Foam { modulus_kpa: 5.0, ..Foam::default() };
        let text = Motion::of(&dropped(soft, 30.0, 400.0, 2), QUARTER_US).unwrap_err().to_string();
        assert!(text.contains("bottoms out"), "{text}");
        let tired = Foam { damping_s_m: 5.0, ..Foam::default() };
        let text = Motion::of(&dropped(tired, 30.0, 100.0, 9), QUARTER_US).unwrap_err().to_string();
        assert!(text.contains("comes to rest"), "{text}");
        assert!(Motion::of(&dropped(Foam::default(), 30.0, 100.0, 2), f64::NAN).is_err());
    }
}
