//! Decodes words eight at a time with AVX2; the words after the last group of eight are decoded one by one.

use super::body::BodyReader;
use super::eight::{EIGHT, Eight, FULL};
use crate::wire::columns::Room;
use crate::wire::v2::decoder::held::ValuesByLine;

/// Decodes plain words with `VALUE` bits of value, in groups of eight.
///
/// # Safety
///
/// The machine must have the features below; each column of `room` must have 8 entries more than the rows so far and
/// the remaining words together; `body.stride` must be that of `held`, which must have fewer than 65 535 positions.
#[target_feature(enable = "avx2,bmi1,popcnt")]
pub(super) unsafe fn blocks<const VALUE: u32>(
    body: &mut BodyReader<'_>,
    held: &mut ValuesByLine,
    room: &mut Room<'_>,
    paired: bool,
) {
    let bytes = if VALUE == 16 { 4 } else { 2 };
    while body.bytes.len() - body.at >= bytes * EIGHT {
        if VALUE > 0 && body.t < held.newest || body.position >= i64::from(FULL) - 1 {
            return;
        }
        let passed = (body.position + 1) as u16;
        // SAFETY: the body has eight words from there on; the caller guarantees the condition on the array.
        let eight = unsafe { Eight::read_unaligned::<VALUE>(body.bytes.as_ptr().add(body.at), passed, held) };
        let Some(eight) = eight.filter(|eight| eight.passed < FULL) else { return };
        // SAFETY: as the caller guarantees, 8 rows fit after the rows so far; the events are on the array, and so in
        // `held`.
        unsafe {
            eight.write::<VALUE>(body.t, room, body.rows, paired);
            if VALUE > 0 && eight.n > 0 {
                eight.store_neighbours(body.t, held);
            }
        }
        if eight.n > 0 {
            body.latest = body.latest.max(body.t);
        }
        body.rows += eight.n;
        body.position = i64::from(eight.passed) - 1;
        body.at += bytes * EIGHT;
    }
}
