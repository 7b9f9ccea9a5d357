//! Reads the chunks of a file one at a time.

use std::fs::File;
use std::path::{Path, PathBuf};

use mcap::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

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

/// Where the messages of a file are.
#[derive(Debug)]
pub(super) struct Blocks {
    pub(super) path: PathBuf,
    pub(super) file: File,
    pub(super) blocks: Vec<FileBlock>,
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
