//! A frame in the bytes that clients receive: protocol.md, *Frames*.

use std::ops::Range;

use taxel_live::recording::now_ns;

use super::encoded_spikes::EncodedSpikes;
use super::player::Player;
use crate::array_state::{ArrayState, RestSource};
use crate::taxel_history::TaxelHistory;
use crate::time_columns::{COLUMN_US, Curve, Curves, SPAN, TimeColumns, column_of};

/// Bytes of the header.
const HEADER: usize = 144;

/// Where the table of sections begins, and how many there are.
const SECTIONS: usize = 64;
const SECTION_COUNT: usize = 10;

/// The flags of the header.
pub(crate) const LIVE: u16 = 1;
pub(crate) const MOVES: u16 = 2;
pub(crate) const RESTART: u16 = 4;
pub(crate) const RECORDS: u16 = 8;
pub(crate) const FOLLOWS: u16 = 16;
const REST_GIVEN: u16 = 32;
const REST_QUIET: u16 = 64;

/// What a frame contains beside the state of the array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct About {
    pub(crate) flags: u16,
    pub(crate) number: u32,
    /// The first column of time that the client lacks.
    pub(crate) from: i64,
    pub(crate) with_rest: bool,
    pub(crate) watched: Option<u32>,
    /// Width of a column of time, us.
    pub(crate) column_us: i64,
}

/// Raster and curves in the width that a frame shows, from narrower columns and from up to two stores.
struct ShownColumns<'a> {
    of_view: &'a TimeColumns,
    /// First column of `of_view`; earlier ones come from `all_columns`.
    first_of_view: i64,
    all_columns: Option<&'a TimeColumns>,
    /// Up to when columns are known, us, and the last stored column.
    latest: Option<i64>,
    last: i64,
    /// Stored columns in one shown column.
    factor: i64,
}

impl<'a> ShownColumns<'a> {
    fn new(
        of_view: &'a TimeColumns,
        first_of_view: i64,
        all_columns: Option<&'a TimeColumns>,
        latest: Option<i64>,
        column_us: i64,
    ) -> Self {
        let stored_us = column_us.min(COLUMN_US);
        let last = latest.map_or(i64::MIN, |t| column_of(t, stored_us));
        // A view that has played for long has dropped the beginning of its own columns.
        let first_of_view = first_of_view.max(of_view.reach().map_or(i64::MAX, |(first, _)| first));
        Self { of_view, first_of_view, all_columns, latest, last, factor: column_us / stored_us }
    }

    /// The first known column.
    fn first(&self) -> i64 {
        let first = self
            .all_columns
            .and_then(TimeColumns::reach)
            .map_or(self.first_of_view, |(first, _)| first.min(self.first_of_view));
        first.div_euclid(self.factor)
    }

    /// The stored columns of a shown one: those of the whole recording, then the view's own.
    fn parts(&self, column: i64) -> [(&TimeColumns, Range<i64>); 2] {
        let parts = column * self.factor..((column + 1) * self.factor).min(self.last + 1);
        let of_view = self.first_of_view.clamp(parts.start, parts.end.max(parts.start));
        [(self.all_columns.unwrap_or(self.of_view), parts.start..of_view), (self.of_view, of_view..parts.end)]
    }

    fn raster(&self, column: i64, out: &mut Vec<u8>) {
        let begin = out.len();
        out.resize(begin + self.of_view.rows(), 0);
        for (store, columns) in self.parts(column) {
            store.add_raster(columns, &mut out[begin..]);
        }
    }

    /// The curves of columns, column after column.
    fn curves(&self, columns: Range<i64>) -> Curves {
        let mut all = Curves { sums: vec![], channels: vec![] };
        for column in columns {
            let mut of_column = self.of_view.no_curves();
            for (store, columns) in self.parts(column) {
                store.join_curves(columns, &mut of_column.sums, &mut of_column.channels);
            }
            all.sums.append(&mut of_column.sums);
            all.channels.append(&mut of_column.channels);
        }
        all
    }
}

/// Frame of the newest state, and its last column. `narrow` has the columns where they are narrower than the state's.
pub(crate) fn of_state(
    state: &mut ArrayState,
    narrow: Option<&mut Player>,
    columns: u16,
    history: Option<&TaxelHistory>,
    spikes: Option<&EncodedSpikes>,
    about: About,
) -> (Vec<u8>, i64) {
    state.update_curve();
    let state = &*state;
    let (of_view, first_of_view) = match narrow {
        Some(narrow) => {
            narrow.state_mut().update_curve();
            let (of_view, first_of_view, _) = narrow.time_columns();
            (of_view, first_of_view)
        }
        // The state's columns are too wide, so none is known.
        None if about.column_us < COLUMN_US => (state.time_columns(), i64::MAX),
        None => (state.time_columns(), i64::MIN),
    };
    let shown = ShownColumns::new(of_view, first_of_view, None, state.latest(), about.column_us);
    write(state, columns, &shown, history, spikes, about)
}

/// Frame of a source at the time of playback, and its last column. The columns are those of `window`, or else those up to that
/// time.
pub(crate) fn of_player(player: &mut Player, window: Option<&mut Player>, about: About) -> (Vec<u8>, i64) {
    player.state_mut().update_curve();
    let player = &*player;
    let beside = match window {
        Some(window) => {
            window.state_mut().update_curve();
            &*window
        }
        None => player,
    };
    let (of_view, first_of_view, all_columns) = beside.time_columns();
    let shown = ShownColumns::new(of_view, first_of_view, all_columns, beside.state().latest(), about.column_us);
    write(player.state(), player.index().array().columns, &shown, beside.history(), beside.spikes(), about)
}

fn write(
    state: &ArrayState,
    columns: u16,
    shown: &ShownColumns<'_>,
    history: Option<&TaxelHistory>,
    spikes: Option<&EncodedSpikes>,
    about: About,
) -> (Vec<u8>, i64) {
    let taxels = state.held().len();
    let rows = taxels / usize::from(columns.max(1));
    let last = shown.latest.map_or(i64::MIN, |t| column_of(t, about.column_us));
    let first = about.from.max(shown.first()).max(last.saturating_add(1 - SPAN));
    let range = if first <= last { first..last + 1 } else { 0..0 };
    let count = usize::try_from(range.end - range.start).unwrap_or(0);
    let mut out = Vec::with_capacity(HEADER + taxels * 5 + count * (2 * rows + 38) + 64);
    out.resize(HEADER, 0);
    let mut sections = [(0_usize, 0_usize); SECTION_COUNT];
    let mut section = |out: &mut Vec<u8>, number: usize, write: &dyn Fn(&mut Vec<u8>)| {
        out.resize(out.len().next_multiple_of(8), 0);
        let begin = out.len();
        write(out);
        sections[number] = (begin, out.len() - begin);
    };
    let values =
        |values: &[u16], out: &mut Vec<u8>| values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
    section(&mut out, 0, &|out| values(state.held(), out));
    section(&mut out, 1, &|out| out.extend(state.change().iter().map(|&change| change.to_le_bytes()[0])));
    section(&mut out, 2, &|out| range.clone().for_each(|column| shown.raster(column, out)));
    let curves = shown.curves(range.clone());
    let each = || curves.sums.chunks_exact(shown.of_view.no_curves().sums.len());
    section(&mut out, 3, &|out| each().for_each(|sums| sums[0].write(out)));
    if let Some(history) = history {
        section(&mut out, 4, &|out| history.write(range.clone(), out));
    }
    if about.with_rest {
        section(&mut out, 5, &|out| values(state.rest(), out));
    }
    if let Some(spikes) = spikes {
        section(&mut out, 6, &|out| spikes.write(range.clone(), out));
    }
    section(&mut out, 7, &|out| {
        curves.channels.iter().for_each(|(least, greatest)| values(&[*least, *greatest], out));
    });
    section(&mut out, 8, &|out| each().for_each(|sums| sums[1..].iter().for_each(|sum| sum.write(out))));
    section(&mut out, 9, &|out| {
        for Curve { sum, area, x, y } in state.curves() {
            [sum, area, x.to_bits(), y.to_bits()].iter().for_each(|word| out.extend(word.to_le_bytes()));
        }
    });
    let mut put = |at: usize, bytes: &[u8]| out[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, b"TXF1");
    // The protocol's fields are as wide as the largest array and section need.
    #[allow(clippy::cast_possible_truncation)]
    {
        put(4, &(HEADER as u16).to_le_bytes());
        put(12, &(rows as u16).to_le_bytes());
        put(44, &(about.column_us as u32).to_le_bytes());
        put(56, &(count as u32).to_le_bytes());
        for (number, (begin, length)) in sections.iter().enumerate().filter(|(_, (_, length))| *length > 0) {
            put(SECTIONS + 8 * number, &(*begin as u32).to_le_bytes());
            put(SECTIONS + 8 * number + 4, &(*length as u32).to_le_bytes());
        }
    }
    let rest = match state.rest_source() {
        RestSource::Given => REST_GIVEN,
        RestSource::Quiet => REST_QUIET,
        RestSource::None => 0,
    };
    put(6, &(about.flags | rest).to_le_bytes());
    put(8, &about.number.to_le_bytes());
    put(14, &columns.to_le_bytes());
    put(16, &state.latest().unwrap_or(i64::MIN).to_le_bytes());
    put(24, &now_ns().to_le_bytes());
    put(32, &state.events().to_le_bytes());
    put(40, &about.watched.unwrap_or(u32::MAX).to_le_bytes());
    put(48, &range.start.to_le_bytes());
    (out, last)
}
