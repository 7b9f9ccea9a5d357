//! Encodes and reads out: in the thread that decodes, or in one behind it.

use taxel_core::Events;
use taxel_core::detect::{Detection, FrameTime, Readout, ReadoutStream};
use taxel_core::encode::{Tare, Zeroing};

use super::ahead::Ahead;
use super::handover::{Quiet, Taken};
use super::options::LiveOptions;
use super::rest::Rest;
use super::saying::Saying;
use super::shared::Shared;

/// Who listens to the events.
pub enum Ear {
    /// Nobody: capture and record only.
    Deaf,
    /// A readout at work.
    Reading(Box<ReadoutStream>),
    /// A readout that first takes a tare: from the first event on for so long (us of the board's clock), or until the
    /// board marks a start.
    Taring(i64, Box<Readout>),
}

impl Ear {
    /// The ear for a readout, where there is one: it takes a fresh tare of `tare_us` where that is given, else it reads at
    /// once, with `tare` where its encoder needs one.
    ///
    /// # Errors
    ///
    /// As [`Readout::stream`].
    pub fn of(
        readout: Option<Readout>,
        tare: Option<&Tare>,
        tare_us: Option<i64>,
        options: &LiveOptions,
    ) -> taxel_core::Result<Self> {
        Ok(match (readout, tare_us) {
            (None, _) => Self::Deaf,
            (Some(readout), Some(us)) => Self::Taring(us, Box::new(readout)),
            (Some(readout), None) => Self::Reading(Box::new(readout.stream(&options.array, options.frames(), tare)?)),
        })
    }
}

pub(super) struct Reader {
    mode: Mode,
    /// What is to be said.
    pub(super) found: Vec<Detection>,
    events: Events,
    zeroings: Vec<Zeroing>,
    frames: FrameTime,
}

enum Mode {
    Reading(Ahead),
    Taring(Box<Rest>),
    /// Between the two, and after an error.
    Idle,
}

impl Reader {
    pub(super) fn new(ear: Ear, options: &LiveOptions) -> Self {
        let events = Events::empty(options.array.clone());
        let mode = match ear {
            Ear::Deaf => Mode::Idle,
            Ear::Reading(stream) => Mode::Reading(Ahead::new(stream)),
            Ear::Taring(stretch_us, readout) => Mode::Taring(Box::new(Rest::new(stretch_us, readout, &options.array))),
        };
        Self { mode, found: vec![], events, zeroings: vec![], frames: options.frames() }
    }

    /// Says whether it takes a tare, and what it takes for rest: before the first events.
    pub(super) fn begin_with(&self, shared: &Shared) {
        shared.shown().counters.taring = matches!(self.mode, Mode::Taring(_));
        self.show_rest(shared);
    }

    /// In a thread of its own: takes what is handed over until the last of it, and says what it finds.
    pub(super) fn run(mut self, shared: &Shared, saying: &Saying) {
        let mut last = false;
        loop {
            if !self.found.is_empty() {
                saying.add(shared, &mut self.found);
                saying.speak(shared);
            }
            if last {
                break;
            }
            let taken = shared.handover.take(&mut self.events, &mut self.zeroings);
            self.hear(shared, taken);
            last = taken.last;
        }
    }

    /// In the thread that decodes: takes its events, and leaves the memory of the last ones.
    pub(super) fn take(&mut self, shared: &Shared, events: &mut Events, taken: Taken) {
        std::mem::swap(&mut self.events, events);
        self.hear(shared, taken);
        self.events.clear();
    }

    /// Nothing came, but time has.
    pub(super) fn wait(&mut self, shared: &Shared, taken: Taken) {
        self.events.clear();
        self.hear(shared, taken);
    }

    /// Takes what is to be zeroed, in its own time.
    pub(super) fn zero(&mut self, zeroings: &[Zeroing]) {
        self.zeroings.extend_from_slice(zeroings);
    }

    fn hear(&mut self, shared: &Shared, taken: Taken) {
        if let Err(error) = self.try_hear(shared, taken) {
            shared.fail(error);
            self.mode = Mode::Idle;
        }
    }

    fn try_hear(&mut self, shared: &Shared, taken: Taken) -> crate::Result<()> {
        match &mut self.mode {
            Mode::Reading(readout) => {
                self.zeroings.drain(..).try_for_each(|zeroing| readout.zero(&zeroing))?;
                readout.push(self.events.view(), &mut self.found)?;
                match taken.quiet {
                    Some(Quiet::Promised(t)) => readout.advance(t, &mut self.found)?,
                    Some(Quiet::Believed(t)) if taken.last => readout.advance(t, &mut self.found)?,
                    Some(Quiet::Believed(t)) => readout.quiet(t, &mut self.found)?,
                    None => {}
                }
            }
            Mode::Taring(rest) => {
                if let Some((stop, inside)) = rest.hear(&self.events, taken.quiet.map(Quiet::until))? {
                    self.begin(shared, stop, inside)?;
                }
            }
            Mode::Idle => self.zeroings.clear(),
        }
        if !self.events.is_empty() || taken.last {
            let counters = &mut shared.shown().counters;
            counters.read_out += self.events.len() as u64;
            if let Mode::Reading(readout) = &self.mode {
                (counters.late, counters.wrong) = (readout.late(), readout.wrong());
            }
        }
        Ok(())
    }

    /// The rest is over: begins to read with the first event after it.
    fn begin(&mut self, shared: &Shared, stop: i64, inside: usize) -> crate::Result<()> {
        let Mode::Taring(rest) = std::mem::replace(&mut self.mode, Mode::Idle) else { return Ok(()) };
        let (tare, stream) = rest.finish(stop, self.frames)?;
        let mut readout = Ahead::new(Box::new(stream));
        readout.push(self.events.view().piece(inside..self.events.len()), &mut self.found)?;
        self.mode = Mode::Reading(readout);
        self.show_rest(shared);
        let mut shown = shared.shown();
        shown.counters.taring = false;
        shown.tare = Some(tare);
        Ok(())
    }

    /// Says what the readout takes for rest, where it reads any.
    fn show_rest(&self, shared: &Shared) {
        if let Mode::Reading(readout) = &self.mode {
            let rest = readout.rest();
            shared.shown().rest = if rest.iter().all(Option::is_none) { vec![] } else { rest };
        }
    }
}
