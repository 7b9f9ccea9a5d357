//! The film of a recording of any length.
//!
//! A keyframe holds the decoder itself, so that its clock, what it has seen and what waits in it are as they were.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crossbeam_channel as channel;
use taxel_core::wire::{self, Decoder};
use taxel_core::{Array, Events, problem};

use super::rate::Rate;
use super::{Activity, Film, Next, Reel};
use crate::panel::lens::{COLUMN_US, Keyframe, Lens, Strip, column_of};
use crate::pipeline::{Change, UNKNOWN};
use crate::recording::{Ending, Header, NOTHING_LOST, Place, Reader, Remarks, Topic, begin_with};
use crate::{Error, Result};

/// What the keyframes of a recording may cost, bytes; and its raster and curves.
const KEYFRAME_BYTES: usize = 128 << 20;
const STRIP_BYTES: usize = 256 << 20;

/// From keyframe to keyframe at least, bytes of the file.
const SPACING: u64 = 1 << 16;

/// Blocks that are decoded ahead of who looks at them.
const AHEAD: usize = 4;

/// How much of a `.lsa` is read at once.
const LSA_PIECE: u64 = 1 << 16;

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

    fn floor(&self) -> u16 {
        self.header.registers.map_or(0, |registers| registers.noise_floor.into())
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

#[cfg(test)]
pub(super) mod tests;
