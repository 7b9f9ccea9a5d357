//! The state that a loop over plain words carries, and the loop that decodes them one by one, on any machine.

use crate::wire::columns::Columns;
use crate::wire::decoder::clock::{FARTHEST_BACK, TURN};
use crate::wire::v1::{FIRST, STAMP_US, WORD_BYTES};

/// Largest distance of a stamp ahead of the latest time that is not ambiguous: see [`FARTHEST_BACK`].
const FARTHEST_AHEAD: i64 = TURN - FARTHEST_BACK - 1;

/// The state of the block loop besides the rows.
pub(crate) struct Carried {
    /// Current time, in stamps: the latest time, or after a step back the time in the reordered stretch.
    pub(crate) latest: i64,
    /// The time up to which words are plain, in stamps.
    pub(crate) until: i64,
    /// Number of intensities with a change, and number without.
    pub(crate) intensities: u64,
    pub(crate) unpaired: u64,
}

impl Carried {
    /// Largest distance of a stamp ahead of the current time; 0 or more until `until` is passed.
    #[inline(always)]
    pub(super) fn largest_lead(&self) -> u16 {
        (self.until - self.latest).min(FARTHEST_AHEAD) as u16
    }
}

/// The 16-bit value of a word; the caller has checked that its bytes are in place.
#[inline(always)]
fn value(word: &[u8]) -> u16 {
    u16::from(word[0]) << 14 | u16::from(word[1]) << 7 | u16::from(word[2])
}

/// See [`super::blocks`]; decodes at most `most` words. The first pair of all columns counts as not plain.
pub(super) fn words(
    bytes: &[u8],
    columns: u16,
    rows: u16,
    state: &mut Carried,
    out: &mut Columns<'_>,
    most: usize,
) -> usize {
    let words = most.min(bytes.len() / WORD_BYTES);
    let (first, paired, mut open) = (out.rows, out.paired, out.open);
    let mut last = if open { out.last_taxel() } else { (0, 0) };
    // The rows that can be written from here on: there are never more rows than words.
    let range = first..first + words;
    let (t, p) = (&mut out.t[range.clone()], &mut out.p[range.clone()]);
    let (x, y) = (&mut out.x[range.clone()], &mut out.y[range]);
    // The first word may be the intensity of the row before.
    let back = usize::from(first > 0);
    let ticks = &mut out.ticks[first - back..first + words];
    let present = &mut out.present[first - back..first + words];
    let (mut n, mut done) = (0, 0);
    for word in bytes.chunks_exact(WORD_BYTES).take(words) {
        let taxel = (u16::from(word[3] & 0x3f), u16::from(word[4] & 0x3f));
        let ahead = value(word).wrapping_sub(state.latest as u16);
        let in_place = word[0] & FIRST != 0 && (word[1] | word[2] | word[3] | word[4]) & FIRST == 0;
        if !in_place || word[0] & 0x08 != 0 || taxel.0 >= columns || taxel.1 >= rows {
            break;
        }
        if word[0] & 0x20 == 0 {
            if ahead > state.largest_lead() {
                break;
            }
            state.latest += i64::from(ahead);
            (t[n], x[n], y[n]) = (state.latest * STAMP_US, taxel.0, taxel.1);
            p[n] = u8::from(word[0] & 0x40 != 0);
            if paired {
                (ticks[n + back], present[n + back]) = (0, 0);
            }
            n += 1;
            (open, last) = (true, taxel);
        } else if open && last == taxel {
            if !paired {
                break;
            }
            (ticks[n + back - 1], present[n + back - 1]) = (value(word), 1);
            state.intensities += 1;
            open = false;
        } else {
            state.unpaired += 1;
            open = false;
        }
        done += 1;
    }
    (out.rows, out.open) = (first + n, open);
    done
}
