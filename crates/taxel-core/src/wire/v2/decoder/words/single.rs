//! Decodes words one by one, on any machine; defines the meaning of each word.

use super::body::{BodyReader, Meaning, word};
use crate::wire::columns::Room;
use crate::wire::v2::counts::Counts;
use crate::wire::v2::decoder::held::ValuesByLine;

/// Decodes at most `most` words of `BYTES` bytes with this layout. `room` must have as many rows left.
#[inline(always)]
pub(super) fn words<const BYTES: usize, const SKIP: u32, const VALUE: u32>(
    body: &mut BodyReader<'_>,
    held: &mut ValuesByLine,
    room: &mut Room<'_>,
    paired: bool,
    counts: &mut Counts,
    most: usize,
) {
    let control = (1_u32 << SKIP) - 1;
    let stride = body.stride.min(31);
    let mask = (1_i64 << stride) - 1;
    let (columns, rows) = (i64::from(held.columns), i64::from(held.rows));
    let end = body.at + (body.bytes.len() - body.at).min(most.saturating_mul(BYTES)) / BYTES * BYTES;
    let BodyReader { base, mut at, mut t, mut position, mut latest, rows: mut n, .. } = *body;
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
        if x >= columns || y >= rows {
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
        room.t[n].write(t);
        room.x[n].write(x);
        room.y[n].write(y);
        room.p[n].write(p);
        if paired {
            room.ticks[n].write(if known { ticks } else { 0 });
            room.present[n].write(known);
        }
        n += 1;
    }
    (body.at, body.t, body.position, body.latest, body.rows) = (at, t, position, latest, n);
}
