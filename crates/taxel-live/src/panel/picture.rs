//! A picture as it goes to a browser: see docs/panel-protocol.md, *Pictures*.

use super::lens::{COLUMN_US, History, Lens, SPAN, Strip, column_of};
use super::player::Player;
use super::spikes::Spikes;
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
    /// A column of time, us.
    pub(super) column_us: i64,
}

/// Raster and curves of a column of time, wherever they are; several columns of a strip may make one.
struct Strips<'a> {
    own: &'a Strip,
    from: i64,
    whole: Option<&'a Strip>,
    /// The last column of the strips.
    last: i64,
    /// Columns of the strips in one that is shown.
    together: i64,
}

impl<'a> Strips<'a> {
    /// `from` the column on from which a strip holds by itself; before it the whole, where there is one.
    fn of(own: &'a Strip, from: i64, whole: Option<&'a Strip>, shown: &Head, about: About) -> Self {
        let unit_us = about.column_us.min(COLUMN_US);
        let last = shown.latest.map_or(i64::MIN, |t| column_of(t, unit_us));
        // A long view has left the beginning of its own behind.
        let from = from.max(own.reach().map_or(i64::MAX, |(first, _)| first));
        Self { own, from, whole, last, together: about.column_us / unit_us }
    }

    /// The first column that is known, of those that are shown.
    fn first(&self) -> i64 {
        let first = self.whole.and_then(Strip::reach).map_or(self.from, |(first, _)| first.min(self.from));
        first.div_euclid(self.together)
    }

    fn at(&self, column: i64) -> &Strip {
        match self.whole {
            Some(whole) if column < self.from => whole,
            _ => self.own,
        }
    }

    fn raster(&self, column: i64, out: &mut Vec<u8>) {
        if self.together == 1 {
            return self.at(column).raster(column, out);
        }
        let (begin, mut one) = (out.len(), vec![]);
        out.resize(begin + self.own.rows(), 0);
        for part in column * self.together..((column + 1) * self.together).min(self.last + 1) {
            if self.at(part).is_silent(part) {
                continue;
            }
            one.clear();
            self.at(part).raster(part, &mut one);
            for (sum, cell) in out[begin..].iter_mut().zip(&one).filter(|(_, cell)| **cell > 0) {
                let (ups, downs) = ((*sum & 15) + (cell & 15), (*sum >> 4) + (cell >> 4));
                *sum = ups.min(15) | downs.min(15) << 4;
            }
        }
    }

    fn curve(&self, column: i64) -> super::lens::Curve {
        let end = ((column + 1) * self.together - 1).min(self.last);
        self.at(end).curve(end)
    }
}

/// Of the newest; where its columns are narrower than those of the lens, `near` has them.
pub(super) fn of_lens(
    lens: &mut Lens,
    near: Option<&mut Player>,
    columns: u16,
    history: Option<&History>,
    spikes: Option<&Spikes>,
    about: About,
) -> (Vec<u8>, i64) {
    let shown = lens.clone_head();
    lens.settle();
    let (own, from) = match near {
        Some(near) => {
            near.lens_mut().settle();
            let (own, from, _) = near.strips();
            (own, from)
        }
        // Without one nothing is known by such columns.
        None if about.column_us < COLUMN_US => (lens.strip(), i64::MAX),
        None => (lens.strip(), i64::MIN),
    };
    picture(&shown, columns, &Strips::of(own, from, None, &shown, about), history, spikes, about)
}

/// Of a film at its time.
pub(super) fn of_player(player: &mut Player, about: About) -> (Vec<u8>, i64) {
    player.lens_mut().settle();
    let player = &*player;
    let columns = player.film().array().columns;
    let shown = player.lens().clone_head();
    let (own, from, whole) = player.strips();
    let strips = Strips::of(own, from, whole, &shown, about);
    picture(&shown, columns, &strips, player.history(), player.spikes(), about)
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
    strips: &Strips<'_>,
    history: Option<&History>,
    spikes: Option<&Spikes>,
    about: About,
) -> (Vec<u8>, i64) {
    let taxels = shown.held.len();
    let rows = taxels / usize::from(columns.max(1));
    let last = shown.latest.map_or(i64::MIN, |t| column_of(t, about.column_us));
    let first = about.from.max(strips.first()).max(last.saturating_add(1 - SPAN));
    let range = if first <= last { first..last + 1 } else { 0..0 };
    let n = usize::try_from(range.end - range.start).unwrap_or(0);
    let mut out = Vec::with_capacity(HEADER + taxels * 5 + n * (2 * rows + 22) + 64);
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
    range.clone().for_each(|column| strips.raster(column, &mut out));
    lengths[k] = end(&out, from);
    let k = begin(&mut out, 3);
    let from = out.len();
    for column in range.clone() {
        let curve = strips.curve(column);
        out.extend_from_slice(&curve.sum.to_le_bytes());
        out.extend_from_slice(&curve.area.to_le_bytes());
        out.extend_from_slice(&curve.x.to_le_bytes());
        out.extend_from_slice(&curve.y.to_le_bytes());
    }
    lengths[k] = end(&out, from);
    if let Some(history) = history {
        let k = begin(&mut out, 4);
        let from = out.len();
        history.write(range.clone(), &mut out);
        lengths[k] = end(&out, from);
    }
    if about.with_rest {
        let k = begin(&mut out, 5);
        let from = out.len();
        shown.rest.iter().for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
        lengths[k] = end(&out, from);
    }
    if let Some(spikes) = spikes {
        let k = begin(&mut out, 6);
        let from = out.len();
        spikes.write(range.clone(), &mut out);
        lengths[k] = end(&out, from);
    }
    let mut put = |at: usize, bytes: &[u8]| out[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, b"TXP1");
    #[allow(clippy::cast_possible_truncation)]
    {
        put(4, &(HEADER as u16).to_le_bytes());
        put(12, &(rows as u16).to_le_bytes());
        put(44, &(about.column_us as u32).to_le_bytes());
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
