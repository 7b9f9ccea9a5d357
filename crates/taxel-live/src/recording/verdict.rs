//! The verdict of a recording: what was lost or damaged at which stage, as a status, as numbers by cause and as one line.
//!
//! All wordings of verdicts are made here and in the table of causes; `docs/outputs.md` and `taxel.Verdict` list them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use taxel_core::wire::{SenderDecoder, StepBack};

use super::causes::{Cause, CauseKind, Counts};
use super::topic::Topic;
use crate::kernel_drops::KernelDrops;

/// The wording of version 1 when nothing was dropped between the socket and the file.
pub const NOTHING_LOST: &str = "nothing lost after arrival (version 1 of the wire cannot show losses before arrival)";
/// The same for frames of numbers.
const NO_LINE_LOST: &str = "nothing lost after arrival (lines are not numbered, so losses before arrival are unknown)";

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
#[serde(default)]
pub struct Verdict {
    /// How much is there.
    pub status: RecordingStatus,
    /// Why what came last is missing, if it is.
    pub ended: Option<String>,
    /// What is known where no loss is.
    pub known: String,
    /// Whether more may be lost than was counted.
    pub at_least: bool,
    /// What happened, by cause.
    #[serde(flatten, with = "by_kind")]
    pub counts: Counts,
    /// The board's time after which times are doubtful, us.
    pub doubtful_after_us: Option<i64>,
    /// Where times step back, in the order of arrival; of many the largest steps.
    pub steps_back: Vec<StepBack>,
    /// The verdicts of the recordings or sources that this one is made of, by name.
    pub parts: Vec<(String, Verdict)>,
}

/// The counts of a verdict in JSON: what was lost, damaged and noted apart.
mod by_kind {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::{CauseKind, Counts};

    #[derive(Default, Serialize, Deserialize)]
    #[serde(default)]
    struct ByKind {
        lost: Counts,
        damaged: Counts,
        noted: Counts,
    }

    pub(super) fn serialize<S: Serializer>(counts: &Counts, to: S) -> Result<S::Ok, S::Error> {
        let lost = counts.of_kinds(&[CauseKind::Lost]);
        let damaged = counts.of_kinds(&[CauseKind::Damaged, CauseKind::File]);
        let noted = counts.of_kinds(&[CauseKind::Noted]);
        ByKind { lost, damaged, noted }.serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Counts, D::Error> {
        let ByKind { mut lost, damaged, noted } = ByKind::deserialize(from)?;
        lost.extend(damaged.iter().chain(noted.iter()));
        Ok(lost)
    }
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
    /// Whether the arrival of a datagram is when it was read from the socket, as the system does not state when it arrived.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub stamped_when_read: bool,
    /// Number of the other messages recorded, by channel.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub messages: BTreeMap<Topic, u64>,
    /// What the decoder could not use of the bytes received.
    pub decoder: Counts,
    /// Where times step back.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub steps_back: Vec<StepBack>,
    /// Of frames of numbers: the time after which times are doubtful, us.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doubtful_after_us: Option<i64>,
    /// For version 2: datagrams that the board sent and that never arrived intact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<u64>,
}

/// What decoding a file found.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Found {
    /// What the decoder could not use.
    pub counts: Counts,
    /// For version 2: sequence numbers that are missing.
    pub missing: Option<u64>,
    /// Whether some of it was of version 1, which numbers nothing.
    pub unnumbered: bool,
    /// The time after which times are doubtful, us.
    pub doubtful_after_us: Option<i64>,
    /// Where times step back.
    pub steps_back: Vec<StepBack>,
}

/// How a recording ended, as the file states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FileEnding {
    /// As planned.
    Finished {
        /// Counts of what was received and lost.
        counts: Box<RecordingCounts>,
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
    Raw(Option<String>, Counts),
    /// A kind of file that does not state what was lost.
    Silent(String),
    /// Several recordings.
    Together(Vec<(String, Verdict)>),
    /// The sources of one file, whose damage each of them has.
    Sources(Vec<(String, Verdict)>),
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
    /// Messages that the file has lost, or holds a second time, as far as they are known.
    pub in_file: Counts,
    /// Number of datagrams, lines or frames in the file.
    pub messages: u64,
    /// The last counts before the end.
    pub so_far: Option<RecordingCounts>,
    /// The verdict of the recording that this one was converted from, as the header states it.
    pub converted: Option<Box<Verdict>>,
    /// What decoding found, if the file was decoded.
    pub decoded: Option<Found>,
    /// Whether the source is one of frames of numbers.
    pub lines: bool,
    /// The board's time at which the recording begins, us.
    pub origin_us: i64,
}

impl Found {
    /// What a decoder found; `origin_us` is added to its times.
    #[must_use]
    pub fn of_sender(sender: &SenderDecoder, origin_us: i64) -> Self {
        let two = sender.version_2().counts();
        let steps = sender.steps_back().iter();
        Self {
            counts: Counts::of_decoders(sender.counts(), &two, sender.totals()),
            missing: (two.datagrams > 0).then_some(two.missing),
            unnumbered: sender.counts().bytes > 0,
            doubtful_after_us: sender.totals().doubtful_after.map(|t| t + origin_us),
            steps_back: steps.map(|step| StepBack { after_us: step.after_us + origin_us, ..*step }).collect(),
        }
    }
}

impl RecordingCounts {
    /// The verdict: nothing lost after arrival, or what was lost where.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        Verdict::of_counts(self, NOTHING_LOST)
    }

    /// The last counts of an unfinished recording, with what decoding found since.
    fn with(mut self, found: &Found) -> Self {
        // If more was received than the file holds, the difference is in its unfinished end.
        self.received = 0;
        self.decoder = self.decoder.max(&found.counts);
        if !found.steps_back.is_empty() {
            self.steps_back.clone_from(&found.steps_back);
        }
        // What was missing when they were saved may have come since, overtaken.
        let knows = self.missing.is_some() && !found.unnumbered;
        self.missing = found.missing.or(self.missing).filter(|n| knows || *n > 0);
        self
    }
}

impl Verdict {
    /// The verdict on what there is to know.
    #[must_use]
    pub fn new(basis: Basis) -> Self {
        match basis {
            Basis::Counts(counts) => counts.verdict(),
            Basis::File(condition) => Self::of_file(*condition),
            Basis::Raw(unmarked, counts) => {
                let mut verdict = Self::silent(".lsa").with(counts.iter());
                verdict.ended = unmarked.map(|name| format!("not finished: {name} is missing"));
                if verdict.ended.is_some() {
                    verdict.at_worst(RecordingStatus::Unfinished);
                }
                verdict
            }
            Basis::Silent(kind) => Self::silent(&kind),
            Basis::Together(parts) => Self::combine(parts),
            Basis::Sources(parts) => Self::combine_with(parts, true),
        }
    }

    /// The verdict on a kind of file that does not state what was lost.
    fn silent(kind: &str) -> Self {
        Self { known: format!("losses unknown: the {kind} does not record them"), ..Self::default() }
    }

    /// The verdict if nothing arrived at all.
    pub(crate) fn nothing_arrived(known: String) -> Self {
        Self { status: RecordingStatus::NothingArrived, known, ..Self::default() }
    }

    /// The verdict on frames of numbers.
    pub(crate) fn of_lines(counts: &RecordingCounts) -> Self {
        Self::of_counts(counts, NO_LINE_LOST)
    }

    /// The verdict on counts; `unnumbered` is what is known if they show no loss and do not count what was sent.
    fn of_counts(counts: &RecordingCounts, unnumbered: &str) -> Self {
        let dropped = counts.dropped_by_kernel.known() + counts.dropped_by_queue;
        let happened = counts.decoder.iter().chain([
            (Cause::KernelDropped, counts.dropped_by_kernel.known()),
            (Cause::QueueDropped, counts.dropped_by_queue),
            (Cause::NotRecorded, counts.received.saturating_sub(counts.dropped_by_queue + counts.recorded)),
            // The board's numbers also lack what was dropped after it was sent.
            (Cause::OnTheWay, counts.missing.unwrap_or(0).saturating_sub(dropped)),
        ]);
        let nothing = counts.missing.is_none() && counts.received + counts.recorded == 0;
        let at_resets = counts.missing.is_some() && counts.decoder[Cause::Resets] > 0;
        let knows = counts.missing.is_some() && !at_resets;
        let in_kernel = !knows && !counts.dropped_by_kernel.are_known();
        let (status, known) = match (knows, in_kernel) {
            _ if nothing => (RecordingStatus::NothingArrived, "nothing arrived"),
            (true, _) if counts.decoder[Cause::OtherBoard] > 0 => {
                (RecordingStatus::Complete, "nothing lost except datagrams of another board")
            }
            (true, _) => (RecordingStatus::Complete, "nothing lost"),
            (_, true) if at_resets => {
                (RecordingStatus::Unknown, "nothing lost, but losses at resets and in the kernel are unknown")
            }
            (_, true) => (RecordingStatus::Unknown, "losses unknown: the kernel does not count dropped datagrams"),
            // After a reset the board's numbers begin anew: what was lost just before or after it they do not show.
            _ if at_resets => (RecordingStatus::CompleteAfterArrival, "nothing lost, but losses at resets are unknown"),
            _ => (RecordingStatus::CompleteAfterArrival, unnumbered),
        };
        let verdict = Self {
            status,
            known: known.to_owned(),
            at_least: at_resets || in_kernel,
            steps_back: counts.steps_back.clone(),
            ..Self::default()
        };
        verdict.with(happened).doubtful(counts.doubtful_after_us)
    }

    /// The verdict on a source of a file: how it ended, what reading it found, and what its counts say.
    fn of_file(condition: Condition) -> Self {
        let Condition { ending, rebuilt, bad_chunks, in_file, messages, .. } = condition;
        let Condition { so_far, converted, decoded, lines, origin_us, .. } = condition;
        let is_converted = converted.is_some();
        let mut decoded = decoded.unwrap_or_default();
        let skipped = rebuilt.gaps + bad_chunks + rebuilt.large_chunks > 0;
        let unnumbered = if lines { NO_LINE_LOST } else { NOTHING_LOST };
        let ended = match &ending {
            Some(FileEnding::Finished { .. }) => None,
            Some(FileEnding::Stopped(why)) => {
                Some(format!("stopped by an error ({why}): the end of the recording is missing"))
            }
            None => Some("not finished: the end of the recording is missing".to_owned()),
        };
        let counted = match ending {
            Some(FileEnding::Finished { counts }) => Some(*counts),
            // The file may hold more than its counts, which are saved now and then; where parts were skipped, decoding
            // finds faults that never came.
            _ => so_far
                .filter(|counts| counts.received > 0 || counts.decoder.iter().next().is_some())
                .map(|counts| counts.with(&if skipped { Found::default() } else { decoded.clone() })),
        };
        let mut verdict = match (converted, counted) {
            (Some(verdict), _) => *verdict,
            (None, Some(counts)) => Self::of_counts(&counts, unnumbered),
            (None, None) => {
                let counts = RecordingCounts { recorded: messages, ..RecordingCounts::default() };
                let found = if skipped { Found::default() } else { decoded.clone() };
                let known = "no counts were saved yet".to_owned();
                Self { known, ..Self::of_counts(&counts.with(&found), unnumbered) }
            }
        };
        if verdict.counts[Cause::JumpedBefore] > 0 && !is_converted {
            decoded.doubtful_after_us = Some(origin_us - 1);
        }
        let lost_here = in_file.iter().any(|(cause, _)| cause.kind() == CauseKind::Lost);
        if (ended.is_some() || lost_here) && verdict.status == RecordingStatus::NothingArrived {
            // It may have come after what is left of the file, or is lost there.
            verdict.status = RecordingStatus::Complete;
        }
        let of_file = [
            (Cause::LargeChunks, rebuilt.large_chunks),
            (Cause::BadChunks, bad_chunks),
            (Cause::SkippedBytes, rebuilt.skipped_bytes),
            (Cause::TornBytes, rebuilt.torn_bytes),
            (Cause::BytesAfterEnd, rebuilt.bytes_after_end),
        ];
        // What it was converted from may have been damaged too.
        verdict = verdict.with(of_file.into_iter().chain(in_file.iter()));
        if ended.is_some() || rebuilt.torn_bytes > 0 {
            verdict.at_worst(RecordingStatus::Unfinished);
        }
        if skipped && ended.is_some() {
            // What was skipped held something; only final counts say how much.
            verdict.at_least = true;
            "what was lost in the parts of the file that were skipped is unknown".clone_into(&mut verdict.known);
            verdict.at_worst(RecordingStatus::Lost);
        }
        if ended.is_some() {
            verdict.ended = ended;
        }
        if decoded.doubtful_after_us.is_some() {
            for cause in [Cause::Jumps, Cause::StampsBack, Cause::Drifts] {
                verdict.counts[cause] = verdict.counts[cause].max(decoded.counts[cause]);
            }
        }
        if verdict.steps_back.is_empty() && !is_converted {
            verdict.steps_back = decoded.steps_back;
        }
        verdict.doubtful(decoded.doubtful_after_us)
    }

    /// Adds what happened, and makes the status as bad as that.
    fn with(mut self, happened: impl IntoIterator<Item = (Cause, u64)>) -> Self {
        for (cause, n) in happened.into_iter().filter(|(_, n)| *n > 0) {
            self.counts[cause] += n;
            match cause.kind() {
                CauseKind::Lost => self.at_worst(RecordingStatus::Lost),
                CauseKind::Damaged | CauseKind::File => self.at_worst(RecordingStatus::Damaged),
                CauseKind::Noted | CauseKind::Live => {}
            }
        }
        self
    }

    /// Makes the status at least as bad as this one.
    fn at_worst(&mut self, status: RecordingStatus) {
        self.status = self.status.max(status);
    }

    /// The verdict where times after this one are doubtful too, if any, us.
    pub(crate) fn doubtful(mut self, after: Option<i64>) -> Self {
        if after.is_some() {
            self.at_worst(RecordingStatus::Damaged);
            self.doubtful_after_us = self.doubtful_after_us.into_iter().chain(after).min();
        }
        self
    }

    /// The verdict on several recordings or sources: the worst status, and the sums of their numbers.
    ///
    /// Equal verdicts without numbers are one.
    pub(crate) fn combine(parts: Vec<(String, Self)>) -> Self {
        Self::combine_with(parts, false)
    }

    fn combine_with(parts: Vec<(String, Self)>, of_one_file: bool) -> Self {
        if let [(_, first), others @ ..] = &parts[..]
            && (others.is_empty()
                || (others.iter().all(|(_, part)| part == first) && first.counts.iter().next().is_none()))
        {
            return first.clone();
        }
        let mut combined = Self { status: RecordingStatus::Complete, ..Self::default() };
        for (name, part) in parts {
            combined.at_worst(part.status);
            for (cause, n) in part.counts.iter() {
                let sum = &mut combined.counts[cause];
                *sum = if of_one_file && cause.kind() == CauseKind::File { n.max(*sum) } else { *sum + n };
            }
            combined.doubtful_after_us = combined.doubtful_after_us.into_iter().chain(part.doubtful_after_us).min();
            combined.steps_back.extend_from_slice(&part.steps_back);
            let taken = |name: &str| combined.parts.iter().any(|(known, _)| known == name);
            let unique = (2..).map(|k| format!("{name} ({k})")).find(|name| !taken(name));
            let name = if taken(&name) { unique.unwrap_or_default() } else { name };
            combined.parts.push((name, part));
        }
        combined
    }

    /// All of it in one line.
    #[must_use]
    pub fn text(&self) -> String {
        let mut said: Vec<String> = self.ended.iter().cloned().collect();
        match self.counts.words(&[CauseKind::Lost]) {
            // Each part says its own.
            _ if !self.parts.is_empty() => {}
            Some(lost) if self.at_least => said.push(format!("LOST, at least: {lost}")),
            Some(lost) => said.push(format!("LOST: {lost}")),
            None => said.push(self.known.clone()),
        }
        if self.parts.is_empty() {
            let damaged = self.counts.words(&[CauseKind::Damaged, CauseKind::File]);
            said.extend(damaged.map(|damaged| format!("damaged: {damaged}")));
            said.extend(self.counts.words(&[CauseKind::Noted]));
            if let Some(StepBack { after_us, by_us, .. }) = self.steps_back.iter().rev().max_by_key(|step| step.by_us) {
                let times = self.steps_back.len();
                let plural = if times == 1 { "" } else { "s" };
                let largest = format!("the largest step: {by_us} us, after the time {after_us} us");
                said.push(format!("times step back {times} time{plural} ({largest})"));
            }
        }
        said.extend(self.parts.iter().map(|(name, part)| format!("{name}: {}", part.text())));
        let stated = self.parts.iter().filter_map(|(_, part)| part.doubtful_after_us).min();
        match self.doubtful_after_us.filter(|_| self.doubtful_after_us != stated) {
            Some(_) if self.parts.is_empty() && self.counts[Cause::JumpedBefore] > 0 => {
                said.push("all times are doubtful".to_owned());
            }
            Some(after) => said.push(format!("times after {after} us are doubtful")),
            None => {}
        }
        said.join("; ")
    }
}
