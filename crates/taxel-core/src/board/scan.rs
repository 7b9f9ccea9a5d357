//! The order in which the board reads its taxels.

use crate::Array;
use crate::wire::Registers;

/// The driven lines of a frame and the sense lines of each, in their order.
#[derive(Debug, Clone)]
pub(super) struct ScanOrder {
    /// The sense lines of a driven line, by step and then by channel, each with its step.
    sense_lines: Vec<(u64, u16)>,
    lfsr: Lfsr,
}

impl ScanOrder {
    /// The state of the scan at reset.
    ///
    /// In step s, channel c reads sense line (steps x c + s); lines beyond the array's rows are left out.
    pub(super) fn new(registers: &Registers, array: &Array) -> Self {
        let (steps, channels) = (registers.steps(array) as u16, u16::from(registers.channels));
        let of_step = |step: u16| (0..channels).map(move |channel| (step.into(), steps * channel + step));
        let sense_lines = (0..steps).flat_map(of_step).filter(|&(_, y)| y < array.rows).collect();
        Self { sense_lines, lfsr: Lfsr(Lfsr::SEED) }
    }

    /// Restarts the random order of lines.
    pub(super) fn reset(&mut self) {
        self.lfsr = Lfsr(Lfsr::SEED);
    }

    /// The driven lines of the next frame, in order.
    pub(super) fn lines(&mut self, registers: &Registers) -> Vec<u16> {
        let mut lines: Vec<u16> = (0..registers.lines).collect();
        if registers.random_lines {
            self.lfsr.shuffle(&mut lines);
        }
        lines
    }

    /// The sense lines of a driven line, in order, each with its step.
    pub(super) fn sense_lines(&self) -> &[(u64, u16)] {
        &self.sense_lines
    }
}

/// The 16-bit linear feedback shift register that shuffles the driven lines (Fibonacci; taps 16, 14, 13, 11: all 65 535
/// states).
#[derive(Debug, Clone)]
struct Lfsr(u16);

impl Lfsr {
    /// State at reset (read).
    const SEED: u16 = 0xace1;

    /// Shifts sixteen times, so that each draw is an independent word.
    fn draw(&mut self) -> u16 {
        for _ in 0..16 {
            let bit = (self.0 ^ self.0 >> 2 ^ self.0 >> 3 ^ self.0 >> 5) & 1;
            self.0 = self.0 >> 1 | bit << 15;
        }
        self.0
    }

    /// Shuffles lines (Fisher and Yates, from the first position up, so that logic can draw line by line; the n - k lines
    /// from position k on change places with k by k + (word x (n - k) >> 16)).
    fn shuffle(&mut self, lines: &mut [u16]) {
        let n = lines.len();
        for k in 0..n.saturating_sub(1) {
            let index = k + ((usize::from(self.draw()) * (n - k)) >> 16);
            lines.swap(k, index);
        }
    }
}
