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
    /// Something is not read out, or not shown, live; no recording lacks it.
    Live,
}

macro_rules! causes {
    ($($(#[doc = $meaning:literal])+ $name:ident $key:literal $kind:ident $one:literal $several:literal $rest:literal,)*) => {
        /// A cause: its key in files and in Python, what it says of a recording, its words, and what they mean.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Cause {
            $($(#[doc = $meaning])+ $name,)*
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

            /// The noun of so many, and what is said of it.
            #[must_use]
            pub fn words(self, n: u64) -> String {
                let (noun, rest) = match self { $(Self::$name => (if n == 1 { $one } else { $several }, $rest),)* };
                format!("{noun} {rest}").trim_end().to_owned()
            }

            /// What the words mean.
            #[must_use]
            pub fn meaning(self) -> &'static str {
                match self { $(Self::$name => concat!($($meaning),+).trim_start(),)* }
            }
        }
    };
}

causes! {
    /// Flags of the board; the same losses as the next.
    BoardDropped "dropped_by_board" Lost "time" "times" "that the board dropped events",
    /// The board's own totals.
    EventsDropped "events_dropped_by_board" Lost "event" "events" "that the board itself counted as dropped",
    /// The receive buffer was full; with `UDP_GRO` a message is several datagrams.
    KernelDropped "dropped_by_kernel" Lost "message" "messages" "dropped by the kernel",
    /// The queue before the decoder was full.
    QueueDropped "dropped_by_queue" Lost "datagram" "datagrams" "dropped by taxel's queue",
    /// Writing failed, as on a full disk.
    NotRecorded "not_recorded" Lost "datagram" "datagrams" "received but not recorded",
    /// After 65 536 bytes of a line; before the first line, bytes that are not text.
    InNoLine "bytes_in_no_line" Lost "byte" "bytes" "in no line of numbers",
    /// What the board's numbers lack beyond those dropped; with `UDP_GRO`, or where the kernel does not count, the
    /// kernel may have dropped them.
    OnTheWay "lost_on_the_way" Lost "datagram" "datagrams" "lost or damaged on the way",
    /// Datagrams, lines or frames.
    DataInFile "lost_in_file" Lost "message" "messages" "of data lost in the file",
    /// Damage of the file.
    RegistersInFile "registers_lost_in_file" Lost "register setting" "register settings" "lost in the file",
    /// Damage of the file.
    MarkersInFile "markers_lost_in_file" Lost "marker" "markers" "lost in the file",
    /// Damage of the file; also zeroed taxels.
    NotesInFile "notes_lost_in_file" Lost "note" "notes" "lost in the file",
    /// Damage of the file.
    DetectionsInFile "detections_lost_in_file" Lost "detection" "detections" "lost in the file",
    /// The values that the taxels held at the beginning.
    HeldInFile "held_values_lost_in_file" Lost "initial state" "initial states" "lost in the file",
    /// Resets, and changes of the version of the wire.
    ChangesInFile "changes_lost_in_file" Lost "board change" "board changes" "lost in the file",
    /// Damage of the file.
    LinesInFile "unread_lines_lost_in_file" Lost "unread line" "unread lines" "lost in the file",
    /// Version 1: bytes of no whole word.
    BytesSkipped "bytes_skipped" Damaged "byte" "bytes" "skipped",
    /// Version 1: words that the next word or the end cut off.
    ShortEvents "short_events" Damaged "short event" "short events" "",
    /// Version 1: words that are an intensity and a marker at once.
    Contradictory "contradictory_kinds" Damaged "contradictory kind" "contradictory kinds" "",
    /// Version 1: of taxels that the array does not have.
    Outside "outside_the_array" Damaged "word" "words" "outside the array",
    /// Version 1: intensities without their change.
    Unpaired "unpaired_intensities" Damaged "unpaired intensity" "unpaired intensities" "",
    /// Events before the latest time: in version 1 by up to 0.1 s; in version 2 by more, farther than a network
    /// reorders.
    OutOfOrder "events_out_of_order" Damaged "event" "events" "out of order",
    /// Version 1: ahead by 1 s or more, after a damaged stamp (6.5536 s late) or a reset. Lines of numbers: ahead of
    /// arrival by more than a second and a hundredth of the pause.
    Jumps "jumps_of_time" Damaged "jump" "jumps" "of time",
    /// Version 1: before this trial; all its times are doubtful.
    JumpedBefore "jumps_of_time_before_it" Damaged "jump" "jumps" "of time before it",
    /// Version 1, which does not number datagrams: their events are there twice. Without values, only those with several
    /// times count.
    DecodedAgain "datagrams_decoded_again" Damaged "datagram" "datagrams" "decoded again",
    /// From a board that sends version 2.
    Refused "bytes_of_version_1_refused" Damaged "byte" "bytes" "of version 1 refused",
    /// Datagrams without bytes.
    Empty "empty_datagrams" Damaged "empty datagram" "empty datagrams" "",
    /// Version 2, unusable: wrong checksum, too short or too long; they also count as lost on the way.
    DatagramsDamaged "datagrams_damaged" Damaged "datagram" "datagrams" "damaged",
    /// Version 2, intact: another board's number, or other contents under the same session and number.
    OtherBoard "datagrams_of_another_board" Damaged "datagram" "datagrams" "of another board",
    /// Version 2: by more than 65 536 numbers.
    TooLate "datagrams_too_late" Damaged "datagram" "datagrams" "too late",
    /// Version 2: events and states of taxels that the array does not have.
    TaxelsOutside "taxels_outside_the_array" Damaged "taxel" "taxels" "outside the array",
    /// Version 2: not read.
    UnknownKind "datagrams_of_an_unknown_kind" Damaged "datagram" "datagrams" "of an unknown kind",
    /// Version 2: read.
    UnknownFlags "datagrams_with_unknown_flags" Damaged "datagram" "datagrams" "with unknown flags",
    /// Version 2: not read.
    UnknownMarker "markers_with_an_unknown_code" Damaged "marker" "markers" "with an unknown code",
    /// Version 2: the contents end within a word, or have an offset that is too late.
    Malformed "malformed_bodies" Damaged "malformed body" "malformed bodies" "",
    /// Version 2: the event has no value.
    UnknownValue "differences_from_an_unknown_value" Damaged "difference" "differences" "from an unknown value",
    /// Two boards use one port; the real number is larger.
    BetweenSenders "changes_between_senders" Damaged "change" "changes" "between senders",
    /// Lines of numbers.
    Strange "lines_that_could_not_be_read" Damaged "line" "lines" "that could not be read",
    /// Lines of numbers: a stamp steps back, by less than a second.
    StampsBack "stamps_out_of_order" Damaged "stamp" "stamps" "out of order",
    /// Lines of numbers: the clock was off by more than a second and a hundredth of the time.
    Drifts "drifts_from_arrival" Damaged "drift" "drifts" "from arrival",
    /// Counted by a later version of taxel.
    Unknown "unknown_causes" Damaged "time" "times" "by a cause that this version does not know",
    /// Messages that are there twice are read twice.
    RepeatedInFile "repeated_in_file" Damaged "message" "messages" "repeated in the file",
    /// Blocks of the file that cannot be read.
    BadChunks "bad_chunks" File "bad chunk" "bad chunks" "of the file skipped",
    /// Damage of the file.
    LargeChunks "large_chunks" File "chunk" "chunks" "of the file skipped whose stated size is above 64 MiB",
    /// Damage of the file.
    SkippedBytes "skipped_bytes" File "byte" "bytes" "of the file skipped",
    /// The recorder was killed, or the file was cut.
    TornBytes "torn_bytes" File "torn byte" "torn bytes" "at the end of the file",
    /// Something was appended, as by `cat`: use `taxel.merge`.
    BytesAfterEnd "bytes_after_end" File "byte" "bytes" "after the end of the recording not read",
    /// Version 2: each counts once.
    Repeated "datagrams_repeated" Noted "datagram" "datagrams" "repeated",
    /// Version 2: they differed from the board's.
    Repaired "events_repaired" Noted "value" "values" "repaired from the board's refresh",
    /// Version 2.
    Resets "resets" Noted "reset" "resets" "of the board",
    /// Lines of numbers: back by more than a second, then times by arrival.
    ClockAnew "clock_began_anew" Noted "restart" "restarts" "of its clock",
    /// Lines of numbers: `nan`.
    Missing "missing_values" Noted "missing value" "missing values" "",
    /// Version 2: by 0.1 s or less, in the network; times are right.
    Overtaken "events_overtaken" Noted "event" "events" "overtaken by later ones",
    /// The beginning or the end of a line did not arrive.
    UnfinishedLines "bytes_of_unfinished_lines" Noted "byte" "bytes" "of unfinished lines",
    /// A new address or port, of the same or another board.
    Addresses "changes_of_address" Noted "change" "changes" "of the sender's address",
    /// No frame arrived.
    Silences "silences" Noted "silence" "silences" "of a second or more",
    /// The sum of those silences.
    SilentMs "silent_ms" Noted "millisecond" "milliseconds" "of silence",
    /// The line of the gaps states them.
    Gaps "gaps" Noted "gap" "gaps" "between frames",
    /// The sum of the gaps.
    GapsUs "gaps_us" Noted "microsecond" "microseconds" "in gaps",
    /// The queue before the readout was full; the recording has them.
    ReadoutDropped "dropped_before_readout" Live "event" "events" "dropped before the readout, which was too slow",
    /// The page's server was too slow; the recording and the readout have them.
    ViewDropped "missing_in_the_view" Live "event" "events" "missing in the page's curves and past",
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
        let said: Vec<String> = said.map(|(cause, n)| format!("{n} {}", cause.words(n))).collect();
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
