//! Serial lines, as ports (pseudo-terminals) and over TCP.

#![cfg(unix)]

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serialport::{SerialPort, TTYPort};
use taxel_live::Error;
use taxel_live::serial_line::{BAUD, SerialLine, SerialPlace};

const LONG: Duration = Duration::from_secs(30);

/// The end of a line at which the board is.
enum End {
    /// With the other end, which keeps its name while no program has it open.
    Port(TTYPort, #[expect(dead_code, reason = "held open")] TTYPort),
    Tcp(TcpStream),
}

impl End {
    /// What has arrived, after a short wait; nothing at the end.
    fn receive(&mut self) -> Vec<u8> {
        let mut bytes = [0; 4096];
        let read = match self {
            Self::Port(port, _) => port.read(&mut bytes),
            Self::Tcp(stream) => stream.read(&mut bytes),
        };
        bytes[..read.unwrap_or(0)].to_vec()
    }

    fn send(&mut self, bytes: &[u8]) {
        match self {
            Self::Port(port, _) => port.write_all(bytes),
            Self::Tcp(stream) => stream.write_all(bytes),
        }
        .expect("a line");
    }
}

/// A place of a kind, and a function that returns its other end once the line is open.
fn place_of(kind: &str) -> (SerialPlace, Box<dyn FnOnce() -> End>) {
    if kind == "port" {
        let (mut ours, theirs) = TTYPort::pair().expect("a pseudo-terminal");
        ours.set_timeout(Duration::from_millis(20)).expect("a time limit");
        let place = SerialPlace::new(&theirs.name().expect("a name"), BAUD).expect("a place");
        return (place, Box::new(|| End::Port(ours, theirs)));
    }
    let server = TcpListener::bind("127.0.0.1:0").expect("a port");
    let place = server.local_addr().expect("an address").to_string().parse().expect("a place");
    let accept = move || {
        let (stream, _) = server.accept().expect("a connection");
        stream.set_read_timeout(Some(Duration::from_millis(20))).expect("a time limit");
        stream.set_write_timeout(Some(Duration::from_millis(20))).expect("a time limit");
        End::Tcp(stream)
    };
    (place, Box::new(accept))
}

fn until(what: impl Fn() -> bool) {
    let begun = Instant::now();
    while !what() {
        assert!(begun.elapsed() < LONG, "never came");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_port_that_another_program_has_opened_is_refused_and_free_afterwards() {
    let (place, end) = place_of("port");
    let first = SerialLine::open(&place, LONG).expect("a line");
    let error = SerialLine::open(&place, LONG).err().expect("it is open");
    assert!(matches!(&error, Error::Socket { source, .. } if source.kind() == ErrorKind::ResourceBusy), "{error}");
    assert_eq!(error.to_string(), format!("{}: another program has opened this port", place.name()));
    drop(first);
    SerialLine::open(&place, LONG).expect("it is free");
    drop(end);
}

#[test]
fn a_place_without_a_port_or_a_server_is_refused() {
    let open = |text: &str| SerialLine::open(&text.parse().unwrap(), LONG).err().expect("none there");
    for text in ["/dev/no-such-port", "COM250"] {
        let error = open(text);
        assert!(matches!(&error, Error::Socket { source, .. } if source.kind() == ErrorKind::NotFound), "{error}");
    }
    for text in ["/dev/null", "/"] {
        let error = open(text).to_string();
        assert!(error.starts_with(&format!("{text}: no serial port (")), "{error}");
    }
    let closed = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let error = open(&closed.to_string());
    assert!(matches!(&error, Error::Socket { source, .. } if source.kind() == ErrorKind::ConnectionRefused), "{error}");
    assert!(error.to_string().starts_with(&format!("TCP {closed}: ")), "{error}");
}

#[test]
fn a_write_never_waits_and_a_read_returns_all_that_was_written() {
    for kind in ["port", "server"] {
        let (place, end) = place_of(kind);
        let mut line = SerialLine::open(&place, LONG).expect("a line");
        let mut end = end();
        let (mut written, piece) = (0, [7; 5000]);
        // Nothing is read: the line is full after a while.
        loop {
            match line.write(&piece).unwrap() {
                0 => break,
                n => written += n,
            }
        }
        let received = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let mut total = 0;
                while total < written {
                    total += end.receive().len();
                }
                received.store(true, Ordering::Relaxed);
                end.send(b"back");
            });
            until(|| received.load(Ordering::Relaxed));
            let (mut back, mut bytes) = (vec![], [0; 3]);
            while back.len() < 4 {
                let n = line.read(&mut bytes, Duration::from_millis(20)).unwrap();
                back.extend_from_slice(&bytes[..n]);
            }
            assert_eq!(back, b"back");
            assert_eq!(line.read(&mut bytes, Duration::ZERO).unwrap(), 0, "nothing more");
        });
    }
}
