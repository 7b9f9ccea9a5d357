//! Commands of the host and the status lines that answer them.

use super::Board;
use super::refresh::totals;
use crate::wire::v2::BoardTotals;
use crate::wire::{Command, Greeting, Registers, StatusLine};

impl Board {
    /// The status line of a reset: version of the wire, size and channels.
    #[must_use]
    pub fn greeting(&self) -> String {
        let Registers { wire_version, channels, .. } = self.written;
        let greeting = Greeting { wire_version, rows: self.array.rows, columns: self.array.columns, channels };
        format!("{greeting}\n")
    }

    /// Executes command bytes as they arrive; returns the status lines that answer them, each with its line end.
    pub fn command(&mut self, bytes: &[u8]) -> String {
        let mut lines = String::new();
        for &byte in bytes {
            if let Some(command) = self.reader.push(byte) {
                lines += &self.execute(command);
                lines.push('\n');
            }
        }
        lines
    }

    fn execute(&mut self, command: Command) -> String {
        let Command { register, value } = command;
        if register == 6 && value == 8 {
            return self.greeting().trim_end().to_owned();
        }
        if register == 6 && value == 9 {
            let BoardTotals { frames, events, dropped, datagrams, faults } = self.totals();
            return format!(
                "status frames={frames} events={events} dropped={dropped} datagrams={datagrams} faults={faults}"
            );
        }
        if register == 6 && value < 8 {
            let register = value as u8;
            return StatusLine::Register { register, value: self.written.word(register) }.to_string();
        }
        let recording = self.written.record;
        match self.written.write(command, &self.array) {
            Err(refusal) => StatusLine::Refusal { register, rule: refusal.rule }.to_string(),
            Ok(()) => {
                if self.written.record != recording {
                    self.mark(self.written.record);
                }
                StatusLine::Register { register, value }.to_string()
            }
        }
    }

    /// Starts or stops a recording, as a write of `record` does; sends a marker if this changes the state.
    pub fn record(&mut self, start: bool) {
        if self.written.record != start {
            self.written.record = start;
            self.mark(start);
        }
    }

    fn mark(&mut self, start: bool) {
        if self.active.wire_version == 2 {
            self.link.marker(self.now(), start, &mut self.counts);
        } else {
            let queued = self.link.marker_word(self.time, start, &mut self.counts);
            self.markers_dropped += u64::from(!queued);
        }
    }

    /// The totals since reset.
    pub(super) fn totals(&self) -> BoardTotals {
        totals(&self.counts, &self.at_reset, self.markers_dropped)
    }

    /// One status line for each kind of fault whose count since reset has changed since the last call.
    pub fn faults(&mut self) -> String {
        let now = [
            ("queue", self.counts.dropped - self.at_reset.dropped),
            ("comparator", self.counts.not_returned - self.at_reset.not_returned),
            ("command", self.reader.skipped()),
        ];
        let mut lines = String::new();
        for ((name, count), reported) in now.into_iter().zip(&mut self.reported) {
            if count != *reported {
                lines += &format!("{}\n", StatusLine::Fault { name: name.to_owned(), count });
                *reported = count;
            }
        }
        lines
    }
}
