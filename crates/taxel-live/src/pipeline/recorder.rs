//! The two kinds of file that a [`Live`](super::Live) records to.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use taxel_core::{Marker, problem};

use super::{Counters, Options, Record, Said};
use crate::Result;
use crate::capture::Batch;
use crate::recording::{self, Header, LsaWriter, Writer, now_ns};

/// A recording being written. Raw `.lsa` holds bytes and nothing else: what else there is to keep is left out of it.
pub(super) struct Recorder {
    path: PathBuf,
    kind: Kind,
}

enum Kind {
    Mcap(Writer),
    /// Locked for the borrow only: one thread writes.
    Lsa(Mutex<LsaWriter>),
}

impl Recorder {
    pub(super) fn create(record: &Record, options: &Options, address: SocketAddr) -> Result<Self> {
        let path = record.path.clone();
        let kind = match path.extension().and_then(|e| e.to_str()) {
            Some("mcap") => {
                let header = Header {
                    array: options.array.clone(),
                    registers: Some(options.registers),
                    difference: options.differences,
                    origin_us: 0,
                    source: format!("udp {address}"),
                    started_ns: now_ns(),
                };
                let how = recording::Options { compression: record.compression, overwrite: record.overwrite };
                Kind::Mcap(Writer::create(&path, &header, how)?)
            }
            Some("lsa") => Kind::Lsa(Mutex::new(LsaWriter::create(&path, record.overwrite)?)),
            _ => {
                let name = path.display();
                return Err(
                    problem!("{name}: a recording is named .mcap (all that is known) or .lsa (raw bytes)").into()
                );
            }
        };
        Ok(Self { path, kind })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn datagrams(&self, batch: &Batch) -> Result<()> {
        match &self.kind {
            Kind::Mcap(writer) => {
                batch.iter().try_for_each(|(d, bytes)| writer.datagram(d.arrived_ns, d.number, bytes))
            }
            Kind::Lsa(writer) => {
                let mut writer = writer.lock().unwrap_or_else(PoisonError::into_inner);
                batch.iter().try_for_each(|(_, bytes)| writer.bytes(bytes))
            }
        }
    }

    pub(super) fn marker(&self, marker: Marker) -> Result<()> {
        match &self.kind {
            Kind::Mcap(writer) => writer.marker(now_ns(), marker),
            Kind::Lsa(_) => Ok(()),
        }
    }

    pub(super) fn detection(&self, said: &Said) -> Result<()> {
        match &self.kind {
            Kind::Mcap(writer) => writer.detection(said.said_ns, &said.detection),
            Kind::Lsa(_) => Ok(()),
        }
    }

    pub(super) fn picture(&self, board_us: i64, columns: u16, held: &[u16], ramp: u16) -> Result<()> {
        match &self.kind {
            Kind::Mcap(writer) => writer.picture(now_ns(), board_us, columns, held, ramp),
            Kind::Lsa(_) => Ok(()),
        }
    }

    /// What an unfinished recording will know of its losses; a raw one knows nothing, but its bytes reach the system.
    pub(super) fn so_far(&self, counters: &Counters) -> Result<()> {
        match &self.kind {
            Kind::Mcap(writer) => writer.counts(now_ns(), &losses(counters)),
            Kind::Lsa(_) => Ok(()),
        }
    }

    /// Bytes must not wait in memory for long: `.mcap` sees to that itself.
    pub(super) fn flush(&self) -> Result<()> {
        match &self.kind {
            Kind::Mcap(_) => Ok(()),
            Kind::Lsa(writer) => writer.lock().unwrap_or_else(PoisonError::into_inner).flush(),
        }
    }

    pub(super) fn note(&self, board_us: Option<i64>, text: &str) -> Result<()> {
        match &self.kind {
            Kind::Mcap(writer) => writer.note(now_ns(), board_us, text),
            Kind::Lsa(_) => Err(problem!("a .lsa holds raw bytes and no notes: record to a .mcap file").into()),
        }
    }

    /// Closes the file and gives the verdict.
    pub(super) fn finish(self, counters: &Counters) -> Result<String> {
        let losses = losses(counters);
        match self.kind {
            Kind::Mcap(writer) => Ok(writer.finish(losses)?.verdict()),
            Kind::Lsa(writer) => {
                writer.into_inner().unwrap_or_else(PoisonError::into_inner).finish()?;
                Ok(losses.verdict())
            }
        }
    }
}

/// What was lost, as recordings keep it.
pub(super) fn losses(counters: &Counters) -> recording::Counts {
    let capture = &counters.capture;
    recording::Counts {
        received: capture.datagrams,
        recorded: counters.decoded,
        dropped_by_kernel: capture.dropped_by_kernel,
        dropped_by_queue: capture.dropped_by_queue,
        decoder: recording::damage(&counters.wire),
        converted: None,
    }
}
