//! Reads the chunks of a file one at a time.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use mcap::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::summary::FileSummary;
use crate::read_at::read_exact_at;
use crate::recording::{Header, limits};
use crate::{Error, Result};

/// A chunk, or a sequence of records outside chunks (as other tools may write them).
#[derive(Debug, Clone, Copy)]
pub(super) struct FileBlock {
    pub(super) offset: u64,
    pub(super) length: u64,
    pub(super) bare: bool,
}

/// Numbers of messages by the number of their channel, as the message indexes behind a chunk list them.
pub(super) type IndexedChunks = BTreeMap<u16, u64>;

/// The channel and the number of messages that a message index lists, from its first 15 bytes.
pub(super) fn index_entry(head: &[u8]) -> Option<(u16, u64)> {
    // Opcode 1, length 8, channel 2, size of the entries 4; an entry has 16 bytes.
    let (channel, size) = head.get(9..15)?.split_first_chunk::<2>()?;
    Some((u16::from_le_bytes(*channel), u64::from(u32::from_le_bytes(size.try_into().ok()?)) / 16))
}

/// Where the messages of a file are.
#[derive(Debug)]
pub(super) struct Blocks {
    pub(super) path: PathBuf,
    pub(super) file: File,
    pub(super) length: u64,
    pub(super) blocks: Vec<FileBlock>,
    /// For each offset where something was skipped: the number of blocks before it, and what the message indexes around it list.
    pub(super) skipped: Vec<(usize, Option<IndexedChunks>)>,
    pub(super) summary: Option<FileSummary>,
}

impl Blocks {
    /// The header's copy in the first chunk that has one.
    pub(super) fn header(&self) -> Result<Option<Header>> {
        let (mut bytes, mut header) = (Vec::new(), None);
        for block in &self.blocks {
            self.records(*block, &mut bytes, |record| {
                if let Record::Channel(channel) = record {
                    header = channel.metadata.get("header").and_then(|text| serde_json::from_str(text).ok());
                }
                header.is_none()
            })?;
            if header.is_some() {
                break;
            }
        }
        Ok(header)
    }

    /// What the message indexes behind a block list; none if there are none, though the block had messages.
    pub(super) fn message_indexes(&self, block: FileBlock) -> Result<Option<IndexedChunks>> {
        // Times of the first and the last message, both 0 in a chunk without messages.
        let mut times = [0; 16];
        read_exact_at(&self.file, &mut times, block.offset + 9).map_err(Error::file(&self.path))?;
        let all = message_indexes_from(&self.path, &self.file, self.length, block.offset + block.length)?;
        Ok((times == [0; 16] || !all.is_empty()).then_some(all))
    }

    /// As [`records`].
    pub(super) fn records(
        &self,
        block: FileBlock,
        bytes: &mut Vec<u8>,
        take: impl FnMut(Record<'_>) -> bool,
    ) -> Result<bool> {
        records(&self.path, &self.file, block, bytes, take)
    }
}

/// Passes the records of a block to `take` until it returns false; returns whether the block is valid.
pub(super) fn records(
    path: &Path,
    file: &File,
    block: FileBlock,
    bytes: &mut Vec<u8>,
    mut take: impl FnMut(Record<'_>) -> bool,
) -> Result<bool> {
    let Ok(length) = usize::try_from(block.length) else { return Ok(false) };
    bytes.resize(length, 0);
    read_exact_at(file, bytes, block.offset).map_err(Error::file(path))?;
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(length.max(limits::CHUNK as usize));
    let mut reader = LinearReader::new_with_options(options);
    let mut position = 0;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                // At the end of the block no bytes are available: the reader then ends, or reports that data are
                // missing.
                let more = wanted.min(length - position);
                reader.insert(more).copy_from_slice(&bytes[position..position + more]);
                reader.notify_read(more);
                position += more;
            }
            // The content of other records is not used, so an error in them is ignored.
            Ok(LinearReadEvent::Record { opcode, .. }) if !matches!(opcode, op::CHANNEL | op::MESSAGE) => {}
            Ok(LinearReadEvent::Record { data, opcode }) if !limits::texts_fit(opcode, data) => return Ok(false),
            Ok(LinearReadEvent::Record { data, opcode }) => match parse_record(opcode, data) {
                Ok(record) => {
                    if !take(record) {
                        return Ok(true);
                    }
                }
                Err(_) => return Ok(false),
            },
            Err(_) => return Ok(false),
        }
    }
    Ok(true)
}

/// What the message indexes from `at` on list, up to the next other record.
pub(super) fn message_indexes_from(path: &Path, file: &File, length: u64, mut at: u64) -> Result<IndexedChunks> {
    let (mut all, mut head) = (IndexedChunks::new(), [0; 15]);
    while at.checked_add(15).is_some_and(|end| end <= length) {
        read_exact_at(file, &mut head, at).map_err(Error::file(path))?;
        let Some((channel, messages)) = index_entry(&head).filter(|_| head[0] == op::MESSAGE_INDEX) else { break };
        *all.entry(channel).or_default() += messages;
        at += 15 + 16 * messages;
    }
    Ok(all)
}
