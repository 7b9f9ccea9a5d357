//! The table of all causes for which something of a recording is lost, damaged or noted, and counts by cause.

use std::collections::BTreeMap;
use std::ops::{Index, IndexMut};

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use taxel_core::wire;

/// What a cause says of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CauseKind {
    /// Something that the board sent, or that the file held, is not there.
    Lost,
    /// Something is there that cannot be used, or its times cannot be relied upon.
    Damaged,
    /// As `Damaged`, of the file as a whole: each of its sources states it.
    File,
    /// Nothing is lost by it.
    Noted,
}

macro_rules! causes {
    ($($name:ident $key:literal $kind:ident $words:literal,)*) => {
        /// A cause: its key in files and in Python, what it says of a recording, and its words in the plural.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Cause {
            $(#[doc = $words] $name,)*
        }

        impl Cause {
            /// All causes, in the order in which a verdict states them.
            pub const ALL: &[Self] = &[$(Self::$name,)*];

            /// The name in files and in Python.
            #[must_use]
            pub fn key(self) -> &'static str {
                match self { $(Self::$name => $key,)* }
            }

            /// What it says of a recording.
            #[must_use]
            pub fn kind(self) -> CauseKind {
                match self { $(Self::$name => CauseKind::$kind,)* }
            }

            fn words(self) -> &'static str {
                match self { $(Self::$name => $words,)* }
            }
        }
    };
}

causes! {
    BoardDropped "dropped_by_board" Lost "times that the board dropped events",
    EventsDropped "events_dropped_by_board" Lost "events that the board itself counted as dropped",
    KernelDropped "dropped_by_kernel" Lost "messages dropped by the kernel",
    QueueDropped "dropped_by_queue" Lost "datagrams dropped by taxel's queue",
    NotRecorded "not_recorded" Lost "datagrams received but not recorded",
    InNoLine "bytes_in_no_line" Lost "bytes in no line of numbers",
    // What the board's numbers lack beyond the datagrams that are counted as dropped.
    OnTheWay "lost_on_the_way" Lost "datagrams lost or damaged on the way",
    DataInFile "lost_in_file" Lost "messages of data lost in the file",
    RegistersInFile "registers_lost_in_file" Lost "register settings lost in the file",
    MarkersInFile "markers_lost_in_file" Lost "markers lost in the file",
    NotesInFile "notes_lost_in_file" Lost "notes lost in the file",
    DetectionsInFile "detections_lost_in_file" Lost "detections lost in the file",
    HeldInFile "held_values_lost_in_file" Lost "initial states lost in the file",
    ChangesInFile "changes_lost_in_file" Lost "board changes lost in the file",
    LinesInFile "unread_lines_lost_in_file" Lost "unread lines lost in the file",
    BytesSkipped "bytes_skipped" Damaged "bytes skipped",
    ShortEvents "short_events" Damaged "short events",
    Contradictory "contradictory_kinds" Damaged "contradictory kinds",
    Outside "outside_the_array" Damaged "words outside the array",
    Unpaired "unpaired_intensities" Damaged "unpaired intensities",
    // Before the latest time: of version 1, and of version 2 those farther before it than a network reorders.
    OutOfOrder "events_out_of_order" Damaged "events out of order",
    // Version 1 ahead of the host's clock; streams of numbers ahead of arrival.
    Jumps "jumps_of_time" Damaged "jumps of time",
    // Before a recording that began while its board was received: all its times are doubtful.
    JumpedBefore "jumps_of_time_before_it" Damaged "jumps of time before it",
    // Version 1 does not number datagrams, so that the events of those that came again are there twice.
    DecodedAgain "datagrams_decoded_again" Damaged "datagrams decoded again",
    // From a board that sends version 2.
    Refused "bytes_of_version_1_refused" Damaged "bytes of version 1 refused",
    Empty "empty_datagrams" Damaged "empty datagrams",
    DatagramsDamaged "datagrams_damaged" Damaged "datagrams damaged",
    // Intact, and of another board than the first.
    OtherBoard "datagrams_of_another_board" Damaged "datagrams of another board",
    TooLate "datagrams_too_late" Damaged "datagrams too late",
    TaxelsOutside "taxels_outside_the_array" Damaged "taxels outside the array",
    UnknownKind "datagrams_of_an_unknown_kind" Damaged "datagrams of an unknown kind",
    UnknownFlags "datagrams_with_unknown_flags" Damaged "datagrams with unknown flags",
    UnknownMarker "markers_with_an_unknown_code" Damaged "markers with an unknown code",
    Malformed "malformed_bodies" Damaged "malformed bodies",
    UnknownValue "differences_from_an_unknown_value" Damaged "differences from an unknown value",
    BetweenSenders "changes_between_senders" Damaged "changes between senders",
    Strange "lines_that_could_not_be_read" Damaged "lines that could not be read",
    StampsBack "stamps_out_of_order" Damaged "stamps out of order",
    Drifts "drifts_from_arrival" Damaged "drifts from arrival",
    // Written by a later version.
    Unknown "unknown_causes" Damaged "times by causes that this version does not know",
    RepeatedInFile "repeated_in_file" Damaged "messages repeated in the file",
    BadChunks "bad_chunks" File "bad chunks of the file skipped",
    LargeChunks "large_chunks" File "chunks of the file skipped whose stated size is above 64 MiB",
    SkippedBytes "skipped_bytes" File "bytes of the file skipped",
    TornBytes "torn_bytes" File "torn bytes at the end of the file",
    BytesAfterEnd "bytes_after_end" File "bytes after the end of the recording not read",
    Repeated "datagrams_repeated" Noted "datagrams repeated",
    Repaired "events_repaired" Noted "values repaired from the board's refresh",
    Resets "resets" Noted "resets of the board",
    ClockAnew "clock_began_anew" Noted "restarts of its clock",
    Missing "missing_values" Noted "missing values",
    Overtaken "events_overtaken" Noted "events overtaken by later ones",
    UnfinishedLines "bytes_of_unfinished_lines" Noted "bytes of unfinished lines",
    Addresses "changes_of_address" Noted "changes of the sender's address",
    // No frame of numbers arrived for a second or more.
    Silences "silences" Noted "silences of a second or more",
    SilentMs "silent_ms" Noted "milliseconds of silence",
    Gaps "gaps" Noted "gaps between frames",
    GapsUs "gaps_us" Noted "microseconds in gaps",
}

/// Causes that the line of the gaps says.
const LINE_OF_GAPS: [Cause; 2] = [Cause::Gaps, Cause::GapsUs];

/// Numbers by cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counts([u64; Cause::ALL.len()]);

impl Default for Counts {
    fn default() -> Self {
        Self([0; Cause::ALL.len()])
    }
}

impl Index<Cause> for Counts {
    type Output = u64;

    fn index(&self, cause: Cause) -> &u64 {
        &self.0[cause as usize]
    }
}

impl IndexMut<Cause> for Counts {
    fn index_mut(&mut self, cause: Cause) -> &mut u64 {
        &mut self.0[cause as usize]
    }
}

impl<const N: usize> From<[(Cause, u64); N]> for Counts {
    fn from(counts: [(Cause, u64); N]) -> Self {
        let mut all = Self::default();
        all.extend(counts);
        all
    }
}

impl Extend<(Cause, u64)> for Counts {
    /// Adds to each number.
    fn extend<I: IntoIterator<Item = (Cause, u64)>>(&mut self, counts: I) {
        counts.into_iter().for_each(|(cause, n)| self[cause] += n);
    }
}

impl Counts {
    /// The causes that happened, and how often, in the order of the table.
    pub fn iter(&self) -> impl Iterator<Item = (Cause, u64)> + '_ {
        Cause::ALL.iter().map(|&cause| (cause, self[cause])).filter(|(_, n)| *n > 0)
    }

    /// What was counted since an earlier state of these counts.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k].saturating_sub(earlier.0[k])))
    }

    /// The larger number of each cause.
    #[must_use]
    pub fn max(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k].max(other.0[k])))
    }

    /// Those of some kinds.
    pub(super) fn of_kinds(&self, kinds: &[CauseKind]) -> Self {
        let mut counts = Self::default();
        counts.extend(self.iter().filter(|(cause, _)| kinds.contains(&cause.kind())));
        counts
    }

    /// The words of all causes of a kind that happened, joined by commas; `None` if none did.
    pub(super) fn words(&self, kinds: &[CauseKind]) -> Option<String> {
        let said = self.iter().filter(|(cause, _)| kinds.contains(&cause.kind()) && !LINE_OF_GAPS.contains(cause));
        let said: Vec<String> = said.map(|(cause, n)| numbered(n, cause.words())).collect();
        (!said.is_empty()).then(|| said.join(", "))
    }

    /// What a decoder of version 1 could not use.
    #[must_use]
    pub fn of_version_1(counts: &wire::Counts) -> Self {
        Self::from([
            (Cause::BytesSkipped, counts.skipped),
            (Cause::ShortEvents, counts.short),
            (Cause::Contradictory, counts.contradictory),
            (Cause::Outside, counts.outside),
            (Cause::Unpaired, counts.unpaired),
            (Cause::OutOfOrder, counts.back),
        ])
    }

    /// What the decoders of both versions could not use, with the sender's totals.
    #[must_use]
    pub fn of_decoders(one: &wire::Counts, two: &wire::v2::Counts, totals: &wire::SenderTotals) -> Self {
        let mut counts = Self::of_version_1(one);
        counts.extend([
            (Cause::OutOfOrder, totals.far_behind),
            (Cause::Jumps, totals.jumps),
            (Cause::DecodedAgain, totals.repeated),
            (Cause::Overtaken, totals.overtaken),
            (Cause::Refused, totals.refused),
            (Cause::Empty, totals.empty),
            (Cause::Repeated, two.repeated),
            (Cause::DatagramsDamaged, two.checksum + two.short + two.long + two.foreign - two.other_board),
            (Cause::OtherBoard, two.other_board),
            (Cause::TooLate, two.old),
            (Cause::TaxelsOutside, two.outside),
            (Cause::UnknownKind, two.unknown_kind),
            (Cause::UnknownFlags, two.unknown_flags),
            (Cause::UnknownMarker, two.unknown_marker),
            (Cause::Malformed, two.malformed),
            (Cause::BoardDropped, two.dropped),
            (Cause::EventsDropped, two.events_dropped),
            (Cause::Resets, two.resets),
            (Cause::Repaired, two.repaired),
            (Cause::UnknownValue, two.unknown_value),
        ]);
        counts
    }
}

impl Serialize for Counts {
    /// Writes the causes that happened by their keys.
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_map(self.iter().map(|(cause, n)| (cause.key(), n)))
    }
}

impl<'de> Deserialize<'de> for Counts {
    /// Reads numbers by key; those of a cause that is not in the table are damage of a later version's kind.
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let mut counts = Self::default();
        for (key, n) in BTreeMap::<String, u64>::deserialize(from)? {
            let known = Cause::ALL.iter().find(|cause| cause.key() == key);
            counts[known.copied().unwrap_or(Cause::Unknown)] += n;
        }
        Ok(counts)
    }
}

/// A number and what it counts, which is given in the plural: of 1 the first word that ends in s, its noun, is in the singular.
fn numbered(n: u64, plural: &str) -> String {
    let noun = plural.split([' ', ',']).find(|word| n == 1 && word.ends_with('s')).unwrap_or_default();
    let singular = noun.strip_suffix("ies").map(|stem| format!("{stem}y"));
    format!("{n} {}", plural.replacen(noun, &singular.unwrap_or(noun.trim_end_matches('s').to_owned()), 1))
}
