//! A picture as it goes to a browser: see docs/panel-protocol.md, *Pictures*.

use super::film::Player;
use super::lens::{COLUMN_US, History, Lens, SPAN, Strip, column_of};
use crate::pipeline::UNKNOWN;
use crate::recording::now_ns;

/// Bytes of the header.
const HEADER: usize = 128;

/// Where the sections are told.
const SECTIONS: usize = 64;

/// What the flags say.
pub(super) const LIVE: u16 = 1;
pub(super) const MOVES: u16 = 2;
pub(super) const RESTART: u16 = 4;
pub(super) const RECORDS: u16 = 8;
pub(super) const FOLLOWS: u16 = 16;

/// What is sent beside what a lens shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct About {
    pub(super) flags: u16,
    pub(super) number: u32,
    /// The first column of time that is wanted.
    pub(super) from: i64,
    pub(super) with_rest: bool,
    pub(super) watched: Option<u32>,
}

/// Raster and curves of a column of time, wherever they are.
trait Columns {
    fn of(&self, column: i64) -> &Strip;
}

struct Two<'a> {
    own: &'a Strip,
    from: i64,
    whole: Option<&'a Strip>,
}

impl Columns for Two<'_> {
    fn of(&self, column: i64) -> &Strip {
        match self.whole {
            Some(whole) if column < self.from => whole,
            _ => self.own,
        }
    }
}

/// Of the newest.
pub(super) fn of_lens(lens: &mut Lens, columns: u16, history: Option<&History>, about: About) -> (Vec<u8>, i64) {
    let shown = lens.clone_head();
    let strip = lens.strip();
    let two = Two { own: strip, from: i64::MIN, whole: None };
    let history = history.map(|history| (history, UNKNOWN));
    picture(&shown, columns, &two, strip.reach(), history, about)
}

/// Of a film at its time.
pub(super) fn of_player(player: &mut Player, about: About) -> (Vec<u8>, i64) {
    let columns = player.film().array().columns;
    let shown = player.lens().clone_head();
    let history = player.history().cloned();
    let (own, from, whole) = player.strips();
    let first = match whole.and_then(Strip::reach) {
        Some((first, _)) => Some(first),
        None => own.reach().map(|(first, _)| first.max(from)),
    };
    let reach = first.zip(own.reach()).map(|(first, (_, last))| (first.min(last), last));
    let two = Two { own, from, whole };
    picture(&shown, columns, &two, reach, history.as_ref().map(|(history, held)| (history, *held)), about)
}

/// What of a lens is no strip.
pub(super) struct Head {
    pub(super) held: Vec<u16>,
    pub(super) change: Vec<i8>,
    pub(super) rest: Vec<u16>,
    pub(super) latest: Option<i64>,
    pub(super) events: u64,
}

impl Lens {
    fn clone_head(&self) -> Head {
        Head {
            held: self.held().to_vec(),
            change: self.change().to_vec(),
            rest: self.rest().to_vec(),
            latest: self.latest(),
            events: self.events(),
        }
    }
}

fn picture(
    shown: &Head,
    columns: u16,
    strips: &dyn Columns,
    reach: Option<(i64, i64)>,
    history: Option<(&History, u16)>,
    about: About,
) -> (Vec<u8>, i64) {
    let taxels = shown.held.len();
    let rows = taxels / usize::from(columns.max(1));
    let last = shown.latest.map_or(i64::MIN, column_of);
    let range = match (shown.latest, reach) {
        (Some(_), Some((first, _))) => about.from.max(first).max(last + 1 - SPAN).min(last)..last + 1,
        _ => 0..0,
    };
    let n = usize::try_from(range.end - range.start).unwrap_or(0);
    let mut out = Vec::with_capacity(HEADER + taxels * 5 + n * (rows + 22) + 64);
    out.resize(HEADER, 0);
    let mut sections = [(0_usize, 0_usize); 8];
    let mut begin = |out: &mut Vec<u8>, k: usize| {
        out.resize(out.len().next_multiple_of(8), 0);
        sections[k].0 = out.len();
        k
    };
    let mut lengths = [0_usize; 8];
    let end = |out: &Vec<u8>, from: usize| out.len() - from;
    let k = begin(&mut out, 0);
    let from = out.len();
    shown.held.iter().for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
    lengths[k] = end(&out, from);
    let k = begin(&mut out, 1);
    let from = out.len();
    out.extend(shown.change.iter().map(|&change| change.to_le_bytes()[0]));
    lengths[k] = end(&out, from);
    let k = begin(&mut out, 2);
    let from = out.len();
    range.clone().for_each(|column| strips.of(column).raster(column, &mut out));
    lengths[k] = end(&out, from);
    let k = begin(&mut out, 3);
    let from = out.len();
    for column in range.clone() {
        let curve = strips.of(column).curve(column);
        out.extend_from_slice(&curve.sum.to_le_bytes());
        out.extend_from_slice(&curve.area.to_le_bytes());
        out.extend_from_slice(&curve.x.to_le_bytes());
        out.extend_from_slice(&curve.y.to_le_bytes());
    }
    lengths[k] = end(&out, from);
    if let Some((history, held)) = history {
        let k = begin(&mut out, 4);
        let from = out.len();
        history.write(range.clone(), held, &mut out);
        lengths[k] = end(&out, from);
    }
    if about.with_rest {
        let k = begin(&mut out, 5);
        let from = out.len();
        shown.rest.iter().for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
        lengths[k] = end(&out, from);
    }
    let mut put = |at: usize, bytes: &[u8]| out[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, b"TXP1");
    #[allow(clippy::cast_possible_truncation)]
    {
        put(4, &(HEADER as u16).to_le_bytes());
        put(12, &(rows as u16).to_le_bytes());
        put(44, &(COLUMN_US as u32).to_le_bytes());
        put(56, &(n as u32).to_le_bytes());
        for (k, ((begin, _), length)) in sections.iter().zip(lengths).enumerate().filter(|(_, (_, length))| *length > 0)
        {
            put(SECTIONS + 8 * k, &(*begin as u32).to_le_bytes());
            put(SECTIONS + 8 * k + 4, &(length as u32).to_le_bytes());
        }
    }
    put(6, &about.flags.to_le_bytes());
    put(8, &about.number.to_le_bytes());
    put(14, &columns.to_le_bytes());
    put(16, &shown.latest.unwrap_or(i64::MIN).to_le_bytes());
    put(24, &now_ns().to_le_bytes());
    put(32, &shown.events.to_le_bytes());
    put(40, &about.watched.unwrap_or(u32::MAX).to_le_bytes());
    put(48, &range.start.to_le_bytes());
    (out, last)
}
