//! What others may do with a pipeline while it runs: look on, record, tell it of the board.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crossbeam_channel as channel;
use taxel_core::encode::Zeroing;
use taxel_core::wire::Registers;

use super::copies::Copies;
use super::counters::Counters;
use super::options::{LiveOptions, Record};
use super::recorder::Recorder;
use super::said::Said;
use super::shared::{Ended, Shared, Request};
use super::source::Source;
use super::tap::Outlet;
use crate::Result;
use crate::capture::Origin;
use crate::locked::lock;

/// Detections that wait for another computer at most.
const COPIED_WAITING: usize = 1 << 12;

/// What others may do with a [`Live`](super::Live) while it runs, and after.
#[derive(Clone)]
pub struct Handle {
    pub(super) shared: Arc<Shared>,
}

impl Handle {
    /// How the [`Live`](super::Live) was begun.
    #[must_use]
    pub fn options(&self) -> &LiveOptions {
        &self.shared.options
    }

    /// The address that it listens on; unspecified, with port 0, where a bridge feeds it.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.shared.receiver.address()
    }

    /// Where datagrams come from.
    #[must_use]
    pub fn place(&self) -> &Origin {
        self.shared.receiver.place()
    }

    /// As [`Live::counters`](super::Live::counters).
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.shared.counters()
    }

    /// As [`Live::is_over`](super::Live::is_over).
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.shared.ended.load(Ordering::Acquire)
    }

    /// What the registers hold, as far as it was told.
    #[must_use]
    pub fn registers(&self) -> Registers {
        *lock(&self.shared.registers)
    }

    /// Tells what was written to the board's registers: the recording keeps it, and the version of the wire is expected.
    pub fn wrote(&self, registers: Registers) {
        *lock(&self.shared.registers) = registers;
        self.shared.request(Request::Registers(registers));
    }

    /// Lets somebody look on, from the next batch on.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where all is over.
    pub fn look(&self) -> Result<Outlet> {
        let (give, outlet) = channel::bounded(1);
        self.shared.request(Request::Tap(give));
        self.wait(&outlet)
    }

    /// Copies what comes, for other computers, from the next batch on.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where all is over.
    pub fn copy(&self) -> Result<Copies> {
        let (give, parcels) = channel::bounded(1);
        let said = self.hear(COPIED_WAITING);
        self.shared.request(Request::Copy(give));
        Ok(Copies::new(Arc::clone(&self.shared), self.wait(&parcels)?, said))
    }

    /// Hears detections as they are said; so many may wait, and who is too slow misses some.
    #[must_use]
    pub fn hear(&self, waiting: usize) -> channel::Receiver<Said> {
        let (say, said) = channel::bounded(waiting);
        lock(&self.shared.subscribers).push(say);
        said
    }

    /// Begins to record what comes from here on, beginning with the registers and what the taxels hold.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where something is recorded already, `File` where the file exists or cannot be created.
    pub fn record(&self, record: &Record) -> Result<()> {
        if lock(&self.shared.recorder).is_some() {
            return Err(taxel_core::problem!("a recording runs already: stop it first").into());
        }
        // What else is heard belongs to the recording that it was begun with.
        let recorder = self.reserve(record, vec![])?;
        lock(&self.shared.broken).take();
        self.next_recording(Some(recorder)).map(drop)
    }

    /// A recording that is to begin, with the board's registers as they are now, and those other sources.
    pub(super) fn reserve(&self, record: &Record, sources: Vec<Source>) -> Result<Recorder> {
        let header = LiveOptions { registers: self.registers(), sources, ..self.shared.options.clone() };
        Recorder::reserve(record, &header, self.place())
    }

    /// Has what comes from here on go to this recording, or to none; gives the one that ran.
    pub(super) fn next_recording(&self, next: Option<Recorder>) -> Result<Ended> {
        // Who looks whether it goes on finds that it does.
        self.shared.records.fetch_or(next.is_some(), Ordering::AcqRel);
        let (give, ended) = channel::bounded(1);
        self.shared.request(Request::Record(next.map(Box::new), give));
        let ended = self.wait(&ended).and_then(std::convert::identity);
        if ended.is_err() {
            self.shared.records.store(lock(&self.shared.recorder).is_some(), Ordering::Release);
        }
        ended
    }

    /// Ends the recording that [`Handle::record`] began. Gives the file, where anything came, and what was lost, in a line.
    ///
    /// # Errors
    ///
    /// What ended it early, or `File` where its end cannot be written; `Core(Problem)` where there is none.
    pub fn end_recording(&self) -> Result<(Option<PathBuf>, String)> {
        let (recorder, counters) = self.next_recording(None)?;
        if let Some(error) = lock(&self.shared.broken).take() {
            return Err(error);
        }
        let Some(recorder) = recorder else {
            return Err(taxel_core::problem!("nothing is recorded").into());
        };
        let verdict = recorder.verdict(&counters);
        Ok((recorder.finish(&counters)?, verdict))
    }

    /// Whether a recording runs, and has not been ended by an error.
    #[must_use]
    pub fn records(&self) -> bool {
        self.shared.records.load(Ordering::Acquire)
    }

    /// As [`Live::note`](super::Live::note).
    ///
    /// # Errors
    ///
    /// As [`Live::note`](super::Live::note).
    pub fn note(&self, text: &str) -> Result<()> {
        self.shared.note(text, true)
    }

    /// Writes down what holds for the whole recording, such as the name of a trial: a note without a time, which is no event.
    ///
    /// # Errors
    ///
    /// As [`Live::note`](super::Live::note).
    pub fn entitle(&self, text: &str) -> Result<()> {
        self.shared.note(text, false)
    }

    /// Takes what these taxels (column, row) hold now for their rest from now on, in the readout and in the recording's
    /// pictures; the recording keeps when it was done, and the rests before and after. Never done but when asked for.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where a taxel does not exist or was not heard of yet, a tare is being taken, or a `.lsa` is recorded, which
    /// could not keep it: then none is zeroed. `File` where the disk is full.
    pub fn zero(&self, taxels: &[(u16, u16)]) -> Result<Vec<Zeroing>> {
        let (give, zeroed) = channel::bounded(1);
        self.shared.request(Request::Zero(taxels.to_vec(), give));
        self.wait(&zeroed).and_then(std::convert::identity)
    }

    /// What was zeroed last at each taxel that was, by taxel index; and how often something was.
    #[must_use]
    pub fn zeroed(&self) -> (Vec<Zeroing>, u64) {
        let published = self.shared.published();
        (published.zeroed.values().copied().collect(), published.zeroings)
    }

    /// How often something was zeroed.
    #[must_use]
    pub fn zeroings(&self) -> u64 {
        self.shared.published().zeroings
    }

    fn wait<T>(&self, from: &channel::Receiver<T>) -> Result<T> {
        loop {
            match from.recv_timeout(Duration::from_millis(50)) {
                Ok(given) => return Ok(given),
                Err(_) if self.is_over() => {
                    return Err(taxel_core::problem!("live: has ended").into());
                }
                Err(_) => {}
            }
        }
    }
}
