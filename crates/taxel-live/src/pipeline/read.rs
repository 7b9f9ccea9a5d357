//! The thread behind decoding: encodes, reads out, and says.

use std::sync::atomic::Ordering;

use crossbeam_channel::Sender;
use taxel_core::Events;
use taxel_core::detect::{Detection, FrameTime, Readout, ReadoutStream};
use taxel_core::encode::{Tare, Zeroing};

use super::ahead::Ahead;
use super::handover::{Quiet, Taken};
use super::options::LiveOptions;
use super::rest::Rest;
use super::said::{Said, Sink};
use super::shared::Shared;
use crate::Error;
use crate::locked::lock;
use crate::recording::now_ns;

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
    sinks: Vec<Box<dyn Sink>>,
    say: Sender<Said>,
    found: Vec<Detection>,
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
    pub(super) fn new(ear: Ear, sinks: Vec<Box<dyn Sink>>, say: Sender<Said>, options: &LiveOptions) -> Self {
        let events = Events::empty(options.array.clone());
        let mode = match ear {
            Ear::Deaf => Mode::Idle,
            Ear::Reading(stream) => Mode::Reading(Ahead::new(stream)),
            Ear::Taring(stretch_us, readout) => Mode::Taring(Box::new(Rest::new(stretch_us, readout, &options.array))),
        };
        Self { mode, sinks, say, found: vec![], events, zeroings: vec![], frames: options.frames() }
    }

    pub(super) fn run(mut self, shared: &Shared) {
        shared.shown().counters.taring = matches!(self.mode, Mode::Taring(_));
        self.show_rest(shared);
        loop {
            let taken = shared.handover.take(&mut self.events, &mut self.zeroings);
            if let Err(error) = self.hear(shared, taken) {
                shared.fail(error);
                self.mode = Mode::Idle;
            }
            if taken.last {
                break;
            }
        }
        shared.ended.store(true, Ordering::Release);
    }

    fn hear(&mut self, shared: &Shared, taken: Taken) -> crate::Result<()> {
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
        self.say_all(shared)
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

    /// From the thread that made them: to the sinks first, then into the recording and to who asks.
    fn say_all(&mut self, shared: &Shared) -> crate::Result<()> {
        for detection in self.found.drain(..) {
            let said_ns = now_ns();
            let offset = shared.shown().counters.offset;
            let said = Said { said: offset.map_or(detection.known, |o| o.board_us(said_ns)), detection, said_ns };
            self.sinks.iter_mut().try_for_each(|sink| sink.take(&said)).map_err(Error::Sink)?;
            if let Some(recorder) = &*lock(&shared.recorder) {
                // Where only a guest's recording is broken, the decoding thread will find that too.
                recorder.detection(&said).or_else(|error| if recorder.is_a_guest() { Ok(()) } else { Err(error) })?;
            }
            shared.happened([said.detection.t, said.detection.known]);
            lock(&shared.listeners).retain(|listener| {
                !matches!(listener.try_send(said.clone()), Err(crossbeam_channel::TrySendError::Disconnected(_)))
            });
            let late_ns = (said.said - said.detection.known) * 1000;
            let dropped = self.say.try_send(said).is_err();
            let mut shown = shared.shown();
            shown.counters.detections += 1;
            shown.counters.detections_dropped += u64::from(dropped);
            shown.said_latency.note(late_ns);
        }
        Ok(())
    }
}
