//! Made from registers.toml by tools/registers.py (`make registers`): edit that.

use super::field::{Scanned, rules, us};
use super::table::Registers;

rules! {
    /// The rules by which values are not allowed, with their numbers.
    fn refusals(
        registers: Registers [random_lines wire_version line_period line_read step_period step_read ramp lines channels],
        scanned: Scanned [steps driven_lines sense_lines]
    );
    4, lines > driven_lines =>
        "lines is {lines}: must be at most {driven_lines}, the number of the array's columns (rule 4)";
    1, line_read > line_period =>
        "line_read {} us is longer than line_period {} us (rule 1)", us(line_read), us(line_period);
    1, step_read > step_period =>
        "step_read {} us is longer than step_period {} us (rule 1)", us(step_read), us(step_period);
    2, steps * step_period > line_read =>
        "step_period {} us is too long for line_read {} us: {steps} steps take {} us (rule 2)", us(step_period), us(line_read), us(steps * step_period);
    3, ramp + 5 > 3 * step_read =>
        "ramp {ramp} ticks is too long for step_read {} us = {} ticks: the ramp must be at least 5 ticks shorter (rule 3)", us(step_read), 3 * step_read;
    5, random_lines != 0 && 16 * lines > line_period =>
        "random_lines: moving to any of {lines} lines takes up to {} us, longer than line_period {} us (rule 5)", us(16 * lines), us(line_period);
    7, channels + 10 > step_period =>
        "step_period {} us is too short for {channels} channels: the logic compares one channel per clock and needs {} us (rule 7)", us(step_period), us(channels + 10);
    8, wire_version != 2 && (driven_lines > 64 || sense_lines > 64) =>
        "wire_version {wire_version} can address only 64 x 64 taxels, but the array has {sense_lines} x {driven_lines}: choose version 2 (rule 8)";
}

rules! {
    /// The rules by which values are probably mistakes, with their numbers.
    fn warnings(
        registers: Registers [random_lines step_period step_read ramp noise_floor lines]
    );
    5, step_period - step_read < 20 =>
        "step_period {} us leaves only {} us before step_read {} us: taxels need {} us to settle (rule 5)", us(step_period), us(step_period - step_read), us(step_read), us(20);
    5, random_lines != 0 && 16 * lines + 20 > step_period - step_read =>
        "random_lines: only {} us are left before step_read: with {lines} lines, taxels need {} us to settle (rule 5)", us(step_period - step_read), us(16 * lines + 20);
    6, noise_floor >= ramp =>
        "noise_floor {noise_floor} ticks must be below ramp {ramp} ticks: otherwise the board sends no events (rule 6)";
}
