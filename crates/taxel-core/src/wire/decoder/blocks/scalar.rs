//! Decodes plain words one by one, on any machine.

use super::carried::{Carried, value};
use crate::wire::columns::Columns;
use crate::wire::v1::{FIRST, STAMP_US, WORD_BYTES};

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
        let ahead = value(word, 0).wrapping_sub(state.latest as u16);
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
            (ticks[n + back - 1], present[n + back - 1]) = (value(word, 0), 1);
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
