//! The sums of capture close, with the sender's own count, whatever is lost where; where the kernel does not count what it
//! drops, that is unknown.

mod ways;

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use taxel_live::capture::{Batch, CaptureCounts, Receiver, ReceiverOptions, SendCounts, Sender};
use taxel_live::{Error, KernelDrops};
use ways::is_portable;

/// What is counted where the kernel drops nothing.
fn no_drops() -> KernelDrops {
    if is_portable() { KernelDrops::UNKNOWN } else { KernelDrops::default() }
}

const ANY: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

/// A receiver with a thread of its own, which queues datagrams until they are read.
fn bind(options: ReceiverOptions) -> Receiver {
    let receiver = Receiver::bind(ANY, options).expect("loopback binds");
    receiver.receive_in_thread(Duration::from_millis(1)).expect("a thread");
    receiver
}

/// Datagram `k` holds its own number, in a length that changes now and then, so that trains begin and end.
fn datagram(k: u64) -> Vec<u8> {
    let length = if k % 7 == 6 { 20 + (k % 90) as usize } else { 1400 };
    let mut bytes = vec![(k % 251) as u8; length];
    bytes[..8].copy_from_slice(&k.to_le_bytes());
    bytes
}

fn send(to: SocketAddr, datagrams: u64, segment: bool) -> SendCounts {
    let mut sender = Sender::open(to, segment).expect("a socket");
    for k in 0..datagrams {
        sender.push(&datagram(k)).expect("sent");
    }
    sender.flush().expect("sent");
    sender.counts()
}

/// Stops, reads the rest; returns what was received (number in the payload, our number) and the counts.
fn drain(receiver: &Receiver) -> (Vec<(u64, u64)>, CaptureCounts) {
    receiver.stop();
    let mut batch = Batch::new();
    let mut received = vec![];
    while !receiver.is_done() {
        receiver.receive(&mut batch, Duration::from_millis(100)).expect("a sound socket");
        for (d, bytes) in batch.iter() {
            let k = u64::from_le_bytes(bytes[..8].try_into().expect("8 bytes"));
            assert_eq!(bytes, datagram(k), "payload {k} came as it was sent");
            assert!(d.arrived_ns > 0);
            received.push((k, d.number));
        }
    }
    (received, receiver.counts())
}

#[test]
fn every_datagram_comes_once_in_order_with_and_without_trains() {
    for (segment, gro) in [(false, false), (false, true), (true, false), (true, true)] {
        let receiver = bind(ReceiverOptions { gro, ..ReceiverOptions::default() });
        let sent = send(receiver.address(), 3000, segment);
        let (received, counts) = drain(&receiver);
        assert_eq!(received, (0..3000).map(|k| (k, k)).collect::<Vec<_>>());
        assert_eq!((counts.datagrams, counts.bytes), (sent.datagrams, sent.bytes));
        assert_eq!((counts.dropped_by_kernel, counts.dropped_by_queue, counts.waiting), (no_drops(), 0, 0));
        assert_eq!(counts.stamped_when_read, is_portable());
        if segment && gro && counts.gro && sent.segmenting {
            assert_eq!(counts.messages, sent.messages, "a train arrives as the train that was sent");
            assert!(counts.messages < counts.datagrams);
        } else {
            assert_eq!(counts.messages, sent.datagrams);
        }
    }
}

#[test]
fn who_takes_receives_by_himself_until_a_thread_does() {
    for (segment, gro, apart) in [(false, false, 60), (false, true, 0), (true, true, 25), (true, false, 99)] {
        let receiver = Receiver::bind(ANY, ReceiverOptions { gro, ..ReceiverOptions::default() }).expect("a port");
        let mut sender = Sender::open(receiver.address(), segment).expect("a socket");
        let (mut batch, mut received) = (Batch::new(), vec![]);
        assert!(!receiver.receive(&mut batch, Duration::from_millis(1)).expect("a sound socket"), "nothing came");
        for round in 0..60 {
            if round == apart {
                receiver.receive_in_thread(Duration::from_millis(apart % 2)).expect("a thread");
            }
            for k in 10 * round..10 * round + 10 {
                sender.push(&datagram(k)).expect("sent");
            }
            sender.flush().expect("sent");
            // The last of them are received after the stop.
            let begun = Instant::now();
            while round < 59 && received.len() < 10 * (round as usize + 1) && begun.elapsed() < Duration::from_secs(10)
            {
                receiver.receive(&mut batch, Duration::from_millis(100)).expect("a sound socket");
                received.extend(batch.iter().map(|(d, bytes)| (bytes.to_vec(), d.number)));
            }
        }
        let (rest, counts) = drain(&receiver);
        assert_eq!(rest, (590..600).map(|k| (k, k)).collect::<Vec<_>>());
        assert_eq!(received, (0..590).map(|k| (datagram(k), k)).collect::<Vec<_>>());
        assert_eq!((counts.datagrams, counts.bytes), (600, sender.counts().bytes));
        assert_eq!((counts.dropped_by_kernel, counts.dropped_by_queue, counts.waiting), (no_drops(), 0, 0));
        assert_eq!(counts.stamped_when_read, is_portable());
        assert!(!receiver.receive(&mut batch, Duration::from_secs(9)).expect("ended"), "after the end at once");
    }
}

#[test]
fn an_address_is_free_again_when_all_was_read_though_the_receiver_lives() {
    for apart in [false, true] {
        let receiver = bind(ReceiverOptions::default());
        if apart {
            receiver.receive_in_thread(Duration::ZERO).expect("a thread");
        }
        send(receiver.address(), 3, false);
        assert_eq!(drain(&receiver).0.len(), 3);
        Receiver::bind(receiver.address(), ReceiverOptions::default()).expect("a free address");
    }
}

#[test]
fn what_came_after_the_stop_is_left() {
    for apart in [false, true] {
        let receiver = Receiver::bind(ANY, ReceiverOptions::default()).expect("a port");
        if apart {
            receiver.receive_in_thread(Duration::ZERO).expect("a thread");
        }
        let to = receiver.address();
        let ended = AtomicBool::new(false);
        std::thread::scope(|scope| {
            // A sender that never pauses does not keep a receiver from ending.
            scope.spawn(|| {
                let mut sender = Sender::open(to, true).expect("a socket");
                while !ended.load(Ordering::Relaxed) {
                    sender.push(&datagram(0)).expect("sent");
                }
            });
            let (mut batch, begun) = (Batch::new(), Instant::now());
            receiver.receive(&mut batch, Duration::from_secs(10)).expect("a sound socket");
            receiver.stop();
            while !receiver.is_done() && begun.elapsed() < Duration::from_secs(60) {
                receiver.receive(&mut batch, Duration::from_millis(100)).expect("a sound socket");
            }
            ended.store(true, Ordering::Relaxed);
        });
        assert!(receiver.is_done());
    }
}

#[test]
fn what_the_kernel_drops_closes_the_sum_at_the_socket() {
    for (segment, gro) in [(false, false), (true, false), (true, true)] {
        // The kernel rounds 1 up to its least buffer: a datagram or two.
        let options = ReceiverOptions { kernel_buffer_bytes: 1, gro, ..ReceiverOptions::default() };
        let (sent, counts, received) = (0..20)
            .find_map(|_| {
                let receiver = bind(options);
                let sent = send(receiver.address(), 20_000, segment);
                let (received, counts) = drain(&receiver);
                let lost = counts.messages < if counts.gro { sent.messages } else { sent.datagrams };
                lost.then_some((sent, counts, received.len() as u64))
            })
            .expect("a buffer of two datagrams overflows");
        // Where trains arrive whole the kernel counts trains; else datagrams.
        let came = if segment && counts.gro && sent.segmenting { sent.messages } else { sent.datagrams };
        let known = KernelDrops(Some(came - counts.messages));
        assert_eq!(counts.dropped_by_kernel, if is_portable() { KernelDrops::UNKNOWN } else { known });
        assert_eq!(counts.datagrams, received);
        assert!(counts.datagrams < sent.datagrams);
    }
}

#[test]
fn what_our_queue_drops_closes_the_sum_behind_it_and_leaves_a_gap_in_the_numbers() {
    let receiver = bind(ReceiverOptions { queue_bytes: 1 << 16, ..ReceiverOptions::default() });
    let sent = send(receiver.address(), 2000, true);
    // No datagram is read before all have arrived.
    let begun = Instant::now();
    while receiver.counts().datagrams < sent.datagrams && begun.elapsed() < Duration::from_secs(10) {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(receiver.counts().waiting + receiver.counts().dropped_by_queue, 2000);
    send(receiver.address(), 1, false);
    let (received, counts) = drain(&receiver);
    assert_eq!(counts.dropped_by_kernel, no_drops());
    assert_eq!(counts.datagrams, sent.datagrams + 1);
    assert_eq!(counts.datagrams, received.len() as u64 + counts.dropped_by_queue);
    assert!(counts.dropped_by_queue > 1900, "64 KiB hold about fifty of two thousand");
    assert!(
        received[..received.len() - 1].iter().all(|&(k, number)| k == number),
        "a number counts what was dropped too"
    );
}

#[test]
fn a_port_that_is_taken_is_one_clear_error() {
    let holder = UdpSocket::bind(ANY).expect("a port");
    let address = holder.local_addr().expect("its address");
    let error = Receiver::bind(address, ReceiverOptions::default()).expect_err("the port is taken");
    assert!(matches!(&error, Error::Socket { source, .. } if source.kind() == std::io::ErrorKind::AddrInUse));
    assert!(error.to_string().starts_with(&format!("UDP {address}: ")), "{error}");
}

#[test]
fn a_queue_smaller_than_a_datagram_is_refused() {
    let error = Receiver::bind(ANY, ReceiverOptions { queue_bytes: 1000, ..ReceiverOptions::default() })
        .expect_err("too small");
    assert_eq!(error.to_string(), "queue_bytes is 1000: must be 65536 or more, the largest datagram");
}

#[test]
fn a_datagram_to_nobody_is_sent_and_counted() {
    let address = bind(ReceiverOptions::default()).address();
    let sent = send(address, 100, true);
    assert_eq!(sent.datagrams, 100);
}

#[test]
fn a_second_sender_is_told_in_the_midst_of_a_batch_and_another_address_too() {
    let receiver = Receiver::bind(ANY, ReceiverOptions::default()).expect("a port");
    let boards = [0; 3].map(|_| UdpSocket::bind(ANY).expect("a port"));
    for which in [0, 0, 1, 0, 0, 2, 2] {
        boards[which].send_to(&datagram(3), receiver.address()).expect("sent");
    }
    let mut batch = Batch::new();
    assert!(receiver.receive(&mut batch, Duration::from_secs(5)).expect("a sound socket"));
    assert_eq!(batch.iter().count(), 7, "one batch");
    let counts = receiver.counts();
    assert_eq!((counts.changes_between_senders, counts.changes_of_address), (1, 2));
}
