//! The verdict on a source of a file: how it ended, what reading it found, and what its counts say.

use std::collections::BTreeMap;

use super::{
    Condition, DamageCounts, FileEnding, JUMPED_BEFORE, NO_LINE_LOST, NOTHING_LOST, RecordingCounts, RecordingStatus,
    Verdict, counted,
};
use crate::recording::damage::{BACK, DRIFTS, JUMPS};

impl RecordingCounts {
    /// What the decoder could not use, by cause, with what reading the file found.
    fn decoder_with(&self, found: &BTreeMap<String, u64>) -> BTreeMap<String, u64> {
        let mut all = self.decoder.clone();
        for (cause, n) in found {
            let known = all.entry(cause.clone()).or_default();
            *known = (*known).max(*n);
        }
        all
    }
}

impl Verdict {
    /// The verdict on a source of a file.
    pub(super) fn of_file(condition: Condition) -> Self {
        let Condition { ending, rebuilt, bad_chunks, mut lost, repeated, messages, .. } = condition;
        let Condition { so_far, converted, decoded, lines, origin_us, .. } = condition;
        let is_converted = converted.is_some();
        let converted = converted.map(|verdict| *verdict);
        let nothing_lost = if lines { NO_LINE_LOST } else { NOTHING_LOST };
        let mut decoded = decoded.unwrap_or_default();
        let skipped = rebuilt.gaps + bad_chunks + rebuilt.large_chunks > 0;
        let mut no_counts = false;
        let (mut verdict, why) = match ending {
            Some(FileEnding::Finished { counts }) => {
                (converted.unwrap_or_else(|| Self::of_counts(&counts, nothing_lost)), None)
            }
            ending => {
                let why = match ending {
                    Some(FileEnding::Stopped(why)) => {
                        format!("stopped by an error ({why}): the end of the recording is missing")
                    }
                    _ => "not finished: the end of the recording is missing".to_owned(),
                };
                let counts = so_far.filter(|counts| counts.received > 0 || counts.decoder.values().any(|n| *n > 0));
                no_counts = counts.is_none() && converted.is_none();
                // The file may hold more than its counts, which are saved now and then; where parts were skipped,
                // decoding finds faults that never came.
                let counts =
                    counts.unwrap_or_else(|| RecordingCounts { recorded: messages, ..RecordingCounts::default() });
                let found = if skipped { DamageCounts::default() } else { decoded.clone() };
                let counted = || Self::of_counts(&counts_with(counts, found), nothing_lost);
                (converted.unwrap_or_else(counted), Some(why))
            }
        };
        let came_short = !verdict.lost.is_empty();
        // What was skipped held something; only final counts say how much.
        let unknown = skipped && why.is_some();
        if verdict.damaged.contains_key(JUMPED_BEFORE) && !is_converted {
            decoded.doubtful_after_us = Some(origin_us - 1);
        }
        let mut bad = vec![];
        for (n, cause, text) in [
            (
                rebuilt.large_chunks,
                "large_chunks",
                format!(
                    "{} skipped, because the stated unpacked size is above 64 MiB",
                    counted(rebuilt.large_chunks, "chunk")
                ),
            ),
            (bad_chunks, "bad_chunks", format!("{} skipped", counted(bad_chunks, "bad chunk"))),
            (
                rebuilt.skipped_bytes,
                "skipped_bytes",
                format!(
                    "{} of the file skipped in {}",
                    counted(rebuilt.skipped_bytes, "byte"),
                    counted(rebuilt.gaps, "place")
                ),
            ),
            (rebuilt.torn_bytes, "torn_bytes", format!("{} at the end", counted(rebuilt.torn_bytes, "torn byte"))),
            (
                rebuilt.bytes_after_end,
                "bytes_after_end",
                format!("{} after the end of the recording not read", counted(rebuilt.bytes_after_end, "byte")),
            ),
            (repeated, "repeated_in_file", format!("{} repeated", counted(repeated, "message"))),
        ] {
            if n > 0 {
                // What it was converted from may have been damaged too.
                *verdict.damaged.entry(cause.to_owned()).or_default() += n;
                bad.push(text);
            }
        }
        lost.retain(|_, n| *n > 0);
        for (topic, n) in &lost {
            if let Some((cause, noun)) = topic.lost_in_file() {
                *verdict.lost.entry(cause.to_owned()).or_default() += *n;
                bad.push(format!("{} lost", counted(*n, noun)));
            }
        }
        let lost_here = unknown || !lost.is_empty();
        if unknown {
            bad.push("what else was lost there is unknown".to_owned());
        }
        if (why.is_some() || lost_here) && verdict.status == RecordingStatus::NothingArrived {
            // It may have come after what is left of the file, or is lost there.
            verdict.status = RecordingStatus::Complete;
        }
        if !bad.is_empty() {
            verdict.status = verdict.status.max(RecordingStatus::Damaged);
        }
        if why.is_some() || rebuilt.torn_bytes > 0 {
            verdict.status = verdict.status.max(RecordingStatus::Unfinished);
        }
        if lost_here {
            verdict.status = verdict.status.max(RecordingStatus::Lost);
        }
        let damage = if lost_here { "LOST" } else { "damage" };
        let damaged_file = (!bad.is_empty()).then(|| format!("{damage} in the file: {}", bad.join(", ")));
        let before = match (&why, &damaged_file) {
            (Some(_), _) => "until then: ",
            (None, Some(_)) => "while recording: ",
            (None, None) => "",
        };
        let mut pieces: Vec<String> = why.into_iter().chain(damaged_file).collect();
        if no_counts {
            pieces.push(format!("{before}no counts were saved yet"));
            // That nothing was lost is not known then.
            let known = verdict.text.split_once("; ").map(|(_, damage)| damage);
            pieces.extend(if came_short { Some(&*verdict.text) } else { known }.map(str::to_owned));
        } else {
            pieces.push(format!("{before}{}", verdict.text));
        }
        verdict.text = pieces.join("; ");
        if decoded.doubtful_after_us.is_some() {
            for (cause, n) in
                decoded.damage.iter().filter(|(cause, n)| [JUMPS, BACK, DRIFTS].contains(&&***cause) && **n > 0)
            {
                verdict.damaged.entry(cause.clone()).or_insert(*n);
            }
        }
        if verdict.steps_back.is_empty() && !is_converted {
            verdict = verdict.with_steps(decoded.steps_back);
        }
        verdict.doubtful(decoded.doubtful_after_us)
    }
}

/// The last counts of an unfinished recording, with what decoding found since.
fn counts_with(mut counts: RecordingCounts, found: DamageCounts) -> RecordingCounts {
    // If more was received than the file holds, the difference is in its unfinished end.
    counts.received = 0;
    counts.decoder = counts.decoder_with(&found.damage);
    if !found.steps_back.is_empty() {
        counts.steps_back = found.steps_back;
    }
    // What was missing when they were saved may have come since, overtaken. What was dropped after its arrival is missing
    // among the board's numbers too.
    let knows = counts.missing.is_some() && !found.unnumbered;
    counts.missing = found.missing.or(counts.missing).filter(|n| knows || *n > 0);
    counts
}
