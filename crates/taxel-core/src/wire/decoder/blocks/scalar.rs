//! Decodes plain words one by one, on any machine.

use super::carried::{Carried, value};
use crate::wire::decoder::filling::FilledColumns;
use crate::wire::v1::{FIRST, STAMP_US, WORD_BYTES};

/// See [`super::blocks`]; decodes at most `most` words. The first pair of a filling counts as not plain.
pub(super) fn words(
    bytes: &[u8],
    columns: u16,
    rows: u16,
    state: &mut Carried,
    filling: &mut FilledColumns<'_>,
    most: usize,
) -> usize {
    let words = most.min(bytes.len() / WORD_BYTES);
    let (first, paired, mut open) = (filling.rows, filling.paired, filling.open);
    let mut last = if open { filling.last_taxel() } else { (0, 0) };
    // The rows that can be written from here on: there are never more rows than words.
    let range = first..first + words;
    let (t, p) = (&mut filling.room.t[range.clone()], &mut filling.room.p[range.clone()]);
    let (x, y) = (&mut filling.room.x[range.clone()], &mut filling.room.y[range]);
    // The first word may be the intensity of the row before.
    let back = usize::from(first > 0);
    let ticks = &mut filling.room.ticks[first - back..first + words];
    let present = &mut filling.room.present[first - back..first + words];
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
            t[n].write(state.latest * STAMP_US);
            x[n].write(taxel.0);
            y[n].write(taxel.1);
            p[n].write(word[0] & 0x40 != 0);
            if paired {
                ticks[n + back].write(0);
                present[n + back].write(false);
            }
            n += 1;
            (open, last) = (true, taxel);
        } else if open && last == taxel {
            if !paired {
                break;
            }
            ticks[n + back - 1].write(value(word, 0));
            present[n + back - 1].write(true);
            state.intensities += 1;
            open = false;
        } else {
            state.unpaired += 1;
            open = false;
        }
        done += 1;
    }
    filling.rows = first + n;
    filling.open = open;
    done
}
