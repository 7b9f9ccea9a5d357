//! The verdict of a recording: what was lost or damaged at which stage, as a status, as numbers by cause and as one line.
//!
//! All wordings of verdicts are made here; `docs/outputs.md` and `taxel.Verdict` list them.

mod of_file;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use taxel_core::wire::StepBack;

use super::damage::{
    ADDRESS, ANEW, BOARD_DROPPED, BOARD_RESET, DamageCounts, EVENTS_DROPPED, IN_NO_LINE, MISSING, OTHER_BOARD,
    OVERTAKEN, REPAIRED, REPEATED, SILENCES, SILENT_MS, UNFINISHED_LINES,
};
use super::topic::Topic;
use crate::kernel_drops::KernelDrops;

/// The wording of version 1 when nothing was dropped between the socket and the file.
pub const NOTHING_LOST: &str = "nothing lost after arrival (version 1 of the wire cannot show losses before arrival)";
/// The same for a stream of numbers, and for frames of them.
const NO_LINE_LOST: &str = "nothing lost after arrival (lines are not numbered, so losses before arrival are unknown)";

/// The wording where a kernel does not count what it drops, and the board does not number what it sends.
const UNCOUNTED: &str = "losses unknown: the kernel does not count dropped datagrams";

/// How much of a recording is there, from the best to the worst; of several parts the worst counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RecordingStatus {
    /// Everything that the board sent between the first and the last datagram.
    Complete,
    /// Everything that arrived; what was lost before cannot be known.
    #[serde(rename = "complete after arrival")]
    CompleteAfterArrival,
    /// Neither the file nor the kernel says what was lost.
    #[default]
    Unknown,
    /// Bytes that arrived, or their times, cannot be relied upon.
    Damaged,
    /// What came last is missing.
    Unfinished,
    /// Nothing arrived at all.
    #[serde(rename = "nothing arrived")]
    NothingArrived,
    /// Something was lost, by one of the causes.
    Lost,
}

/// What a recording lost.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Verdict {
    /// How much is there.
    pub status: RecordingStatus,
    /// All of it in one line.
    pub text: String,
    /// What was lost, by cause.
    pub lost: BTreeMap<String, u64>,
    /// What could not be used, by cause: of the bytes that came, and of the file.
    pub damaged: BTreeMap<String, u64>,
    /// What happened without a loss of its own: repeated datagrams, repaired values, resets and others.
    pub noted: BTreeMap<String, u64>,
    /// The board's time after which times are doubtful, us.
    pub doubtful_after_us: Option<i64>,
    /// Where times step back, in the order of arrival; of many the largest steps.
    pub steps_back: Vec<StepBack>,
    /// The verdicts of the recordings or sources that this one is made of, by name.
    pub parts: Vec<(String, Verdict)>,
}

/// Counts of datagrams and bytes, by what happened to them; the sums of the causes equal the totals.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct RecordingCounts {
    /// Datagrams received from the socket.
    pub received: u64,
    /// Datagrams in this recording.
    pub recorded: u64,
    /// What the kernel dropped because its receive buffer was full: datagrams, or with `UDP_GRO` trains of them.
    /// `null` where the system does not count them.
    pub dropped_by_kernel: KernelDrops,
    /// Datagrams that taxel dropped because its own queue was full.
    pub dropped_by_queue: u64,
    /// Whether datagrams came several a message (`UDP_GRO`), so that the kernel may have dropped several at once.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub several_a_message: bool,
    /// Whether the arrival of a datagram is when it was read from the socket, as the system does not state when it arrived.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub stamped_when_read: bool,
    /// Number of the other messages recorded, by channel.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub messages: BTreeMap<Topic, u64>,
    /// What the decoder could not use of the bytes received, by cause; see [`damage`](super::damage::damage).
    pub decoder: BTreeMap<String, u64>,
    /// Where times step back.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub steps_back: Vec<StepBack>,
    /// For version 2: datagrams that the board sent and that never arrived intact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<u64>,
}

/// How a recording ended, as the file states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FileEnding {
    /// As planned.
    Finished {
        /// Counts of what was received and lost.
        counts: RecordingCounts,
    },
    /// Stopped because writing failed, with the operating system's error.
    Stopped(String),
}

/// The parts of a damaged file that were skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Rebuilt {
    /// Whether the end of the file is missing: writing was killed, or the file was truncated.
    pub unfinished: bool,
    /// Number of bytes of an incomplete record at the end of the file.
    pub torn_bytes: u64,
    /// Number of bytes behind the end of a whole file.
    pub bytes_after_end: u64,
    /// Number of places where the walk met an invalid record and resynchronised.
    pub gaps: u64,
    /// Number of bytes skipped there.
    pub skipped_bytes: u64,
    /// Number of chunks that were skipped because the unpacked size that they state exceeds the limit.
    pub large_chunks: u64,
}

/// What a verdict is made from.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// The counts of what was received and lost.
    Counts(RecordingCounts),
    /// A recording of the live format.
    File(Box<Condition>),
    /// Raw bytes: the name of the missing `.lss`, and what the decoder could not use.
    Raw(Option<String>, BTreeMap<String, u64>),
    /// A kind of file that does not state what was lost.
    Silent(String),
    /// Several recordings or sources.
    Together(Vec<(String, Verdict)>),
    /// The sources of one file.
    Sources(Vec<(String, Verdict)>),
    /// The recording with this verdict, of which all times are later by so many us.
    Later(i64, Verdict),
}

/// One source of a file of the live format: how it ended, and what reading found.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Condition {
    /// How the recording ended.
    pub ending: Option<FileEnding>,
    /// Damage found at opening.
    pub rebuilt: Rebuilt,
    /// Number of chunks that could not be used.
    pub bad_chunks: u64,
    /// Number of messages that the file has lost, as far as they are known, by channel.
    pub lost: BTreeMap<Topic, u64>,
    /// Number of messages that the file holds a second time, as far as they are known.
    pub repeated: u64,
    /// Number of datagrams, lines or frames in the file.
    pub messages: u64,
    /// The last counts before the end.
    pub so_far: Option<RecordingCounts>,
    /// The verdict of the recording that this one was converted from, as the header states it.
    pub converted: Option<Box<Verdict>>,
    /// What decoding found, if the file was decoded.
    pub decoded: Option<DamageCounts>,
    /// Whether the source is one of numbers, or of frames of them.
    pub lines: bool,
    /// The board's time at which the recording begins, us.
    pub origin_us: i64,
}

impl RecordingCounts {
    /// The verdict: nothing lost after arrival, or what was lost where.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        Verdict::of_counts(self, NOTHING_LOST)
    }
}

impl Verdict {
    /// The verdict on what there is to know.
    #[must_use]
    pub fn new(basis: Basis) -> Self {
        match basis {
            Basis::Counts(counts) => Self::of_counts(&counts, NOTHING_LOST),
            Basis::File(condition) => Self::of_file(*condition),
            Basis::Raw(unmarked, damage) => Self::of_raw(unmarked, &damage),
            Basis::Silent(kind) => {
                let text = format!("losses unknown: the {kind} does not record them");
                Self { status: RecordingStatus::Unknown, text, ..Self::default() }
            }
            Basis::Together(parts) => Self::combine(parts),
            Basis::Sources(parts) => Self::of_sources(parts),
            Basis::Later(us, verdict) => verdict.shift_by(us),
        }
    }

    /// The verdict if nothing arrived at all.
    pub(crate) fn nothing_arrived(text: String) -> Self {
        Self { status: RecordingStatus::NothingArrived, text, ..Self::default() }
    }

    /// The verdict on a stream of numbers, or on frames of them.
    pub(crate) fn of_lines(counts: &RecordingCounts) -> Self {
        Self::of_counts(counts, NO_LINE_LOST)
    }

    /// The verdict on counts; `nothing_lost` is the line if they show no loss and do not count what was sent.
    pub(crate) fn of_counts(counts: &RecordingCounts, nothing_lost: &str) -> Self {
        let of_board = |cause: &str| counts.decoder.get(cause).copied().unwrap_or(0);
        let dropped = [
            (counts.dropped_by_kernel.known(), "dropped_by_kernel", "messages dropped by the kernel"),
            (counts.dropped_by_queue, "dropped_by_queue", "datagrams dropped by taxel's queue"),
            (
                counts.received.saturating_sub(counts.dropped_by_queue + counts.recorded),
                "not_recorded",
                "datagrams received but not recorded",
            ),
            (of_board(IN_NO_LINE), IN_NO_LINE, "bytes in no line of numbers"),
        ];
        // The board's numbers also skip what was dropped after it was sent, which is counted above.
        let not_sent = ["not_recorded", IN_NO_LINE];
        let behind: u64 = dropped.iter().filter(|(_, cause, _)| !not_sent.contains(cause)).map(|(n, ..)| n).sum();
        let missing = counts.missing.unwrap_or(0);
        // Which of them were dropped is not known where more was dropped than is missing (datagrams that came again, or came
        // after the last number), or more datagrams than messages.
        let several = counts.several_a_message && counts.dropped_by_kernel.known() > 0 && missing > behind;
        let unclear = missing.min(behind) > 0 && (several || missing < behind || of_board(REPEATED) > 0);
        let counted_by_kernel = counts.dropped_by_kernel.are_known();
        let board = [
            (of_board(BOARD_DROPPED), "dropped_by_board", "times that the board dropped events"),
            (of_board(EVENTS_DROPPED), EVENTS_DROPPED, "events that the board itself counted as dropped"),
        ];
        let way = if !counted_by_kernel && missing > behind {
            (
                missing - behind,
                "lost_on_the_way_or_dropped",
                "datagrams lost or damaged on the way, or dropped and not counted by a kernel",
            )
        } else if unclear {
            (
                missing,
                "lost_on_the_way_or_dropped",
                "datagrams lost or damaged on the way, or already counted as dropped",
            )
        } else {
            (missing.saturating_sub(behind), "lost_on_the_way", "datagrams lost or damaged on the way")
        };
        let mut verdict = Self::default();
        let mut words = vec![];
        for (n, cause, text) in board.into_iter().chain(dropped).chain([way]).filter(|(n, ..)| *n > 0) {
            verdict.lost.insert(cause.to_owned(), n);
            words.push(numbered(n, text));
        }
        if words.is_empty() && counts.missing.is_none() && counts.received + counts.recorded == 0 {
            let unfinished = of_board(UNFINISHED_LINES);
            if unfinished > 0 {
                let text = format!("nothing arrived; {}", numbered(unfinished, OF_UNFINISHED_LINES));
                let noted = [(UNFINISHED_LINES.to_owned(), unfinished)].into();
                return Self { noted, ..Self::nothing_arrived(text) };
            }
            return Self::nothing_arrived("nothing arrived".to_owned());
        }
        // After a reset the board's numbers begin anew: what was lost just before or after it they do not show.
        let knows = counts.missing.is_some() && of_board(BOARD_RESET) == 0;
        verdict.status = match (&words[..], knows) {
            ([], true) => RecordingStatus::Complete,
            ([], false) if !counted_by_kernel => RecordingStatus::Unknown,
            ([], false) => RecordingStatus::CompleteAfterArrival,
            _ => RecordingStatus::Lost,
        };
        let hidden = counts.missing.is_some() && !knows;
        let mut pieces = vec![if !words.is_empty() {
            let but = match (hidden, knows || counted_by_kernel) {
                (true, true) => ", and losses at resets are unknown",
                (true, false) => ", and losses at resets and in the kernel are unknown",
                (false, true) => "",
                (false, false) => ", and losses in the kernel are unknown",
            };
            format!("LOST: {}{but}", words.join(", "))
        } else if knows && of_board(OTHER_BOARD) > 0 {
            "nothing lost except datagrams of another board".to_owned()
        } else if knows {
            "nothing lost".to_owned()
        } else if hidden && counted_by_kernel {
            "nothing lost, but losses at resets are unknown".to_owned()
        } else if hidden {
            "nothing lost, but losses at resets and in the kernel are unknown".to_owned()
        } else if !counted_by_kernel {
            UNCOUNTED.to_owned()
        } else {
            nothing_lost.to_owned()
        }];
        pieces.extend(verdict.damage_of(&counts.decoder));
        for (n, cause, text) in [
            (of_board(REPAIRED), REPAIRED, "values repaired from the board's refresh"),
            (of_board(BOARD_RESET), BOARD_RESET, "resets of the board"),
            (of_board(ANEW), ANEW, "restarts of its clock"),
            (of_board(MISSING), MISSING, "missing values"),
            (of_board(OVERTAKEN), OVERTAKEN, "events overtaken by later ones"),
            (of_board(UNFINISHED_LINES), UNFINISHED_LINES, OF_UNFINISHED_LINES),
            (of_board(ADDRESS), ADDRESS, "changes of the sender's address"),
        ] {
            if n > 0 {
                verdict.noted.insert(cause.to_owned(), n);
                pieces.push(numbered(n, text));
            }
        }
        let (silences, silent_ms) = (of_board(SILENCES), of_board(SILENT_MS));
        if silences > 0 {
            verdict
                .noted
                .extend([(SILENCES, silences), (SILENT_MS, silent_ms)].map(|(cause, n)| (cause.to_owned(), n)));
            let tenths = silent_ms.div_ceil(100);
            let times = counted(silences, "time");
            let all = format!("{}.{} s in all", tenths / 10, tenths % 10);
            pieces.push(format!("no frame arrived for a second or more: {times}, {all}"));
        }
        verdict.text = pieces.join("; ");
        verdict.with_steps(counts.steps_back.clone())
    }

    /// The verdict where times also step back there.
    pub(crate) fn with_steps(mut self, steps: Vec<StepBack>) -> Self {
        if !steps.is_empty() {
            self.change(|verdict| verdict.steps_back.extend(steps));
        }
        self
    }

    /// Adds what a decoder could not use; returns its line.
    fn damage_of(&mut self, decoder: &BTreeMap<String, u64>) -> Option<String> {
        let no_damage = [
            BOARD_DROPPED,
            EVENTS_DROPPED,
            BOARD_RESET,
            REPAIRED,
            ANEW,
            MISSING,
            ADDRESS,
            OVERTAKEN,
            IN_NO_LINE,
            UNFINISHED_LINES,
            SILENCES,
            SILENT_MS,
        ];
        let found = || decoder.iter().filter(|(cause, n)| **n > 0 && !no_damage.contains(&cause.as_str()));
        for (cause, n) in found() {
            // Version 2 decodes each datagram once.
            let counts = if cause == REPEATED { &mut self.noted } else { &mut self.damaged };
            counts.insert(cause.clone(), *n);
        }
        if !self.damaged.is_empty() {
            self.status = self.status.max(RecordingStatus::Damaged);
        }
        let words: Vec<String> = found().map(|(cause, n)| numbered(*n, &cause.replace('_', " "))).collect();
        (!words.is_empty()).then(|| format!("in the bytes that arrived: {}", words.join(", ")))
    }

    /// The verdict where times after this one are doubtful too, if any, us.
    pub(crate) fn doubtful(mut self, after: Option<i64>) -> Self {
        if after.is_some() {
            self.status = self.status.max(RecordingStatus::Damaged);
            self.change(|verdict| verdict.doubtful_after_us = verdict.doubtful_after_us.into_iter().chain(after).min());
        }
        self
    }

    /// The verdict on raw bytes.
    fn of_raw(unmarked: Option<String>, damage: &BTreeMap<String, u64>) -> Self {
        let mut verdict = Self { status: RecordingStatus::Unknown, ..Self::default() };
        let damage = verdict.damage_of(damage);
        if unmarked.is_some() {
            verdict.status = verdict.status.max(RecordingStatus::Unfinished);
        }
        let unmarked = unmarked.map(|name| format!("not finished: {name} is missing"));
        let silent = "losses unknown: the .lsa does not record them".to_owned();
        verdict.text = unmarked.into_iter().chain([silent]).chain(damage).collect::<Vec<_>>().join("; ");
        verdict
    }

    /// The verdict on several recordings or sources: the worst status, and the sums of their numbers.
    ///
    /// Equal verdicts without numbers are one.
    pub(crate) fn combine(parts: Vec<(String, Self)>) -> Self {
        Self::combine_with(parts, |_, sum, n| sum + n)
    }

    /// As [`Self::combine`], of the sources of one file, whose damage each of them has: it counts once.
    fn of_sources(parts: Vec<(String, Self)>) -> Self {
        Self::combine_with(parts, |cause, sum, n| if OF_THE_FILE.contains(&cause) { sum.max(n) } else { sum + n })
    }

    fn combine_with(parts: Vec<(String, Self)>, add: impl Fn(&str, u64, u64) -> u64) -> Self {
        let numbers = |part: &Self| !(part.lost.is_empty() && part.damaged.is_empty() && part.noted.is_empty());
        if let [(_, first), others @ ..] = &parts[..]
            && (others.is_empty() || (others.iter().all(|(_, part)| part == first) && !numbers(first)))
        {
            return first.clone();
        }
        let mut combined = Self { status: RecordingStatus::Complete, ..Self::default() };
        let mut named: Vec<(String, Self)> = vec![];
        for (name, part) in parts {
            combined.status = combined.status.max(part.status);
            for (sums, counts) in [
                (&mut combined.lost, &part.lost),
                (&mut combined.damaged, &part.damaged),
                (&mut combined.noted, &part.noted),
            ] {
                for (cause, n) in counts {
                    let sum = sums.entry(cause.clone()).or_default();
                    *sum = add(cause, *sum, *n);
                }
            }
            let taken = |name: &str| named.iter().any(|(known, _)| known == name);
            let unique = (2..).map(|k| format!("{name} ({k})")).find(|name| !taken(name));
            let name = if taken(&name) { unique.unwrap_or_default() } else { name };
            named.push((name, part));
        }
        combined.change(|verdict| {
            // The earliest of those that there are.
            verdict.doubtful_after_us = named.iter().filter_map(|(_, part)| part.doubtful_after_us).min();
            verdict.steps_back = named.iter().flat_map(|(_, part)| part.steps_back.clone()).collect();
            verdict.parts = named;
        });
        combined
    }

    /// The verdict on the recording whose times are later by so many us.
    fn shift_by(mut self, us: i64) -> Self {
        if us != 0 && (self.doubtful_after_us.is_some() || !self.steps_back.is_empty()) {
            self.change(|verdict| {
                verdict.steps_back.iter_mut().for_each(|step| step.after_us = step.after_us.saturating_add(us));
                verdict.parts.iter_mut().for_each(|(_, part)| *part = std::mem::take(part).shift_by(us));
                verdict.doubtful_after_us = verdict.doubtful_after_us.map(|after| after.saturating_add(us));
            });
        }
        self
    }

    /// Changes the parts, the steps back and the time after which times are doubtful, and what the text says of them.
    fn change(&mut self, change: impl FnOnce(&mut Self)) {
        let before = self.text.strip_suffix(&self.end()).unwrap_or(&self.text).trim_end_matches("; ").to_owned();
        change(self);
        let between = if before.is_empty() || before.ends_with(": ") { "" } else { "; " };
        self.text = format!("{before}{between}{}", self.end());
    }

    /// What the text ends with: the texts of all parts, and the steps back and the time after which times are doubtful unless a
    /// part says them.
    fn end(&self) -> String {
        let stated = self.parts.iter().filter_map(|(_, part)| part.doubtful_after_us).min();
        let doubtful = self.doubtful_after_us.filter(|_| self.doubtful_after_us != stated);
        let parts = self.parts.iter().map(|(name, part)| format!("{name}: {}", part.text));
        let all = self.parts.is_empty() && self.damaged.contains_key(JUMPED_BEFORE);
        let doubt = doubtful.map(|after| match all {
            true => "all times are doubtful".to_owned(),
            false => format!("times after {after} us are doubtful"),
        });
        let largest = self.steps_back.iter().rev().max_by_key(|step| step.by_us).filter(|_| self.parts.is_empty());
        let back = largest.map(|StepBack { after_us, by_us, .. }| {
            let times = counted(self.steps_back.len() as u64, "time");
            format!("times step back {times} (the largest step: {by_us} us, after the time {after_us} us)")
        });
        parts.chain(back).chain(doubt).collect::<Vec<_>>().join("; ")
    }
}

/// A number and what it counts, in the plural unless it is 1.
fn counted(n: u64, noun: &str) -> String {
    numbered(n, &format!("{noun}s"))
}

/// A number and what it counts, which is given in the plural: of 1 the first word that ends in s, its noun, is in the singular.
fn numbered(n: u64, plural: &str) -> String {
    let noun = plural.split(' ').find(|word| n == 1 && word.ends_with('s')).unwrap_or_default();
    let singular = noun.strip_suffix("ies").map(|stem| format!("{stem}y"));
    format!("{n} {}", plural.replacen(noun, &singular.unwrap_or(noun.trim_end_matches('s').to_owned()), 1))
}

/// What the text says of the bytes of lines that have no end or no beginning.
const OF_UNFINISHED_LINES: &str = "bytes of unfinished lines";
/// The jumps of time before a recording that began while its board was received: all times since are doubtful.
pub(crate) const JUMPED_BEFORE: &str = "jumps_of_time_before_it";
/// Damage that is of a file as a whole, and that each of its sources has.
const OF_THE_FILE: [&str; 5] = ["bad_chunks", "large_chunks", "skipped_bytes", "torn_bytes", "bytes_after_end"];
