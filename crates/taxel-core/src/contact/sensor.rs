//! Fabric, amplifier and converter: from the force on a taxel to ticks of its counter.

use rand::rngs::StdRng;
use rand::{Rng, RngCore, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::of_scene;
use crate::allowed::Range;
use crate::circuit::ramp::RAMP_END_V;
use crate::circuit::{Fabric, Ramp, VirtualGround};
use crate::parameters::parameters;
use crate::{Error, Result};

/// The ramp for which `noise_ticks` is stated.
const STATED_RAMP: f64 = 150.0;

parameters! {
    /// The sensor's response to force: one law for all taxels, and how far taxels differ.
    ///
    /// A taxel conducts `G = G0 + k F^n`; the amplifier gives `V = V_trans (1 + R_f G)` (thesis 4.3.2). The ramp is an
    /// RC curve towards 5 V that ends at 3 V: 0.02 N, which the thesis could detect at 1.3 V (4.4.1), is then 0.1 V and
    /// 4.5 ticks of a ramp of 150. Above 3 V a taxel reads the ramp's whole time.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Sensor {
        /// Voltage of the lines, V (thesis 4.4.1).
        pub v_trans: f64 = 1.3, "V", Range::ABOVE_0.below(RAMP_END_V);
        /// Feedback resistor, kOhm (thesis 4.3.2).
        pub feedback_kohm: f64 = 47.0, "kOhm", Range::ABOVE_0;
        /// Conductance at rest, uS. A guess.
        pub rest_us: f64 = 0.1, "uS", Range::FROM_0;
        /// Conductance that 0.02 N adds, uS: 0.1 V at the default voltage and resistor.
        pub touch_us: f64 = 1.64, "uS", Range::ABOVE_0;
        /// Exponent n of force, 0.5 to 1. A guess: no maker's curve was found.
        pub exponent: f64 = 0.7, "", Range::within(0.5, 1.0);
        /// Side of a taxel, mm (thesis 5.6.1).
        pub side_mm: f64 = 2.29, "mm", Range::ABOVE_0;
        /// How far gains differ: standard deviation of their logarithm. A guess.
        pub gain_spread: f64 = 0.2, "", Range::FROM_0;
        /// How far offsets differ: standard deviation, mV. A guess.
        pub offset_mv: f64 = 20.0, "mV", Range::FROM_0;
        /// Noise of one conversion: standard deviation in ticks of a ramp of 150; more of a slower one. A guess.
        pub noise_ticks: f64 = 0.5, "ticks", Range::FROM_0;
    }
}

impl Sensor {
    /// Checks that the law makes sense.
    ///
    /// # Errors
    ///
    /// `Scene`, naming the parameter.
    pub fn check(&self) -> Result<()> {
        of_scene("sensor", self.check_ranges())
    }

    /// Input voltage of a taxel without spread under a force, V.
    #[must_use]
    pub fn volts(&self, force_n: f64) -> f64 {
        self.readout().volts_alone(self.fabric().conductance_us(force_n))
    }

    fn fabric(&self) -> Fabric {
        Fabric { rest_us: self.rest_us, touch_us: self.touch_us, exponent: self.exponent }
    }

    fn readout(&self) -> VirtualGround {
        VirtualGround { v_trans: self.v_trans, feedback_kohm: self.feedback_kohm, ..VirtualGround::default() }
    }
}

/// An array of taxels, each with its own gain and offset, and the converter that reads them.
#[derive(Debug, Clone)]
pub struct Taxels {
    /// Volts at rest, and volts that a force adds for each `F^n`, by taxel.
    rest_v: Vec<f32>,
    gain_v: Vec<f32>,
    ramp: u16,
    /// Ticks of a voltage, in even steps from 0 to the ramp's end.
    ticks_of: Vec<f32>,
    exponent: f32,
    area_mm2: f32,
    noise: GaussianNoise,
}

impl Taxels {
    const STEPS: usize = 1024;

    /// Draws `count` taxels by `seed`, read by a ramp of `ramp` ticks.
    ///
    /// # Errors
    ///
    /// `Scene` where the sensor makes no sense or the ramp has no tick.
    pub fn new(sensor: &Sensor, count: usize, ramp: u16, seed: u64) -> Result<Self> {
        sensor.check()?;
        if ramp == 0 {
            return Err(Error::scene("ramp is 0 ticks: must be 1 or more"));
        }
        let mut draw = StdRng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut draw) };
        let (mut rest_v, mut gain_v) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let per_power = sensor.v_trans * 1e-3 * sensor.feedback_kohm * sensor.touch_us / 0.02_f64.powf(sensor.exponent);
        for _ in 0..count {
            gain_v.push((per_power * (sensor.gain_spread * normal()).exp()) as f32);
            rest_v.push((sensor.volts(0.0) + 1e-3 * sensor.offset_mv * normal()) as f32);
        }
        let ticks_of = (0..=Self::STEPS + 1)
            .map(|k| Ramp::rc(ramp.into()).ticks(RAMP_END_V * k as f64 / Self::STEPS as f64) as f32)
            .collect();
        Ok(Self {
            rest_v,
            gain_v,
            ramp,
            ticks_of,
            exponent: sensor.exponent as f32,
            area_mm2: (sensor.side_mm * sensor.side_mm) as f32,
            noise: GaussianNoise::new(sensor.noise_ticks * f64::from(ramp) / STATED_RAMP, draw.random()),
        })
    }

    /// The ramp's whole time, ticks.
    #[must_use]
    pub fn ramp(&self) -> u16 {
        self.ramp
    }

    /// How many taxels.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rest_v.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rest_v.is_empty()
    }

    /// `F^n` of a stress on a taxel, MPa: what [`Taxels::ticks`] takes.
    #[must_use]
    pub fn drive(&self, stress_mpa: f32) -> f32 {
        (stress_mpa.max(0.0) * self.area_mm2).powf(self.exponent)
    }

    /// When the ramp passes the input of taxel `index`, in ticks, before noise.
    #[must_use]
    pub fn ticks(&self, index: usize, drive: f32) -> f32 {
        let volts = self.rest_v[index] + self.gain_v[index] * drive;
        let step = (volts * (Self::STEPS as f64 / RAMP_END_V) as f32).clamp(0.0, Self::STEPS as f32);
        let k = step as usize;
        self.ticks_of[k] + (step - k as f32) * (self.ticks_of[k + 1] - self.ticks_of[k])
    }

    /// Converts once more: noise, then what the counter shows.
    pub fn convert(&mut self, clean: &[f32], out: &mut [u16]) {
        self.noise.add(clean, self.ramp, out);
    }
}

/// Gaussian noise from a table of quantiles.
///
/// One draw of 16 bits ends at 4.2 standard deviations, short of what crosses a noise floor of six: two are added.
#[derive(Debug, Clone)]
struct GaussianNoise {
    quantiles: Vec<f32>,
    draw: StdRng,
    bytes: Vec<u8>,
}

impl GaussianNoise {
    fn new(sd: f64, seed: u64) -> Self {
        let quantiles = if sd > 0.0 {
            let n = 65_536;
            (0..n)
                .map(|k| (sd / 2.0_f64.sqrt() * normal_quantile((f64::from(k) + 0.5) / f64::from(n))) as f32)
                .collect()
        } else {
            vec![]
        };
        Self { quantiles, draw: StdRng::seed_from_u64(seed), bytes: vec![] }
    }

    fn add(&mut self, clean: &[f32], ramp: u16, out: &mut [u16]) {
        // A value at or past the ramp's end never trips: it reads the ramp's time.
        let top = f32::from(ramp);
        if self.quantiles.is_empty() {
            for (value, ticks) in clean.iter().zip(out) {
                *ticks = value.min(top) as u16;
            }
            return;
        }
        self.bytes.resize(4 * clean.len(), 0);
        self.draw.fill_bytes(&mut self.bytes);
        let table: &[f32; 65_536] = self.quantiles.as_slice().try_into().expect("made with 65 536 entries");
        for ((value, ticks), bytes) in clean.iter().zip(out).zip(self.bytes.chunks_exact(4)) {
            let (a, b) = (u16::from_le_bytes([bytes[0], bytes[1]]), u16::from_le_bytes([bytes[2], bytes[3]]));
            let noisy = value + table[usize::from(a)] + table[usize::from(b)];
            *ticks = noisy.clamp(0.0, top) as u16;
        }
    }
}

/// The inverse of the normal distribution, by bisection of the error function.
fn normal_quantile(p: f64) -> f64 {
    let below = |x: f64| 0.5 * libm::erfc(-x / 2.0_f64.sqrt());
    let (mut low, mut high) = (-9.0, 9.0);
    while high - low > 1e-7 {
        let middle = f64::midpoint(low, high);
        if below(middle) < p { low = middle } else { high = middle }
    }
    f64::midpoint(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_thesis_smallest_touch_is_a_tenth_of_a_volt_and_four_and_a_half_ticks() {
        let sensor = Sensor::default();
        let (rest, touch) = (sensor.volts(0.0), sensor.volts(0.02));
        assert!((touch - rest - 0.1).abs() < 5e-4, "{}", touch - rest);
        let ticks = Ramp::rc(150.0).ticks(touch) - Ramp::rc(150.0).ticks(rest);
        assert!((ticks - 4.5).abs() < 0.1, "{ticks}");
    }

    #[test]
    fn the_ramp_ends_at_three_volts_near_one_newton() {
        let sensor = Sensor::default();
        assert!(sensor.volts(1.0) < 3.0 && sensor.volts(1.2) > 3.0);
        assert!(Ramp::rc(150.0).ticks(sensor.volts(1.2)) == 150.0);
    }

    #[test]
    fn the_table_equals_the_law() {
        let sensor = Sensor { gain_spread: 0.0, offset_mv: 0.0, noise_ticks: 0.0, ..Sensor::default() };
        let taxels = Taxels::new(&sensor, 1, 150, 1).unwrap();
        for force in [0.0, 0.003, 0.02, 0.3, 0.9, 1.08, 2.0] {
            let stress = (force / (2.29 * 2.29)) as f32;
            let got = taxels.ticks(0, taxels.drive(stress));
            assert!((f64::from(got) - Ramp::rc(150.0).ticks(sensor.volts(force))).abs() < 2e-3, "{force} N: {got}");
        }
    }

    #[test]
    fn noise_has_its_spread_and_its_tails() {
        let sensor = Sensor { gain_spread: 0.0, offset_mv: 0.0, ..Sensor::default() };
        let mut taxels = Taxels::new(&sensor, 4096, 150, 7).unwrap();
        let clean = vec![75.5; 4096];
        let mut out = vec![0; 4096];
        let (mut sum, mut squares, mut far, frames) = (0.0, 0.0, 0, 2_000);
        for _ in 0..frames {
            taxels.convert(&clean, &mut out);
            for &ticks in &out {
                let off = f64::from(ticks) - 75.0;
                sum += off;
                squares += off * off;
                far += i32::from(off.abs() >= 3.0);
            }
        }
        let n = 4096.0 * f64::from(frames);
        // A counter adds the spread of its last place, 1/12, give or take 0.008 by where the value lies in it.
        assert!((sum / n).abs() < 1e-3, "{}", sum / n);
        assert!((squares / n - 0.25 - 1.0 / 12.0).abs() < 0.01, "{}", squares / n);
        // Three ticks off is past 5 standard deviations: 5.7e-7 of conversions, 4.7 expected here.
        assert!((1..=14).contains(&far), "{far}");
    }

    #[test]
    fn the_same_seed_gives_the_same_taxels() {
        let ticks = |seed| {
            let mut taxels = Taxels::new(&Sensor::default(), 64, 150, seed).unwrap();
            let clean: Vec<f32> = (0..64).map(|k| taxels.ticks(k, 0.1)).collect();
            let mut out = vec![0; 64];
            taxels.convert(&clean, &mut out);
            out
        };
        assert_eq!(ticks(3), ticks(3));
        assert_ne!(ticks(3), ticks(4));
    }

    type Spoil = fn(&mut Sensor);

    #[test]
    fn each_nonsense_parameter_is_named() {
        let wrong: [(&str, Spoil); 5] = [
            ("v_trans", |s| s.v_trans = 3.0),
            ("exponent", |s| s.exponent = 1.5),
            ("gain_spread", |s| s.gain_spread = -0.1),
            ("noise_ticks", |s| s.noise_ticks = f64::INFINITY),
            ("side_mm", |s| s.side_mm = 0.0),
        ];
        for (name, spoil) in wrong {
            let mut sensor = Sensor::default();
            spoil(&mut sensor);
            assert!(Taxels::new(&sensor, 1, 150, 0).unwrap_err().to_string().contains(name), "{name}");
        }
        assert!(Taxels::new(&Sensor::default(), 1, 0, 0).is_err());
    }
}
