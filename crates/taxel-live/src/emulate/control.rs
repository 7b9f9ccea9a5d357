//! The emulated board's UART, as a TCP port: five-byte commands in, ASCII status lines out.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};

use taxel_core::board::Board;

use crate::{Error, Result};

/// Takes commands from whoever is connected; one at a time, as a UART has one cable: a new one takes the place of the old.
#[derive(Debug)]
pub(super) struct Control {
    listener: TcpListener,
    address: SocketAddr,
    cable: Option<TcpStream>,
    greeting: String,
}

impl Control {
    pub(super) fn listen(address: SocketAddr, board: &Board) -> Result<Self> {
        let listener = TcpListener::bind(address).map_err(place(address))?;
        listener.set_nonblocking(true).map_err(place(address))?;
        let address = listener.local_addr().map_err(place(address))?;
        Ok(Self { listener, address, cable: None, greeting: board.greeting() })
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Carries out what came and answers; never waits.
    pub(super) fn serve(&mut self, board: &mut Board) {
        if let Ok((cable, _)) = self.listener.accept() {
            let ready = cable.set_nonblocking(true).and_then(|()| cable.set_nodelay(true));
            self.cable = ready.is_ok().then_some(cable);
            self.say(&self.greeting.clone());
        }
        let faults = board.faults();
        self.say(&faults);
        let mut bytes = [0; 256];
        while let Some(cable) = &mut self.cable {
            match cable.read(&mut bytes) {
                Ok(0) => self.cable = None,
                Ok(n) => {
                    let lines = board.command(&bytes[..n]);
                    self.say(&lines);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => self.cable = None,
            }
        }
    }

    /// A status line that nobody reads is lost, as on a UART; a cable that was pulled is let go.
    fn say(&mut self, lines: &str) {
        if let Some(cable) = &mut self.cable
            && let Err(error) = cable.write_all(lines.as_bytes())
            && error.kind() != ErrorKind::WouldBlock
        {
            self.cable = None;
        }
    }
}

/// Names a socket in an error.
fn place(address: SocketAddr) -> impl FnOnce(std::io::Error) -> Error {
    Error::socket(format!("TCP {address}"))
}
