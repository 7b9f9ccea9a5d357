//! Words of a body to rows: one by one on any machine, in blocks where it has the instructions.
//!
//! The blocks take what is plain (on the array, no earlier than anything that is held, values as they are) and stop at
//! anything else, which [`single::words`] takes: it alone defines what a word means, so every set of instructions gives
//! the same rows, held values and counts.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod body;
#[cfg(target_arch = "x86_64")]
mod eight;
mod single;

pub(super) use body::{Body, Meaning};
#[cfg(target_arch = "x86_64")]
pub(super) use eight::{EIGHT, Eight, FULL};

use super::held::Held;
use crate::vectors::Instructions;
use crate::wire::columns::Room;
use crate::wire::v2::counts::Counts;

/// Rows beyond those that words give that a block may write over.
const MARGIN: usize = 32;

/// Words that are taken one by one before blocks are tried again.
const STRETCH: usize = 32;
/// As [`STRETCH`], of AVX2, whose blocks are shorter.
const SHORT_STRETCH: usize = 8;

/// Bytes of the shortest word.
const WORD_BYTES: usize = 2;

/// How many rows a stream of so many bytes may need, whatever it holds.
#[must_use]
pub fn stream_rows(bytes: usize) -> usize {
    most_rows(bytes / WORD_BYTES)
}

/// How much room so many words need, rows.
pub(super) fn most_rows(words: usize) -> usize {
    words + MARGIN
}

/// Decodes a body, from its `rows` on; with `paired` each row gets an intensity, or the mark that it has none. `room` has
/// [`most_rows`] or more from there on.
#[inline]
pub(super) fn decode(
    body: &mut Body<'_>,
    set: Instructions,
    held: &mut Held,
    room: &mut Room<'_>,
    paired: bool,
    counts: &mut Counts,
) {
    let first = body.rows;
    assert!(room.len() >= first + most_rows(body.left()), "columns too short");
    while body.left() > 0 {
        blocks(body, set, held, room, paired);
        if body.left() == 0 {
            break;
        }
        let most = match set {
            Instructions::Plain => usize::MAX,
            Instructions::Avx2 | Instructions::Avx512 => SHORT_STRETCH,
            Instructions::Avx512Bytes => STRETCH,
        };
        match body.layout.value {
            0 => single::words::<2, 15, 0>(body, held, room, paired, counts, most),
            8 => single::words::<2, 7, 8>(body, held, room, paired, counts, most),
            _ => single::words::<4, 15, 16>(body, held, room, paired, counts, most),
        }
    }
    counts.events += (body.rows - first) as u64;
    counts.malformed += u64::from(body.cut || body.at < body.bytes.len());
}

/// Takes plain words, as far as they go, where the machine has the instructions.
#[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
fn blocks(body: &mut Body<'_>, set: Instructions, held: &mut Held, room: &mut Room<'_>, paired: bool) {
    #[cfg(target_arch = "x86_64")]
    if set >= Instructions::Avx2
        && body.meaning == Meaning::Changes
        && body.stride == held.stride
        && held.values.len() < usize::from(FULL)
    {
        // SAFETY: the machine has this set, as `Decoder::instructions` and `best` see to. `decode` has asserted that the room
        // holds, behind the rows so far, a row for each word and 32 more, and no word gives more than one row. The last two
        // conditions are the block's own.
        unsafe {
            match (set, body.layout.value) {
                (Instructions::Avx512Bytes, 0) => avx512::blocks::<0>(body, held, room, paired),
                (Instructions::Avx512Bytes, 8) => avx512::blocks::<8>(body, held, room, paired),
                (Instructions::Avx512Bytes, _) => avx512::blocks::<16>(body, held, room, paired),
                (_, 0) => avx2::blocks::<0>(body, held, room, paired),
                (_, 8) => avx2::blocks::<8>(body, held, room, paired),
                (_, _) => avx2::blocks::<16>(body, held, room, paired),
            }
        }
    }
}
