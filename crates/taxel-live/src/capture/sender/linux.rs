//! Sending in bursts on Linux: one call sends a train, which the kernel splits into datagrams.

use std::io;
use std::mem::{size_of, zeroed};
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::AsRawFd;
use std::ptr::from_mut;

use libc::c_void;
use socket2::SockAddr;

use crate::capture::socket::set;

#[repr(C, align(8))]
struct Control([u8; 64]);

/// Whether the kernel splits trains.
pub(super) fn splits_trains(socket: &UdpSocket) -> bool {
    set(socket.as_raw_fd(), libc::SOL_UDP, libc::UDP_SEGMENT, &0).is_ok()
}

/// Sends datagrams of `segment` bytes, the last of which may be shorter.
pub(super) fn send_train(socket: &UdpSocket, train: &mut [u8], segment: usize, to: SocketAddr) -> io::Result<()> {
    let to = SockAddr::from(to);
    let mut part = libc::iovec { iov_base: train.as_mut_ptr().cast::<c_void>(), iov_len: train.len() };
    let mut control = Control([0; 64]);
    // SAFETY: msghdr is plain data, for which all zeros is a valid value; the name, the buffer and the control
    // memory that it points to live through the call, and the control memory has room for one u16.
    let sent = unsafe {
        let mut message: libc::msghdr = zeroed();
        message.msg_name = to.as_ptr().cast_mut().cast::<c_void>();
        message.msg_namelen = to.len();
        message.msg_iov = &raw mut part;
        message.msg_iovlen = 1;
        message.msg_control = from_mut(&mut control).cast::<c_void>();
        message.msg_controllen = libc::CMSG_SPACE(size_of::<u16>() as u32) as _;
        let header = libc::CMSG_FIRSTHDR(&raw const message);
        (*header).cmsg_level = libc::SOL_UDP;
        (*header).cmsg_type = libc::UDP_SEGMENT;
        (*header).cmsg_len = libc::CMSG_LEN(size_of::<u16>() as u32) as _;
        let segment = u16::try_from(segment).unwrap_or(u16::MAX);
        libc::CMSG_DATA(header).cast::<u16>().write_unaligned(segment);
        libc::sendmsg(socket.as_raw_fd(), &raw const message, 0)
    };
    if sent < 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
}
