//! Resolves names of hosts to addresses, identically for senders and receivers.

use std::net::{SocketAddr, ToSocketAddrs};

use taxel_core::problem;

use crate::Result;

/// The address of a host, given by name or number, and a port. The first IPv4 address is preferred, so that "localhost"
/// resolves to the same address for a board that sends and for a host that listens.
///
/// # Errors
///
/// `Core(Problem)` if there is no such host.
pub fn of_host(host: &str, port: u16) -> Result<SocketAddr> {
    let found: Vec<SocketAddr> = (host, port).to_socket_addrs().map_or_else(|_| vec![], Iterator::collect);
    let Some(first) = found.iter().find(|address| address.is_ipv4()).or(found.first()) else {
        return Err(problem!("host"; " is {host:?}: must be an IP address or the name of a host").into());
    };
    Ok(*first)
}

/// Parses an address such as "127.0.0.1:5208", "localhost:5208" or "`[::1]`:5208".
///
/// # Errors
///
/// `Core(Problem)` if the text is not an address.
pub fn of_text(text: &str) -> Result<SocketAddr> {
    match host_and_port(text) {
        Some((host, port)) => of_host(host, port),
        None => Err(problem!("address {text:?}: must be a host and a port, for example 127.0.0.1:5208").into()),
    }
}

/// Splits an address into host and port; `None` if it is not an address.
#[must_use]
pub fn host_and_port(text: &str) -> Option<(&str, u16)> {
    let (host, port) = text.rsplit_once(':')?;
    let host = host.strip_prefix('[').and_then(|inner| inner.strip_suffix(']')).unwrap_or(host);
    port.parse().ok().filter(|_| !host.is_empty()).map(|port| (host, port))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn localhost_is_one_place() {
        assert_eq!(of_host("localhost", 5208).unwrap(), "127.0.0.1:5208".parse().unwrap());
        assert_eq!(of_text("localhost:5208").unwrap(), "127.0.0.1:5208".parse().unwrap());
    }

    #[test]
    fn addresses_are_read_as_they_are_written() {
        for text in ["127.0.0.1:5208", "[::1]:5208", "0.0.0.0:0", "[fe80::1]:9"] {
            assert_eq!(of_text(text).unwrap(), text.parse().unwrap());
        }
        assert_eq!(of_host("::1", 7).unwrap(), "[::1]:7".parse().unwrap());
        for text in ["nowhere", "", ":5208", "127.0.0.1", "127.0.0.1:99999", "127.0.0.1:", "no such host:1"] {
            assert!(of_text(text).is_err(), "{text}");
        }
    }
}
