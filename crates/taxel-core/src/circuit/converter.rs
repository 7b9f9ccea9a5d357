//! The multiplexer, the comparators and the counters: from the amplifiers' voltages to ticks.
//!
//! While a column is read its sense lines are put on the channels' comparators one after the other. A comparator's input
//! settles towards its line's voltage with the multiplexer's time constant, and that line, where the amplifiers are slow,
//! from its voltage in the last column. Meanwhile the ramp rises; a reading is the time at which the comparator first trips.

use serde::{Deserialize, Serialize};

use super::ramp::{RAMP_END_V, Ramp, RampShape};
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::{Result, problem};

/// Ticks of the counter in 1 us.
pub const TICKS_A_US: f64 = 300.0;

parameters! {
    /// How voltages become ticks; the times are those of the preset "5.2 kHz".
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Converter {
        /// How the ramp rises.
        pub shape: RampShape = RampShape::Rc;
        /// How long it rises, ticks of 1/300 us.
        pub ramp: u32 = 150, "ticks", Range::within(1.0, 65_534.0);
        /// Between a comparator's two thresholds, V (thesis 4.3.2).
        pub hysteresis_v: f64 = 0.1, "V", Range::FROM_0;
        /// Time constant of a comparator's input behind the multiplexer, us: it settles to 2 % in 0.2 us (4.4.1).
        pub settle_us: f64 = 0.05, "us", TIME;
        /// Time constant of the amplifiers, `R_f C`, us: a column's voltage decays with it in the next. 0: they settle
        /// at once.
        pub amplifier_us: f64 = 0.0, "us", TIME;
        /// Time constant with which the ramp falls back, us. A guess.
        pub discharge_us: f64 = 0.02, "us", TIME;
        /// From a step's beginning to the ramp's, us.
        pub wait_us: f64 = 0.2, "us", TIME;
        /// From one sense line of a channel to its next, us.
        pub step_us: f64 = 0.75, "us", Range::ABOVE_0.at_most(1e6);
        /// From one column to the next, us.
        pub line_us: f64 = 3.0, "us", Range::ABOVE_0.at_most(1e6);
        /// Sense lines of a channel.
        pub steps: usize = 4, "", Range::within(1.0, 65_535.0);
    }
}

/// The most points of a trace, and the most steps of the multiplexer in one.
const MOST_POINTS: f64 = 1e7;

/// A time, us.
const TIME: Range = Range::FROM_0.at_most(1e6);

impl Converter {
    /// Checks every parameter, and that a step holds its ramp and a column its steps.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        let Self { step_us, line_us, steps, .. } = *self;
        let least = self.wait_us + f64::from(self.ramp) / TICKS_A_US;
        // The board's own times are whole numbers of 10 ns: sums of them may be off in the last place.
        if step_us < least - 1e-9 {
            return Err(problem!(
                "step_us"; " is {step_us} us: must be {least:.4} or more, the length of wait_us and the ramp"
            ));
        }
        let least = steps as f64 * step_us;
        if line_us < least - 1e-9 {
            return Err(problem!(
                "line_us"; " is {line_us} us: must be {least} or more, the length of {steps} steps of {step_us} us"
            ));
        }
        Ok(())
    }

    /// Its ramp.
    #[must_use]
    pub fn ramp(&self) -> Ramp {
        Ramp { shape: self.shape, ticks: f64::from(self.ramp) }
    }

    /// The voltage of the ramp that ended `after_us` ago, V.
    fn end_voltage(&self, after_us: f64) -> f64 {
        RAMP_END_V * decay(after_us, self.discharge_us)
    }

    /// The shape of a comparator's input in a step.
    ///
    /// `line_v` is the line's voltage when it has settled, `over_v` by how much it lies above that as the step begins,
    /// and `input_v` the comparator's input then.
    fn input(&self, line_v: f64, over_v: f64, input_v: f64) -> Input {
        let (slow, mut fast) = (self.amplifier_us, self.settle_us);
        if (slow - fast).abs() < 1e-6 * fast {
            // Equal time constants have a formula of their own; those a millionth apart give the same result.
            fast *= 1.0 + 2e-6;
        }
        let carried = if over_v == 0.0 { 0.0 } else { over_v * slow / (slow - fast) };
        let settling = if fast == 0.0 { 0.0 } else { input_v - line_v - carried };
        Input { line_v, carried, slow, settling, fast }
    }

    /// Where the ramp, `from` ticks ahead of its beginning, passes an input, ticks; the ramp's time at most.
    fn reading(&self, input: &Input, from: f64) -> f64 {
        let (ramp, most, half) = (self.ramp(), f64::from(self.ramp), 0.5 * self.hysteresis_v);
        let at = |tick: f64| input.at(self.wait_us + tick / TICKS_A_US);
        let passes = |tick: f64| ramp.ticks_if_it_went_on(at(tick) + half) - from;
        // An input that moves much more slowly than the ramp meets it once, and each iteration comes closer to that time.
        if input.steepest(self.wait_us) / TICKS_A_US < 0.1 * ramp.least_slope() {
            let mut tick = passes(most).clamp(0.0, most);
            for _ in 0..30 {
                let next = passes(tick).clamp(0.0, most);
                if (next - tick).abs() < 1e-6 {
                    return next;
                }
                tick = next;
            }
        }
        // Otherwise tick by tick, as the counter does; between two ticks the input is taken as a straight line.
        let ahead = |tick: f64| tick - passes(tick);
        let mut before = ahead(0.0);
        if before >= 0.0 {
            return 0.0;
        }
        for tick in 1..=self.ramp {
            let now = ahead(tick.into());
            if now >= 0.0 {
                let share = if before.is_finite() { now / (now - before) } else { 0.0 };
                return f64::from(tick) - share;
            }
            before = now;
        }
        most
    }

    /// The signals of one comparator, as an oscilloscope would show them, while its lines, `line_v`, are read one after
    /// the other, again and again, with a point each `every_us`.
    ///
    /// # Errors
    ///
    /// `Problem` where there is not one voltage a step, or the points or the steps until `stop_us` are too many.
    pub fn trace(&self, line_v: &[f64], every_us: f64, stop_us: f64) -> Result<Vec<Moment>> {
        self.check()?;
        if line_v.len() != self.steps {
            return Err(problem!("voltages: {} values; must be one per step, {}", line_v.len(), self.steps));
        }
        if let Some(k) = line_v.iter().position(|v| !v.is_finite()) {
            return Err(problem!("voltages[{k}] is {}: must be finite", line_v[k]));
        }
        if !(every_us > 0.0 && every_us.is_finite() && stop_us / every_us <= MOST_POINTS) {
            return Err(problem!(
                "every_us"; " is {every_us} us: must be above 0 and finite, with at most {MOST_POINTS:e} points in {stop_us} us"
            ));
        }
        let most_us = MOST_POINTS * self.step_us;
        if !(0.0..=most_us).contains(&stop_us) {
            return Err(problem!(
                "stop_us"; " is {stop_us} us: must be from 0 to {most_us} ({MOST_POINTS:e} steps)"
            ));
        }
        let (ramp_us, half) = (f64::from(self.ramp) / TICKS_A_US, 0.5 * self.hysteresis_v);
        let mut input_v = line_v[self.steps - 1];
        let (mut step, mut begun_us) = (0, 0.0);
        let mut high = false;
        let mut moments = vec![];
        for k in 0..=(stop_us / every_us) as usize {
            let t_us = k as f64 * every_us;
            loop {
                let last = step % self.steps + 1 == self.steps;
                let takes = if last { self.line_us - (self.steps - 1) as f64 * self.step_us } else { self.step_us };
                if t_us < begun_us + takes {
                    break;
                }
                input_v = self.input(line_v[step % self.steps], 0.0, input_v).at(takes);
                (step, begun_us) = (step + 1, begun_us + takes);
            }
            let since = t_us - begun_us;
            let input = self.input(line_v[step % self.steps], 0.0, input_v).at(since);
            let ramp_v = match since - self.wait_us {
                up if (0.0..=ramp_us).contains(&up) => self.ramp().volts(up * TICKS_A_US),
                down if down > 0.0 => self.end_voltage(down - ramp_us),
                _ if step == 0 => 0.0,
                before => self.end_voltage(before + self.step_us - ramp_us),
            };
            high = if high { ramp_v >= input - half } else { ramp_v >= input + half };
            moments.push(Moment { t_us, line_v: line_v[step % self.steps], input_v: input, ramp_v, high });
        }
        Ok(moments)
    }
}

/// `exp(-t / tau)`; 0 where the time constant is 0.
fn decay(t_us: f64, tau_us: f64) -> f64 {
    if tau_us > 0.0 { (-t_us / tau_us).exp() } else { 0.0 }
}

/// A comparator's input in a step: its line's settled voltage, the rest of the last column's on the line, and the rest of
/// the last line's at the input.
#[derive(Debug, Clone, Copy)]
struct Input {
    line_v: f64,
    carried: f64,
    slow: f64,
    settling: f64,
    fast: f64,
}

impl Input {
    fn at(&self, since_us: f64) -> f64 {
        let mut volts = self.line_v;
        if self.carried != 0.0 {
            volts += self.carried * decay(since_us, self.slow);
        }
        if self.settling != 0.0 {
            volts += self.settling * decay(since_us, self.fast);
        }
        volts
    }

    /// The largest slope that it can have from then on, V/us.
    fn steepest(&self, since_us: f64) -> f64 {
        let output = |size: f64, tau: f64| if size == 0.0 { 0.0 } else { size.abs() * decay(since_us, tau) / tau };
        output(self.carried, self.slow) + output(self.settling, self.fast)
    }
}

/// A point of [`Converter::trace`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// When, us.
    pub t_us: f64,
    /// The voltage of the sense line that the multiplexer has chosen, V.
    pub line_v: f64,
    /// The comparator's input, V.
    pub input_v: f64,
    /// The ramp, V.
    pub ramp_v: f64,
    /// The comparator's output: whether the ramp has passed.
    pub high: bool,
}

/// A converter that scans frame after frame, with its state at the end of the last one.
#[derive(Debug, Clone)]
pub struct ConverterScan {
    converter: Converter,
    columns: usize,
    /// By row: the line as its column ends. By channel: the comparator's input and output as its step ends.
    line_v: Vec<f64>,
    input_v: Vec<f64>,
    high: Vec<bool>,
    begun: bool,
}

impl ConverterScan {
    /// A scan of an array.
    ///
    /// # Errors
    ///
    /// As [`Converter::check`].
    pub fn new(converter: Converter, rows: usize, columns: usize) -> Result<Self> {
        converter.check()?;
        let channels = rows.div_ceil(converter.steps);
        let (line_v, input_v, high) = (vec![0.0; rows], vec![0.0; channels], vec![false; channels]);
        Ok(Self { converter, columns, line_v, input_v, high, begun: false })
    }

    /// How voltages become ticks.
    #[must_use]
    pub fn converter(&self) -> &Converter {
        &self.converter
    }

    /// Goes on with other times; as many steps as before, and checked.
    pub(super) fn follow(&mut self, converter: Converter) {
        debug_assert_eq!(converter.steps, self.converter.steps);
        self.converter = converter;
    }

    /// Converts a frame of voltages, `[row * columns + column]`, columns in their order; each step of a channel reads
    /// its next row. Ticks with their fraction; not a number where a comparator had not returned when the ramp began.
    ///
    /// Before the first frame everything is settled. Where voltages are fewer than taxels, those given are converted.
    pub fn frame(&mut self, volts: &[f64], ticks: &mut [f64]) {
        let Converter { steps, step_us, line_us, wait_us, amplifier_us, hysteresis_v, ramp, .. } = self.converter;
        let (columns, half) = (self.columns, 0.5 * hysteresis_v);
        let idle_us = step_us - f64::from(ramp) / TICKS_A_US;
        let (left, left_by_column) = (self.converter.end_voltage(idle_us), {
            self.converter.end_voltage(idle_us + line_us - steps as f64 * step_us)
        });
        for x in 0..columns {
            for step in 0..steps {
                let (begins_us, last) = (step as f64 * step_us, step + 1 == steps);
                let takes = if last { line_us - begins_us } else { step_us };
                for channel in 0..self.input_v.len() {
                    let y = steps * channel + step;
                    let Some((&line_v, out)) = volts.get(y * columns + x).zip(ticks.get_mut(y * columns + x)) else {
                        continue;
                    };
                    let over_v = match self.begun {
                        true => (self.line_v[y] - line_v) * decay(begins_us, amplifier_us),
                        false => 0.0,
                    };
                    let before = if self.begun { self.input_v[channel] } else { line_v };
                    let input = self.converter.input(line_v, over_v, before);
                    let ramp_v = match step {
                        0 if self.begun => left_by_column,
                        0 => 0.0,
                        _ => left,
                    };
                    let returned = !self.high[channel] || ramp_v < input.at(wait_us) - half;
                    *out = if returned {
                        self.converter.reading(&input, self.converter.ramp().ticks(ramp_v))
                    } else {
                        f64::NAN
                    };
                    self.high[channel] = !returned || *out < f64::from(ramp);
                    self.input_v[channel] = input.at(takes);
                }
            }
            for (y, line_v) in self.line_v.iter_mut().enumerate() {
                let now = volts.get(y * columns + x).copied().unwrap_or_default();
                *line_v = if self.begun { now + (*line_v - now) * decay(line_us, amplifier_us) } else { now };
            }
            self.begun = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(converter: Converter, frames: &[&[f64]], columns: usize) -> Vec<Vec<f64>> {
        let mut scan = ConverterScan::new(converter, frames[0].len() / columns, columns).unwrap();
        let mut ticks = vec![0.0; frames[0].len()];
        frames
            .iter()
            .map(|volts| {
                scan.frame(volts, &mut ticks);
                ticks.clone()
            })
            .collect()
    }

    fn at_once() -> Converter {
        Converter { hysteresis_v: 0.0, settle_us: 0.0, discharge_us: 0.0, ..Converter::default() }
    }

    #[test]
    fn what_settles_at_once_reads_the_ramp_s_own_inverse() {
        let volts: Vec<f64> = (0..24).map(|k| 0.3 + 0.2 * f64::from(k)).collect();
        let ramp = at_once().ramp();
        for (got, v) in frames(at_once(), &[&volts], 3)[0].iter().zip(&volts) {
            assert!((got - ramp.ticks(*v)).abs() < 1e-9, "{v} V reads {got}");
        }
        let wide = Converter { hysteresis_v: 0.4, ..at_once() };
        for (got, v) in frames(wide, &[&volts], 3)[0].iter().zip(&volts) {
            assert!((got - ramp.ticks(v + 0.2)).abs() < 1e-9, "half the hysteresis is on top: {v} V reads {got}");
        }
    }

    #[test]
    fn an_input_meets_the_ramp_where_both_stand_at_one_voltage() {
        // Two time constants, fast and slow, above and below: the reading solves ramp = input + half the hysteresis.
        for (amplifier_us, settle_us) in [(0.0, 0.05), (0.705, 0.0), (0.705, 0.05), (0.3, 0.3), (5.0, 0.4)] {
            let converter = Converter { amplifier_us, settle_us, ..Converter::default() };
            for (line_v, over_v, input_v) in [(1.4, 0.0, 2.9), (2.9, 0.0, 1.4), (1.5, 1.2, 2.0), (2.5, -1.0, 1.3)] {
                let input = converter.input(line_v, over_v, input_v);
                assert!((input.at(0.0) - if settle_us > 0.0 { input_v } else { line_v + over_v }).abs() < 1e-6);
                assert!((input.at(1e3) - line_v).abs() < 1e-9);
                let tick = converter.reading(&input, 0.0);
                let gap = converter.ramp().volts(tick) - input.at(0.2 + tick / TICKS_A_US) - 0.05;
                assert!(
                    gap.abs() < 2e-4 || tick == 150.0 && gap < 0.0,
                    "{amplifier_us} {settle_us} {line_v}: {tick}, {gap}"
                );
            }
        }
    }

    #[test]
    fn slow_amplifiers_carry_a_column_over_by_the_stated_share() {
        // Appendix: exp(-0.75 / 0.705) is left after the first slot, 1.4 % after the fourth.
        let converter = Converter { amplifier_us: 0.705, settle_us: 0.0, ..at_once() };
        let (low, high) = (vec![1.4; 4], vec![2.4; 4]);
        let two: Vec<f64> = (0..4).flat_map(|k| [high[k], low[k]]).collect();
        let read = &frames(converter.clone(), &[&two, &two], 2)[1];
        for y in 0..4 {
            let tick = read[2 * y + 1];
            let since = 0.75 * y as f64 + 0.2 + tick / TICKS_A_US;
            // Column 1 was at 1.4 V before column 0: that went from it to 2.4 V for 3 us.
            let left = (1.0 - (-3.0_f64 / 0.705).exp()) * (-since / 0.705).exp();
            assert!((converter.ramp().volts(tick) - 1.4 - left).abs() < 3e-3, "row {y}: {tick}");
        }
        assert!(((-0.75_f64 / 0.705).exp() - 0.35).abs() < 0.01 && ((-3.0_f64 / 0.705).exp() - 0.014).abs() < 1e-3);
    }

    #[test]
    fn a_comparator_that_the_ramp_leaves_high_has_not_returned() {
        let volts = [1.3; 8];
        let slow = Converter { discharge_us: 5.0, ..at_once() };
        let read = frames(slow, &[&volts, &volts], 1);
        assert!(read[0][0].is_finite() && read[0][1].is_nan() && read[1][0].is_nan(), "{read:?}");
        // An input that stays above the ramp, even one that begins charged, never trips: no comparator has to return.
        let read = frames(Converter { discharge_us: 5.0, ..at_once() }, &[&[4.9; 8], &[4.9; 8]], 1);
        assert!(read.concat().iter().all(|&t| t == 150.0), "{read:?}");
        let quick = frames(Converter { discharge_us: 0.02, ..at_once() }, &[&volts, &volts], 1);
        assert!(quick.concat().iter().all(|t| (t - quick[0][0]).abs() < 0.01), "{quick:?}");
    }

    #[test]
    fn a_trace_shows_one_rise_of_the_comparator_a_step_where_it_reads() {
        let lines = [1.4, 2.2, 1.9, 2.7];
        let converter = Converter::default();
        let moments = converter.trace(&lines, 0.001, 12.0).unwrap();
        let rises: Vec<&Moment> = moments.windows(2).filter(|w| !w[0].high && w[1].high).map(|w| &w[1]).collect();
        assert_eq!(rises.len(), 16);
        let read = frames(converter, &[&lines, &lines], 1)[1].clone();
        for (k, rise) in rises[4..8].iter().enumerate() {
            let tick = (rise.t_us - 3.0 - 0.75 * k as f64 - 0.2) * TICKS_A_US;
            assert!((tick - read[k]).abs() < 0.5, "step {k}: {tick} {}", read[k]);
        }
    }

    #[test]
    fn times_that_do_not_fit_are_refused() {
        for (wrong, name) in [
            (Converter { ramp: 300, ..Converter::default() }, "step_us"),
            (Converter { line_us: 2.9, ..Converter::default() }, "line_us"),
            (Converter { hysteresis_v: f64::NAN, ..Converter::default() }, "hysteresis_v"),
        ] {
            assert!(ConverterScan::new(wrong, 4, 4).unwrap_err().to_string().contains(name));
        }
        assert!(Converter::default().trace(&[1.0; 3], 0.01, 1.0).is_err());
    }
}
