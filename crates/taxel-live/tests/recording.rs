//! The live format survives: what is written is read back, finished or not, whole or damaged.

use std::path::{Path, PathBuf};

use taxel_core::detect::Detection;
use taxel_core::wire::{self, Registers, v2};
use taxel_core::{Array, Marker, Stop};
use taxel_live::KernelDrops;
use taxel_live::recording::{
    Cause, Compression, Counts, FileEnding, Header, NOTHING_LOST, Reader, RecordingCounts, RecordingStatus, Topic,
    Writer, WriterOptions,
};

/// A folder that is gone when the test ends.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("taxel-recording-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn header() -> Header {
    Header::of_board(Array::thesis(), Some(Registers::default()), "udp 127.0.0.1:5208".to_owned(), 1_000_000_000_000)
}

/// The bytes of datagram `k`: enough of them for more than one chunk.
fn datagram(k: u64) -> Vec<u8> {
    (0..1400).map(|i| u8::try_from((k * 7 + i) % 251).unwrap()).collect()
}

fn record(path: &Path, datagrams: u64, compression: Compression) {
    let writer = Writer::create(path, &header(), WriterOptions { compression, overwrite: false }).unwrap();
    for k in 0..datagrams {
        writer.datagram(1_000_000_000_000 + i64::try_from(k).unwrap() * 1000, k, &datagram(k)).unwrap();
    }
    writer.note(1_000_000_000_500, Some(192), "left heel").unwrap();
    writer.marker(1_000_000_000_600, Marker { t: 384, start: true }).unwrap();
    let detection = Detection { label: "contact".to_owned(), t: 100, known: 192, slope: 1.5, repaired: true };
    writer.detection(1_000_000_000_700, &detection).unwrap();
    writer.registers(1_000_000_000_800, &header().registers.unwrap()).unwrap();
    writer.preview(1_000_000_000_900, 192, &vec![75; 4096]).unwrap();
    let counts = RecordingCounts { received: datagrams, ..RecordingCounts::default() };
    writer.finish(counts).unwrap();
}

fn datagrams(reader: &Reader) -> (Vec<(u64, i64, Vec<u8>)>, u64) {
    let mut all = vec![];
    let bad = reader
        .messages(Stop::never(), |m| {
            if m.topic == Topic::Datagrams {
                all.push((m.number, m.at_ns, m.data.to_vec()));
            }
            Ok(())
        })
        .unwrap();
    (all, bad)
}

#[test]
fn what_was_written_is_read_back_with_any_compression() {
    let folder = Folder::new("round");
    for (name, compression) in [("none", Compression::None), ("lz4", Compression::Lz4), ("zstd", Compression::Zstd)] {
        let path = folder.0.join(name);
        record(&path, 3000, compression);
        let reader = Reader::open(&path).unwrap();
        assert_eq!(reader.header(), &header());
        assert!(!reader.rebuilt().unfinished);
        let (all, bad) = datagrams(&reader);
        assert_eq!((all.len(), bad), (3000, 0));
        for (k, (number, at, bytes)) in (0_u64..).zip(&all) {
            let arrived = 1_000_000_000_000 + i64::try_from(k).unwrap() * 1000;
            assert_eq!((*number, *at, bytes), (k, arrived, &datagram(k)));
        }
        let (remarks, _) = reader.remarks(Stop::never()).unwrap();
        assert_eq!(remarks.notes[0].text, "left heel");
        assert_eq!(remarks.notes[0].t_us, Some(192));
        assert_eq!(remarks.markers, vec![Marker { t: 384, start: true }]);
        assert_eq!(
            remarks.detections[0].1,
            Detection { label: "contact".to_owned(), t: 100, known: 192, slope: 1.5, repaired: true }
        );
        assert_eq!(remarks.registers[0].1, header().registers.unwrap());
        assert_eq!(
            (remarks.datagrams, remarks.datagram_bytes, remarks.messages[&Topic::Pressure]),
            (3000, 4_200_000, 1)
        );
        let Some(FileEnding::Finished { counts }) = reader.ending() else { panic!("not finished") };
        assert_eq!((counts.received, counts.recorded, counts.verdict().text().as_str()), (3000, 3000, NOTHING_LOST));
    }
}

#[test]
fn an_existing_file_is_replaced_only_when_asked() {
    let folder = Folder::new("exists");
    let path = folder.0.join("a.mcap");
    std::fs::write(&path, b"precious").unwrap();
    let error = Writer::create(&path, &header(), WriterOptions::default()).err().unwrap().to_string();
    assert!(error.contains("a.mcap") && error.to_lowercase().contains("exists"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), b"precious");
    let options = WriterOptions { overwrite: true, ..WriterOptions::default() };
    Writer::create(&path, &header(), options).unwrap().finish(RecordingCounts::default()).unwrap();
    assert!(Reader::open(&path).is_ok());
}

#[test]
fn a_file_cut_anywhere_gives_its_whole_chunks() {
    let folder = Folder::new("cut");
    let path = folder.0.join("whole.mcap");
    record(&path, 2000, Compression::Lz4);
    let bytes = std::fs::read(&path).unwrap();
    let (all, _) = datagrams(&Reader::open(&path).unwrap());
    let mut before = 0;
    for k in 0..=400 {
        let cut = bytes.len() * k / 400;
        let part = folder.0.join("part.mcap");
        std::fs::write(&part, &bytes[..cut]).unwrap();
        let Ok(reader) = Reader::open(&part) else {
            assert!(cut < 2000, "nothing read of {cut} bytes");
            continue;
        };
        let (left, bad) = datagrams(&reader);
        assert_eq!(bad, 0);
        assert!(left.len() >= before, "fewer datagrams of more bytes");
        assert_eq!(left[..], all[..left.len()]);
        before = left.len();
    }
    assert_eq!(before, 2000);
}

/// The first chunk: its place and the size of what it holds, packed; where chunks end hangs on the writer's clock.
fn first_chunk(file: &[u8]) -> (usize, usize) {
    // By the lengths that agree: opcode 6, and the record's length less the packed size is 40 without a name.
    (5000..file.len())
        .find_map(|k| {
            let word = |at: usize| Some(u64::from_le_bytes(file.get(at..at + 8)?.try_into().unwrap()));
            let (length, packed) = (word(k + 1)?, word(k + 41)?);
            (file[k] == 6 && length > 1000 && packed + 40 == length).then(|| (k, usize::try_from(packed).unwrap()))
        })
        .unwrap()
}

#[test]
fn a_damaged_chunk_is_skipped_and_counted() {
    let folder = Folder::new("damage");
    let path = folder.0.join("whole.mcap");
    record(&path, 3000, Compression::None);
    let mut bytes = std::fs::read(&path).unwrap();
    let (all, _) = datagrams(&Reader::open(&path).unwrap());
    let (chunk, packed) = first_chunk(&bytes);
    bytes[chunk + 49 + packed / 2] ^= 0x40;
    std::fs::write(&path, &bytes).unwrap();
    let (left, bad) = datagrams(&Reader::open(&path).unwrap());
    assert_eq!(bad, 1);
    assert!(left.len() > 1000 && left.len() < 3000, "{} datagrams are left", left.len());
    assert!(left.iter().all(|d| all.contains(d)));
}

#[test]
fn a_byte_damaged_anywhere_loses_nothing_uncounted() {
    let folder = Folder::new("anywhere");
    let path = folder.0.join("whole.mcap");
    record(&path, 3000, Compression::None);
    let whole = std::fs::read(&path).unwrap();
    let (all, _) = datagrams(&Reader::open(&path).unwrap());
    for k in 0..60 {
        // Over the whole file, and byte by byte through what follows the last chunk: indices and the summary.
        let place = if k % 2 == 0 { whole.len() * k / 60 } else { whole.len() - 1 - 7 * k };
        let mut bytes = whole.clone();
        bytes[place] ^= 0x40;
        std::fs::write(&path, &bytes).unwrap();
        let Ok(reader) = Reader::open(&path) else {
            assert!(place < 2000, "nothing read for byte {place}");
            continue;
        };
        let (left, bad) = datagrams(&reader);
        let counted = reader.rebuilt().gaps + reader.rebuilt().large_chunks + bad;
        assert!(left.len() == all.len() || counted > 0, "byte {place}: {} of {} uncounted", left.len(), all.len());
        let mut rest = all.iter();
        assert!(left.iter().all(|d| rest.any(|other| other == d)), "byte {place}: not what was written");
    }
}

#[test]
fn a_damaged_length_loses_no_more_than_its_chunk() {
    let folder = Folder::new("length");
    let path = folder.0.join("whole.mcap");
    record(&path, 3000, Compression::None);
    let whole = std::fs::read(&path).unwrap();
    let (chunk, _) = first_chunk(&whole);
    let opcodes = (0..8).map(|bit| (chunk, 1 << bit));
    for (place, flip) in opcodes.chain([(chunk + 3, 1), (chunk + 8, 0x80), (chunk + 30, 0xFF), (chunk + 37, 2)]) {
        let mut bytes = whole.clone();
        bytes[place] ^= flip;
        std::fs::write(&path, &bytes).unwrap();
        let reader = Reader::open(&path).unwrap();
        let (left, bad) = datagrams(&reader);
        // A length that is too large counts as a chunk that is too large to be unpacked.
        let counted = reader.rebuilt().gaps + reader.rebuilt().large_chunks + bad;
        assert_eq!(counted, 1, "byte {place} ^ {flip}: {:?}", reader.rebuilt());
        assert!(left.len() >= 2000, "byte {place}: {} datagrams are left", left.len());
        assert!(!reader.rebuilt().unfinished);
    }
}

#[test]
fn a_writer_that_is_dropped_writes_everything_and_states_that_it_was_not_finished() {
    let folder = Folder::new("drop");
    let path = folder.0.join("a.mcap");
    let writer = Writer::create(&path, &header(), WriterOptions::default()).unwrap();
    for k in 0..100 {
        writer.datagram(k, u64::try_from(k).unwrap(), &datagram(0)).unwrap();
    }
    drop(writer);
    let reader = Reader::open(&path).unwrap();
    assert_eq!(datagrams(&reader).0.len(), 100);
    assert_eq!(reader.ending(), None);
}

#[test]
fn a_discarded_recording_ends_with_messages_still_waiting() {
    for k in 0..50 {
        let folder = Folder::new("discard");
        let path = folder.0.join("a.mcap");
        let writer = Writer::create(&path, &header(), WriterOptions::default()).unwrap();
        for _ in 0..k {
            writer.note(1_000_000_000_500, None, "before the first datagram").unwrap();
        }
        let (done, ended) = std::sync::mpsc::channel();
        std::thread::spawn(move || done.send(writer.discard()));
        ended.recv_timeout(std::time::Duration::from_secs(30)).expect("the writing thread ends").unwrap();
        assert!(!path.exists());
    }
}

#[test]
fn a_full_disk_is_one_error() {
    let options = WriterOptions { overwrite: true, ..WriterOptions::default() };
    let error = Writer::create(Path::new("/dev/full"), &header(), options).err().map(|e| e.to_string());
    assert_eq!(error.as_deref(), Some("/dev/full: No space left on device (os error 28)"));
}

#[test]
fn wrong_files_are_refused_in_one_line() {
    let folder = Folder::new("wrong");
    let path = folder.0.join("a.mcap");
    for (bytes, reason) in [
        (&b"\x1f\x8b\x08\x00\x00\x00\x00\x00"[..], "byte 0: starts with 1F 8B 08 00, not with the MCAP magic"),
        (&b""[..], "byte 0: the file ends inside the MCAP magic"),
        (&b"\x89MCAP0\r"[..], "byte 7: the file ends inside the MCAP magic"),
        (&b"\x89MCAP0\r\n"[..], "is not a taxel recording"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let error = Reader::open(&path).unwrap_err().to_string();
        assert!(error.contains(reason) && error.contains("a.mcap") && !error.contains('\n'), "{error}");
    }
}

#[test]
fn all_that_a_decoder_of_version_2_could_not_use_is_damage() {
    let found = v2::Counts {
        datagrams: 9,
        old: 1,
        short: 2,
        long: 3,
        foreign: 4 + 12,
        other_board: 12,
        checksum: 5,
        unknown_kind: 6,
        unknown_flags: 7,
        malformed: 8,
        outside: 9,
        unknown_marker: 10,
        unknown_value: 11,
        ..v2::Counts::default()
    };
    let decoder = Counts::of_decoders(&wire::Counts::default(), &found, &wire::SenderTotals::default());
    let counts = RecordingCounts { received: 9, recorded: 9, missing: Some(0), decoder, ..RecordingCounts::default() };
    let verdict = counts.verdict();
    let expected = [
        ("datagrams_damaged", 2 + 3 + 4 + 5),
        ("datagrams_of_another_board", 12),
        ("datagrams_too_late", 1),
        ("taxels_outside_the_array", 9),
        ("datagrams_of_an_unknown_kind", 6),
        ("datagrams_with_unknown_flags", 7),
        ("markers_with_an_unknown_code", 10),
        ("malformed_bodies", 8),
        ("differences_from_an_unknown_value", 11),
    ];
    let damaged: Vec<_> = verdict.counts.iter().map(|(cause, n)| (cause.key(), n)).collect();
    assert_eq!((damaged, verdict.status), (expected.to_vec(), RecordingStatus::Damaged));
}

#[test]
fn the_verdict_states_what_was_lost_where() {
    let sound = RecordingCounts { received: 10, recorded: 10, ..RecordingCounts::default() };
    assert_eq!(sound.verdict().text(), NOTHING_LOST);
    let lossy = RecordingCounts {
        received: 10,
        recorded: 6,
        dropped_by_kernel: KernelDrops(Some(2)),
        dropped_by_queue: 3,
        ..RecordingCounts::default()
    };
    let verdict = lossy.verdict().text();
    for part in
        ["LOST: 2 messages dropped by the kernel", "3 datagrams dropped by taxel's queue", "1 datagram received"]
    {
        assert!(verdict.contains(part), "{verdict}");
    }
    let damaged = RecordingCounts { decoder: [(Cause::BytesSkipped, 7)].into(), ..sound };
    assert_eq!(damaged.verdict().text(), format!("{NOTHING_LOST}; damaged: 7 bytes skipped"));
}

#[test]
fn what_a_kernel_does_not_count_is_unknown_unless_the_board_numbers_what_it_sends() {
    let sound = RecordingCounts { received: 10, recorded: 10, ..RecordingCounts::default() };
    let uncounted = RecordingCounts { dropped_by_kernel: KernelDrops::UNKNOWN, ..sound.clone() };
    let verdict = uncounted.verdict();
    assert_eq!(verdict.status, RecordingStatus::Unknown);
    assert_eq!(verdict.text(), "losses unknown: the kernel does not count dropped datagrams");
    let numbered = RecordingCounts { missing: Some(0), ..uncounted.clone() }.verdict();
    assert_eq!((numbered.status, numbered.text().as_str()), (RecordingStatus::Complete, "nothing lost"));
    let missing = RecordingCounts { missing: Some(5), dropped_by_queue: 2, recorded: 8, ..uncounted.clone() }.verdict();
    assert_eq!(missing.counts, [(Cause::QueueDropped, 2), (Cause::OnTheWay, 3)].into());
    let dropped = RecordingCounts { dropped_by_queue: 1, recorded: 9, ..uncounted.clone() }.verdict();
    assert_eq!(dropped.text(), "LOST, at least: 1 datagram dropped by taxel's queue");
    // In a file it is null; a file that says nothing of it was written where the kernel counts.
    let json = serde_json::to_value(&uncounted).unwrap();
    assert_eq!(json["dropped_by_kernel"], serde_json::Value::Null);
    assert_eq!(serde_json::from_value::<RecordingCounts>(json).unwrap(), uncounted);
    assert_eq!(serde_json::from_str::<RecordingCounts>("{\"received\":10,\"recorded\":10}").unwrap(), sound);
}
