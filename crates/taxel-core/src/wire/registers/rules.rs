//! Made from registers.toml by tools/registers.py (`make registers`): edit that.

use super::field::{Scanned, us};
use super::table::Registers;

/// The first rule that refuses these registers, with its numbers.
pub(super) fn first_refusal(registers: &Registers, scanned: &Scanned) -> Option<(u8, String)> {
    let random_lines = i64::from(registers.random_lines);
    let wire_version = i64::from(registers.wire_version);
    let line_period = i64::from(registers.line_period);
    let line_read = i64::from(registers.line_read);
    let step_period = i64::from(registers.step_period);
    let step_read = i64::from(registers.step_read);
    let ramp = i64::from(registers.ramp);
    let lines = i64::from(registers.lines);
    let channels = i64::from(registers.channels);
    let steps = i64::from(scanned.steps);
    let driven_lines = i64::from(scanned.driven_lines);
    let sense_lines = i64::from(scanned.sense_lines);
    if lines > driven_lines {
        return Some((
            4,
            format!("lines is {}: must be at most {}, the number of the array's columns (rule 4)", lines, driven_lines),
        ));
    }
    if line_read > line_period {
        return Some((
            1,
            format!("line_read {} us is longer than line_period {} us (rule 1)", us(line_read), us(line_period)),
        ));
    }
    if step_read > step_period {
        return Some((
            1,
            format!("step_read {} us is longer than step_period {} us (rule 1)", us(step_read), us(step_period)),
        ));
    }
    if steps * step_period > line_read {
        return Some((
            2,
            format!(
                "step_period {} us is too long for line_read {} us: {} steps take {} us (rule 2)",
                us(step_period),
                us(line_read),
                steps,
                us(steps * step_period)
            ),
        ));
    }
    if ramp + 5 > 3 * step_read {
        return Some((
            3,
            format!(
                "ramp {} ticks is too long for step_read {} us = {} ticks: the ramp must be at least 5 ticks shorter (rule 3)",
                ramp,
                us(step_read),
                3 * step_read
            ),
        ));
    }
    if random_lines != 0 && 16 * lines > line_period {
        return Some((
            5,
            format!(
                "random_lines: moving to any of {} lines takes up to {} us, longer than line_period {} us (rule 5)",
                lines,
                us(16 * lines),
                us(line_period)
            ),
        ));
    }
    if channels + 10 > step_period {
        return Some((
            7,
            format!(
                "step_period {} us is too short for {} channels: the logic compares one channel per clock and needs {} us (rule 7)",
                us(step_period),
                channels,
                us(channels + 10)
            ),
        ));
    }
    if wire_version != 2 && (driven_lines > 64 || sense_lines > 64) {
        return Some((
            8,
            format!(
                "wire_version {} can address only 64 x 64 taxels, but the array has {} x {}: choose version 2 (rule 8)",
                wire_version, sense_lines, driven_lines
            ),
        ));
    }
    None
}

/// Warnings about values that are allowed but probably a mistake.
pub(super) fn warnings(registers: &Registers) -> Vec<(u8, String)> {
    let mut warnings = vec![];
    let random_lines = i64::from(registers.random_lines);
    let step_period = i64::from(registers.step_period);
    let step_read = i64::from(registers.step_read);
    let ramp = i64::from(registers.ramp);
    let noise_floor = i64::from(registers.noise_floor);
    let lines = i64::from(registers.lines);
    if step_period - step_read < 20 {
        warnings.push((
            5,
            format!(
                "step_period {} us leaves only {} us before step_read {} us: taxels need {} us to settle (rule 5)",
                us(step_period),
                us(step_period - step_read),
                us(step_read),
                us(20)
            ),
        ));
    }
    if random_lines != 0 && 16 * lines + 20 > step_period - step_read {
        warnings.push((5, format!(
            "random_lines: only {} us are left before step_read: with {} lines, taxels need {} us to settle (rule 5)",
            us(step_period - step_read), lines, us(16 * lines + 20)
        )));
    }
    if noise_floor >= ramp {
        warnings.push((
            6,
            format!(
                "noise_floor {} ticks must be below ramp {} ticks: otherwise the board sends no events (rule 6)",
                noise_floor, ramp
            ),
        ));
    }
    warnings
}
