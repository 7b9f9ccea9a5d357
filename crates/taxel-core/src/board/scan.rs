//! In which order the board looks at its taxels.

use crate::wire::registers::SENSE_LINES;

/// The sense lines that convert together, step after step, each in the order of the channels.
///
/// Step s puts sense line 4 c + s on channel c of 16; with 64 channels there is one step, and line c is on channel c.
#[must_use]
pub(crate) fn sense_lines(channels: u8) -> Vec<Vec<u16>> {
    let steps = SENSE_LINES / u16::from(channels);
    (0..steps).map(|step| (0..u16::from(channels)).map(|channel| steps * channel + step).collect()).collect()
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
