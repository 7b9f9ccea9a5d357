//! Changes that can be looked at from any time on: the last minute while live, or a recording of any length.
//!
//! Both keep keyframes, from which reading on gives what reading from the beginning gives. Of a recording a keyframe holds
//! the decoder itself, so that its clock, what it has seen and what waits in it are as they were.

use std::collections::VecDeque;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crossbeam_channel as channel;
use taxel_core::encode::Encoder;
use taxel_core::wire::{self, Decoder};
use taxel_core::{Array, Events, problem};

use super::lens::{COLUMN_US, FORGET, History, Keyframe, LATE_US, Lens, SPAN, Strip, column_of};
use super::spikes::Spikes;
use crate::pipeline::{Change, Piece, UNKNOWN};
use crate::recording::{Ending, Header, NOTHING_LOST, Place, Reader, Remarks, Topic, begin_with};
use crate::{Error, Result};

/// How far back a live view may look, us ...
pub(super) const REACH_US: i64 = 60_000_000;
/// ... and what that may cost, bytes.
const REACH_BYTES: usize = 512 << 20;

/// What the keyframes of a recording may cost, bytes; and its raster and curves.
const KEYFRAME_BYTES: usize = 128 << 20;
const STRIP_BYTES: usize = 256 << 20;

/// From keyframe to keyframe at least, bytes of the file.
const SPACING: u64 = 1 << 16;

/// Blocks that are decoded ahead of who looks at them.
const AHEAD: usize = 4;

/// How much of a `.lsa` is read at once.
const LSA_PIECE: u64 = 1 << 16;

/// Bins of the rate over time at most, before two become one.
const BINS: usize = 1000;

/// Changes that may be read for the history of a taxel and an encoder's spikes alone.
const HISTORY_CHANGES: u64 = 2_000_000;

/// What comes next of a film.
#[derive(Debug)]
pub enum Next {
    /// Changes were appended.
    Changes,
    /// Changes are missing; the taxels hold this then, and so many events have come.
    Held(Vec<u16>, u64),
    /// Nothing more, as yet.
    End,
}

/// Reads on from a keyframe.
pub trait Reel: Send {
    /// Appends the next changes.
    ///
    /// # Errors
    ///
    /// `File` where the file cannot be read.
    fn next(&mut self, out: &mut Vec<Change>) -> Result<Next>;
}

/// See the module.
pub trait Film: Send + Sync {
    /// The sensor.
    fn array(&self) -> &Array;

    /// Changes up to it are none, ticks.
    fn floor(&self) -> u16;

    /// First and last time that can be shown, us; `None` where nothing came.
    fn range(&self) -> Option<(i64, i64)>;

    /// The last keyframe at or before a time, or the first, and what reads on from it.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where there is none.
    fn open(&self, t: i64) -> Result<(Keyframe, Box<dyn Reel>)>;

    /// The keyframe before this one: its time, if there is one.
    fn earlier(&self, t: i64) -> Option<i64>;

    /// Raster and curves of all of it, where they are kept.
    fn strip(&self) -> Option<&Strip>;

    /// Events up to about a time.
    fn events_before(&self, t: i64) -> u64;
}

// ---------------------------------------------------------------------------------------------- live

/// A piece in the ring.
#[derive(Debug)]
pub struct Kept {
    /// What came.
    pub piece: Piece,
    rest: Option<Arc<Vec<u16>>>,
    bytes: usize,
}

/// The last minute of what came, or what 512 MB hold.
#[derive(Debug)]
pub struct Ring {
    pieces: VecDeque<Arc<Kept>>,
    /// The number of the first.
    first: u64,
    bytes: usize,
    latest: Option<i64>,
    rest: Option<(u64, Arc<Vec<u16>>)>,
}

/// The same, to be looked at.
#[derive(Debug, Clone)]
pub struct RingFilm {
    ring: Arc<Mutex<Ring>>,
    array: Array,
    floor: u16,
}

impl RingFilm {
    /// An empty one.
    #[must_use]
    pub fn new(array: Array, floor: u16) -> Self {
        let ring = Ring { pieces: VecDeque::new(), first: 0, bytes: 0, latest: None, rest: None };
        Self { ring: Arc::new(Mutex::new(ring)), array, floor }
    }

    fn ring(&self) -> MutexGuard<'_, Ring> {
        self.ring.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps a piece; `lens` is as it was before it.
    pub fn keep(&self, piece: Piece, lens: &Lens) -> Arc<Kept> {
        let mut ring = self.ring();
        let rest = piece.held.is_some().then(|| {
            if ring.rest.as_ref().is_none_or(|(rests, _)| *rests != lens.rests()) {
                ring.rest = Some((lens.rests(), Arc::new(lens.rest().to_vec())));
            }
            Arc::clone(&ring.rest.as_ref().expect("it was put there").1)
        });
        let held = piece.held.as_ref().map_or(0, Vec::len);
        let bytes = piece.changes.len() * size_of::<Change>() + 4 * held + size_of::<Kept>();
        ring.latest = ring.latest.max(piece.changes.iter().map(|c| c.t).max());
        ring.bytes += bytes;
        let kept = Arc::new(Kept { piece, rest, bytes });
        ring.pieces.push_back(Arc::clone(&kept));
        let latest = ring.latest;
        // The first is always one to begin with.
        loop {
            let second = ring.pieces.iter().skip(1).position(|kept| kept.piece.held.is_some()).map(|k| k + 1);
            let Some(second) = second else { break };
            let old = ring.pieces[second].piece.since.zip(latest).is_some_and(|(since, now)| now - since > REACH_US);
            if !old && ring.bytes <= REACH_BYTES {
                break;
            }
            for _ in 0..second {
                let gone = ring.pieces.pop_front().map_or(0, |kept| kept.bytes);
                ring.bytes -= gone;
                ring.first += 1;
            }
        }
        kept
    }

    /// How many pieces have come; [`RingFilm::changes_from`] goes on there.
    #[must_use]
    pub fn come_to(&self) -> u64 {
        let ring = self.ring();
        ring.first + ring.pieces.len() as u64
    }

    /// Hands out the changes of the pieces from a number on; gives the next number.
    pub fn changes_from(&self, number: u64, mut take: impl FnMut(&[Change])) -> u64 {
        let mut number = number;
        loop {
            let kept = {
                let ring = self.ring();
                number = number.max(ring.first);
                #[allow(clippy::cast_possible_truncation)]
                ring.pieces.get((number - ring.first) as usize).cloned()
            };
            let Some(kept) = kept else { return number };
            take(&kept.piece.changes);
            number += 1;
        }
    }

    /// The history of a taxel up to now by columns of so many us, and where to go on.
    #[must_use]
    pub fn history(&self, taxel: u32, column_us: i64) -> (History, u64) {
        let from = self.range().map_or(0, |(_, latest)| latest - SPAN * column_us);
        let (number, held, since) = {
            let ring = self.ring();
            let place = ring.begin(from).unwrap_or(0);
            let kept = ring.pieces.get(place);
            let held = kept.and_then(|kept| kept.piece.held.as_ref());
            (
                ring.first + place as u64,
                held.map_or(UNKNOWN, |held| held[taxel as usize]),
                kept.and_then(|k| k.piece.since),
            )
        };
        let mut history = History::new(taxel, held, since, column_us);
        let number = self.changes_from(number, |changes| changes.iter().for_each(|change| history.take(change)));
        (history, number)
    }

    /// Bytes of memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.ring().bytes
    }

    /// Events by bin from the first time on: step us, counts.
    #[must_use]
    pub fn rate(&self) -> (i64, i64, Vec<u64>) {
        let mut rate = Rate::default();
        let first = self.ring().first;
        self.changes_from(first, |changes| changes.iter().for_each(|change| rate.take(change.t, 1)));
        rate.said()
    }
}

impl Ring {
    /// The place of the last keyframe at or before a time, or of the first.
    fn begin(&self, t: i64) -> Option<usize> {
        let whole = |kept: &Arc<Kept>| kept.piece.held.is_some();
        let last = self.pieces.iter().rposition(|kept| whole(kept) && kept.piece.since.is_none_or(|since| since <= t));
        last.or_else(|| self.pieces.iter().position(whole))
    }
}

struct RingReel {
    film: RingFilm,
    number: u64,
    /// The piece whose held values were told.
    told: Option<u64>,
}

impl Reel for RingReel {
    fn next(&mut self, out: &mut Vec<Change>) -> Result<Next> {
        let ring = self.film.ring();
        let lost = self.number < ring.first;
        self.number = self.number.max(ring.first);
        #[allow(clippy::cast_possible_truncation)]
        let Some(kept) = ring.pieces.get((self.number - ring.first) as usize).cloned() else { return Ok(Next::End) };
        drop(ring);
        if (lost || kept.piece.missing > 0 || kept.piece.reset)
            && self.told != Some(self.number)
            && let Some(held) = &kept.piece.held
        {
            self.told = Some(self.number);
            return Ok(Next::Held(held.clone(), kept.piece.before));
        }
        out.extend_from_slice(&kept.piece.changes);
        self.number += 1;
        Ok(Next::Changes)
    }
}

impl Film for RingFilm {
    fn array(&self) -> &Array {
        &self.array
    }

    fn floor(&self) -> u16 {
        self.floor
    }

    fn range(&self) -> Option<(i64, i64)> {
        let ring = self.ring();
        let latest = ring.latest?;
        // Before anything came there are pieces that hold nothing.
        let begin = |kept: &Arc<Kept>| kept.piece.since.or(kept.piece.changes.first().map(|c| c.t));
        Some((ring.pieces.iter().find_map(begin).unwrap_or(latest), latest))
    }

    fn open(&self, t: i64) -> Result<(Keyframe, Box<dyn Reel>)> {
        let ring = self.ring();
        let place = ring.begin(t).ok_or_else(|| problem!("nothing came yet"))?;
        let kept = &ring.pieces[place];
        let held = kept.piece.held.clone().unwrap_or_default();
        let rest = kept.rest.as_ref().map_or_else(|| held.clone(), |rest| rest.to_vec());
        let frame = Keyframe { latest: kept.piece.since, events: kept.piece.before, held, rest };
        let number = ring.first + place as u64;
        drop(ring);
        Ok((frame, Box::new(RingReel { film: self.clone(), number, told: Some(number) })))
    }

    fn earlier(&self, t: i64) -> Option<i64> {
        let ring = self.ring();
        ring.pieces.iter().rev().filter(|kept| kept.piece.held.is_some()).filter_map(|k| k.piece.since).find(|&s| s < t)
    }

    fn strip(&self) -> Option<&Strip> {
        None
    }

    fn events_before(&self, t: i64) -> u64 {
        let ring = self.ring();
        ring.begin(t).map_or(0, |place| ring.pieces[place].piece.before)
    }
}

// ---------------------------------------------------------------------------------------------- recordings

/// Events over time in bins that grow with it.
#[derive(Debug, Default)]
struct Rate {
    first: Option<i64>,
    step: i64,
    bins: Vec<u64>,
}

impl Rate {
    /// So many more at a time.
    fn take(&mut self, t: i64, count: u64) {
        let first = *self.first.get_or_insert(t);
        self.step = self.step.max(COLUMN_US);
        loop {
            #[allow(clippy::cast_possible_truncation)]
            let bin = (t.saturating_sub(first).max(0) / self.step).unsigned_abs() as usize;
            if bin < BINS {
                if bin >= self.bins.len() {
                    self.bins.resize(bin + 1, 0);
                }
                self.bins[bin] += count;
                return;
            }
            self.bins = self.bins.chunks(2).map(|two| two.iter().sum()).collect();
            self.step = self.step.saturating_mul(2);
        }
    }

    fn said(self) -> (i64, i64, Vec<u64>) {
        (self.first.unwrap_or(0), self.step.max(COLUMN_US), self.bins)
    }
}

/// What each taxel did, and what it is known to have held.
#[derive(Debug, Clone)]
pub struct Activity {
    /// Events at each taxel.
    pub events: Vec<u32>,
    /// Events that went the way of the taxel's event before: a touch makes such, noise at the floor next to none.
    pub moved: Vec<u32>,
    /// Different values that its events showed: 0, 1, or 2 for more.
    pub values: Vec<u8>,
    /// The least and the greatest that it held, ticks; [`UNKNOWN`] and 0 where it was not heard of.
    pub range: Vec<(u16, u16)>,
    first: Vec<u16>,
    up: Vec<bool>,
}

impl Activity {
    /// Of so many taxels that have done nothing.
    #[must_use]
    pub fn new(taxels: usize) -> Self {
        Self {
            events: vec![0; taxels],
            moved: vec![0; taxels],
            values: vec![0; taxels],
            range: vec![(UNKNOWN, 0); taxels],
            first: vec![UNKNOWN; taxels],
            up: vec![false; taxels],
        }
    }

    /// Takes a change; one that a state told is none of the taxel's own, as a dead one is told of too.
    pub fn take(&mut self, change: &Change) {
        let taxel = change.taxel as usize;
        self.hold(taxel, change.ticks);
        if change.repaired {
            return;
        }
        if self.events[taxel] > 0 && self.up[taxel] == change.up {
            self.moved[taxel] = self.moved[taxel].saturating_add(1);
        }
        self.up[taxel] = change.up;
        self.events[taxel] = self.events[taxel].saturating_add(1);
        if change.ticks == UNKNOWN {
            return;
        }
        if self.values[taxel] == 0 {
            (self.values[taxel], self.first[taxel]) = (1, change.ticks);
        } else if self.first[taxel] != change.ticks {
            self.values[taxel] = 2;
        }
    }

    /// A taxel holds so much, as far as it is known.
    fn hold(&mut self, taxel: usize, ticks: u16) {
        if ticks != UNKNOWN {
            let (least, greatest) = self.range[taxel];
            self.range[taxel] = (least.min(ticks), greatest.max(ticks));
        }
    }
}

#[derive(Debug)]
enum Source {
    Mcap(Box<Reader>),
    Lsa(File, u64),
}

/// What decodes it.
#[derive(Debug, Clone)]
enum Ear {
    Datagrams(Box<wire::Receiver>),
    Bytes(Box<Decoder>),
}

#[derive(Debug)]
struct Key {
    block: usize,
    place: Place,
    ear: Ear,
    frame: Keyframe,
}

/// A recording, indexed.
#[derive(Debug)]
pub struct FileFilm {
    path: PathBuf,
    source: Source,
    header: Header,
    keys: Vec<Key>,
    strip: Option<Strip>,
    range: Option<(i64, i64)>,
    /// Bytes of the file.
    pub bytes: u64,
    /// Events in all.
    pub events: u64,
    /// Events over time: first time, step (us), counts.
    pub rate: (i64, i64, Vec<u64>),
    /// What each taxel did.
    pub activity: Activity,
    /// Notes, markers, detections, registers.
    pub remarks: Remarks,
    /// What was lost, in a line.
    pub verdict: String,
    /// Whether it lacks its end.
    pub unfinished: bool,
}

impl FileFilm {
    /// Reads a recording (`.mcap`, `.lsa`) once, and keeps where to begin.
    ///
    /// # Errors
    ///
    /// `File` where it cannot be read, `Core` where it is no recording.
    pub fn open(path: &Path) -> Result<Arc<Self>> {
        let bytes = std::fs::metadata(path).map_err(Error::file(path))?.len();
        let (source, header, verdict, unfinished) = match path.extension().and_then(|e| e.to_str()) {
            Some("mcap") => {
                let reader = Reader::open(path)?;
                let verdict = match reader.ending() {
                    Some(Ending::Finished { verdict, .. }) => verdict.clone(),
                    Some(Ending::Stopped(why)) => format!("stopped by an error ({why}): what came last is missing"),
                    None => "not finished: what came last is missing".to_owned(),
                };
                let (header, unfinished) = (reader.header().clone(), reader.rebuilt().unfinished);
                (Source::Mcap(Box::new(reader)), header, verdict, unfinished)
            }
            Some("lsa") => {
                let file = File::open(path).map_err(Error::file(path))?;
                let header = Header::of_board(Array::thesis(), None, path.display().to_string(), 0);
                let complete = path.with_extension("lss").exists();
                let verdict =
                    if complete { NOTHING_LOST.to_owned() } else { "no .lss: perhaps not complete".to_owned() };
                (Source::Lsa(file, bytes), header, verdict, !complete)
            }
            _ => {
                let name = path.display();
                return Err(problem!("{name}: the panel shows .mcap and .lsa; taxel convert makes a .mcap").into());
            }
        };
        let taxels = header.array.len();
        let mut film = Self {
            path: path.to_owned(),
            source,
            header,
            keys: vec![],
            strip: None,
            range: None,
            bytes,
            events: 0,
            rate: (0, COLUMN_US, vec![]),
            activity: Activity::new(taxels),
            remarks: Remarks::default(),
            verdict,
            unfinished,
        };
        film.index()?;
        Ok(Arc::new(film))
    }

    /// What the file says of itself.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn blocks(&self) -> usize {
        match &self.source {
            Source::Mcap(reader) => reader.blocks(),
            Source::Lsa(_, length) => usize::try_from(length.div_ceil(LSA_PIECE)).unwrap_or(usize::MAX),
        }
    }

    fn ear(&self) -> Ear {
        let decoder = Decoder::new(self.header.array.clone()).differences(self.header.difference);
        match &self.source {
            Source::Mcap(_) => Ear::Datagrams(Box::new(wire::Receiver::new(decoder, 1))),
            Source::Lsa(..) => Ear::Bytes(Box::new(decoder)),
        }
    }

    /// Decodes a block; the last gives what waits as well. Gives the bytes that it held.
    fn block(
        &self,
        k: usize,
        place: &mut Place,
        ear: &mut Ear,
        events: &mut Events,
        mut remarks: Option<&mut Remarks>,
    ) -> Result<u64> {
        let mut bytes = 0;
        match (&self.source, &mut *ear) {
            (Source::Mcap(reader), Ear::Datagrams(receiver)) => {
                reader.block(k, place, |message| {
                    if message.topic == Topic::Datagrams {
                        receiver.push(message.data, Some(message.at_ns / 1000), events);
                        bytes += message.data.len() as u64;
                    } else if message.topic == Topic::Held {
                        begin_with(receiver, message.data);
                    } else if message.topic == Topic::Pressure {
                        return Ok(());
                    }
                    if let Some(remarks) = &mut remarks {
                        remarks.take(&message);
                    }
                    Ok(())
                })?;
            }
            (Source::Lsa(file, length), Ear::Bytes(decoder)) => {
                let offset = k as u64 * LSA_PIECE;
                bytes = LSA_PIECE.min(length - offset);
                let mut piece = vec![0; usize::try_from(bytes).unwrap_or(0)];
                file.read_exact_at(&mut piece, offset).map_err(Error::file(&self.path))?;
                decoder.push_into(&piece, None, events);
            }
            _ => {}
        }
        if k + 1 == self.blocks() {
            match ear {
                Ear::Datagrams(receiver) => receiver.finish_into(events),
                Ear::Bytes(decoder) => decoder.finish_into(events),
            }
        }
        Ok(bytes)
    }

    fn changes(&self, events: &Events, out: &mut Vec<Change>) {
        let columns = usize::from(self.header.array.columns);
        out.extend((0..events.len()).map(|k| {
            let ticks = match &events.intensity {
                Some(intensity) if intensity.present[k] => intensity.ticks[k],
                _ => UNKNOWN,
            };
            // A sensor has 2^22 taxels at most (recording's limits).
            #[allow(clippy::cast_possible_truncation)]
            let taxel = (usize::from(events.y[k]) * columns + usize::from(events.x[k])) as u32;
            Change {
                t: events.t[k] + self.header.origin_us,
                taxel,
                ticks,
                up: events.p[k],
                repaired: events.is_repaired(k),
            }
        }));
    }

    /// Reads it through, once: one thread decodes, this one looks.
    fn index(&mut self) -> Result<()> {
        let taxels = self.header.array.len();
        let blank = Keyframe { latest: None, events: 0, held: vec![UNKNOWN; taxels], rest: vec![UNKNOWN; taxels] };
        let mut lens = Lens::new(self.header.array.columns, self.floor(), &blank, COLUMN_US, STRIP_BYTES);
        let mut keys: Vec<Key> = vec![];
        let (give, pieces) = channel::bounded(AHEAD);
        let film = &*self;
        let heard = std::thread::scope(|scope| {
            let decoding = scope.spawn(move || film.decode_all(&give));
            for Decoded { key, thin, held, changes } in pieces {
                keys.extend(key.map(|(block, place, ear)| Key { block, place, ear, frame: lens.keyframe() }));
                if thin {
                    let mut odd = false;
                    keys.retain(|_| {
                        odd = !odd;
                        odd
                    });
                }
                if let Some(held) = held.filter(|_| lens.events() == 0) {
                    // A recording begun in mid-stream says what was held; it stands before all datagrams, in the first block.
                    lens.hold(&held, 0);
                    if let Some(key) = keys.first_mut() {
                        key.frame = lens.keyframe();
                    }
                }
                lens.take_all(&changes);
            }
            decoding.join().unwrap_or_else(|_| Err(problem!("indexing failed within taxel; please report it").into()))
        })?;
        self.keys = keys;
        self.events = lens.events();
        self.range = heard.first.zip(lens.latest());
        self.rate = heard.rate.said();
        self.activity = heard.activity;
        self.remarks = heard.remarks;
        lens.settle();
        let strip = lens.strip().clone();
        let whole =
            strip.reach().zip(heard.first).is_none_or(|((begin, _), first)| begin <= column_of(first, COLUMN_US));
        self.strip = whole.then_some(strip);
        Ok(())
    }

    /// Decodes all of it, block by block.
    fn decode_all(&self, give: &channel::Sender<Decoded>) -> Result<Heard> {
        let taxels = self.header.array.len();
        let (mut ear, mut place) = (self.ear(), Place::default());
        // Of version 2 a decoder remembers the last 65 536 numbers.
        let each = 4 * taxels + (80 << 10);
        let (mut spacing, mut since, mut keys) = (SPACING, u64::MAX, 0);
        let mut events = Events::empty(self.header.array.clone());
        let mut heard =
            Heard { first: None, rate: Rate::default(), activity: Activity::new(taxels), remarks: Remarks::default() };
        for k in 0..self.blocks() {
            let mut piece = Decoded { key: None, thin: false, held: None, changes: vec![] };
            if since >= spacing {
                (since, keys) = (0, keys + 1);
                piece.key = Some((k, place.kept(), ear.clone()));
                if keys * each > KEYFRAME_BYTES {
                    (piece.thin, keys, spacing) = (true, keys.div_ceil(2), 2 * spacing);
                }
            }
            events.clear();
            let told = heard.remarks.held.is_some();
            since = since.saturating_add(self.block(k, &mut place, &mut ear, &mut events, Some(&mut heard.remarks))?);
            if !told {
                piece.held = heard.remarks.held.clone().filter(|held| held.len() == taxels);
                let known = piece.held.iter().flatten().enumerate();
                known.for_each(|(taxel, &ticks)| heard.activity.hold(taxel, ticks));
            }
            self.changes(&events, &mut piece.changes);
            for change in &piece.changes {
                heard.activity.take(change);
            }
            for together in piece.changes.chunk_by(|one, next| one.t == next.t) {
                let t = together[0].t;
                heard.first = Some(heard.first.map_or(t, |first: i64| first.min(t)));
                heard.rate.take(t, together.len() as u64);
            }
            if give.send(piece).is_err() {
                break;
            }
        }
        Ok(heard)
    }
}

/// What the decoding of a block gave.
struct Decoded {
    /// Where reading can begin again: the block, and what was there before it.
    key: Option<(usize, Place, Ear)>,
    /// There are too many of those: every other one goes.
    thin: bool,
    /// What was held when the recording was begun.
    held: Option<Vec<u16>>,
    changes: Vec<Change>,
}

/// What a whole recording holds beside its changes.
struct Heard {
    first: Option<i64>,
    rate: Rate,
    activity: Activity,
    remarks: Remarks,
}

struct FileReel {
    film: Arc<FileFilm>,
    block: usize,
    place: Place,
    ear: Ear,
    events: Events,
}

impl Reel for FileReel {
    fn next(&mut self, out: &mut Vec<Change>) -> Result<Next> {
        if self.block >= self.film.blocks() {
            return Ok(Next::End);
        }
        self.events.clear();
        self.film.block(self.block, &mut self.place, &mut self.ear, &mut self.events, None)?;
        self.block += 1;
        self.film.changes(&self.events, out);
        Ok(Next::Changes)
    }
}

impl Film for Arc<FileFilm> {
    fn array(&self) -> &Array {
        &self.header.array
    }

    fn floor(&self) -> u16 {
        FileFilm::floor(self)
    }

    fn range(&self) -> Option<(i64, i64)> {
        self.range
    }

    fn open(&self, t: i64) -> Result<(Keyframe, Box<dyn Reel>)> {
        let place = self.keys.partition_point(|key| key.frame.latest.is_none_or(|latest| latest <= t)).max(1) - 1;
        let Some(Key { block, place, ear, frame }) = self.keys.get(place) else {
            return Err(problem!("{}: holds no events", self.path.display()).into());
        };
        let reel = FileReel {
            film: Arc::clone(self),
            block: *block,
            place: place.clone(),
            ear: ear.clone(),
            events: Events::empty(self.header.array.clone()),
        };
        Ok((frame.clone(), Box::new(reel)))
    }

    fn earlier(&self, t: i64) -> Option<i64> {
        self.keys.iter().rev().filter_map(|key| key.frame.latest).find(|&latest| latest < t)
    }

    fn strip(&self) -> Option<&Strip> {
        self.strip.as_ref()
    }

    fn events_before(&self, t: i64) -> u64 {
        let place = self.keys.partition_point(|key| key.frame.latest.is_none_or(|latest| latest <= t)).max(1) - 1;
        self.keys.get(place).map_or(0, |key| key.frame.events)
    }
}

impl FileFilm {
    fn floor(&self) -> u16 {
        self.header.registers.map_or(0, |registers| registers.noise_floor.into())
    }
}

// ---------------------------------------------------------------------------------------------- a view

/// How a view looks at a film.
#[derive(Debug, Clone)]
pub struct Gaze {
    /// A column of time, us ([`is_column`](super::lens::is_column)).
    pub column_us: i64,
    /// Whose history is shown.
    pub watched: Option<u32>,
    /// Whose spikes.
    pub encoder: Option<Encoder>,
    /// Raster and curves of all that can be shown, where the film does not keep them itself.
    pub whole: Option<Arc<Strip>>,
}

impl Gaze {
    /// By columns of so many us, and nothing else.
    #[must_use]
    pub fn plain(column_us: i64) -> Self {
        Self { column_us, watched: None, encoder: None, whole: None }
    }

    /// Whether columns are narrower than what films keep.
    #[must_use]
    pub fn is_near(&self) -> bool {
        self.column_us < COLUMN_US
    }
}

/// A film at a time.
pub struct Player {
    film: Arc<dyn Film>,
    reel: Box<dyn Reel>,
    lens: Lens,
    /// From this column of the lens on its own strip holds; before it the film's.
    own: i64,
    waiting: Vec<Change>,
    place: usize,
    t: i64,
    history: Option<History>,
    spikes: Option<Spikes>,
    gaze: Gaze,
}

impl Player {
    /// Shows a time (us), cut to what there is, as it is looked at.
    ///
    /// # Errors
    ///
    /// As [`Film::open`] and [`Reel::next`]; `Core(Problem)` where the encoder cannot be of this array.
    pub fn open(film: Arc<dyn Film>, t: i64, gaze: Gaze) -> Result<Self> {
        let (first, last) = film.range().ok_or_else(|| problem!("nothing to show: it holds no events"))?;
        let t = t.clamp(first, last);
        let span = SPAN * gaze.column_us;
        let kept = !gaze.is_near() && (film.strip().is_some() || gaze.whole.is_some());
        let wants = gaze.watched.is_some() || gaze.encoder.is_some();
        let dense = film.events_before(t).saturating_sub(film.events_before(t - span)) > HISTORY_CHANGES;
        let needs = if kept && (!wants || dense) { 0 } else { span };
        let (frame, reel) = film.open(t.saturating_sub(needs.max(FORGET * COLUMN_US) + LATE_US))?;
        let columns = film.array().columns;
        let unit_us = gaze.column_us.min(COLUMN_US);
        let room = Strip::room(film.array().rows.into(), span / unit_us);
        let lens = Lens::new(columns, film.floor(), &frame, unit_us, room);
        let own = frame.latest.map_or(i64::MIN, |latest| column_of(latest + LATE_US, unit_us));
        let history = gaze.watched.map(|taxel| {
            let held = frame.held.get(taxel as usize).copied().unwrap_or(UNKNOWN);
            History::new(taxel, held, frame.latest, gaze.column_us)
        });
        let encoder = gaze.encoder.as_ref();
        let spikes = encoder.map(|e| Spikes::new(e, film.array(), gaze.column_us, &frame.held, frame.latest));
        let spikes = spikes.transpose()?;
        let mut player = Self { film, reel, lens, own, waiting: vec![], place: 0, t, history, spikes, gaze };
        player.advance(t)?;
        Ok(player)
    }

    /// Moves on to a later time, at most to the end; gives whether there is more.
    ///
    /// # Errors
    ///
    /// As [`Reel::next`].
    pub fn advance(&mut self, t: i64) -> Result<bool> {
        let last = self.film.range().map_or(t, |(_, last)| last);
        self.follow(t.min(last))?;
        if let Some(spikes) = self.spikes.as_mut().filter(|_| t >= last) {
            // Nothing more comes at the last stamp either.
            spikes.advance(last + 1);
        }
        Ok(t < last)
    }

    /// Moves on to a later time, into the silence behind the end too.
    ///
    /// # Errors
    ///
    /// As [`Reel::next`].
    pub fn follow(&mut self, t: i64) -> Result<()> {
        loop {
            let ahead = &self.waiting[self.place..];
            let now = ahead.iter().position(|change| change.t > t).unwrap_or(ahead.len());
            let (now, later) = ahead.split_at(now);
            self.lens.take_all(now);
            if let Some(history) = &mut self.history {
                now.iter().for_each(|change| history.take(change));
            }
            if let Some(spikes) = &mut self.spikes {
                spikes.take(now);
            }
            self.place += now.len();
            if !later.is_empty() {
                break;
            }
            self.waiting.clear();
            self.place = 0;
            match self.reel.next(&mut self.waiting)? {
                Next::Changes => {}
                Next::Held(held, events) => self.lens.hold(&held, events),
                Next::End => break,
            }
        }
        self.lens.advance(t);
        if let Some(spikes) = &mut self.spikes {
            spikes.advance(t);
        }
        self.t = self.t.max(t);
        Ok(())
    }

    /// The time of the next stamp that has events, us.
    ///
    /// # Errors
    ///
    /// As [`Reel::next`].
    pub fn next_stamp(&mut self) -> Result<Option<i64>> {
        loop {
            if let Some(change) = self.waiting.get(self.place) {
                return Ok(Some(change.t.max(self.t)));
            }
            self.waiting.clear();
            self.place = 0;
            match self.reel.next(&mut self.waiting)? {
                Next::Changes => {}
                Next::Held(held, events) => self.lens.hold(&held, events),
                Next::End => return Ok(None),
            }
        }
    }

    /// The time of the last stamp before this one that has events, us.
    ///
    /// # Errors
    ///
    /// As [`Film::open`] and [`Reel::next`].
    pub fn last_stamp(&self) -> Result<Option<i64>> {
        let mut from = self.t;
        loop {
            let (_, mut reel) = self.film.open(from.saturating_sub(1))?;
            let (mut changes, mut found) = (vec![], None);
            'reading: loop {
                changes.clear();
                match reel.next(&mut changes)? {
                    Next::Changes => {}
                    Next::Held(..) => continue,
                    Next::End => break,
                }
                for change in &changes {
                    if change.t >= self.t {
                        break 'reading;
                    }
                    found = found.max(Some(change.t));
                }
            }
            if found.is_some() {
                return Ok(found);
            }
            match self.film.earlier(from.saturating_sub(1)) {
                Some(earlier) => from = earlier,
                None => return Ok(None),
            }
        }
    }

    /// The time shown, us.
    #[must_use]
    pub fn t(&self) -> i64 {
        self.t
    }

    /// What it shows.
    #[must_use]
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The film.
    #[must_use]
    pub fn film(&self) -> &Arc<dyn Film> {
        &self.film
    }

    /// The same, to take rest and floor of another.
    pub fn lens_mut(&mut self) -> &mut Lens {
        &mut self.lens
    }

    /// How it is looked at.
    #[must_use]
    pub fn gaze(&self) -> &Gaze {
        &self.gaze
    }

    /// What is watched.
    #[must_use]
    pub fn history(&self) -> Option<&History> {
        self.history.as_ref()
    }

    pub(super) fn spikes(&self) -> Option<&Spikes> {
        self.spikes.as_ref()
    }

    pub(super) fn spikes_mut(&mut self) -> Option<&mut Spikes> {
        self.spikes.as_mut()
    }

    /// The lens' strip, and from which column on it holds; before that the film's, where one is kept.
    #[must_use]
    pub fn strips(&self) -> (&Strip, i64, Option<&Strip>) {
        let whole = if self.gaze.is_near() { None } else { self.gaze.whole.as_deref().or(self.film.strip()) };
        (self.lens.strip(), self.own, whole)
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng};
    use taxel_core::board::Board;
    use taxel_core::encode::ChangeEvents;
    use taxel_core::wire::{Command, Registers};

    use super::*;
    use crate::panel::picture::{About, of_player};
    use crate::recording::{Writer, WriterOptions};

    /// A board at play for a while, with pauses longer than its clock's turn, as a recording; its versions change.
    fn recorded(name: &str, ending: &str, seed: u64) -> PathBuf {
        let path = std::env::temp_dir().join(format!("taxel-{name}-{}.{ending}", std::process::id()));
        let array = Array::thesis();
        let mut random = StdRng::seed_from_u64(seed);
        let mut board = Board::new(Registers::default(), &array).unwrap();
        let header = Header::of_board(array.clone(), Some(Registers::default()), String::new(), 0);
        let how = WriterOptions { overwrite: true, ..WriterOptions::default() };
        let writer = (ending == "mcap").then(|| Writer::create(&path, &header, how).unwrap());
        let (mut ticks, mut bytes, mut number) = (vec![48_u16; array.len()], vec![], 0);
        for part in 0..6 {
            if part % 2 == 1 && ending == "mcap" {
                let version = if part % 4 == 1 { 2 } else { 1 };
                let registers = Registers { wire_version: version, ..*board.registers() };
                board.command(&Command { register: 0, value: registers.word(0) }.to_bytes());
            }
            for frame in 0..4000 {
                // Now and then a pause.
                if !(1500..2000).contains(&frame) && random.random_range(0..3) == 0 {
                    for _ in 0..random.random_range(1..300) {
                        let taxel = random.random_range(0..array.len());
                        ticks[taxel] = random.random_range(20..140);
                    }
                }
                let now_ns = (board.time_us() * 1000.0) as i64 + 1_000_000_000;
                board
                    .frame(&ticks, |datagram| {
                        if let Some(writer) = &writer {
                            writer.datagram(now_ns, number, datagram).unwrap();
                            number += 1;
                        } else {
                            bytes.extend_from_slice(datagram);
                        }
                        true
                    })
                    .unwrap();
            }
        }
        match writer {
            Some(writer) => drop(writer.finish(crate::recording::Counts::default()).unwrap()),
            None => std::fs::write(&path, bytes).unwrap(),
        }
        path
    }

    /// What a full decode knows at a time: held values by their own rule, without lens or keyframe.
    fn held_at(changes: &[Change], t: i64, taxels: usize) -> (Vec<u16>, u64) {
        let (mut held, mut events) = (vec![UNKNOWN; taxels], 0);
        for change in changes.iter().take_while(|change| change.t <= t) {
            if change.ticks != UNKNOWN {
                held[change.taxel as usize] = change.ticks;
            }
            events += 1;
        }
        (held, events)
    }

    fn whole(film: &Arc<FileFilm>) -> Vec<Change> {
        let mut events = Events::empty(film.header.array.clone());
        match &film.source {
            Source::Mcap(reader) => {
                events = reader.decode(wire::Pairing::Direct, taxel_core::Stop::never()).unwrap().events;
            }
            Source::Lsa(..) => {
                let bytes = std::fs::read(&film.path).unwrap();
                let mut decoder = Decoder::new(film.header.array.clone());
                decoder.push_into(&bytes, None, &mut events);
                decoder.finish_into(&mut events);
            }
        }
        let mut changes = vec![];
        film.changes(&events, &mut changes);
        changes
    }

    /// Raster and curves of a picture, and of which columns they are.
    fn shown(player: &mut Player, us: i64) -> (std::ops::Range<i64>, Vec<u8>, Vec<u8>) {
        let about = About {
            flags: 0,
            number: 0,
            from: i64::MIN,
            with_rest: false,
            watched: player.gaze().watched,
            column_us: us,
        };
        let (bytes, _) = of_player(player, about);
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let section = |k: usize| bytes[word(64 + 8 * k)..][..word(68 + 8 * k)].to_vec();
        let first = i64::from_le_bytes(bytes[48..56].try_into().unwrap());
        assert_eq!(word(44) as i64, us);
        (first..first + word(56) as i64, section(2), section(3))
    }

    /// The same by their own rule: every change up to a time counts in its column, 15 of a row at most.
    fn counted(changes: &[Change], columns: std::ops::Range<i64>, us: i64, t: i64, array: &Array) -> Vec<u8> {
        let rows = usize::from(array.rows);
        let mut raster = vec![0_u8; (columns.end - columns.start) as usize * rows];
        for change in changes.iter().filter(|c| c.t <= t && columns.contains(&column_of(c.t, us))) {
            let row = change.taxel as usize / usize::from(array.columns);
            let cell = &mut raster[(column_of(change.t, us) - columns.start) as usize * rows + row];
            let (ups, downs) = (*cell & 15, *cell >> 4);
            *cell = if change.up { (ups + 1).min(15) | downs << 4 } else { ups | (downs + 1).min(15) << 4 };
        }
        raster
    }

    #[test]
    fn any_time_of_a_recording_looks_as_after_a_full_decode() {
        for (ending, seed) in [("mcap", 1), ("lsa", 2)] {
            let path = recorded("any-time", ending, seed);
            let film = FileFilm::open(&path).unwrap();
            let changes = whole(&film);
            assert_eq!(film.events, changes.len() as u64);
            assert!(film.keys.len() >= 5, "{ending}: {} keyframes", film.keys.len());
            let (first, last) = film.range.unwrap();
            let (mut random, mut some) = (StdRng::seed_from_u64(7), 0);
            for turn in 0..25 {
                let t = if turn == 24 { last } else { random.random_range(first..=last) };
                let us = [COLUMN_US, 500, 64_000][turn % 3];
                // Every change counts, so that what was sent last is what is held.
                let spiking = ChangeEvents { noise_floor: 0.5, ..ChangeEvents::default() };
                let spiking = Encoder::ChangeEvents(spiking);
                let gaze = Gaze { watched: Some(2080), encoder: Some(spiking.clone()), ..Gaze::plain(us) };
                let mut player = Player::open(Arc::new(Arc::clone(&film)), t, gaze).unwrap();
                let (held, events) = held_at(&changes, t, film.header.array.len());
                assert_eq!((player.lens().held(), player.lens().events()), (&held[..], events), "{ending} at {t} us");
                let (columns, raster, curves) = shown(&mut player, us);
                assert_eq!(columns.end, column_of(t, us) + 1);
                let begin = (columns.end - SPAN).max(column_of(first, us));
                assert_eq!(columns.start, begin, "{ending} at {t} us: all of the window");
                assert!(
                    raster == counted(&changes, columns.clone(), us, t, &film.header.array),
                    "{ending}: raster at {t} us by {us} us"
                );
                // From the beginning on, without a keyframe, by a lens whose columns are as wide: curves and changes.
                let blank = Keyframe {
                    latest: None,
                    events: 0,
                    held: vec![UNKNOWN; film.header.array.len()],
                    rest: vec![UNKNOWN; film.header.array.len()],
                };
                let mut slow = Lens::new(film.header.array.columns, film.floor(), &blank, us, 1 << 28);
                changes.iter().filter(|change| change.t <= t).for_each(|change| slow.take(change));
                slow.advance(t);
                slow.settle();
                assert_eq!(player.lens().change(), slow.change(), "{ending} at {t} us");
                let mut same = vec![];
                for column in columns.clone() {
                    let curve = slow.strip().curve(column);
                    same.extend_from_slice(&curve.sum.to_le_bytes());
                    same.extend_from_slice(&curve.area.to_le_bytes());
                    same.extend_from_slice(&curve.x.to_le_bytes());
                    same.extend_from_slice(&curve.y.to_le_bytes());
                }
                assert!(curves == same, "{ending}: curves at {t} us by {us} us");
                // An encoder that heard all from the beginning says the same; where stamps are no multiples of its period it
                // may sample a period earlier or later, so that a spike at an edge of the window is within or without.
                let mut heard = Spikes::new(&spiking, &film.header.array, us, &[], None).unwrap();
                changes.iter().filter(|change| change.t <= t).for_each(|change| heard.take(&[*change]));
                heard.advance(if t >= last { last + 1 } else { t });
                let (mut spikes, mut all) = (vec![], vec![]);
                player.spikes().unwrap().write(columns.clone(), &mut spikes);
                heard.write(columns, &mut all);
                let rows = usize::from(film.header.array.rows);
                let of_row = |cells: &[u8], row: usize| -> i64 {
                    cells.iter().skip(row).step_by(rows).map(|&cell| i64::from(cell & 15) + i64::from(cell >> 4)).sum()
                };
                // Its period is 0.1 ms.
                let edges = [begin * us, t];
                let at_edge = |t: i64| edges.iter().any(|edge| (t - edge).abs() <= 100);
                for row in 0..rows {
                    let of = |change: &&Change| change.taxel as usize / usize::from(film.header.array.columns) == row;
                    let may = changes.iter().filter(|change| at_edge(change.t)).filter(of).count() as i64;
                    let differ = (of_row(&spikes, row) - of_row(&all, row)).abs();
                    assert!(differ <= may, "{ending}: spikes of row {row} at {t} us by {us} us: {differ}, not {may}");
                }
                assert!(ending != "lsa" || spikes == all, "{ending}: spikes at {t} us by {us} us");
                some += all.iter().filter(|&&n| n > 0).count();
            }
            assert!(some > 1000, "{ending}: {some} spikes");
            std::fs::remove_file(&path).unwrap();
        }
    }

    #[test]
    fn steps_go_from_stamp_to_stamp_both_ways_and_through_silence() {
        let path = recorded("steps", "mcap", 3);
        let film = FileFilm::open(&path).unwrap();
        let mut stamps: Vec<i64> = whole(&film).iter().map(|change| change.t).collect();
        stamps.dedup();
        let mut random = StdRng::seed_from_u64(8);
        for _ in 0..20 {
            let place = random.random_range(1..stamps.len() - 1);
            let mut player = Player::open(Arc::new(Arc::clone(&film)), stamps[place], Gaze::plain(COLUMN_US)).unwrap();
            assert_eq!(player.last_stamp().unwrap(), Some(stamps[place - 1]));
            assert_eq!(player.next_stamp().unwrap(), Some(stamps[place + 1]));
        }
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn the_ring_keeps_a_minute_and_a_view_back_sees_what_was() {
        let array = Array::thesis();
        let film = RingFilm::new(array.clone(), 3);
        let blank = vec![UNKNOWN; array.len()];
        let start = Keyframe { latest: None, events: 0, held: blank.clone(), rest: blank.clone() };
        let mut lens = Lens::new(array.columns, 3, &start, COLUMN_US, 0);
        // Who looks before anything came is told so.
        film.keep(Piece { held: Some(blank.clone()), ..Piece::default() }, &lens);
        assert_eq!(film.range(), None);
        film.keep(
            Piece {
                changes: vec![Change { t: 5, taxel: 0, ticks: 50, up: true, repaired: false }],
                ..Piece::default()
            },
            &lens,
        );
        film.keep(
            Piece {
                changes: vec![Change { t: 9, taxel: 0, ticks: 51, up: true, repaired: false }],
                ..Piece::default()
            },
            &lens,
        );
        assert_eq!(film.range(), Some((5, 9)));
        let film = RingFilm::new(array.clone(), 3);
        let (mut held, mut all, mut random) = (blank, vec![], StdRng::seed_from_u64(9));
        for n in 0..900_i64 {
            let changes: Vec<Change> = (0..40)
                .map(|k| Change {
                    t: n * 100_000 + k * 2000,
                    taxel: random.random_range(0..4096),
                    ticks: random.random_range(20..140),
                    up: true,
                    repaired: false,
                })
                .collect();
            let since = all.last().map(|change: &Change| change.t);
            let piece = Piece {
                held: Some(held.clone()),
                since,
                before: all.len() as u64,
                changes: changes.clone(),
                ..Piece::default()
            };
            film.keep(piece, &lens);
            for change in changes {
                held[change.taxel as usize] = change.ticks;
                lens.take(&change);
                all.push(change);
            }
        }
        let (first, last) = film.range().unwrap();
        assert!((REACH_US..REACH_US + 1_000_000).contains(&(last - first)), "{} us", last - first);
        for _ in 0..20 {
            let t = random.random_range(first + 6_000_000..=last);
            let player = Player::open(Arc::new(film.clone()), t, Gaze::plain(COLUMN_US)).unwrap();
            assert_eq!(player.lens().held(), held_at(&all, t, array.len()).0, "at {t} us");
        }
        assert!(film.bytes() < 16 << 20);
    }
}
