//! One frame of the board: it scans the array, queues the changes and advances time.

use super::Board;
use super::asynchronous::{Asynchronous, Sample, TaxelCrossing};
use super::comparator::NOT_RETURNED;
use super::link::ScannedEvent;
use super::options::{IntensityWord, Previous};
use crate::{Result, problem};

/// What is given of a frame, by taxel: trip times, and whose events find room.
#[derive(Clone, Copy)]
struct FrameReading<'a> {
    ticks: &'a [u16],
    accepted: Option<&'a [bool]>,
}

impl Board {
    /// Scans one frame and advances time by its length.
    ///
    /// `ticks` are the comparators' trip times by taxel index, in 1/300 us from the ramp's start; one at or above the
    /// ramp's length reads as that length, and [`NOT_RETURNED`] is a fault. `sink` receives each datagram's payload and
    /// returns whether it accepted it. Datagrams that it does not accept wait in the queue; if the queue is full, a
    /// taxel's words are dropped. With `pattern` set, [`pattern`](super::pattern()) takes the place of the trip times.
    ///
    /// # Errors
    ///
    /// `Problem` if the number of trip times is not that of taxels.
    pub fn frame(&mut self, ticks: &[u16], sink: impl FnMut(&[u8]) -> bool) -> Result<()> {
        self.frame_accepting(ticks, None, sink)
    }

    /// [`Self::frame`], in which only these taxels' events find room; those of others are dropped and counted.
    ///
    /// # Errors
    ///
    /// `Problem` if the number of trip times or of flags is not that of taxels.
    pub fn frame_accepting(
        &mut self,
        ticks: &[u16],
        accepted: Option<&[bool]>,
        mut sink: impl FnMut(&[u8]) -> bool,
    ) -> Result<()> {
        if ticks.len() != self.array.len() {
            return Err(problem!("frame of {} trip times: the array has {} taxels", ticks.len(), self.array.len()));
        }
        if let Some(accepted) = accepted
            && accepted.len() != self.array.len()
        {
            return Err(problem!("accepted has {} entries: the array has {} taxels", accepted.len(), self.array.len()));
        }
        self.take_over();
        self.link.offer(&mut self.counts, &mut sink);
        let registers = self.active;
        let of_ball = self.ball.frame(&self.array, registers.pattern, registers.ramp);
        let ticks = of_ball.as_deref().unwrap_or(ticks);
        let read = FrameReading { ticks, accepted };
        let lines = self.scan.lines(&registers);
        let any = self.compare(ticks);
        if self.is_asynchronous() {
            self.queue_crossings(any, read, &mut sink);
        } else if any {
            for (n, &x) in (0_u64..).zip(&lines) {
                if self.comparators.line_changed[usize::from(x)] {
                    self.line(x, self.time + n * u64::from(registers.line_period), read, &mut sink);
                }
            }
        }
        if self.options.previous == Previous::LastSample && !registers.mechanoreceptor {
            self.comparators.sample(ticks, &registers);
        }
        self.time += registers.frame_10ns();
        self.counts.frames += 1;
        self.end_frame(&mut sink);
        Ok(())
    }

    /// Applies the written registers, between two frames.
    fn take_over(&mut self) {
        if self.active == self.written {
            return;
        }
        if self.active.wire_version != self.written.wire_version {
            self.link.flush_words();
        }
        if self.active.mechanoreceptor != self.written.mechanoreceptor {
            self.afferents.forget();
            self.asynchronous = Asynchronous::default();
        }
        self.active = self.written;
        let now = self.now();
        self.link.with_packer(|packer| packer.flush(now));
        self.link.follow(self.settings());
    }

    /// Finds the taxels that make an event in this frame; returns whether there is any.
    fn compare(&mut self, ticks: &[u16]) -> bool {
        let (registers, faults) = (self.active, &mut self.counts.not_returned);
        if !registers.mechanoreceptor {
            return self.comparators.compare(ticks, &registers, faults);
        }
        let afferents = &mut self.afferents;
        self.comparators.fire(ticks, &registers, faults, |taxel, t| afferents.sample(taxel, t, &registers))
    }

    /// Queues the events of one driven line: step by step, channel by channel. For version 2, with all events of a
    /// frame at one time, row by row, because the words' positions must ascend.
    fn line(&mut self, x: u16, start: u64, read: FrameReading<'_>, sink: &mut impl FnMut(&[u8]) -> bool) {
        let registers = self.active;
        if registers.wire_version == 2 && registers.frame_sync {
            for y in 0..self.array.rows {
                self.taxel(self.time, (x, y), read, sink);
            }
            return;
        }
        for k in 0..self.scan.sense_lines().len() {
            let (step, y) = self.scan.sense_lines()[k];
            let at = if registers.frame_sync { self.time } else { start + step * u64::from(registers.step_period) };
            self.taxel(at, (x, y), read, sink);
        }
    }

    /// Queues the event of a taxel, if it has one.
    fn taxel(&mut self, at: u64, (x, y): (u16, u16), read: FrameReading<'_>, sink: &mut impl FnMut(&[u8]) -> bool) {
        let registers = self.active;
        let taxel = self.array.index(x, y);
        if !self.comparators.changed[taxel] || !self.array.has(taxel) {
            return;
        }
        let (value, before) = (read.ticks[taxel].min(registers.ramp), self.comparators.values[taxel]);
        let (p, intensity) = if registers.mechanoreceptor {
            self.afferents.spike(taxel)
        } else {
            match self.options.intensity {
                IntensityWord::Value | IntensityWord::Nothing => (value >= before, value),
                IntensityWord::Difference => (value >= before, value.abs_diff(before)),
            }
        };
        if self.enqueue(ScannedEvent { at, x, y, p, intensity }, read, sink) && !registers.mechanoreceptor {
            self.comparators.values[taxel] = value;
        }
    }

    /// Finds the crossings of taxels that compare by themselves, and queues those before this frame.
    fn queue_crossings(&mut self, any: bool, read: FrameReading<'_>, sink: &mut impl FnMut(&[u8]) -> bool) {
        let mut asynchronous = std::mem::take(&mut self.asynchronous);
        let (registers, columns, new) = (self.active, usize::from(self.array.columns), asynchronous.is_new());
        let ticks = read.ticks;
        if any {
            for taxel in (0..ticks.len()).filter(|&taxel| self.comparators.changed[taxel]) {
                let (x, y) = ((taxel % columns) as u16, (taxel / columns) as u16);
                if x >= registers.lines || !self.array.has(taxel) {
                    continue;
                }
                let after = u64::from(x) * u64::from(registers.line_period);
                let sample = Sample { taxel, x, y, after, ticks: ticks[taxel].min(registers.ramp) };
                let sent = &mut self.comparators.values[taxel];
                asynchronous.cross(self.time, sample, registers.noise_floor.into(), sent);
            }
        }
        // A taxel whose comparator has not returned keeps its last reading.
        let now =
            ticks.iter().zip(&self.comparators.values).map(|(&t, &value)| if t == NOT_RETURNED { value } else { t });
        let due = asynchronous.end_frame(self.time, now.map(|t| t.min(registers.ramp)));
        self.asynchronous = asynchronous;
        // At reset, the events of all taxels are in the first frame itself.
        debug_assert!(!new || due.is_empty());
        for TaxelCrossing { at, x, y, p, value, moved } in due {
            let intensity = if self.options.intensity == IntensityWord::Difference { moved } else { value };
            self.enqueue(ScannedEvent { at, x, y, p, intensity }, read, sink);
        }
    }

    /// Queues an event on the active version of the wire; returns false if the queue was full and the event was
    /// dropped.
    fn enqueue(&mut self, found: ScannedEvent, read: FrameReading<'_>, sink: &mut impl FnMut(&[u8]) -> bool) -> bool {
        self.counts.changes += 1;
        if read.accepted.is_some_and(|accepted| !accepted[self.array.index(found.x, found.y)]) {
            self.link.refuse(&mut self.counts);
            return false;
        }
        if self.active.wire_version == 2 {
            let packed = self.link.pack(found, &mut self.counts);
            self.link.offer(&mut self.counts, sink);
            return packed;
        }
        let valued = self.active.mechanoreceptor || self.options.intensity != IntensityWord::Nothing;
        let queued = self.link.words(found, valued, &mut self.counts);
        self.link.offer(&mut self.counts, sink);
        queued
    }

    /// Sends what is due at the end of a frame: all words of version 1; for version 2 events, promises, states and
    /// totals.
    fn end_frame(&mut self, sink: &mut impl FnMut(&[u8]) -> bool) {
        let period = self.options.version_2.states_us * 100;
        if period > 0 {
            self.refresh.frame(&self.active, period);
        }
        if self.active.wire_version == 1 {
            self.link.flush_words();
        } else {
            let (now, next) = (self.now(), self.now() + self.active.frame_10ns() / 100);
            self.link.with_packer(|packer| packer.over(now, next));
            if let Some(x) = self.refresh.line(&self.active) {
                self.repeat(x, now);
            }
            // The totals count what the sink accepted before them.
            self.link.offer(&mut self.counts, sink);
            if self.refresh.totals() {
                let status = self.totals();
                self.link.with_packer(|packer| packer.status(now, &status));
            }
        }
        self.link.offer(&mut self.counts, sink);
    }

    /// Sends the values of a driven line again as states, with the comparators' reference values.
    fn repeat(&mut self, x: u16, now: u64) {
        if self.active.mechanoreceptor || self.options.intensity == IntensityWord::Nothing {
            return;
        }
        let Self { link, array, comparators, .. } = self;
        let taxels = (0..array.rows)
            .map(|y| ((x, y), array.index(x, y)))
            .filter(|&(_, taxel)| array.has(taxel))
            .map(|(position, taxel)| (position, comparators.values[taxel]));
        link.with_packer(|packer| packer.states(now, taxels));
    }
}
