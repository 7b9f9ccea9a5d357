//! Defects of taxels and their effect on trip times before the board compares them; each flaw has its own seed.

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::NOT_RETURNED;
use crate::{Array, Result, problem};

/// Magnitude of a flaw, and the seed from which it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Flaw {
    /// Magnitude in the flaw's own unit; 0 is none.
    pub size: f64,
    /// Seed of the random draws.
    pub seed: u64,
}

/// The flaws of taxels; the default is none.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Flaws {
    /// Gain mismatch: standard deviation of the gains' logarithm.
    pub gain: Flaw,
    /// Threshold mismatch, ticks: a taxel's reading is too low by the absolute value of a normal draw with this
    /// standard deviation.
    pub threshold: Flaw,
    /// Hysteresis, ticks: how far a reading lags behind its input in both directions; drawn per taxel from half to
    /// three halves of this.
    pub hysteresis: Flaw,
    /// Drift, ticks per minute: standard deviation over taxels of a constant drift rate.
    pub drift: Flaw,
    /// Fraction of taxels that always read 0.
    pub dead: Flaw,
    /// Fraction of taxels that always read one value.
    pub stuck: Flaw,
    /// Number of lines with a loose contact: at random times, all taxels of such a line read 0 for a while.
    pub loose: Flaw,
    /// Noise of one reading: standard deviation, ticks.
    pub noise: Flaw,
}

/// Mean duration for which a loose line is connected, and for which it is broken, s.
const HOLDS_S: f64 = 1.0;
const BROKEN_S: f64 = 0.05;

/// Taxels with flaws.
#[derive(Debug, Clone)]
pub struct Flawed {
    flaws: Flaws,
    gain: Vec<f64>,
    threshold: Vec<f64>,
    /// Half-width of the hysteresis of each taxel, ticks, and its current output.
    play: Vec<f64>,
    reads: Vec<f64>,
    drift_per_us: Vec<f64>,
    fixed: Vec<Option<u16>>,
    loose: Vec<Loose>,
    contact: StdRng,
    noise: StdRng,
    begun: bool,
}

/// A line with a loose contact.
#[derive(Debug, Clone)]
struct Loose {
    taxels: Vec<usize>,
    holds: bool,
    until_us: f64,
}

impl Flawed {
    /// Draws the flaws of an array's taxels.
    ///
    /// # Errors
    ///
    /// `Problem` if a magnitude is out of range; the message names the flaw.
    pub fn new(flaws: Flaws, array: &Array) -> Result<Self> {
        let lines = f64::from(array.rows) + f64::from(array.columns);
        for (name, size, most) in [
            ("gain", flaws.gain.size, 10.0),
            ("threshold", flaws.threshold.size, 65_535.0),
            ("hysteresis", flaws.hysteresis.size, 65_535.0),
            ("drift", flaws.drift.size, 1e6),
            ("dead", flaws.dead.size, 1.0),
            ("stuck", flaws.stuck.size, 1.0),
            ("loose", flaws.loose.size, lines),
            ("noise", flaws.noise.size, 65_535.0),
        ] {
            if !(0.0..=most).contains(&size) {
                return Err(problem!("flaw {name} is {size}: must be from 0 to {most}"));
            }
        }
        let n = array.len();
        let normal = |flaw: Flaw| {
            let mut draw = StdRng::seed_from_u64(flaw.seed);
            (0..n).map(move |_| -> f64 { flaw.size * Distribution::<f64>::sample(&StandardNormal, &mut draw) })
        };
        let share = |flaw: Flaw| {
            let mut draw = StdRng::seed_from_u64(flaw.seed);
            (0..n)
                .map(move |_| (draw.random::<f64>() < flaw.size).then(|| draw.random::<u16>() % 256))
                .collect::<Vec<_>>()
        };
        let dead = share(flaws.dead);
        let fixed = share(flaws.stuck).into_iter().zip(dead).map(|(stuck, dead)| dead.map(|_| 0).or(stuck)).collect();
        let mut way = StdRng::seed_from_u64(flaws.hysteresis.seed);
        let mut contact = StdRng::seed_from_u64(flaws.loose.seed);
        let columns = usize::from(array.columns);
        let driven = (0..columns).map(|x| (x..n).step_by(columns).collect());
        let sensed = (0..usize::from(array.rows)).map(|y| (y * columns..(y + 1) * columns).collect());
        let of_line = |taxels| Loose { taxels, holds: true, until_us: 0.0 };
        let mut loose: Vec<Loose> = driven.chain(sensed).map(of_line).collect();
        rand::seq::SliceRandom::shuffle(&mut loose[..], &mut contact);
        loose.truncate(flaws.loose.size as usize);
        Ok(Self {
            flaws,
            gain: normal(flaws.gain).map(f64::exp).collect(),
            threshold: normal(flaws.threshold).map(f64::abs).collect(),
            play: (0..n).map(|_| 0.5 * flaws.hysteresis.size * way.random_range(0.5..1.5)).collect(),
            reads: vec![0.0; n],
            drift_per_us: normal(flaws.drift).map(|a_minute| a_minute / 60e6).collect(),
            fixed,
            loose,
            contact,
            noise: StdRng::seed_from_u64(flaws.noise.seed),
            begun: false,
        })
    }

    /// The taxels that always read one value, by index, with this value (0: dead).
    #[must_use]
    pub fn fixed(&self) -> &[Option<u16>] {
        &self.fixed
    }

    /// Replaces a frame's trip times by the readings of these taxels at `time_us` since the board's start.
    pub fn read(&mut self, time_us: f64, ticks: &mut [u16]) {
        let Flaws { gain, threshold, hysteresis, drift, noise, .. } = self.flaws;
        let wanders = [gain, threshold, hysteresis, drift, noise].iter().any(|flaw| flaw.size > 0.0);
        for (k, value) in ticks.iter_mut().enumerate() {
            if *value == NOT_RETURNED {
                continue;
            }
            if wanders {
                let input = self.gain[k] * f64::from(*value) - self.threshold[k] + self.drift_per_us[k] * time_us;
                let (reads, play) = (&mut self.reads[k], self.play[k]);
                *reads = if self.begun { reads.clamp(input - play, input + play) } else { input };
                let mut shown = *reads;
                if noise.size > 0.0 {
                    shown += noise.size * Distribution::<f64>::sample(&StandardNormal, &mut self.noise);
                }
                *value = shown.round().clamp(0.0, f64::from(NOT_RETURNED - 1)) as u16;
            }
            if let Some(fixed) = self.fixed[k] {
                *value = fixed;
            }
        }
        self.begun = true;
        for line in &mut self.loose {
            while line.until_us <= time_us {
                line.holds = !line.holds;
                let mean_us = 1e6 * if line.holds { HOLDS_S } else { BROKEN_S };
                line.until_us += -mean_us * (1.0 - self.contact.random::<f64>()).ln();
            }
            if !line.holds {
                line.taxels.iter().for_each(|&taxel| ticks[taxel] = 0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flawed(flaws: Flaws) -> Flawed {
        Flawed::new(flaws, &Array::thesis()).unwrap()
    }

    fn flaw(size: f64) -> Flaw {
        Flaw { size, seed: 7 }
    }

    #[test]
    fn without_flaws_nothing_changes() {
        let mut ticks: Vec<u16> = (0..4096).map(|k| (k % 151) as u16).collect();
        ticks[9] = NOT_RETURNED;
        let before = ticks.clone();
        flawed(Flaws::default()).read(5e6, &mut ticks);
        assert_eq!(ticks, before);
    }

    #[test]
    fn each_flaw_shows_itself_and_no_other() {
        let mut ticks = vec![100_u16; 4096];
        flawed(Flaws { gain: flaw(0.1), ..Flaws::default() }).read(0.0, &mut ticks);
        let mean = ticks.iter().map(|&t| f64::from(t)).sum::<f64>() / 4096.0;
        let sd = (ticks.iter().map(|&t| (f64::from(t) - mean).powi(2)).sum::<f64>() / 4096.0).sqrt();
        assert!((mean - 100.5).abs() < 1.0 && (sd - 10.0).abs() < 1.0, "{mean} {sd}");
        let mut dead = flawed(Flaws { dead: flaw(0.02), ..Flaws::default() });
        ticks.fill(100);
        dead.read(0.0, &mut ticks);
        let zeros = ticks.iter().filter(|&&t| t == 0).count();
        assert!((50..120).contains(&zeros) && ticks.iter().all(|&t| t == 0 || t == 100), "{zeros}");
        let mut slow = flawed(Flaws { hysteresis: flaw(10.0), ..Flaws::default() });
        let mut values = vec![];
        for value in [50, 100, 95, 50] {
            ticks.fill(value);
            slow.read(0.0, &mut ticks);
            values.push(ticks[0]);
        }
        let behind = 100 - values[1];
        assert!((2..=8).contains(&behind), "{values:?}");
        assert_eq!(values, [50, 100 - behind, 100 - behind, 50 + behind]);
        let mut wandering = flawed(Flaws { drift: flaw(6.0), ..Flaws::default() });
        ticks.fill(100);
        wandering.read(600e6, &mut ticks);
        let far = ticks.iter().filter(|&&t| t.abs_diff(100) > 60).count();
        assert!((800..1800).contains(&far), "beyond one standard deviation: {far}");
    }

    #[test]
    fn a_loose_line_goes_whole_and_comes_back() {
        let mut loose = flawed(Flaws { loose: flaw(2.0), ..Flaws::default() });
        let (mut broken, mut whole) = (0, 0);
        for k in 0..50_000 {
            let mut ticks = vec![100_u16; 4096];
            loose.read(f64::from(k) * 1000.0, &mut ticks);
            match ticks.iter().filter(|&&t| t == 0).count() {
                0 => whole += 1,
                64 | 127 | 128 => broken += 1,
                n => panic!("{n} taxels of a line"),
            }
        }
        assert!(whole > 40_000 && (1000..9000).contains(&broken), "{whole} {broken}");
    }

    #[test]
    fn sizes_that_are_none_are_refused() {
        for flaws in [
            Flaws { dead: flaw(1.5), ..Flaws::default() },
            Flaws { gain: flaw(f64::NAN), ..Flaws::default() },
            Flaws { loose: flaw(129.0), ..Flaws::default() },
        ] {
            assert!(Flawed::new(flaws, &Array::thesis()).is_err());
        }
    }
}
