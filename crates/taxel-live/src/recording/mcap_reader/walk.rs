//! Walks from record to record, which rebuilds the index of a file and resynchronises after damage.

use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

use mcap::records::{Record, op};
use mcap::{MAGIC, parse_record};

use super::blocks::{Block, texts_fit};
use crate::recording::metadata::{BEGIN, END};
use crate::recording::{Counts, Ending, Header, Rebuilt, limits};
use crate::{Error, Result};

/// Size of a record's opcode and length, bytes.
const RECORD_HEAD: u64 = 9;

/// The state of the walk.
pub(super) struct Walk<'a> {
    path: &'a Path,
    file: &'a File,
    length: u64,
    pub(super) begin: Option<Header>,
    pub(super) end: Option<Header>,
    pub(super) ending: Option<Ending>,
    /// The final counts of the other sources.
    pub(super) ends: BTreeMap<String, Counts>,
    pub(super) blocks: Vec<Block>,
    /// Unpacked size of the chunks so far, as they state it, bytes.
    unpacked: u64,
    pub(super) rebuilt: Rebuilt,
}

impl<'a> Walk<'a> {
    pub(super) fn of(path: &'a Path, file: &'a File, length: u64) -> Self {
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
            unpacked: 0,
            rebuilt,
        }
    }

    /// Up to `wanted` bytes at `offset`; fewer at the end of the file.
    fn bytes(&self, offset: u64, wanted: u64) -> Result<Vec<u8>> {
        let n = usize::try_from(wanted.min(self.length.saturating_sub(offset))).unwrap_or(0);
        let mut bytes = vec![0; n];
        self.file.read_exact_at(&mut bytes, offset).map_err(Error::file(self.path))?;
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
                &format!("byte {n}: the file ends inside the MCAP magic, it holds nothing"),
            ));
        }
        let hex: Vec<String> = start.iter().take(4).map(|b| format!("{b:02X}")).collect();
        Err(Error::format(
            self.path,
            &format!("byte 0: starts with {}, not with the MCAP magic (89 4D 43 41)", hex.join(" ")),
        ))
    }

    pub(super) fn records(&mut self) -> Result<()> {
        let mut at = MAGIC.len() as u64;
        while at < self.length {
            let Some((opcode, length, size)) = self.sound(at)? else {
                match self.next_sound(at + 1)? {
                    Some(next) => {
                        self.rebuilt.gaps += 1;
                        self.rebuilt.skipped_bytes += next - at;
                        at = next;
                        continue;
                    }
                    None => {
                        self.rebuilt.torn_bytes = self.length - at;
                        return Ok(());
                    }
                }
            };
            match opcode {
                op::DATA_END => {
                    self.rebuilt.unfinished = false;
                    return Ok(());
                }
                op::METADATA => self.metadata(at, length)?,
                op::CHUNK if size.max(length) > u64::from(limits::CHUNK) => self.rebuilt.large_chunks += 1,
                op::CHUNK => {
                    self.unpacked += size;
                    let most = limits::unpacked(self.length);
                    if self.unpacked > most {
                        let limit = "bytes (1000 times the file and 256 MiB)";
                        return Err(Error::format(
                            self.path,
                            &format!(
                                "chunk at byte {at}: the chunks up to here say that they unpack to more than {most} {limit}"
                            ),
                        ));
                    }
                    self.blocks.push(Block { offset: at, length: RECORD_HEAD + length, bare: false });
                }
                op::SCHEMA | op::CHANNEL | op::MESSAGE => match self.blocks.last_mut() {
                    Some(block) if block.bare && block.offset + block.length == at && block.length < 1 << 20 => {
                        block.length += RECORD_HEAD + length;
                    }
                    _ => self.blocks.push(Block { offset: at, length: RECORD_HEAD + length, bare: true }),
                },
                _ => {}
            }
            at += RECORD_HEAD + length;
        }
        Ok(())
    }

    /// Opcode and length of the record at `at`, where they make sense, and the size that it states to unpack to.
    fn sound(&self, at: u64) -> Result<Option<(u8, u64, u64)>> {
        let head = self.bytes(at, 80)?;
        let (Some(&opcode), Some(length)) = (head.first(), number(&head, 1)) else { return Ok(None) };
        let fits = at.checked_add(RECORD_HEAD).and_then(|a| a.checked_add(length)).is_some_and(|e| e <= self.length);
        // The records that may precede the end of the data. A flipped bit in an opcode must not hide a chunk, so
        // lengths are checked where the format allows it.
        let known = match opcode {
            op::CHUNK => chunk(&head, length).is_some(),
            op::MESSAGE_INDEX => head.get(11..15).is_some_and(|b| word(b) + 6 == length),
            op::METADATA => head.get(9..13).is_some_and(|b| word(b) + 8 <= length),
            op::DATA_END => length == 4,
            op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::ATTACHMENT => true,
            _ => false,
        };
        let size = if opcode == op::CHUNK { chunk(&head, length).unwrap_or(0) } else { 0 };
        Ok((fits && known).then_some((opcode, length, size)))
    }

    /// The next position from `at` on with a chunk or a metadata record of ours.
    fn next_sound(&self, mut at: u64) -> Result<Option<u64>> {
        const WINDOW: u64 = 1 << 20;
        while at < self.length {
            let window = self.bytes(at, WINDOW)?;
            for (k, &byte) in window.iter().enumerate() {
                if byte != op::CHUNK && byte != op::METADATA {
                    continue;
                }
                let place = at + k as u64;
                if let Some((opcode, length, _)) = self.sound(place)? {
                    let ours = || -> Result<bool> {
                        Ok(length < limits::METADATA
                            && self.bytes(place + RECORD_HEAD + 4, BEGIN.len() as u64)? == BEGIN.as_bytes())
                    };
                    if opcode == op::CHUNK || ours()? {
                        return Ok(Some(place));
                    }
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
        if !texts_fit(op::METADATA, &body) {
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
                    Some(why) => Some(Ending::Stopped(why.clone())),
                    None => {
                        let counts = record.metadata.get("counts").and_then(|text| serde_json::from_str(text).ok());
                        counts.map(|counts| Ending::Finished { counts })
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
    // opcode 1, length 8, start 8, end 8, size 8, checksum 4, name of the compression, packed size 8
    const NAME: usize = 37;
    let name_bytes = head.get(NAME..NAME + 4).map(|b| word(b) as usize).filter(|&n| n <= 16)?;
    let packed = number(head, NAME + 4 + name_bytes)?;
    let rest = (NAME + 4 + name_bytes + 8) as u64 - RECORD_HEAD;
    if packed.checked_add(rest) == Some(length) { number(head, 25) } else { None }
}

/// The 64-bit number at `place`.
fn number(bytes: &[u8], place: usize) -> Option<u64> {
    bytes.get(place..place + 8).and_then(|b| b.try_into().ok()).map(u64::from_le_bytes)
}

/// The 32-bit number in four bytes.
fn word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte))
}
