//! Packs queued messages into chunks of the format, and passes each chunk to the operating system as whole records.
//!
//! Chunks are built in memory (the crate's buffered mode), because its direct mode seeks back to fill in lengths: a
//! kill in between would leave a length of 2e16 in the file.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions};
use serde_json::json;

use super::queue::MessageQueue;
use super::record_file::RecordFile;
use crate::recording::metadata::{BEGIN, CHECK, END, check};
use crate::recording::{Compression, Header, OutputFile, RecordingCounts, Topic, Verdict, now_ns};

/// Size at which a chunk is closed, bytes; it is closed earlier if the queue is empty.
pub(super) const CHUNK_BYTES: usize = 1 << 20;

/// Size of a message record without its content, bytes.
const MESSAGE_BYTES: usize = 31;

/// The MCAP crate's writer, after it has written the recording's header.
pub(super) struct ChunkWriter {
    mcap: mcap::Writer<NoSeek<RecordFile>>,
    header: Header,
    /// The messages being written; the buffer is then swapped with the queue's.
    pub(super) batch: MessageQueue,
}

impl ChunkWriter {
    pub(super) fn begin(
        file: OutputFile,
        header: &Header,
        compression: Compression,
        at_disk: &Arc<AtomicBool>,
    ) -> std::result::Result<Self, McapError> {
        let options = WriteOptions::new()
            .profile("taxel")
            .library(concat!("taxel ", env!("CARGO_PKG_VERSION")))
            .compression(match compression {
                Compression::None => None,
                Compression::Lz4 => Some(mcap::Compression::Lz4),
                Compression::Zstd => Some(mcap::Compression::Zstd),
            })
            .compression_level(u32::from(compression == Compression::Zstd))
            .compression_threads(0)
            // Each chunk has its own checksum, so the data section needs none.
            .calculate_data_section_crc(false)
            .disable_seeking(true)
            .chunk_size(Some(2 * CHUNK_BYTES as u64));
        let mcap = options.create(NoSeek::new(RecordFile::new(file, at_disk)))?;
        let mut writer = Self { mcap, header: header.clone(), batch: MessageQueue::default() };
        let opening = BTreeMap::from([("header".to_owned(), json!(header).to_string())]);
        writer.mcap.write_metadata(&Metadata { name: BEGIN.to_owned(), metadata: opening.clone() })?;
        for (k, source) in std::iter::once(header).chain(&header.sources).enumerate() {
            for topic in source.topics() {
                let schema = match topic.schema() {
                    None => 0,
                    Some((name, encoding, text)) => writer.mcap.add_schema(name, encoding, text)?,
                };
                // The header is stored a second time in a channel record, which a chunk's checksum protects.
                let first = k == 0 && matches!(topic, Topic::Datagrams | Topic::Frames);
                let mut more = if first { opening.clone() } else { BTreeMap::new() };
                if let Some(frames) = source.frames.as_ref().filter(|_| topic == Topic::Frames) {
                    let about = [
                        ("unit", frames.unit.clone()),
                        ("array", json!(source.array).to_string()),
                        ("source", source.name.clone()),
                        ("clock", frames.clock.to_string()),
                    ];
                    more.extend(about.map(|(key, value)| (key.to_owned(), value)));
                }
                let (number, name) = (topic.channel(k), topic.channel_name(k, &source.name));
                writer.mcap.add_channel_with_id(number, schema, &name, topic.encoding(), &more)?;
            }
        }
        writer.mcap.flush()?;
        Ok(writer)
    }

    /// Packs messages into chunks and passes each to the operating system, after which a kill no longer loses it; without
    /// any, looks whether the file is still there.
    pub(super) fn write(&mut self) -> std::result::Result<(), McapError> {
        let (mut at, mut chunk) = (0, 0);
        for message in &self.batch.messages {
            let header = MessageHeader {
                channel_id: message.channel,
                sequence: message.number,
                log_time: message.at_ns,
                publish_time: message.at_ns,
            };
            self.mcap.write_to_known_channel(&header, &self.batch.bytes[at..at + message.bytes])?;
            at += message.bytes;
            chunk += MESSAGE_BYTES + message.bytes;
            if chunk >= CHUNK_BYTES {
                self.mcap.flush()?;
                chunk = 0;
            }
        }
        self.batch.clear();
        self.mcap.flush()
    }

    /// Writes the counts and the summary, and waits until everything is on the disk.
    pub(super) fn end(
        &mut self,
        counts: Option<&RecordingCounts>,
        others: &BTreeMap<String, RecordingCounts>,
    ) -> std::result::Result<(), McapError> {
        if let Some(counts) = counts {
            let verdict = if self.header.frames.is_none() { counts.verdict() } else { Verdict::of_lines(counts) };
            let mut end = BTreeMap::from([
                ("verdict".to_owned(), verdict.text()),
                ("counts".to_owned(), json!(counts).to_string()),
                ("header".to_owned(), json!(self.header).to_string()),
                ("stopped_ns".to_owned(), now_ns().to_string()),
            ]);
            end.extend(others.iter().map(|(name, counts)| (format!("counts.{name}"), json!(counts).to_string())));
            end.insert(CHECK.to_owned(), check(&end));
            self.mcap.write_metadata(&Metadata { name: END.to_owned(), metadata: end })?;
        }
        self.mcap.flush()?;
        self.mcap.finish()?;
        Ok(())
    }

    pub(super) fn into_file(self) -> RecordFile {
        self.mcap.into_inner().into_inner()
    }
}
