//! Decodes a body's words to rows: one by one on any machine, in blocks if it has the instructions.
//!
//! The blocks decode plain words (on the array, no earlier than any stored value, values and not differences) and stop
//! at any other word, which [`single::words`] decodes. Only that function defines a word's meaning, so all instruction
//! sets return the same rows, values and counts.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod body;
#[cfg(target_arch = "x86_64")]
mod eight;
mod single;

pub(super) use body::{BodyReader, Meaning};
#[cfg(target_arch = "x86_64")]
pub(super) use eight::{EIGHT, Eight, FULL};

use super::held::ValuesByLine;
use crate::vectors::Instructions;
use crate::wire::columns::Room;
use crate::wire::v2::counts::Counts;

/// Rows after those of the words that a block may overwrite.
const MARGIN: usize = 8;

/// Number of words decoded one by one before blocks are tried again.
const STRETCH: usize = 8;

/// Size of the shortest word, bytes.
const WORD_BYTES: usize = 2;

/// Most rows that a stream of this many bytes can need.
#[must_use]
pub fn stream_rows(bytes: usize) -> usize {
    most_rows(bytes / WORD_BYTES)
}

/// Room that this many words need, rows.
pub(super) fn most_rows(words: usize) -> usize {
    words + MARGIN
}

/// Decodes a body, from row `rows` on; with `paired` the intensity columns are written for each row. `room` has at
/// least [`most_rows`] rows from there on.
#[inline]
pub(super) fn decode(
    body: &mut BodyReader<'_>,
    set: Instructions,
    held: &mut ValuesByLine,
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
        let most = if set < Instructions::Avx2 { usize::MAX } else { STRETCH };
        match body.layout.value {
            0 => single::words::<2, 15, 0>(body, held, room, paired, counts, most),
            8 => single::words::<2, 7, 8>(body, held, room, paired, counts, most),
            _ => single::words::<4, 15, 16>(body, held, room, paired, counts, most),
        }
    }
    counts.events += (body.rows - first) as u64;
    counts.malformed += u64::from(body.cut || body.at < body.bytes.len());
}

/// Decodes plain words up to the first that is not, if the machine has the instructions.
#[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
fn blocks(body: &mut BodyReader<'_>, set: Instructions, held: &mut ValuesByLine, room: &mut Room<'_>, paired: bool) {
    #[cfg(target_arch = "x86_64")]
    if set >= Instructions::Avx2
        && body.meaning == Meaning::Changes
        && body.stride == held.stride
        && held.values.len() < usize::from(FULL)
    {
        // SAFETY: `Decoder::instructions` and `best` select a set only if the machine has it. `decode` has asserted
        // that the room after the rows so far holds a row for each word and 8 more, and no word gives more than one
        // row. The block itself checks the last two conditions.
        unsafe {
            match body.layout.value {
                0 => avx2::blocks::<0>(body, held, room, paired),
                8 => avx2::blocks::<8>(body, held, room, paired),
                _ => avx2::blocks::<16>(body, held, room, paired),
            }
        }
    }
}
