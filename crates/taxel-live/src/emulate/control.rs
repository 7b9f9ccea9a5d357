//! The emulated board's UART: five-byte commands in, ASCII status lines out, over a TCP port.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};

use taxel_core::board::Board;

use crate::{Error, Result};

/// Reads commands from the connected host. On the TCP port there is one host at a time, as a UART has one cable: a new connection
/// replaces the old one.
#[derive(Debug)]
pub(super) struct CommandPort {
    listener: Option<(TcpListener, SocketAddr)>,
    cable: Option<TcpStream>,
}

impl CommandPort {
    pub(super) fn open(address: Option<SocketAddr>) -> Result<Self> {
        let mut control = Self { listener: None, cable: None };
        if let Some(address) = address {
            let with_address = |error| Error::socket(format!("TCP {address}"))(error);
            let listener = TcpListener::bind(address).map_err(with_address)?;
            listener.set_nonblocking(true).map_err(with_address)?;
            let found = listener.local_addr().map_err(with_address)?;
            control.listener = Some((listener, found));
        }
        Ok(control)
    }

    pub(super) fn address(&self) -> Option<SocketAddr> {
        self.listener.as_ref().map(|(_, address)| *address)
    }

    /// Sends the line that a board sends at reset.
    pub(super) fn send_greeting(&mut self, board: &Board) {
        send(&mut self.cable, &board.greeting());
    }

    /// Executes received commands and answers them; never waits.
    pub(super) fn serve(&mut self, board: &mut Board) {
        if let Some((listener, _)) = &self.listener
            && let Ok((mut cable, _)) = listener.accept()
        {
            let ready = cable.set_nonblocking(true).and_then(|()| cable.set_nodelay(true));
            let ready = ready.and_then(|()| cable.write_all(board.greeting().as_bytes()));
            self.cable = ready.is_ok().then_some(cable);
        }
        send(&mut self.cable, &board.faults());
        let mut bytes = [0; 256];
        while let Some(cable) = &mut self.cable {
            match cable.read(&mut bytes) {
                Ok(0) => self.cable = None,
                Ok(n) => {
                    let lines = board.command(&bytes[..n]);
                    send(&mut self.cable, &lines);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => self.cable = None,
            }
        }
    }
}

/// Sends status lines. They are lost if nothing reads them, as on a UART; a closed connection is dropped.
fn send(cable: &mut Option<TcpStream>, lines: &str) {
    if let Some(stream) = cable
        && let Err(error) = stream.write_all(lines.as_bytes())
        && error.kind() != ErrorKind::WouldBlock
    {
        *cable = None;
    }
}
