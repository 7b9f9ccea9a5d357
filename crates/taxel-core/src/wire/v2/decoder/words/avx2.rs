//! Words eight by eight with AVX2; what is left behind whole eights goes one by one.

use super::body::Body;
use super::eight::{EIGHT, Eight, FULL};
use crate::wire::columns::Room;
use crate::wire::v2::decoder::held::Held;

/// Takes plain words of so many bits of value, as far as there are eight.
///
/// # Safety
///
/// The machine must have the features below; each column of `room` must have 8 entries more than the rows so far and the words
/// that are left; `body.stride` must be that of `held`, which has fewer than 65 535 places.
#[target_feature(enable = "avx2,bmi1,popcnt")]
pub(super) unsafe fn blocks<const VALUE: u32>(body: &mut Body<'_>, held: &mut Held, room: &mut Room<'_>, paired: bool) {
    let bytes = if VALUE == 16 { 4 } else { 2 };
    while body.bytes.len() - body.at >= bytes * EIGHT {
        if VALUE > 0 && body.t < held.newest || body.position >= i64::from(FULL) - 1 {
            return;
        }
        let passed = (body.position + 1) as u16;
        // SAFETY: eight words lie in the body from there on; the caller's promise is on the array.
        let eight = unsafe { Eight::whole::<VALUE>(body.bytes.as_ptr().add(body.at), passed, held) };
        let Some(eight) = eight.filter(|eight| eight.passed < FULL) else { return };
        // SAFETY: the caller's promise: 8 rows fit behind the rows so far; the events lie on the array, and so in `held`.
        unsafe {
            eight.write::<VALUE>(body.t, room, body.rows, paired);
            if VALUE > 0 && eight.n > 0 {
                eight.hold_neighbours(body.t, held);
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
