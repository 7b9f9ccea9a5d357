//! Taxels that compare by themselves: no scan, each change told as it happens (thesis 4.5 and Table 7.1).

/// A taxel that has moved by a step since it last told, and when.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crossing {
    /// Since reset, 10 ns.
    pub(super) at: u64,
    pub(super) x: u16,
    pub(super) y: u16,
    pub(super) p: bool,
    /// The value reached, ticks.
    pub(super) value: u16,
    /// How far that is from the one before.
    pub(super) moved: u16,
}

/// What taxels by themselves are at.
///
/// Of each is known what it reads once a frame, at the time of its line; between two readings it counts as a straight
/// line, and tells each step of `floor + 1` ticks when it is reached. So what comes between two readings is known by the
/// second, and is told a frame after it has happened, with the time at which it did.
#[derive(Debug, Clone, Default)]
pub(super) struct Alone {
    /// What each read in the frame before, and when that began; nothing before the first frame.
    last: Option<(u64, Vec<u16>)>,
    /// What lies too late for the frame in which it was found.
    waiting: Vec<Crossing>,
}

/// A reading: its taxel, when it is taken after a frame's beginning, and what it is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub(super) taxel: usize,
    pub(super) x: u16,
    pub(super) y: u16,
    pub(super) after: u64,
    pub(super) ticks: u16,
}

impl Alone {
    /// Whether no frame has come yet.
    pub(super) fn is_new(&self) -> bool {
        self.last.is_none()
    }

    /// Lets go what would still be told.
    pub(super) fn hush(&mut self) {
        self.waiting.clear();
    }

    /// Finds the steps that a taxel has made since the last frame; `sent` is what it told last, and becomes what it tells
    /// now. Before the first frame it tells what it reads.
    pub(super) fn cross(&mut self, begins: u64, sample: Sample, floor: u16, sent: &mut u16) {
        let Sample { taxel, x, y, after, ticks } = sample;
        let Some((began, last)) = &self.last else {
            let (p, moved) = (ticks >= *sent, ticks.abs_diff(*sent));
            self.waiting.push(Crossing { at: begins, x, y, p, value: ticks, moved });
            *sent = ticks;
            return;
        };
        let (from, moved) = (last[taxel], floor + 1);
        let (span, way) = (begins - began, f64::from(ticks.abs_diff(from)));
        let p = ticks >= *sent;
        while ticks.abs_diff(*sent) > floor && (ticks >= *sent) == p {
            *sent = if p { *sent + moved } else { *sent - moved };
            // Past already where the floor was lowered since.
            let passed = if p { *sent <= from } else { *sent >= from };
            let share = if passed || way == 0.0 { 0.0 } else { f64::from(sent.abs_diff(from)) / way };
            let at = began + after + (share * span as f64) as u64;
            self.waiting.push(Crossing { at, x, y, p, value: *sent, moved });
        }
    }

    /// Ends a frame that began then: keeps what was read, gives what happened before it, by time.
    pub(super) fn over(&mut self, begins: u64, ticks: impl Iterator<Item = u16>) -> Vec<Crossing> {
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
