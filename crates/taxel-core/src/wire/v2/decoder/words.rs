//! Decodes a body's words to rows: one by one on any machine, first eight at a time if it has the instructions.
//!
//! Eight at a time are plain words only (changes at one time, not before any stored value, on the array); [`each`] decodes
//! all from the first eight on that are not. Only that function defines a word's meaning, so all instruction sets return the
//! same rows, values and counts.

mod body;
#[cfg(target_arch = "x86_64")]
mod eight;

pub(super) use body::{BodyReader, Meaning};

use super::held::ValuesByLine;
use crate::vectors::Instructions;
use crate::wire::columns::Columns;
use crate::wire::v2::counts::Counts;
use body::word;

/// Rows behind those of the words that may be overwritten.
const MARGIN: usize = 8;

/// Rows that columns must have left for these words.
pub(super) fn room(words: usize) -> usize {
    words + MARGIN
}

/// Decodes a body of words of `BYTES` bytes with this layout to rows; the columns must have [`room`] for them.
#[inline(always)]
#[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
pub(super) fn decode<const BYTES: usize, const SKIP: u32, const VALUE: u32>(
    body: &mut BodyReader<'_>,
    set: Instructions,
    held: &mut ValuesByLine,
    out: &mut Columns<'_>,
    counts: &mut Counts,
) {
    assert!(out.left() >= room(body.words::<BYTES>()), "columns too short");
    let first = out.rows;
    if VALUE > 0 {
        out.begin_pairs();
    }
    #[cfg(target_arch = "x86_64")]
    if set >= Instructions::Avx2
        && body.meaning == Meaning::Changes
        && body.stride == held.stride
        && (VALUE == 0 || body.t >= held.newest)
        && held.values.len() < usize::from(eight::FULL)
        && body.position < i64::from(eight::FULL) - 1
    {
        let passed = (body.position + 1) as u16;
        // SAFETY: `Decoder::instructions` and `best` select a set only if the machine has it; a header lies before the
        // body; `out` has a row for each word and 8 more, as was just asserted.
        let (at, passed) = unsafe { eight::words::<VALUE>(body.bytes, body.at, passed, body.t, held, out) };
        (body.at, body.position) = (at, i64::from(passed) - 1);
        if out.rows > first {
            body.latest = body.t;
        }
    }
    if body.at < body.bytes.len() {
        *body = each::<BYTES, SKIP, VALUE>(*body, held, out, counts);
        counts.malformed += u64::from(body.cut || body.at < body.bytes.len());
    }
    counts.events += (out.rows - first) as u64;
}

/// Decodes words of `BYTES` bytes with this layout one by one; defines the meaning of each word.
#[inline(never)]
fn each<'a, const BYTES: usize, const SKIP: u32, const VALUE: u32>(
    mut body: BodyReader<'a>,
    held: &mut ValuesByLine,
    out: &mut Columns<'_>,
    counts: &mut Counts,
) -> BodyReader<'a> {
    let control = (1_u32 << SKIP) - 1;
    let stride = body.stride.min(31);
    let mask = (1_i64 << stride) - 1;
    let (width, height) = (i64::from(held.columns), i64::from(held.rows));
    let end = body.at + body.words::<BYTES>() * BYTES;
    let BodyReader { base, mut at, mut t, mut position, mut latest, .. } = body;
    while at < end {
        let bits = word::<BYTES>(body.bytes, at);
        at += BYTES;
        let p = bits >> (SKIP + VALUE) & 1 == 1;
        let skip = bits >> VALUE & control;
        let value = (bits & ((1 << VALUE) - 1)) as u16;
        if skip == control {
            if !p {
                position += (i64::from(value) + 1) << (SKIP - 1);
                continue;
            }
            match body.offset::<BYTES>(at) {
                Some(offset) => (at, t, position) = (at + BYTES, base + i64::from(offset), -1),
                None => (at, body.cut) = (body.bytes.len(), true),
            }
            continue;
        }
        position += i64::from(skip) + 1;
        let (x, y) = (position >> stride, position & mask);
        if x >= width || y >= height {
            counts.outside += 1;
            continue;
        }
        let (x, y) = (x as u16, y as u16);
        let (mut p, mut ticks, mut known) = (p, value, VALUE > 0);
        if VALUE > 0 {
            let index = held.index(x, y);
            let newest = t >= held.since[index];
            match body.meaning {
                Meaning::Changes => {}
                Meaning::Differences => {
                    let from = held.get(index).or(held.initial);
                    known = from.is_some();
                    counts.unknown_value += u64::from(!known);
                    ticks =
                        from.map_or(0, |from| if p { from.saturating_add(value) } else { from.saturating_sub(value) });
                }
                Meaning::States => {
                    counts.states += 1;
                    let before = held.get(index);
                    if !newest {
                        counts.stale += 1;
                        continue;
                    }
                    if before == Some(value) {
                        continue;
                    }
                    counts.repaired += 1;
                    p = value >= before.unwrap_or_default();
                }
                Meaning::StaleStates => {
                    counts.states += 1;
                    counts.stale += 1;
                    continue;
                }
            }
            if known && (newest || body.meaning == Meaning::Differences) {
                held.set(index, ticks, t);
            }
        }
        latest = latest.max(t);
        let n = out.rows;
        (out.t[n], out.x[n], out.y[n], out.p[n]) = (t, x, y, u8::from(p));
        if out.paired {
            (out.ticks[n], out.present[n]) = (if known { ticks } else { 0 }, u8::from(known));
        }
        out.rows = n + 1;
    }
    BodyReader { at, t, position, latest, ..body }
}
