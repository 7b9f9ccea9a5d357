//! Serial lines, as ports (pseudo-terminals) and over TCP: a board's commands and answers, and what can go wrong.

#![cfg(unix)]

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use serialport::{SerialPort, TTYPort};
use taxel_core::board::Board;
use taxel_core::wire::{Command, Greeting, Registers};
use taxel_core::{Array, Stop};
use taxel_live::Error;
use taxel_live::board_line::BoardLine;
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

    fn hang_up(self) {
        if let Self::Tcp(stream) = self {
            stream.shutdown(Shutdown::Both).expect("a line");
        }
    }

    /// Answers as a board does, until `over`.
    fn serve(&mut self, board: &mut Board, over: &AtomicBool) {
        while !over.load(Ordering::Relaxed) {
            let lines = board.command(&self.receive());
            self.send(lines.as_bytes());
        }
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

/// Runs a test on an open line of each kind.
fn on_each_line(timeout: Duration, test: impl Fn(BoardLine, End)) {
    for kind in ["port", "server"] {
        let (place, end) = place_of(kind);
        let line = BoardLine::open(place, timeout).expect("a line");
        test(line, end());
    }
}

fn board() -> Board {
    Board::new(Registers::default(), &Array::thesis()).expect("a valid preset")
}

fn until(what: impl Fn() -> bool) {
    let begun = Instant::now();
    while !what() {
        assert!(begun.elapsed() < LONG, "never came");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_board_takes_commands_and_answers() {
    on_each_line(LONG, |mut line, mut end| {
        let over = AtomicBool::new(false);
        let never = Stop::never();
        let (board, end) = std::thread::scope(|scope| {
            let served = scope.spawn(|| {
                let mut board = board();
                end.serve(&mut board, &over);
                (board, end)
            });
            assert_eq!(line.command(Command { register: 4, value: 140 }, never).unwrap(), 140);
            assert_eq!(line.command(Command { register: 6, value: 4 }, never).unwrap(), 140);
            let refused = line.command(Command { register: 2, value: 301 }, never).unwrap_err().to_string();
            assert!(
                refused.ends_with(": the board refuses REG2 = 0x0000012D (REG2 rule 1 of its registers)"),
                "{refused}"
            );
            let greeting = Greeting { wire_version: 1, rows: 64, columns: 64, channels: 16 };
            assert_eq!((line.greeting(never).unwrap(), line.resets()), (greeting, 0));
            let answers = ["ok REG4=0x0000008C", "ok REG4=0x0000008C", "bad REG2 rule 1", "taxel-board v1 64x64 16ch"];
            assert_eq!(line.take_lines().unwrap(), answers);
            over.store(true, Ordering::Relaxed);
            served.join().expect("no panic")
        });
        assert_eq!(board.registers().ramp, 140);
        end.hang_up();
        line.close();
        let closed = line.listen().unwrap_err();
        assert!(matches!(closed, Error::Core(taxel_core::Error::Device(_))), "{closed}");
    });
}

#[test]
fn wherever_the_lines_are_cut_they_mean_the_same() {
    let text =
        b"taxel-board v1 64x64 16ch\r\nfault queue 3\n\nok REG4=0x0000008C\nfault comparator 12\n\xc3\nfault queue 5\n";
    for seed in 0..5 {
        on_each_line(LONG, |mut line, mut end| {
            let (mut random, mut rest) = (StdRng::seed_from_u64(seed), &text[..]);
            while !rest.is_empty() {
                let (piece, others) = rest.split_at(random.random_range(1..=rest.len().min(9)));
                end.send(piece);
                rest = others;
                line.listen().unwrap();
            }
            let mut lines = vec![];
            until_lines(&mut line, &mut lines, 6);
            assert_eq!(
                lines[..4],
                ["taxel-board v1 64x64 16ch", "fault queue 3", "ok REG4=0x0000008C", "fault comparator 12"]
            );
            assert_eq!(line.faults().clone(), [("comparator".to_owned(), 12), ("queue".to_owned(), 5)].into());
            assert_eq!(line.resets(), 1);
        });
    }
}

fn until_lines(line: &mut BoardLine, lines: &mut Vec<String>, number: usize) {
    let begun = Instant::now();
    while lines.len() < number {
        lines.extend(line.take_lines().unwrap());
        assert!(begun.elapsed() < LONG, "{lines:?}");
    }
}

#[test]
fn an_answer_that_came_before_its_command_is_none() {
    // Long enough for the first answer, though the second call waits for its end.
    on_each_line(Duration::from_secs(1), |mut line, mut end| {
        let end = std::thread::scope(|scope| {
            let answered = scope.spawn(|| {
                while end.receive().is_empty() {}
                end.send(b"ok REG5=0x00000000\nok REG4=0x00000001\n");
                end
            });
            assert_eq!(line.command(Command { register: 5, value: 0 }, Stop::never()).unwrap(), 0);
            answered.join().expect("no panic")
        });
        let error = line.command(Command { register: 4, value: 1 }, Stop::never()).unwrap_err().to_string();
        assert!(error.ends_with(": no answer within 1 s: is this the board's serial line?"), "{error}");
        drop(end);
    });
}

#[test]
fn bytes_of_another_baud_rate_and_a_line_without_an_end_are_no_answer() {
    on_each_line(Duration::from_secs(1), |mut line, mut end| {
        let over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let over = &over;
            scope.spawn(move || {
                while !over.load(Ordering::Relaxed) {
                    if !end.receive().is_empty() {
                        end.send(&[0xfe, 0x80, 0, 0x1c].repeat(500));
                    }
                }
                end.hang_up();
            });
            let error = line.greeting(Stop::never()).unwrap_err().to_string();
            over.store(true, Ordering::Relaxed);
            let is_port = error.starts_with('/');
            let why = if is_port {
                "bytes arrived that are not text: is the board's baud rate 115200?"
            } else {
                "is this the board's"
            };
            assert!(error.contains(why), "{error}");
        });
    });
}

#[test]
fn a_line_that_never_pauses_ends_no_call() {
    on_each_line(Duration::from_millis(300), |mut line, mut end| {
        let over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    let sent = match &mut end {
                        End::Port(port, _) => port.write(&[b'x'; 1000]),
                        End::Tcp(stream) => stream.write(&[b'x'; 1000]),
                    };
                    // It fails where nothing reads.
                    drop(sent);
                }
            });
            line.listen().unwrap();
            assert!(line.greeting(Stop::never()).is_err());
            let held: usize = line.take_lines().unwrap().iter().map(String::len).sum();
            over.store(true, Ordering::Relaxed);
            assert!(held <= 256 * 1024, "{held}");
        });
    });
}

#[test]
fn a_line_that_hangs_up_while_it_is_read_is_an_error_that_says_so() {
    on_each_line(LONG, |mut line, mut end| {
        std::thread::scope(|scope| {
            scope.spawn(move || {
                while end.receive().is_empty() {}
                end.hang_up();
            });
            let error = line.greeting(Stop::never()).unwrap_err();
            assert!(
                matches!(&error, Error::Socket { source, .. } if source.kind() == ErrorKind::NotConnected),
                "{error}"
            );
            assert!(error.to_string().contains(": the line was disconnected"), "{error}");
        });
        let error = line.command(Command { register: 4, value: 1 }, Stop::never()).unwrap_err().to_string();
        assert!(error.contains(": the line was disconnected"), "{error}");
        let error = line.reopen(Duration::from_millis(100), Stop::never()).unwrap_err().to_string();
        assert!(error.contains(": no board answered within 0.1 s ("), "{error}");
    });
}

#[test]
fn a_call_that_waits_is_interrupted() {
    on_each_line(LONG, |mut line, end| {
        for call in 0..2 {
            let asked = AtomicBool::new(false);
            let is_asked = || asked.swap(true, Ordering::Relaxed);
            let stopped = match call {
                0 => line.greeting(Stop::when(&is_asked)),
                _ => line.reopen(LONG, Stop::when(&is_asked)),
            };
            assert!(matches!(stopped, Err(Error::Core(taxel_core::Error::Interrupted))), "{stopped:?}");
        }
        drop(end);
    });
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
