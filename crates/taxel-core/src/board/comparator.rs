//! The comparator of each scanned taxel: which values of a frame make events.

use crate::wire::Registers;

/// A trip time that marks a fault: the comparator had not returned when the ramp began, so there is no reading.
pub const NOT_RETURNED: u16 = u16::MAX;

/// The reference value of each taxel, and which taxels changed in this frame.
#[derive(Debug, Clone)]
pub(super) struct Comparators {
    columns: usize,
    /// By taxel: the value with which a new one is compared.
    pub(super) values: Vec<u16>,
    /// By taxel: whether this frame's value makes an event.
    pub(super) changed: Vec<bool>,
    /// By driven line: whether any of its taxels makes an event.
    pub(super) line_changed: Vec<bool>,
}

impl Comparators {
    /// Comparators of taxels whose reference is 0.
    pub(super) fn new(taxels: usize, columns: u16) -> Self {
        let columns = usize::from(columns);
        Self { columns, values: vec![0; taxels], changed: vec![false; taxels], line_changed: vec![false; columns] }
    }

    /// Compares a frame with the reference values, in one pass over the whole array; counts faults, and returns whether
    /// any taxel changed.
    pub(super) fn compare(&mut self, ticks: &[u16], registers: &Registers, not_returned: &mut u64) -> bool {
        let columns = self.columns;
        let (ramp, floor, lines) = (registers.ramp, u16::from(registers.noise_floor), registers.lines.into());
        self.line_changed.fill(false);
        let rows = ticks.chunks_exact(columns).zip(self.values.chunks_exact(columns));
        for ((ticks, values), changed) in rows.zip(self.changed.chunks_exact_mut(columns)) {
            for x in 0..columns {
                let hit = ticks[x].min(ramp).abs_diff(values[x]) > floor && ticks[x] != NOT_RETURNED;
                changed[x] = hit;
                self.line_changed[x] |= hit;
            }
            *not_returned += ticks[..lines].iter().map(|&t| u64::from(t == NOT_RETURNED)).sum::<u64>();
        }
        self.line_changed[..lines].iter().any(|&hit| hit)
    }

    /// Marks the taxels for which `fires` returns true, on a board whose comparators are afferents; counts faults, and
    /// returns whether any fired.
    pub(super) fn fire(
        &mut self,
        ticks: &[u16],
        registers: &Registers,
        not_returned: &mut u64,
        mut fires: impl FnMut(usize, u16) -> bool,
    ) -> bool {
        self.line_changed.fill(false);
        let mut any = false;
        for (taxel, &t) in ticks.iter().enumerate() {
            let x = taxel % self.columns;
            self.changed[taxel] = false;
            if x >= usize::from(registers.lines) {
                continue;
            }
            if t == NOT_RETURNED {
                *not_returned += 1;
                continue;
            }
            if fires(taxel, t.min(registers.ramp)) {
                (self.changed[taxel], self.line_changed[x], any) = (true, true, true);
            }
        }
        any
    }

    /// Makes this frame's samples the reference of the next frame, whether they were sent or not.
    pub(super) fn sample(&mut self, ticks: &[u16], registers: &Registers) {
        let columns = self.columns;
        for (ticks, values) in ticks.chunks_exact(columns).zip(self.values.chunks_exact_mut(columns)) {
            for x in 0..usize::from(registers.lines) {
                if ticks[x] != NOT_RETURNED {
                    values[x] = ticks[x].min(registers.ramp);
                }
            }
        }
    }
}
