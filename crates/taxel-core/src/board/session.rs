//! A board's session from reset to stop, as the demo and `taxel emulate` use it: arming, tare, start and stop.

use super::{Board, BoardCounts};
use crate::spikes::us;
use crate::wire::{Command, Registers};
use crate::{Result, Stop, problem};

/// The commands of a session of `frames` frames, each with the frame before which it is sent.
///
/// The first frame arms the board ([`Board::arm`]). During the tare the noise floor is 0, so that every taxel sends its
/// rest repeatedly; `tare_ms` later the floor of `registers` is written and the recording started, and before the last
/// frame it is stopped.
///
/// # Errors
///
/// `Problem` if the tare is not between 0 and a minute, or does not leave two frames.
pub fn session(registers: &Registers, tare_ms: f64, frames: u64) -> Result<Vec<(u64, Command)>> {
    let mut commands = opening(registers, tare_ms)?;
    let start = commands.last().map_or(1, |(frame, _)| *frame);
    if frames < start + 2 {
        return Err(problem!(
            "{frames} frames are too few: arming, a tare of {tare_ms} ms, start and stop need {} or more",
            start + 2
        ));
    }
    commands.push((frames - 1, write(7, Registers { record: false, ..*registers })));
    Ok(commands)
}

/// The commands at the start of a session of any length: those of [`session`] without the stop.
///
/// # Errors
///
/// `Problem` if the tare is not between 0 and a minute.
pub fn opening(registers: &Registers, tare_ms: f64) -> Result<Vec<(u64, Command)>> {
    if !(0.0..=60_000.0).contains(&tare_ms) {
        return Err(problem!("tare_ms"; " is {tare_ms} ms: must be from 0 to 60000"));
    }
    let start = 1 + (us(tare_ms) / registers.frame_us()).ceil() as u64;
    let mut commands = vec![];
    if start > 1 {
        commands.push((1, write(5, Registers { noise_floor: 0, ..*registers })));
        commands.push((start, write(5, *registers)));
    }
    commands.push((start, write(7, Registers { record: true, ..*registers })));
    Ok(commands)
}

fn write(register: u8, registers: Registers) -> Command {
    Command { register, value: registers.word(register) }
}

impl Board {
    /// Scans the first frame and discards its events: at reset all reference values are 0, so every taxel would be
    /// sent. The frame and its faults are counted, the discarded events are not.
    ///
    /// # Errors
    ///
    /// As [`Board::frame`].
    pub fn arm(&mut self, ticks: &[u16]) -> Result<()> {
        let before = self.counts;
        self.frame(ticks, |_| true)?;
        self.asynchronous.clear();
        let BoardCounts { frames, not_returned, .. } = self.counts;
        self.counts = BoardCounts { frames, not_returned, ..before };
        Ok(())
    }

    /// Scans frames as fast as possible until `touch` returns none.
    ///
    /// `touch` writes the trip times of a frame; each command is executed before the frame with its number.
    ///
    /// # Errors
    ///
    /// As [`Board::frame`]; `Interrupted` if asked to stop.
    pub fn play(
        &mut self,
        mut touch: impl FnMut(&mut [u16]) -> Result<bool>,
        commands: &[(u64, Command)],
        mut sink: impl FnMut(&[u8]) -> bool,
        stop: Stop<'_>,
    ) -> Result<()> {
        let mut ticks = vec![0; self.array.len()];
        let mut commands = commands.iter().peekable();
        while touch(&mut ticks)? {
            stop.check()?;
            while let Some((_, command)) = commands.next_if(|(frame, _)| *frame <= self.counts.frames) {
                self.command(&command.to_bytes());
            }
            self.frame(&ticks, &mut sink)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Array;

    #[test]
    fn the_board_arms_tares_starts_and_stops() {
        let registers = Registers { noise_floor: 3, ..Registers::default() };
        let commands = session(&registers, 1.0, 12).unwrap();
        let mut board = Board::new(registers, &Array::thesis()).unwrap();
        board.arm(&[50; 4096]).unwrap();
        let (mut frame, mut words) = (0, [0; 12]);
        let last = std::cell::Cell::new(0);
        let touch = |ticks: &mut [u16]| {
            // A taxel that changes by one tick per frame, which makes events with a floor of 0 only.
            frame += 1;
            ticks.fill(50);
            ticks[9] += frame as u16 % 2;
            last.set(frame);
            Ok(frame < 12)
        };
        let sink = |datagram: &[u8]| {
            words[last.get()] += datagram.len() / 5;
            true
        };
        board.play(touch, &commands, sink, Stop::never()).unwrap();
        // Six frames of 192 us for the tare; then a start, no events, a stop.
        assert_eq!(words, [0, 2, 2, 2, 2, 2, 2, 1, 0, 0, 0, 1]);
        let counts = board.counts();
        assert_eq!((counts.frames, counts.changes, counts.sent), (12, 6, words.iter().sum::<usize>() as u64));
        assert_eq!(board.registers().noise_floor, 3);
        assert!(!board.registers().record);
    }

    #[test]
    fn without_a_tare_the_second_frame_starts() {
        let commands = session(&Registers::default(), 0.0, 10).unwrap();
        assert_eq!(commands.iter().map(|(frame, c)| (*frame, c.register)).collect::<Vec<_>>(), [(1, 7), (9, 7)]);
    }

    #[test]
    fn a_session_that_cannot_be_is_refused() {
        for wrong in [-1.0, f64::NAN, 1e9] {
            assert!(session(&Registers::default(), wrong, 1 << 40).is_err());
        }
        assert!(session(&Registers::default(), 50.0, 262).is_err());
        assert!(session(&Registers::default(), 50.0, 264).is_ok());
    }
}
