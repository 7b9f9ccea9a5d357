//! A frame in the bytes that clients receive, which `python/taxel/panel/web/protocol.js` reads.
//!
//! Numbers are little-endian. The header of 136 bytes has rows and columns, the board's time, flags, the number of the
//! first column of time and how many there are (1250 at most; column k begins at k times its width, 4000 us or what
//! `zoom` requested), and from byte 64 on first byte and length of each section, 0 if it is missing. Each begins at a
//! multiple of 8:
//!
//! 0. pressure, u16 a taxel, row by row: the held value; 65535: none yet
//! 1. change, i8 a taxel: the largest recent change, ticks; it decays by a sixteenth each 4 ms. Without values each
//!    change counts 16
//! 2. raster, u8 x time columns x rows: ups (low 4 bits) and downs (high 4 bits) of a row in a column, 15 at most
//! 3. curves, 32 bytes a time column: least and greatest of each value: u32 sums of ticks above rest (for frames with
//!    `newtons`, weighted by area); u32 taxels above rest; f32 x and f32 y of the centre. Without a value the least is
//!    above the greatest; the centre is NaN if nothing is pressed, if noise can add up to the sum, and for channels
//! 4. history, 3 x u16 a time column: the watched taxel: least, greatest, last; 65535: unknown
//! 5. rest, u16 a taxel; 65535: unknown
//! 6. values, 16 bytes x (1 + sources): at the frame's time, of all taxels and of each source: u32 sum, u32 taxels above
//!    rest (2^32 - 1: no value), f32 x and y of the centre
//! 7. channels, 2 x u16 x time columns x taxels: for 64 channels at most: least and greatest ticks above rest
//! 8. sources, 32 bytes x time columns x sources: for frames of two to four sources: curves of each

use crate::columns::{COLUMN_US, Curve, Curves, SPAN, column_of};
use crate::frame_values::RestSource;
use crate::history::TaxelHistory;
use crate::state::ArrayState;

/// Bytes of the header.
const HEADER: usize = 136;

/// Where the table of sections begins, and how many there are.
const SECTIONS: usize = 64;
const SECTION_COUNT: usize = 9;

/// The flags of the header.
pub(crate) const MOVES: u16 = 2;
pub(crate) const RESTART: u16 = 4;
pub(crate) const FOLLOWS: u16 = 16;
const REST_GIVEN: u16 = 32;
const REST_QUIET: u16 = 64;

/// What a frame contains beside the state of the array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct About {
    pub(crate) flags: u16,
    /// The first column of time that the client lacks.
    pub(crate) from: i64,
    pub(crate) watched: Option<u32>,
    /// Width of a column of time, us.
    pub(crate) column_us: i64,
}

/// A frame of a state, with the history of the watched taxel, and its last column. The columns are those of another state `beside` it, or its own.
pub(crate) fn write(
    state: &ArrayState,
    beside: &ArrayState,
    history: Option<&TaxelHistory>,
    about: About,
) -> (Vec<u8>, i64) {
    let (taxels, array, columns) = (state.held().len(), &state.sensor.array, beside.columns());
    let (rows, unit_us) = (usize::from(array.rows), about.column_us.min(COLUMN_US));
    let last = beside.latest.map_or(i64::MIN, |t| column_of(t, about.column_us));
    let known = columns.reach().map_or(i64::MAX, |(first, _)| column_of(first * unit_us, about.column_us));
    let first = about.from.max(known).max(last.saturating_add(1 - SPAN));
    let range = if first <= last { first..last + 1 } else { 0..0 };
    let count = usize::try_from(range.end - range.start).unwrap_or(0);
    // A column that is shown has several that are stored, the last one those up to now.
    let end = beside.latest.map_or(i64::MIN, |t| column_of(t, unit_us) + 1);
    let factor = about.column_us / unit_us;
    let shown = range.clone().map(|column| column * factor..((column + 1) * factor).min(end));
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
    section(&mut out, 2, &|out| {
        for stored in shown.clone() {
            let begin = out.len();
            out.resize(begin + rows, 0);
            columns.add_raster(stored, &mut out[begin..]);
        }
    });
    let curves = |stored| {
        let mut curves = columns.no_curves();
        columns.join_curves(stored, &mut curves);
        curves
    };
    let curves: Vec<Curves> = shown.clone().map(curves).collect();
    section(&mut out, 3, &|out| curves.iter().for_each(|curves| curves.sums[0].write(out)));
    if let Some(history) = history {
        section(&mut out, 4, &|out| history.write(range.clone(), out));
    }
    section(&mut out, 5, &|out| values(state.rest(), out));
    section(&mut out, 6, &|out| {
        for Curve { sum, area, x, y } in state.curves() {
            [sum, area, x.to_bits(), y.to_bits()].iter().for_each(|word| out.extend(word.to_le_bytes()));
        }
    });
    section(&mut out, 7, &|out| {
        let channels = curves.iter().flat_map(|curves| &curves.channels);
        channels.for_each(|(least, greatest)| values(&[*least, *greatest], out));
    });
    section(&mut out, 8, &|out| curves.iter().flat_map(|curves| &curves.sums[1..]).for_each(|sum| sum.write(out)));
    let mut put = |at: usize, bytes: &[u8]| out[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, b"TXF1");
    // The protocol's fields are as wide as the largest array and section need.
    {
        put(4, &(HEADER as u16).to_le_bytes());
        put(12, &array.rows.to_le_bytes());
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
    put(14, &array.columns.to_le_bytes());
    put(16, &state.latest.unwrap_or(i64::MIN).to_le_bytes());
    put(32, &state.events.to_le_bytes());
    put(40, &about.watched.unwrap_or(u32::MAX).to_le_bytes());
    put(48, &range.start.to_le_bytes());
    (out, last)
}
