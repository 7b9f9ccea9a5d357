//! The two kinds of file that a [`Live`](super::Live) records to.

use std::fs::OpenOptions;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use taxel_core::encode::Tare;
use taxel_core::{Marker, problem};

use super::counters::Counters;
use super::options::{LiveOptions, Record};
use super::said::Said;
use crate::capture::Batch;
use crate::recording::{self, Header, LsaWriter, Writer, now_ns};
use crate::{Error, Result};

/// A recording being written. Raw `.lsa` holds bytes and nothing else: what else there is to keep is left out of it.
///
/// A file that is to be replaced is touched when there is something to replace it with, and not before: where nothing
/// comes, it stays.
pub(super) struct Recorder {
    record: Record,
    header: Header,
    /// Whether there was no such file.
    new: bool,
    noted: AtomicBool,
    kind: OnceLock<Kind>,
    /// Held by the one who opens the file.
    opening: Mutex<()>,
}

enum Kind {
    Mcap(Writer),
    /// Locked for the borrow only: one thread writes.
    Lsa(Mutex<LsaWriter>),
}

impl Recorder {
    pub(super) fn create(record: &Record, options: &LiveOptions, address: SocketAddr) -> Result<Self> {
        let header = Header {
            array: options.array.clone(),
            registers: Some(options.registers),
            difference: options.differences,
            origin_us: 0,
            source: format!("udp {address}"),
            started_ns: now_ns(),
        };
        let path = &record.path;
        let new = !(record.overwrite && path.exists());
        let recorder = Self {
            record: record.clone(),
            header,
            new,
            noted: AtomicBool::new(false),
            kind: OnceLock::new(),
            opening: Mutex::new(()),
        };
        if new {
            recorder.kind()?;
        } else {
            named(path)?;
            recording::replaceable(path)?;
            OpenOptions::new().write(true).open(path).map_err(Error::file(path))?;
        }
        Ok(recorder)
    }

    /// The open file.
    fn kind(&self) -> Result<&Kind> {
        let _one = self.opening.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kind) = self.kind.get() {
            return Ok(kind);
        }
        let Record { path, compression, overwrite } = &self.record;
        let kind = match named(path)? {
            "mcap" => {
                let how = recording::WriterOptions { compression: *compression, overwrite: *overwrite };
                Kind::Mcap(Writer::create(path, &self.header, how)?)
            }
            _ => Kind::Lsa(Mutex::new(LsaWriter::create(path, *overwrite)?)),
        };
        Ok(self.kind.get_or_init(|| kind))
    }

    pub(super) fn datagrams(&self, batch: &Batch) -> Result<()> {
        match self.kind()? {
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
        match self.kind()? {
            Kind::Mcap(writer) => writer.marker(now_ns(), marker),
            Kind::Lsa(_) => Ok(()),
        }
    }

    pub(super) fn detection(&self, said: &Said) -> Result<()> {
        match self.kind()? {
            Kind::Mcap(writer) => writer.detection(said.said_ns, &said.detection),
            Kind::Lsa(_) => Ok(()),
        }
    }

    /// What is taken off the pictures from here on.
    pub(super) fn tare(&self, tare: &Tare) -> Result<()> {
        if let Kind::Mcap(writer) = self.kind()? {
            writer.tare(tare);
        }
        Ok(())
    }

    pub(super) fn picture(&self, board_us: i64, columns: u16, held: &[u16]) -> Result<()> {
        match self.kind()? {
            Kind::Mcap(writer) => writer.picture(now_ns(), board_us, columns, held),
            Kind::Lsa(_) => Ok(()),
        }
    }

    /// What an unfinished recording will know of its losses; a raw one knows nothing, but its bytes reach the system.
    pub(super) fn so_far(&self, counters: &Counters) -> Result<()> {
        match self.kind.get() {
            Some(Kind::Mcap(writer)) => writer.counts(now_ns(), &losses(counters)),
            Some(Kind::Lsa(_)) | None => Ok(()),
        }
    }

    /// Bytes must not wait in memory for long: `.mcap` sees to that itself.
    pub(super) fn flush(&self) -> Result<()> {
        match self.kind.get() {
            Some(Kind::Mcap(_)) | None => Ok(()),
            Some(Kind::Lsa(writer)) => writer.lock().unwrap_or_else(PoisonError::into_inner).flush(),
        }
    }

    pub(super) fn note(&self, board_us: Option<i64>, text: &str) -> Result<()> {
        if named(&self.record.path)? == "lsa" {
            return Err(problem!("a .lsa holds raw bytes and no notes: record to a .mcap file").into());
        }
        self.noted.store(true, Ordering::Relaxed);
        match self.kind()? {
            Kind::Mcap(writer) => writer.note(now_ns(), board_us, text),
            Kind::Lsa(_) => Ok(()),
        }
    }

    /// Closes the file and says where it is; a file that would hold nothing is not kept.
    pub(super) fn finish(self, counters: &Counters) -> Result<Option<PathBuf>> {
        let path = self.record.path;
        if counters.nothing_came() && !self.noted.into_inner() {
            drop(self.kind);
            if self.new {
                std::fs::remove_file(&path).map_err(Error::file(&path))?;
            }
            return Ok(None);
        }
        match self.kind.into_inner() {
            Some(Kind::Mcap(writer)) => drop(writer.finish(losses(counters))?),
            Some(Kind::Lsa(writer)) => writer.into_inner().unwrap_or_else(PoisonError::into_inner).finish()?,
            None => {}
        }
        Ok(Some(path))
    }
}

/// What kind of file a name says.
fn named(path: &Path) -> Result<&str> {
    match path.extension().and_then(|e| e.to_str()) {
        Some(kind @ ("mcap" | "lsa")) => Ok(kind),
        _ => {
            let name = path.display();
            Err(problem!("{name}: a recording is named .mcap (all that is known) or .lsa (raw bytes)").into())
        }
    }
}

/// What was lost, as recordings keep it.
pub(super) fn losses(counters: &Counters) -> recording::Counts {
    let capture = &counters.capture;
    let (second, missing) = recording::damage_of_version_2(&counters.wire_v2).unzip();
    let mut decoder = recording::damage(&counters.wire);
    decoder.extend(second.unwrap_or_default());
    recording::Counts {
        received: capture.datagrams,
        recorded: counters.decoded,
        dropped_by_kernel: capture.dropped_by_kernel,
        dropped_by_queue: capture.dropped_by_queue,
        decoder,
        missing,
        converted: None,
    }
}
