//! Taxels that compare their values by themselves: no scan, each change sent as it happens (thesis 4.5 and Table 7.1).

/// A taxel whose value has changed by a step since its last event, and the time at which it did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TaxelCrossing {
    /// Time since reset, 10 ns.
    pub(super) at: u64,
    pub(super) x: u16,
    pub(super) y: u16,
    pub(super) p: bool,
    /// The value reached, ticks.
    pub(super) value: u16,
    /// Difference from the value before.
    pub(super) moved: u16,
}

/// The readings of the last frame, and the crossings that still wait to be sent.
///
/// A taxel is read once per frame, at the time of its line. Between two readings its value is interpolated linearly,
/// and each step of `floor + 1` ticks is an event. The interpolation needs the second reading, so an event is sent one
/// frame after it happened, with the time at which it happened.
#[derive(Debug, Clone, Default)]
pub(super) struct Asynchronous {
    /// Start of the previous frame, and its reading of each taxel; `None` before the first frame.
    last: Option<(u64, Vec<u16>)>,
    /// Crossings later than the start of the frame in which they were found.
    waiting: Vec<TaxelCrossing>,
}

/// A reading: its taxel, its time after the frame's start, and its value.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub(super) taxel: usize,
    pub(super) x: u16,
    pub(super) y: u16,
    pub(super) after: u64,
    pub(super) ticks: u16,
}

impl Asynchronous {
    /// Whether there was no frame yet.
    pub(super) fn is_new(&self) -> bool {
        self.last.is_none()
    }

    /// Discards the crossings that wait.
    pub(super) fn clear(&mut self) {
        self.waiting.clear();
    }

    /// Finds the steps of a taxel since the last frame; `sent` is the value of its last event, and is updated. Before
    /// the first frame, the reading itself is an event.
    pub(super) fn cross(&mut self, begins: u64, sample: Sample, floor: u16, sent: &mut u16) {
        let Sample { taxel, x, y, after, ticks } = sample;
        let Some((began, last)) = &self.last else {
            let (p, moved) = (ticks >= *sent, ticks.abs_diff(*sent));
            self.waiting.push(TaxelCrossing { at: begins, x, y, p, value: ticks, moved });
            *sent = ticks;
            return;
        };
        let (from, moved) = (last[taxel], floor + 1);
        let (span, way) = (begins - began, f64::from(ticks.abs_diff(from)));
        let p = ticks >= *sent;
        while ticks.abs_diff(*sent) > floor && (ticks >= *sent) == p {
            *sent = if p { *sent + moved } else { *sent - moved };
            // Already passed at the last reading, if the floor was lowered since.
            let passed = if p { *sent <= from } else { *sent >= from };
            let share = if passed || way == 0.0 { 0.0 } else { f64::from(sent.abs_diff(from)) / way };
            let at = began + after + (share * span as f64) as u64;
            self.waiting.push(TaxelCrossing { at, x, y, p, value: *sent, moved });
        }
    }

    /// Ends a frame that began at `begins`: stores its readings, and returns the crossings before `begins`, by time.
    pub(super) fn end_frame(&mut self, begins: u64, ticks: impl Iterator<Item = u16>) -> Vec<TaxelCrossing> {
        match &mut self.last {
            Some((began, last)) => {
                *began = begins;
                last.iter_mut().zip(ticks).for_each(|(last, ticks)| *last = ticks);
            }
            None => self.last = Some((begins, ticks.collect())),
        }
        let known = begins / 100;
        self.waiting.sort_by_key(|c| (c.at / 100, c.x, c.y));
        let due = self.waiting.partition_point(|c| c.at / 100 < known);
        self.waiting.drain(..due).collect()
    }
}
