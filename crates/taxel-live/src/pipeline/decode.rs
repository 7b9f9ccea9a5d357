//! Receives and decodes, reads out or hands the events on, and records. While it records, another thread receives.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use taxel_core::detect::Detection;
use taxel_core::encode::Zeroing;
use taxel_core::wire::{Decoder, Receiver, Took};
use taxel_core::{Events, problem};

use super::copies::{Copier, GATHER, copier};
use super::handover::{Quiet, Taken};
use super::read::Reader;
use super::recorder::Recorder;
use super::shared::{Ended, Shared, Wish};
use super::stills::Stills;
use super::tap::{Tap, UNKNOWN, tap};
use crate::Result;
use crate::capture::Batch;
use crate::clock::{BoardClock, leaves};
use crate::locked::lock;
use crate::recording::now_ns;
use crate::recording::{BoardChange, Change};

/// How often those who look on get a new picture.
const PICTURE_EVERY: Duration = Duration::from_millis(100);

/// How often an unfinished recording learns what was lost.
const COUNTS_EVERY: Duration = Duration::from_secs(1);

/// In silence the readout's time is moved on this often at most, and once a frame where frames are longer.
const TICK: Duration = Duration::from_micros(500);

/// How long to wait for datagrams where silence means nothing.
const IDLE: Duration = Duration::from_millis(20);

/// While it records and nothing is read out, what comes within so long is received together: it costs half the CPU.
const TOGETHER: Duration = Duration::from_millis(1);

/// Events are handed on when so many are there, also in the middle of a large batch.
const HAND_ON: usize = 1 << 14;

/// What is to be done when the thread that leads comes back.
pub(super) enum Next {
    /// Something was found ([`Work::found`]).
    Say,
    /// The readout wants a thread of its own from here on.
    Apart(Box<Reader>),
    /// Nothing will come any more.
    Over,
}

pub(super) struct Work {
    shared: Arc<Shared>,
    /// The readout, as long as it works in this thread.
    reader: Option<Reader>,
    /// One that is to have a thread of its own.
    leaves: Option<Box<Reader>>,
    /// Without a readout there is nothing to say.
    nothing: Vec<Detection>,
    begun: bool,
    batch: Batch,
    sender: Receiver,
    promise: Promise,
    /// What the readout was told last of how far time has come, by promises of version 2.
    believed: Option<i64>,
    /// The latest time that was heard, us.
    heard: Option<i64>,
    listens: bool,
    clock: BoardClock,
    events: Events,
    /// [`UNKNOWN`] until a taxel was heard of.
    held: Vec<u16>,
    taps: Vec<Tap>,
    copiers: Vec<Copier>,
    /// How many datagrams were received before the next one.
    received: u64,
    frame_us: f64,
    /// Decodes from a recording's first datagram on, until it is known by how much the recording's clock is behind.
    fresh: Option<Box<Receiver>>,
    /// Whether any intensity has come: from then on every piece has the column, so that a lost one is one missing value.
    has_intensities: bool,
    decoded: u64,
    late: u64,
    counted: u64,
    /// Whether the recorder knows the tare.
    tared: bool,
    pictured: Instant,
    stills: Stills,
    told: Instant,
}

/// What a board of version 2 has promised: nothing before it comes any more.
#[derive(Debug, Clone, Copy, Default)]
struct Promise {
    until: Option<i64>,
    /// Numbers that had not come when a gap was last waited for, and until when (us, host) it is.
    missing: u64,
    waits: Option<i64>,
}

impl Promise {
    /// A datagram came. At a gap what it promises waits for a frame: the missing ones may only be late.
    fn note(&mut self, took: &Took, arrived_us: i64, gap_us: i64) {
        if took.reset || took.missing < self.missing {
            (self.missing, self.waits) = (took.missing, None);
        } else if took.missing > self.missing {
            (self.missing, self.waits) = (took.missing, Some(arrived_us + gap_us));
        }
        if self.waits.is_some_and(|until| arrived_us >= until) {
            self.waits = None;
        }
        if self.waits.is_none() {
            self.until = took.until.or(self.until);
        }
    }

    fn take(&mut self) -> Option<i64> {
        self.until.take()
    }
}

impl Work {
    pub(super) fn new(shared: Arc<Shared>, sender: Receiver, reader: Option<Reader>) -> Self {
        let (array, frame_us) = (shared.options.array.clone(), shared.options.registers.frame_us());
        Self {
            shared,
            listens: reader.is_some(),
            reader,
            leaves: None,
            nothing: vec![],
            begun: false,
            batch: Batch::new(),
            sender,
            promise: Promise::default(),
            believed: None,
            heard: None,
            clock: BoardClock::default(),
            held: vec![UNKNOWN; array.len()],
            events: Events::empty(array),
            taps: vec![],
            copiers: vec![],
            received: 0,
            frame_us,
            fresh: None,
            has_intensities: false,
            decoded: 0,
            late: 0,
            counted: 0,
            tared: false,
            pictured: Instant::now(),
            stills: Stills::new(),
            told: Instant::now(),
        }
    }

    /// What the readout has found and nobody has said yet.
    pub(super) fn found(&mut self) -> &mut Vec<Detection> {
        self.reader.as_mut().map_or(&mut self.nothing, |reader| &mut reader.found)
    }

    /// Goes on until something is to be done about it; an error ends it.
    pub(super) fn go_on(&mut self) -> Next {
        self.rounds().unwrap_or_else(|error| {
            self.shared.fail(error);
            self.close(None);
            Next::Over
        })
    }

    fn rounds(&mut self) -> Result<Next> {
        if !self.begun {
            self.begun = true;
            if let Some(reader) = &self.reader {
                reader.begin_with(&self.shared);
            }
            if lock(&self.shared.recorder).is_some() {
                self.apart()?;
            }
        }
        loop {
            if let Some(reader) = self.leaves.take() {
                return Ok(Next::Apart(reader));
            }
            if !self.found().is_empty() {
                return Ok(Next::Say);
            }
            if self.shared.receiver.is_done() {
                self.finish()?;
                return Ok(Next::Over);
            }
            self.round()?;
        }
    }

    /// From now on a thread of its own receives, and another one reads out: a disk may hold this one up.
    fn apart(&mut self) -> Result<()> {
        self.shared.receiver.apart(if self.listens { Duration::ZERO } else { TOGETHER })?;
        self.leave();
        Ok(())
    }

    /// From now on another thread reads out.
    fn leave(&mut self) {
        if let Some(reader) = self.reader.take() {
            self.leaves = Some(Box::new(reader));
        }
    }

    fn round(&mut self) -> Result<()> {
        self.expect()?;
        // Only where a board makes no promises does silence say anything.
        let guesses = self.listens && self.sender.version() == 1;
        let tick = if guesses { TICK.max(Duration::from_secs_f64(self.frame_us * 1e-6)) } else { IDLE };
        let wait = if self.copiers.is_empty() { tick } else { tick.min(GATHER) };
        let mut batch = std::mem::take(&mut self.batch);
        let silent_until = if self.shared.receiver.take(&mut batch, wait)? {
            self.decode(&batch)?;
            self.record(|recorder| recorder.datagrams(&batch))?;
            None
        } else {
            let until = self.shared.receiver.silent_until();
            self.silence(until);
            until
        };
        self.copy(&batch, silent_until);
        self.batch = batch;
        self.taps.retain_mut(Tap::tick);
        self.still(false)?;
        self.look()?;
        if self.shared.wished.swap(false, Ordering::Acquire) {
            self.fulfil()?;
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.sender.finish_into(&mut self.events);
        self.hand_on()?;
        self.still(true)?;
        let believed = self.believes(self.shared.receiver.silent_until());
        self.taps.retain_mut(Tap::tick);
        let dropped = self.dropped_by_kernel();
        self.copiers.iter_mut().for_each(|copier| copier.finish(dropped));
        self.close(believed);
        self.fulfil()
    }

    /// The last that the readout hears.
    fn close(&mut self, believed: Option<Quiet>) {
        match &mut self.reader {
            Some(reader) => reader.wait(&self.shared, Taken { quiet: believed, last: true }),
            None => self.shared.handover.close(believed),
        }
    }

    /// What came goes to other computers.
    fn copy(&mut self, batch: &Batch, silent_until: Option<i64>) {
        if let Some((last, _)) = batch.iter().last() {
            self.received = last.number + 1;
        }
        if self.copiers.is_empty() {
            return;
        }
        let dropped = self.dropped_by_kernel();
        self.copiers.retain_mut(|copier| {
            copier.take(batch, dropped);
            copier.tick(silent_until, dropped)
        });
    }

    fn dropped_by_kernel(&self) -> u64 {
        self.shared.receiver.counts().dropped_by_kernel
    }

    /// Does something with the recording that runs. An error ends all where the recording was asked for from the
    /// beginning, and the recording alone where it was begun while listening.
    fn record(&self, work: impl FnOnce(&mut Recorder) -> Result<()>) -> Result<()> {
        let mut slot = lock(&self.shared.recorder);
        let Some(recorder) = &mut *slot else { return Ok(()) };
        match work(recorder) {
            Err(error) if recorder.since().is_some() => {
                *slot = None;
                lock(&self.shared.broken).get_or_insert(error);
                self.shared.records.store(false, Ordering::Release);
                Ok(())
            }
            outcome => outcome,
        }
    }

    /// What was asked for between two batches.
    fn fulfil(&mut self) -> Result<()> {
        let wishes = std::mem::take(&mut *lock(&self.shared.wishes));
        for wish in wishes {
            match wish {
                Wish::Record(next, give) => {
                    let ended = self.next_recording(next);
                    // Who asked may have gone.
                    let _ = give.send(ended);
                }
                Wish::Look(give) => {
                    let counters = &self.shared.shown().counters;
                    let (tap, outlet) =
                        tap(&self.shared.options.array, self.held.clone(), counters.board_us, counters.events);
                    if give.send(outlet).is_ok() {
                        self.taps.push(tap);
                    }
                }
                Wish::Copy(give) => {
                    let (copier, parcels) = copier(self.received);
                    if give.send(parcels).is_ok() {
                        self.copiers.push(copier);
                    }
                }
                Wish::Zero(taxels, give) => {
                    // Who asked may have gone.
                    let _ = give.send(self.zero(&taxels));
                }
                Wish::Registers(registers) => {
                    self.frame_us = registers.frame_us();
                    self.speaks(registers.wire_version)?;
                    self.record(|recorder| recorder.registers(&registers))?;
                }
            }
        }
        Ok(())
    }

    /// What has come so far belongs to the recording that runs, what comes from here on to the next one.
    fn next_recording(&mut self, next: Option<Box<Recorder>>) -> Result<Ended> {
        self.still(true)?;
        let now = self.shared.counters();
        let ended = lock(&self.shared.recorder).take();
        self.fresh = None;
        if let Some(mut next) = next {
            self.apart()?;
            if let Err(error) = next.begin(&now, &self.held) {
                *lock(&self.shared.recorder) = ended;
                return Err(error);
            }
            let decoder = Decoder::new(self.shared.options.array.clone()).differences(self.shared.options.differences);
            self.fresh = Some(Box::new(Receiver::new(decoder, 1)));
            self.tared = false;
            let timed = next.is_timed();
            *lock(&self.shared.recorder) = Some(*next);
            if timed {
                self.zeroed_before()?;
            }
        }
        self.shared.records.store(self.fresh.is_some(), Ordering::Release);
        Ok((ended, now))
    }

    /// What was zeroed before holds in the recording that was begun, too.
    fn zeroed_before(&self) -> Result<()> {
        let zeroed: Vec<Zeroing> = self.shared.shown().zeroed.values().copied().collect();
        self.record(|recorder| zeroed.iter().try_for_each(|one| recorder.zeroing(one)))
    }

    /// Takes what these taxels hold for their rest, from now on: where one cannot be zeroed none is.
    fn zero(&mut self, taxels: &[(u16, u16)]) -> Result<Vec<Zeroing>> {
        let array = &self.shared.options.array;
        let shown = self.shared.shown();
        if shown.counters.taring {
            return Err(problem!("a tare is being taken: zero taxels when that is done").into());
        }
        let now = shown.counters.offset.map(|offset| offset.board_us(now_ns()));
        let Some(t) = shown.counters.board_us.max(self.believed).max(now) else {
            return Err(problem!("nothing came yet: no taxel can be zeroed").into());
        };
        let mut zeroings = vec![];
        for &(x, y) in taxels {
            let mut zeroing = Zeroing { t, x, y, rest: 0.0, before: None };
            zeroing.check(array)?;
            let place = array.index(x, y);
            if self.held[place] == UNKNOWN {
                return Err(
                    problem!("taxel at row {y}, column {x}: not heard of yet, so what it holds is unknown").into()
                );
            }
            zeroing.rest = self.held[place].into();
            let tared = shown.rest.get(place).copied().flatten();
            zeroing.before = shown.zeroed.get(&place).map(|earlier| earlier.rest).or(tared);
            zeroings.push(zeroing);
        }
        drop(shown);
        if let Some(recorder) = &*lock(&self.shared.recorder) {
            // First what is kept: nothing is zeroed that a recording does not know of.
            zeroings.iter().try_for_each(|zeroing| recorder.zeroing(zeroing))?;
        }
        let mut shown = self.shared.shown();
        shown.zeroed.extend(zeroings.iter().map(|one| (array.index(one.x, one.y), *one)));
        shown.zeroings += 1;
        drop(shown);
        self.shared.happened([t]);
        match &mut self.reader {
            Some(reader) => reader.zero(&zeroings),
            None if self.listens => self.shared.handover.zero(&zeroings),
            None => {}
        }
        Ok(zeroings)
    }

    /// The recording's own decoder has come to its first stamp, an event's or a marker's: from then on it is known what its
    /// clock lacks. `heard` and `marked` are how many of each were there before the datagram.
    fn compare(&mut self, bytes: &[u8], arrived_us: i64, heard: usize, marked: usize) -> Result<()> {
        let Some(fresh) = &mut self.fresh else { return Ok(()) };
        let mut events = Events::empty(self.shared.options.array.clone());
        fresh.push(bytes, Some(arrived_us), &mut events);
        let by_event = self.events.t.get(heard).zip(events.t.first()).map(|(ours, theirs)| ours - theirs);
        let by_marker =
            self.events.markers.get(marked).zip(events.markers.first()).map(|(ours, theirs)| ours.t - theirs.t);
        if let Some(origin_us) = by_event.or(by_marker) {
            self.fresh = None;
            let mut timed = true;
            self.record(|recorder| {
                timed = recorder.is_timed();
                recorder.set_origin(origin_us)
            })?;
            if !timed {
                self.zeroed_before()?;
            }
        }
        Ok(())
    }

    /// The host may have told the board to speak another version of the wire.
    fn expect(&mut self) -> Result<()> {
        let version = self.shared.expected.swap(0, std::sync::atomic::Ordering::AcqRel);
        if version == 0 { Ok(()) } else { self.speaks(version) }
    }

    /// The board was told to speak this version of the wire.
    fn speaks(&mut self, version: u8) -> Result<()> {
        if version == self.sender.version() {
            return Ok(());
        }
        self.sender.expect(version, &mut self.events);
        let change = Change::Wire { version, asked: true };
        let change = BoardChange { at_ns: now_ns(), t_us: self.heard, change };
        self.record(|recorder| recorder.board_change(&change))
    }

    /// What became of the board is kept.
    fn mark(&self, took: &Took, at_ns: i64) -> Result<()> {
        if took.version == 1 && !took.changed {
            return Ok(());
        }
        let wire = took.changed.then_some(Change::Wire { version: took.version, asked: false });
        self.record(|recorder| {
            recorder.takes(took.version)?;
            for change in wire.into_iter().chain(took.reset.then_some(Change::Reset)) {
                recorder.board_change(&BoardChange { at_ns, t_us: took.now, change })?;
            }
            Ok(())
        })
    }

    #[allow(clippy::cast_possible_truncation)]
    fn decode(&mut self, batch: &Batch) -> Result<()> {
        for (datagram, bytes) in batch.iter() {
            let (mut before, mut marked) = (self.events.len(), self.events.markers.len());
            let arrived_us = datagram.arrived_ns / 1000;
            let took = self.sender.push(bytes, Some(arrived_us), &mut self.events);
            if took.reset {
                self.begin_anew(before, marked)?;
                (before, marked) = (0, 0);
            }
            let now = now_ns();
            self.decoded += 1;
            self.mark(&took, datagram.arrived_ns)?;
            self.heard = took.now.or(self.heard);
            self.compare(bytes, arrived_us, before, marked)?;
            if took.version == 2 {
                if took.reset {
                    self.believed = None;
                }
                let late = self.events.t[before..].iter().filter(|&&t| self.believed.is_some_and(|until| t < until));
                self.late += late.count() as u64;
                let gap_us = (self.shared.options.gap_frames * self.frame_us) as i64;
                self.promise.note(&took, arrived_us, gap_us);
            }
            let last = self.events.t[before..].last().copied();
            if let Some(left) = leaves(&took, last, bytes.len(), self.frame_us()) {
                self.clock.note(left, datagram.arrived_ns);
            }
            self.shared.shown().decode_latency.note(now - datagram.arrived_ns);
            if self.events.len() >= HAND_ON {
                // So much waits only where reading out takes longer than what comes leaves it.
                self.leave();
                self.hand_on()?;
            }
        }
        self.hand_on()
    }

    /// The board was reset: hands on what came before; what its taxels held holds no more.
    fn begin_anew(&mut self, rows: usize, markers: usize) -> Result<()> {
        let later = self.events.split_off(rows, markers);
        self.hand_on()?;
        self.held.fill(UNKNOWN);
        self.taps.iter_mut().for_each(Tap::forget);
        self.events.append(&later, later.len());
        Ok(())
    }

    #[allow(clippy::cast_possible_truncation)]
    fn frame_us(&self) -> i64 {
        self.frame_us as i64
    }

    /// Hands the events on to the readout, and tells those who look on.
    fn hand_on(&mut self) -> Result<()> {
        let events = &mut self.events;
        if let Some(intensity) = &events.intensity {
            self.has_intensities = true;
            for k in 0..events.t.len() {
                if intensity.present[k] {
                    self.held[events.array.index(events.x[k], events.y[k])] = intensity.ticks[k];
                }
            }
        }
        self.taps.iter_mut().for_each(|tap| tap.take(events));
        if !events.markers.is_empty() {
            let markers = std::mem::take(&mut self.events.markers);
            self.record(|recorder| markers.iter().try_for_each(|m| recorder.marker(*m)))?;
            self.shared.happened(markers.iter().map(|m| m.t));
            self.events.markers = markers;
        }
        let events = &mut self.events;
        {
            let mut shown = self.shared.shown();
            shown.markers.extend_from_slice(&events.markers);
            let counters = &mut shown.counters;
            counters.decoded = self.decoded;
            counters.wire = *self.sender.counts();
            counters.wire_v2 = self.sender.two().counts();
            counters.wire_version = self.sender.version();
            counters.wire_refused = self.sender.refused();
            counters.wire_changes = self.sender.changes();
            counters.wire_late = self.late;
            counters.events += events.len() as u64;
            counters.offset = self.clock.offset();
            counters.board_us = counters.board_us.max(events.t.iter().max().copied());
            counters.markers += events.markers.len() as u64;
            counters.marked_start = events.markers.last().map(|m| m.start).or(counters.marked_start);
        }
        let promised = self.promise.take();
        if self.listens && (promised.is_some() || !events.is_empty() || !events.markers.is_empty()) {
            match &mut self.reader {
                Some(reader) => {
                    reader.take(&self.shared, events, Taken { quiet: promised.map(Quiet::Promised), last: false });
                }
                None => {
                    let dropped = self.shared.handover.put(events, promised);
                    self.shared.shown().counters.events_dropped = dropped;
                }
            }
            self.believed = self.believed.max(promised);
        }
        events.clear();
        if self.has_intensities {
            events.intensity.get_or_insert_default();
        }
        Ok(())
    }

    /// Nothing waits: of a board that makes no promises the readout's time may move on by the host's clock.
    fn silence(&mut self, until_ns: Option<i64>) {
        let Some(quiet) = self.believes(until_ns) else { return };
        match &mut self.reader {
            Some(reader) => reader.wait(&self.shared, Taken { quiet: Some(quiet), last: false }),
            None => self.shared.handover.quiet(quiet),
        }
    }

    #[allow(clippy::cast_possible_truncation)]
    fn believes(&self, until_ns: Option<i64>) -> Option<Quiet> {
        if !self.listens || self.sender.version() != 1 {
            return None;
        }
        let guard = (self.shared.options.guard_frames * self.frame_us) as i64;
        // What a frame sees leaves at its end: before the start of the frame that ends now all has come.
        Some(Quiet::Believed(self.clock.offset()?.board_us(until_ns?) - self.frame_us() - guard))
    }

    /// The pictures of the recording; the last one at its end.
    fn still(&mut self, last: bool) -> Result<()> {
        let now = Instant::now();
        if !(last || self.stills.is_due(now)) {
            return Ok(());
        }
        let happened = std::mem::take(&mut *lock(&self.shared.happened));
        if lock(&self.shared.recorder).is_none() {
            self.stills.clear();
            return Ok(());
        }
        let new = self.decoded != self.counted;
        self.counted = self.decoded;
        if let (true, Some(t_us)) = (new, self.shared.shown().counters.board_us) {
            // In a picture 0 is a taxel that was never heard of.
            let held = self.held.iter().map(|&held| if held == UNKNOWN { 0 } else { held });
            self.stills.take(now, now_ns(), t_us, held);
        }
        happened.into_iter().for_each(|t| self.stills.around(t));
        let columns = self.shared.options.array.columns;
        let mut stills = std::mem::replace(&mut self.stills, Stills::new());
        let kept = self.record(|recorder| {
            stills.give().try_for_each(|still| recorder.picture(still.at_ns, still.t_us, columns, &still.held))
        });
        self.stills = stills;
        kept
    }

    /// What others look at, at their own pace.
    fn look(&mut self) -> Result<()> {
        if self.pictured.elapsed() < PICTURE_EVERY {
            return Ok(());
        }
        self.pictured = Instant::now();
        let (counters, tare) = {
            let mut shown = self.shared.shown();
            // Who asks for a picture hears 0 of a taxel that was never heard of.
            for (shown, &held) in shown.picture.iter_mut().zip(&self.held) {
                *shown = if held == UNKNOWN { 0 } else { held };
            }
            let tare = if self.tared { None } else { shown.tare.clone() };
            (shown.counters.clone(), tare)
        };
        if lock(&self.shared.recorder).is_none() {
            return Ok(());
        }
        self.tared |= tare.is_some();
        let tell = self.told.elapsed() >= COUNTS_EVERY;
        if tell {
            self.told = Instant::now();
        }
        let (capture, bridged) = (self.shared.receiver.counts(), self.shared.receiver.bridged());
        self.record(|recorder| {
            if let Some(tare) = tare {
                recorder.tare(&tare)?;
            }
            recorder.flush()?;
            if tell { recorder.so_far(&super::counters::Counters { capture, bridged, ..counters }) } else { Ok(()) }
        })
    }
}
