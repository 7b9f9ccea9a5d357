//! From one computer's pipeline to another's: what came there comes here, every loss is counted, and there is one clock.

mod ways;

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use taxel_core::{Array, Stop};
use taxel_live::bridged::Bridged;
use taxel_live::capture::{ParcelFeed, Receiver, ReceiverOptions, Sender};
use taxel_live::host_clock::RoundTrip;
use taxel_live::pipeline::{Copied, Live, LiveOptions, LiveSummary, ReadoutSetup};
use taxel_live::recording::{Reader, Topic, now_ns};

const ANY: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

/// The other computer's clock: 3.7 s ahead, 50 ppm fast.
const AHEAD_NS: i64 = 3_700_000_000;
const DRIFT: f64 = 50e-6;

fn there(here_ns: i64, since_ns: i64) -> i64 {
    here_ns + AHEAD_NS + ((here_ns - since_ns) as f64 * DRIFT) as i64
}

struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("taxel-bridged-{}-{name}", std::process::id()));
        let _ = std::fs::remove_file(&path);
        Self(path)
    }

    fn options(&self) -> LiveOptions {
        LiveOptions { record: Some(self.0.clone()), ..LiveOptions::new(Array::thesis()) }
    }

    /// Datagrams with their arrival times, ns.
    fn recorded(&self) -> Vec<(i64, Vec<u8>)> {
        let mut found = vec![];
        let reader = Reader::open(&self.0).expect("a recording");
        reader
            .messages(Stop::never(), |message| {
                if message.topic == Topic::Datagrams {
                    found.push((message.at_ns, message.data.to_vec()));
                }
                Ok(())
            })
            .expect("sound chunks");
        found
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Each of them once, of 1 to 280 events.
fn datagrams(n: usize) -> Vec<Vec<u8>> {
    (0..n).map(|k| [0xC0, (k >> 8) as u8 & 0x3F, k as u8 & 0x3F, 3, 4].repeat(1 + k % 280)).collect()
}

fn wait_until(what: impl Fn() -> bool) {
    let begun = Instant::now();
    while !what() {
        assert!(begun.elapsed() < Duration::from_secs(30), "never came");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// A minute of round trips that took 300 us, ending now.
fn compare(feed: &ParcelFeed, since_ns: i64) {
    let now = now_ns();
    for k in (1..=240).rev() {
        let asked = now - k * 250_000_000;
        let (came, back) = (asked + 150_000, asked + 300_000);
        feed.compare(RoundTrip { asked, came: there(came, since_ns), answered: there(came, since_ns), back });
    }
}

/// Sends `n` datagrams to one pipeline, carries its parcels to another by way of `carry`, and ends both.
fn bridged(
    n: usize,
    name: &str,
    mut carry: impl FnMut(usize, Vec<u8>) -> Vec<Vec<u8>>,
) -> (Scratch, LiveSummary, Scratch, LiveSummary) {
    let (near, far) = (Scratch::new(&format!("{name}-near.mcap")), Scratch::new(&format!("{name}-far.mcap")));
    let since = now_ns() - 60_000_000_000;
    let source = Live::start(ANY, near.options(), ReadoutSetup::None, vec![]).expect("a port");
    let mut copies = source.handle().copy().expect("it runs");
    let (receiver, feed) = Receiver::fed("zenoh:there/left", ReceiverOptions::default());
    let live = Live::start_fed(receiver, far.options(), ReadoutSetup::None, vec![]).expect("nothing to refuse");
    feed.begin_session();
    compare(&feed, since);
    let to = source.address();
    let sends = std::thread::spawn(move || {
        let mut sender = Sender::open(to, false).expect("a socket");
        for datagram in datagrams(n) {
            sender.push(&datagram).expect("sent");
            std::thread::sleep(Duration::from_micros(50));
        }
    });
    let mut source = Some(source);
    let mut ended = None;
    let mut k = 0;
    loop {
        match copies.next(Duration::from_millis(20)) {
            Some(Copied::Parcel(mut parcel)) => {
                let base = i64::from_le_bytes(parcel[24..32].try_into().unwrap());
                parcel[24..32].copy_from_slice(&there(base, since).to_le_bytes());
                for parcel in carry(k, parcel) {
                    assert!(feed.push(&parcel), "one session");
                }
                k += 1;
            }
            Some(Copied::Frame(_) | Copied::Detection(_)) => {}
            None if copies.is_over() => break,
            None => {}
        }
        if sends.is_finished()
            && let Some(live) = source.take_if(|live| live.counters().decoding.decoded == n as u64)
        {
            ended = Some(live.stop().expect("a sound way"));
        }
    }
    sends.join().expect("sent");
    let received = live.counters().capture.datagrams;
    wait_until(|| live.counters().decoding.decoded == received);
    (near, ended.expect("ended"), far, live.stop().expect("a sound way"))
}

fn came(summary: &LiveSummary) -> Bridged {
    summary.counters.bridged.expect("a bridge")
}

#[test]
fn what_came_there_comes_here_and_as_of_this_clock() {
    let (near, sent, far, received) = bridged(3000, "whole", |_, parcel| vec![parcel]);
    assert_eq!(sent.counters.bridged, None);
    assert_eq!(received.counters.decoding.decoded, 3000);
    assert_eq!(received.counters.decoding.wire, sent.counters.decoding.wire);
    let bridged = came(&received);
    assert_eq!((bridged.missing, bridged.dropped, bridged.refused, bridged.ended), (0, 0, 0, true));
    assert_eq!(bridged.dropped_by_kernel.are_known(), !ways::is_portable());
    let verdict = if ways::is_portable() { "losses unknown" } else { "nothing lost" };
    assert!(received.verdict.text.starts_with(verdict), "{}", received.verdict.text);
    let (there, here) = (near.recorded(), far.recorded());
    assert_eq!(there.len(), 3000);
    for (a, b) in there.iter().zip(&here) {
        assert_eq!(a.1, b.1);
        assert!((a.0 - b.0).abs() < 10_000, "both clocks are this computer's: {} ns apart", a.0 - b.0);
    }
}

#[test]
fn what_is_lost_repeated_or_spoilt_on_the_way_is_counted() {
    let mut spoilt = 0;
    let (_near, _, far, received) = bridged(3000, "lossy", |k, mut parcel| match k % 7 {
        2 => vec![],
        3 => vec![parcel.clone(), parcel],
        5 => {
            parcel.pop();
            spoilt += 1;
            vec![parcel]
        }
        _ => vec![parcel],
    });
    let bridged = came(&received);
    let came = far.recorded().len() as u64;
    assert!(bridged.missing > 0 && spoilt > 0);
    assert_eq!(bridged.refused, spoilt);
    assert!(bridged.repeated > 0);
    assert_eq!(came, received.counters.decoding.decoded);
    // The first parcels and the last arrived (numbers 0 and 1 do), or what is beyond them is not known to be missing.
    if bridged.ended {
        assert_eq!(came + bridged.missing, 3000);
    }
    assert!(received.verdict.text.contains("lost between the computers"), "{}", received.verdict.text);
}

#[test]
fn a_bridge_that_is_begun_anew_is_met_anew_and_goes_on() {
    let (receiver, feed) = Receiver::fed("zenoh:there", ReceiverOptions::default());
    let live = Live::start_fed(receiver, LiveOptions::new(Array::thesis()), ReadoutSetup::None, vec![]).expect("begun");
    for session in 0..3 {
        let source = Live::start(ANY, LiveOptions::new(Array::thesis()), ReadoutSetup::None, vec![]).expect("a port");
        let mut copies = source.handle().copy().expect("it runs");
        let mut sender = Sender::open(source.address(), false).expect("a socket");
        sender.push(&datagrams(1)[0]).expect("sent");
        let before = live.counters().capture.datagrams;
        let mut met = 0;
        while live.counters().capture.datagrams == before {
            if let Some(Copied::Parcel(parcel)) = copies.next(Duration::from_millis(50)) {
                while !feed.push(&parcel) {
                    met += 1;
                    feed.begin_session();
                    let now = now_ns();
                    feed.compare(RoundTrip { asked: now, came: now, answered: now, back: now });
                }
            }
        }
        assert_eq!(met, 1, "session {session}");
        source.stop().expect("a sound way");
    }
    feed.fail("the board is another one now");
    let ended = (0..200).find_map(|_| live.next(Duration::from_millis(50)).err()).expect("it ends");
    assert!(ended.to_string().contains("zenoh:there: the board is another one now"), "{ended}");
    assert_eq!(live.counters().bridged.expect("a bridge").restarts, 2);
}
