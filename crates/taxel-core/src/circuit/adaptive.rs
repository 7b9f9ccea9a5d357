//! A ramp that adapts to the signal: steep while it moves fast, gentle while it hardly does (thesis 4.3.2).

use serde::{Deserialize, Serialize};

use super::converter::{Converter, ConverterScan, TICKS_A_US};
use super::ramp::RAMP_END_V;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::{Result, Stop, problem};

parameters! {
    /// A converter that sets the duration of its ramp frame by frame; the rest of a step and of a column is constant.
    ///
    /// After a frame the taxel that moved farthest sets the length of the next ramp: the length that lets it move by
    /// `moves_ticks` of that ramp within the frame, so that a reading's error by its age stays of the size of that by
    /// its resolution. A move of `noise_ticks` or less of the coarser of two ramps does not count; without any, the
    /// next ramp lasts twice as long, up to the gentlest. The rule is ours: the thesis calls for one and states none.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Adaptive {
        /// The converter; its times of a step and a column are those with its own `ramp`, which they include.
        pub converter: Converter = Converter::default();
        /// The shortest time of the ramp, ticks.
        pub steepest: u32 = 38, "ticks", Range::within(1.0, 65_534.0);
        /// The longest, ticks.
        pub gentlest: u32 = 510, "ticks", Range::within(1.0, 65_534.0);
        /// How far the fastest taxel may move in a frame, ticks.
        pub moves_ticks: f64 = 4.0, "ticks", Range::ABOVE_0;
        /// What does not count as a move, ticks.
        pub noise_ticks: f64 = 2.0, "ticks", Range::FROM_0;
    }
}

/// Frames that were converted one after the other.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Converted {
    /// When each frame began, us.
    pub t_us: Vec<f64>,
    /// How long the ramp of each lasted, ticks.
    pub ramp: Vec<u32>,
    /// The ticks, as [`ConverterScan::frame`] gives them, frame after frame.
    pub ticks: Vec<f64>,
    /// The voltage of each number of ticks, V: that of the ramp halfway to the next tick, or at its end.
    pub volts: Vec<f64>,
}

/// The most readings of one call.
const MOST: f64 = 2e8;

impl Adaptive {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.steepest > self.gentlest {
            return Err(problem!("steepest"; " is {}: must be at most gentlest, {}", self.steepest, self.gentlest));
        }
        self.converter.check()?;
        self.with(self.steepest).check()
    }

    /// The converter with a ramp of another length.
    fn with(&self, ramp: u32) -> Converter {
        let Converter { step_us, line_us, steps, ramp: before, .. } = self.converter;
        let longer_us = (f64::from(ramp) - f64::from(before)) / TICKS_A_US;
        Converter {
            ramp,
            step_us: step_us + longer_us,
            line_us: line_us + steps as f64 * longer_us,
            ..self.converter.clone()
        }
    }

    /// The ramp at which a taxel as fast as that moves by `moves_ticks` in a frame, ticks.
    fn fitting(&self, v_per_us: f64, columns: usize) -> u32 {
        // A frame takes a + b ramp, a tick is RAMP_END_V / ramp: v (a + b ramp) = moves RAMP_END_V / ramp.
        let b = columns as f64 * self.converter.steps as f64 / TICKS_A_US;
        let a = columns as f64 * self.converter.line_us - b * f64::from(self.converter.ramp);
        let moves = self.moves_ticks * RAMP_END_V / v_per_us;
        let ramp = ((a * a + 4.0 * b * moves).sqrt() - a) / (2.0 * b);
        (ramp.min(65_534.0) as u32).clamp(self.steepest, self.gentlest)
    }

    /// Converts the voltages of lines: frames, `[row * columns + column]`, each `period_us` after the last, straight
    /// in between. Each column is read as it is then; a frame that would end after the last voltages is not begun.
    ///
    /// # Errors
    ///
    /// As [`Adaptive::check`]; `Problem` where voltages are no whole frames, or more than 2e8 readings could come;
    /// `Interrupted`.
    pub fn convert(
        &self,
        volts: &[f64],
        period_us: f64,
        rows: usize,
        columns: usize,
        stop: Stop<'_>,
    ) -> Result<Converted> {
        self.check()?;
        let taxels = rows * columns;
        if taxels == 0 || !volts.len().is_multiple_of(taxels) {
            return Err(problem!("volts"; ": {} values; must be whole frames of {rows} x {columns}", volts.len()));
        }
        if !(period_us > 0.0 && period_us.is_finite()) {
            return Err(problem!("period_us"; " is {period_us} us: must be above 0"));
        }
        let frames = volts.len() / taxels;
        let end_us = frames.saturating_sub(1) as f64 * period_us;
        if end_us / (columns as f64 * self.with(self.steepest).line_us) * taxels as f64 > MOST {
            return Err(problem!(
                "volts last {end_us} us, which can give more than {MOST} readings: split volts into shorter pieces"
            ));
        }
        let mut out = Converted::default();
        let (mut ramp, mut t_us) = (self.gentlest, 0.0);
        let mut scan = ConverterScan::new(self.with(ramp), rows, columns)?;
        let (mut now, mut ticks, mut before) = (vec![0.0; taxels], vec![0.0; taxels], vec![f64::NAN; taxels]);
        let mut coarser_v = 0.0;
        loop {
            stop.check()?;
            let converter = self.with(ramp);
            let (line_us, tick_v) = (converter.line_us, RAMP_END_V / f64::from(ramp));
            let frame_us = columns as f64 * line_us;
            if t_us + frame_us > end_us {
                return Ok(out);
            }
            for x in 0..columns {
                let steps = (t_us + x as f64 * line_us) / period_us;
                let (k, share) = ((steps as usize).min(frames.saturating_sub(2)), steps);
                let share = share - k as f64;
                for y in 0..rows {
                    let at = k * taxels + y * columns + x;
                    now[y * columns + x] = volts[at] + share * (volts[at + taxels] - volts[at]);
                }
            }
            scan.follow(converter);
            scan.frame(&now, &mut ticks);
            out.t_us.push(t_us);
            out.ramp.push(ramp);
            out.ticks.extend(&ticks);
            // The counter shows whole ticks; a comparator that had not returned gives no reading.
            let shape = scan.converter().ramp();
            out.volts.extend(ticks.iter().map(|tick| shape.volts(tick.floor() + 0.5)));
            let mut moved = 0.0;
            for (before, &tick) in before.iter_mut().zip(&ticks) {
                let read = shape.volts(tick.floor());
                let by = (read - *before).abs();
                moved = if by > moved { by } else { moved };
                *before = if read.is_nan() { *before } else { read };
            }
            let noise_v = self.noise_ticks * tick_v.max(coarser_v);
            (coarser_v, t_us) = (tick_v, t_us + frame_us);
            ramp = if moved > noise_v {
                self.fitting(moved / frame_us, columns)
            } else {
                ramp.saturating_mul(2).min(self.gentlest)
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4 rows and 8 columns that all follow a voltage over time, us.
    fn converted(adaptive: &Adaptive, volts: impl Fn(f64) -> f64, us: usize) -> Converted {
        let frames: Vec<f64> = (0..us).flat_map(|t| [volts(t as f64); 32]).collect();
        adaptive.convert(&frames, 1.0, 4, 8, Stop::never()).unwrap()
    }

    #[test]
    fn what_stands_still_is_read_by_the_gentlest_ramp_as_the_converter_reads_it() {
        let converter = Converter { discharge_us: 0.0, ..Converter::default() };
        let adaptive = Adaptive { converter, ..Adaptive::default() };
        let got = converted(&adaptive, |_| 1.7, 3000);
        assert!(got.ramp.iter().all(|&ramp| ramp == 510) && got.ramp.len() > 40);
        let mut ticks = vec![0.0; 32];
        ConverterScan::new(adaptive.with(510), 4, 8).unwrap().frame(&[1.7; 32], &mut ticks);
        assert!(got.ticks.iter().zip(ticks.iter().cycle()).all(|(a, b)| (a - b).abs() < 1e-6));
        let line_us = 3.0 + 4.0 * 360.0 / 300.0;
        assert!((got.t_us[1] - 8.0 * line_us).abs() < 1e-9);
    }

    #[test]
    fn a_frame_moves_by_as_many_ticks_as_asked_for_while_the_signal_is_fast() {
        let adaptive = Adaptive { steepest: 20, moves_ticks: 6.0, ..Adaptive::default() };
        // From 1 to 2.5 V within 1.5 ms: 1 mV/us.
        let got = converted(&adaptive, |t| 1.0 + 1e-3 * t, 1500);
        let settled = &got.ramp[4..];
        let wanted = adaptive.fitting(1e-3, 8);
        let mean = settled.iter().map(|&r| f64::from(r)).sum::<f64>() / settled.len() as f64;
        assert!((mean - f64::from(wanted)).abs() < 0.3 * f64::from(wanted), "{wanted}: {settled:?}");
        let frame_us = 8.0 * adaptive.with(wanted).line_us;
        let moved = 1e-3 * frame_us / (RAMP_END_V / f64::from(wanted));
        assert!(wanted < 510 && (moved - 6.0).abs() < 0.3, "{wanted}: {moved} ticks");
    }

    #[test]
    fn it_turns_steep_at_once_and_gentle_step_by_step() {
        let got = converted(&Adaptive::default(), |t| if t < 1000.0 { 1.3 } else { 2.5 }, 3000);
        let jump = got.ramp.iter().position(|&ramp| ramp < 510).unwrap();
        // The step falls within a frame: columns that were read before it move in the next one.
        assert!(got.ramp[jump] < 60, "{:?}", got.ramp);
        assert_eq!(got.ramp[jump + 1..jump + 6], [38, 76, 152, 304, 510], "{:?}", got.ramp);
        assert!(got.ramp[jump + 6..].iter().all(|&ramp| ramp == 510));
    }

    #[test]
    fn nonsense_is_refused() {
        let wrong = |adaptive: Adaptive| adaptive.convert(&[1.0; 64], 1e3, 4, 8, Stop::never()).is_err();
        assert!(wrong(Adaptive { steepest: 600, ..Adaptive::default() }));
        assert!(wrong(Adaptive { moves_ticks: 0.0, ..Adaptive::default() }));
        let unfit = Converter { step_us: 0.1, ..Converter::default() };
        assert!(wrong(Adaptive { converter: unfit, ..Adaptive::default() }));
        let adaptive = Adaptive::default();
        for (volts, period_us) in [(65, 1.0), (64, 0.0), (64, f64::NAN), (64, 1e300)] {
            assert!(
                adaptive.convert(&vec![1.0; volts], period_us, 4, 8, Stop::never()).is_err(),
                "{volts} {period_us}"
            );
        }
    }
}
