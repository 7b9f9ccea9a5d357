//! Walks from record to record, which rebuilds the index of a file and resynchronises after damage.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use mcap::records::{Record, op};
use mcap::{MAGIC, parse_record};

use super::blocks::{FileBlock, records};
use crate::read_at::read_exact_at;
use crate::recording::metadata::{BEGIN, CHECK, END, check};
use crate::recording::{FileEnding, Header, Rebuilt, RecordingCounts, limits};
use crate::{Error, Result};

/// Size of a record's opcode and length, bytes.
const RECORD_HEAD: u64 = 9;

/// Size of a footer and of the magic bytes behind it, with which a file ends.
const FOOTER: u64 = RECORD_HEAD + 20 + MAGIC.len() as u64;

/// The state of the walk.
pub(super) struct FileWalk<'a> {
    path: &'a Path,
    file: &'a File,
    length: u64,
    pub(super) begin: Option<Header>,
    pub(super) end: Option<Header>,
    pub(super) ending: Option<FileEnding>,
    /// The final counts of the other sources.
    pub(super) ends: BTreeMap<String, RecordingCounts>,
    pub(super) blocks: Vec<FileBlock>,
    pub(super) rebuilt: Rebuilt,
}

impl<'a> FileWalk<'a> {
    pub(super) fn new(path: &'a Path, file: &'a File, length: u64) -> Self {
        let rebuilt = Rebuilt { unfinished: true, ..Rebuilt::default() };
        Self {
            path,
            file,
            length,
            begin: None,
            end: None,
            ending: None,
            ends: BTreeMap::new(),
            blocks: vec![],
            rebuilt,
        }
    }

    /// Up to `wanted` bytes at `offset`; fewer at the end of the file.
    fn bytes(&self, offset: u64, wanted: u64) -> Result<Vec<u8>> {
        let n = usize::try_from(wanted.min(self.length.saturating_sub(offset))).unwrap_or(0);
        let mut bytes = vec![0; n];
        read_exact_at(self.file, &mut bytes, offset).map_err(Error::file(self.path))?;
        Ok(bytes)
    }

    pub(super) fn magic(&self) -> Result<()> {
        let start = self.bytes(0, MAGIC.len() as u64)?;
        if start == MAGIC {
            return Ok(());
        }
        if MAGIC.starts_with(&start) {
            let n = start.len();
            return Err(Error::format(
                self.path,
                &format!("byte {n}: the file ends inside the MCAP magic (its first 8 bytes), so it contains nothing"),
            ));
        }
        let hex: Vec<String> = start.iter().take(4).map(|b| format!("{b:02X}")).collect();
        Err(Error::format(
            self.path,
            &format!("byte 0: starts with {}, not with the MCAP magic (89 4D 43 41)", hex.join(" ")),
        ))
    }

    pub(super) fn records(&mut self) -> Result<()> {
        self.data()?;
        // The record that ends a recording is written after all data.
        if self.ending.is_some() {
            (self.rebuilt.unfinished, self.rebuilt.torn_bytes) = (false, 0);
        }
        Ok(())
    }

    /// Where what cannot be read begins: at `at`, or at the chunk that ends there, if that is damaged. In it bytes may be
    /// missing or too many, so that it ends elsewhere.
    fn damage_start(&mut self, at: u64) -> Result<u64> {
        match self.blocks.last() {
            Some(&block)
                if !block.bare
                    && block.offset + block.length == at
                    && !records(self.path, self.file, block, &mut vec![], |_| true)? =>
            {
                self.blocks.pop();
                Ok(block.offset)
            }
            _ => Ok(at),
        }
    }

    fn data(&mut self) -> Result<()> {
        let mut at = MAGIC.len() as u64;
        while at < self.length {
            let Some((opcode, length, size)) = self.readable_record(at)? else {
                let from = self.damage_start(at)?;
                match self.next_readable(from + 1)? {
                    Some(next) => {
                        self.rebuilt.gaps += 1;
                        self.rebuilt.skipped_bytes += next - from;
                        at = next;
                        continue;
                    }
                    None => {
                        self.rebuilt.torn_bytes = self.length - from;
                        return Ok(());
                    }
                }
            };
            match opcode {
                op::DATA_END => {
                    self.rebuilt.unfinished = false;
                    self.rebuilt.bytes_after_end = self.length - self.end(at + RECORD_HEAD + length)?;
                    return Ok(());
                }
                op::METADATA => self.metadata(at, length)?,
                op::CHUNK | op::SCHEMA | op::CHANNEL | op::MESSAGE if size.max(length) > u64::from(limits::CHUNK) => {
                    self.rebuilt.large_chunks += 1;
                }
                op::CHUNK => {
                    self.blocks.push(FileBlock { offset: at, length: RECORD_HEAD + length, bare: false });
                }
                // Next to chunks such a record is another one, damaged.
                op::SCHEMA | op::CHANNEL | op::MESSAGE => match self.blocks.last_mut() {
                    Some(block) if block.bare && block.offset + block.length == at && block.length < 1 << 20 => {
                        block.length += RECORD_HEAD + length;
                    }
                    _ => {
                        self.blocks.push(FileBlock { offset: at, length: RECORD_HEAD + length, bare: true });
                    }
                },
                _ => {}
            }
            at += RECORD_HEAD + length;
        }
        Ok(())
    }

    /// Where a file ends by the footer of its summary, which begins at `at`; the end of the file where that is not there.
    fn end(&self, mut at: u64) -> Result<u64> {
        loop {
            let head = self.bytes(at, RECORD_HEAD)?;
            let (Some(&opcode), Some(length)) = (head.first(), number(&head, 1)) else { return Ok(self.length) };
            if length >= self.length.saturating_sub(at) {
                return Ok(self.length);
            }
            at += RECORD_HEAD + length;
            if opcode == op::FOOTER {
                return Ok(self.length.min(at + MAGIC.len() as u64));
            }
        }
    }

    /// Opcode and length of the record at `at`, where they make sense, and the size that it states to unpack to.
    fn readable_record(&self, at: u64) -> Result<Option<(u8, u64, u64)>> {
        let head = self.bytes(at, 80)?;
        let (Some(&opcode), Some(length)) = (head.first(), number(&head, 1)) else { return Ok(None) };
        let fits = at.checked_add(RECORD_HEAD).and_then(|a| a.checked_add(length)).is_some_and(|e| e <= self.length);
        // The records that may precede the end of the data. A flipped bit in an opcode must not hide a chunk, so
        // lengths are checked where the format allows it.
        let known = match opcode {
            op::CHUNK => chunk(&head, length).is_some(),
            op::MESSAGE_INDEX => head.get(11..15).is_some_and(|b| word(b) + 6 == length),
            // Name and table.
            op::METADATA => self.two_parts(at + RECORD_HEAD)? == length,
            // Two times of 8 bytes, name and kind, content behind its length of 8 bytes, checksum of 4.
            op::ATTACHMENT => {
                let before = 16 + self.two_parts(at + RECORD_HEAD + 16)?;
                let content = number(&self.bytes(at + RECORD_HEAD + before, 8)?, 0);
                content.and_then(|content| content.checked_add(before + 12)) == Some(length)
            }
            op::DATA_END => length == 4,
            // Profile and library.
            op::HEADER => at == MAGIC.len() as u64 && self.two_parts(at + RECORD_HEAD)? == length,
            op::SCHEMA | op::CHANNEL | op::MESSAGE => self.blocks.last().is_none_or(|block| block.bare),
            _ => false,
        };
        let size = if opcode == op::CHUNK { chunk(&head, length).unwrap_or(0) } else { 0 };
        Ok((fits && known).then_some((opcode, length, size)))
    }

    /// Size of two parts that follow each other at `at`, each behind its length of 4 bytes.
    fn two_parts(&self, at: u64) -> Result<u64> {
        let first = 4 + word(&self.bytes(at, 4)?);
        Ok(first + 4 + word(&self.bytes(at + first, 4)?))
    }

    /// Whether the record at `at`, which makes sense, is one at which the walk may continue after damage: a chunk, a
    /// metadata record of ours, or the end of the data.
    fn resumes(&self, at: u64, opcode: u8, length: u64) -> Result<bool> {
        let next = at + RECORD_HEAD + length;
        Ok(match opcode {
            op::CHUNK => true,
            op::METADATA => {
                length < limits::METADATA && self.bytes(at + RECORD_HEAD + 4, BEGIN.len() as u64)? == BEGIN.as_bytes()
            }
            // A footer behind the data names the offset where its summary begins.
            op::DATA_END => {
                let footer = self.bytes(self.length.saturating_sub(FOOTER), FOOTER)?;
                footer.first() == Some(&op::FOOTER) && number(&footer, 9).is_some_and(|begin| begin == next)
            }
            _ => false,
        })
    }

    /// The next position from `at` on where the walk may continue.
    fn next_readable(&self, mut at: u64) -> Result<Option<u64>> {
        const WINDOW: u64 = 1 << 20;
        while at < self.length {
            let window = self.bytes(at, WINDOW)?;
            for (k, &byte) in window.iter().enumerate() {
                if !matches!(byte, op::CHUNK | op::METADATA | op::DATA_END) {
                    continue;
                }
                let offset = at + k as u64;
                if let Some((opcode, length, _)) = self.readable_record(offset)?
                    && self.resumes(offset, opcode, length)?
                {
                    return Ok(Some(offset));
                }
            }
            at += window.len() as u64;
        }
        Ok(None)
    }

    fn metadata(&mut self, at: u64, length: u64) -> Result<()> {
        if length > limits::METADATA {
            return Ok(());
        }
        let body = self.bytes(at + RECORD_HEAD, length)?;
        if !limits::texts_fit(op::METADATA, &body) {
            return Ok(());
        }
        let Ok(Record::Metadata(record)) = parse_record(op::METADATA, &body) else { return Ok(()) };
        let header = record.metadata.get("header").and_then(|text| serde_json::from_str(text).ok());
        match record.name.as_str() {
            BEGIN => self.begin = header,
            END => {
                self.end = header;
                let ends = record.metadata.iter().filter_map(|(key, text)| {
                    Some((key.strip_prefix("counts.")?.to_owned(), serde_json::from_str(text).ok()?))
                });
                self.ends = ends.collect();
                self.ending = match record.metadata.get("stopped") {
                    Some(why) => Some(FileEnding::Stopped(why.clone())),
                    None if record.metadata.get(CHECK) != Some(&check(&record.metadata)) => None,
                    None => {
                        let counts = record.metadata.get("counts").and_then(|text| serde_json::from_str(text).ok());
                        counts.map(|counts| FileEnding::Finished { counts })
                    }
                };
            }
            _ => {}
        }
        Ok(())
    }
}

/// The unpacked size that a chunk states, if the lengths inside its header agree with the record's length.
fn chunk(head: &[u8], length: u64) -> Option<u64> {
    let (before, packed) = packed_range(head)?;
    if packed.checked_add(before - RECORD_HEAD) == Some(length) { number(head, 25) } else { None }
}

/// Where the packed messages of a chunk begin, and their size, as its header states.
fn packed_range(head: &[u8]) -> Option<(u64, u64)> {
    // opcode 1, length 8, start 8, end 8, size 8, checksum 4, name of the compression, packed size 8
    const NAME: usize = 37;
    let name_bytes = head.get(NAME..NAME + 4).map(|b| word(b) as usize).filter(|&n| n <= 16)?;
    Some(((NAME + 4 + name_bytes + 8) as u64, number(head, NAME + 4 + name_bytes)?))
}

/// The 64-bit number at `offset`.
fn number(bytes: &[u8], offset: usize) -> Option<u64> {
    bytes.get(offset..offset + 8).and_then(|b| b.try_into().ok()).map(u64::from_le_bytes)
}

/// The 32-bit number in four bytes.
fn word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte))
}
