//! What a decoder could not use, by cause, as recordings store it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use taxel_core::wire::{self, SenderDecoder, StepBack};

use crate::text_lines::LeftOut;

/// What decoding a file found.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct DamageCounts {
    /// What the decoder could not use, by cause.
    pub damage: BTreeMap<String, u64>,
    /// For version 2: sequence numbers that are missing.
    pub missing: Option<u64>,
    /// Whether some of it was of version 1, which numbers nothing.
    pub unnumbered: bool,
    /// The time after which times are doubtful, us.
    pub doubtful_after_us: Option<i64>,
    /// Where times step back.
    pub steps_back: Vec<StepBack>,
}

impl DamageCounts {
    /// What a decoder found; `origin_us` is added to its times.
    #[must_use]
    pub fn from_sender(sender: &SenderDecoder, origin_us: i64) -> Self {
        let (causes, missing) = damage(sender.counts(), &sender.version_2().counts(), sender.totals());
        let doubtful_after_us = sender.totals().doubtful_after.map(|t| t + origin_us);
        let steps = sender.steps_back().iter();
        let steps_back = steps.map(|step| StepBack { after_us: step.after_us + origin_us, ..*step }).collect();
        Self { damage: causes, missing, unnumbered: sender.counts().bytes > 0, doubtful_after_us, steps_back }
    }

    /// Number of lines that could not be read.
    #[must_use]
    pub fn strange(&self) -> u64 {
        self.damage.get(STRANGE).copied().unwrap_or(0)
    }

    /// Number of bytes that are in no line.
    #[must_use]
    pub fn left_out(&self) -> LeftOut {
        let count = |cause: &str| self.damage.get(cause).copied().unwrap_or(0);
        LeftOut { in_no_line: count(IN_NO_LINE), unfinished: count(UNFINISHED_LINES) }
    }
}

/// What a decoder of version 1 could not use, by cause.
#[must_use]
pub fn damage_of_version_1(counts: &wire::Counts) -> BTreeMap<String, u64> {
    [
        ("bytes_skipped", counts.skipped),
        ("short_events", counts.short),
        ("contradictory_kinds", counts.contradictory),
        ("outside_the_array", counts.outside),
        ("unpaired_intensities", counts.unpaired),
        (OUT_OF_ORDER, counts.back),
    ]
    .map(|(cause, n)| (cause.to_owned(), n))
    .into()
}

/// What the decoders of both versions could not use, by cause, with the sender's totals; and the number of missing datagrams of
/// version 2, if the board sends it.
#[must_use]
pub fn damage(
    counts: &wire::Counts,
    two: &wire::v2::Counts,
    totals: &wire::SenderTotals,
) -> (BTreeMap<String, u64>, Option<u64>) {
    let mut causes = damage_of_version_1(counts);
    *causes.entry(OUT_OF_ORDER.to_owned()).or_default() += totals.far_behind;
    let of_sender = [
        (JUMPS, totals.jumps),
        (AGAIN, totals.repeated),
        (OVERTAKEN, totals.overtaken),
        (REFUSED, totals.refused),
        (EMPTY, totals.empty),
        (REPEATED, two.repeated),
    ];
    causes.extend(of_sender.map(|(cause, n)| (cause.to_owned(), n)));
    if two.datagrams == 0 {
        return (causes, None);
    }
    let of_version_2 = [
        ("datagrams_damaged", two.checksum + two.short + two.long + two.foreign - two.other_board),
        (OTHER_BOARD, two.other_board),
        ("datagrams_too_late", two.old),
        ("taxels_outside_the_array", two.outside),
        ("datagrams_of_an_unknown_kind", two.unknown_kind),
        ("datagrams_with_unknown_flags", two.unknown_flags),
        ("markers_with_an_unknown_code", two.unknown_marker),
        ("malformed_bodies", two.malformed),
        (BOARD_DROPPED, two.dropped),
        (EVENTS_DROPPED, two.events_dropped),
        (BOARD_RESET, two.resets),
        (REPAIRED, two.repaired),
        ("differences_from_an_unknown_value", two.unknown_value),
    ];
    causes.extend(of_version_2.map(|(cause, n)| (cause.to_owned(), n)));
    (causes, Some(two.missing))
}

/// What a decoder of version 2 counts that is no damage of bytes: losses in the board itself, ...
pub(super) const BOARD_DROPPED: &str = "times_that_the_board_dropped_events";
pub(super) const EVENTS_DROPPED: &str = "events_dropped_by_board";
/// ... resets, values that differed from the board's own, as their events were lost, and datagrams that came again.
pub(super) const BOARD_RESET: &str = "resets";
pub(super) const REPAIRED: &str = "events_repaired";
pub(super) const REPEATED: &str = "datagrams_repeated";
/// Events before the latest time: of version 1, which does not number its datagrams, and of version 2 those farther before it
/// than a network reorders; and the other ones of version 2.
const OUT_OF_ORDER: &str = "events_out_of_order";
pub(super) const OVERTAKEN: &str = "events_overtaken";
/// Datagrams that are intact, and of another board than the first.
pub(super) const OTHER_BOARD: &str = "datagrams_of_another_board";
/// Datagrams of version 1 that came again: version 1 does not number them, so that their events are there twice.
pub(super) const AGAIN: &str = "datagrams_decoded_again";
/// Jumps of the times of version 1 ahead of the host's clock.
pub(crate) const JUMPS: &str = "jumps_of_time";
/// Causes of a stream of numbers: lines that could not be read, restarts of its clock, which are no damage, stamps that step
/// back, and how often the clock left that of arrival little by little.
pub(super) const STRANGE: &str = "lines_that_could_not_be_read";
/// Bytes of a stream of numbers that are in no line, and so are lost, and those of lines that have no end or no beginning.
pub(super) const IN_NO_LINE: &str = "bytes_in_no_line";
pub(super) const UNFINISHED_LINES: &str = "bytes_of_unfinished_lines";
pub(super) const ANEW: &str = "clock_began_anew";
/// How often no frame of numbers arrived for a second or more, and how long in all, ms.
pub(crate) const SILENCES: &str = "silences";
pub(crate) const SILENT_MS: &str = "silent_ms";
/// Values of a stream of numbers that a line says are missing (`nan`).
pub(super) const MISSING: &str = "missing_values";
pub(super) const BACK: &str = "stamps_out_of_order";
pub(super) const DRIFTS: &str = "drifts_from_arrival";
/// Datagrams of version 1 without bytes.
const EMPTY: &str = "empty_datagrams";
/// How often the sender had another address than before, as a board that got another one has, or another board.
pub(crate) const ADDRESS: &str = "changes_of_address";
/// Bytes of version 1 from a board that sends version 2.
const REFUSED: &str = "bytes_of_version_1_refused";
