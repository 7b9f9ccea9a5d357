//! The summary at the end of a file: how many messages each channel has, under a checksum of its own.

use std::collections::BTreeMap;
use std::fs::File;

use mcap::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::read_at::read_exact_at;
use crate::recording::limits;
use crate::recording::metadata::END;

/// What an undamaged summary states.
#[derive(Debug, Clone, Default)]
pub(super) struct FileSummary {
    /// Number of messages of each channel, by its name; none if the file has no statistics.
    pub(super) messages: Option<BTreeMap<String, u64>>,
    /// Whether the file had the record that ends a recording.
    pub(super) finished: bool,
    /// Where the file ends by what it states.
    pub(super) end: u64,
}

impl FileSummary {
    /// Reads what follows the data, from their end at byte `at` on; none if any of it is missing or damaged.
    pub(super) fn read(file: &File, mut at: u64, length: u64) -> Option<Self> {
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_emit_chunks(true)
            .with_validate_summary_section_crc(true)
            .with_record_length_limit(usize::try_from(limits::METADATA).ok()?);
        let mut reader = LinearReader::new_with_options(options);
        let (mut summary, mut names, mut counts, mut complete) = (Self::default(), BTreeMap::new(), None, false);
        while let Some(event) = reader.next_event() {
            match event.ok()? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let more = wanted.min(usize::try_from(length - at).unwrap_or(usize::MAX));
                    read_exact_at(file, reader.insert(more), at).ok()?;
                    reader.notify_read(more);
                    at += more as u64;
                }
                LinearReadEvent::Record { opcode: op::STATISTICS, data } => counts = Some(message_counts(data)?),
                LinearReadEvent::Record { opcode: op::CHANNEL, data } if limits::texts_fit(op::CHANNEL, data) => {
                    if let Ok(Record::Channel(channel)) = parse_record(op::CHANNEL, data) {
                        names.insert(channel.id, channel.topic);
                    }
                }
                // Offset, length, length of the name, name.
                LinearReadEvent::Record { opcode: op::METADATA_INDEX, data } => {
                    summary.finished |= data.get(20..) == Some(END.as_bytes());
                }
                LinearReadEvent::Record { opcode: op::FOOTER, .. } => complete = true,
                LinearReadEvent::Record { .. } => {}
            }
        }
        // A summary of another program may count messages without their channels.
        if let Some(counts) = counts.filter(|counts| names.len() >= counts.len()) {
            let by_name = names.into_iter().map(|(id, name)| (name, counts.get(&id).copied().unwrap_or(0)));
            summary.messages = Some(by_name.collect());
        }
        summary.end = at;
        complete.then_some(summary)
    }
}

/// The number of messages of each channel in a record of statistics.
fn message_counts(data: &[u8]) -> Option<BTreeMap<u16, u64>> {
    // Number of messages 8, schemas 2, channels 4, attachments 4, metadata 4, chunks 4, first time 8, last 8, size of the table 4
    let table = data.get(46..)?;
    let pairs = table.chunks_exact(10).map(|pair| {
        let (id, n) = pair.split_first_chunk::<2>()?;
        Some((u16::from_le_bytes(*id), u64::from_le_bytes(n.try_into().ok()?)))
    });
    pairs.collect()
}
