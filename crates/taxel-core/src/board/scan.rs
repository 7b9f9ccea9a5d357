//! In which order the board looks at its taxels.

use crate::Array;
use crate::wire::Registers;

/// The sense lines that convert together, step after step, each in the order of the channels.
///
/// Step s puts sense line (steps x c + s) on channel c; of these only the array's rows are there.
#[must_use]
pub(crate) fn sense_lines(registers: &Registers, array: &Array) -> Vec<Vec<u16>> {
    let steps = registers.steps(array) as u16;
    let channels = u16::from(registers.channels);
    let line =
        |step: u16| (0..channels).map(move |channel| steps * channel + step).filter(|&y| y < array.rows).collect();
    (0..steps).map(line).collect()
}

/// The 16-bit shift register that shuffles the driven lines (Fibonacci; taps 16, 14, 13, 11: all 65 535 states).
#[derive(Debug, Clone)]
pub(crate) struct Lfsr(u16);

impl Lfsr {
    /// What it holds at reset (read).
    pub(crate) const SEED: u16 = 0xace1;

    pub(crate) fn new() -> Self {
        Self(Self::SEED)
    }

    /// Sixteen shifts on: each draw is a fresh word.
    fn draw(&mut self) -> u16 {
        for _ in 0..16 {
            let bit = (self.0 ^ self.0 >> 2 ^ self.0 >> 3 ^ self.0 >> 5) & 1;
            self.0 = self.0 >> 1 | bit << 15;
        }
        self.0
    }

    /// Shuffles lines (Fisher and Yates, from the last place down; place = word x (k + 1) >> 16).
    pub(crate) fn shuffle(&mut self, lines: &mut [u16]) {
        for k in (1..lines.len()).rev() {
            let place = (usize::from(self.draw()) * (k + 1)) >> 16;
            lines.swap(k, place);
        }
    }
}
