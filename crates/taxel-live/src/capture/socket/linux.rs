//! Linux's socket: the kernel stamps arrivals, merges datagrams and counts drops.

use std::io;
use std::mem::{size_of, size_of_val, zeroed};
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::{AsRawFd, RawFd};
use std::ptr::{from_mut, from_ref};
use std::time::Duration;

use libc::{c_int, c_void};

use super::senders::Senders;
use crate::capture::counts::Totals;
use crate::capture::options::ReceiverOptions;
use crate::capture::queue::Batch;
use crate::host_clock::Ahead;
use crate::kernel_drops::KernelDrops;
use crate::recording::now_ns;

/// Index of the drop count among the numbers of `SO_MEMINFO` (`SK_MEMINFO_DROPS` of linux/sock_diag.h).
const MEMINFO_DROPS: usize = 8;
const MEMINFO_NUMBERS: usize = 9;

/// Room for three control messages: stamp, drop count, segment size.
const CONTROL_BYTES: usize = 128;

#[repr(C, align(8))]
struct Control([u8; CONTROL_BYTES]);

#[derive(Debug)]
pub(crate) struct LinuxSocket {
    socket: UdpSocket,
    gro: bool,
    totals: Totals,
    senders: Senders<Address>,
    ahead: Ahead,
}

/// The address of a sender as the kernel writes it.
type Address = [u8; size_of::<libc::sockaddr_in6>()];

impl LinuxSocket {
    pub(super) fn bind(address: SocketAddr, options: &ReceiverOptions) -> io::Result<Self> {
        let socket = UdpSocket::bind(address)?;
        let fd = socket.as_raw_fd();
        let bytes = c_int::try_from(options.kernel_buffer_bytes).unwrap_or(c_int::MAX);
        // With CAP_NET_ADMIN the size may exceed net.core.rmem_max; without it, that is the limit.
        if set(fd, libc::SOL_SOCKET, libc::SO_RCVBUFFORCE, &bytes).is_err() {
            set(fd, libc::SOL_SOCKET, libc::SO_RCVBUF, &bytes)?;
        }
        set(fd, libc::SOL_SOCKET, libc::SO_TIMESTAMPNS, &1_i32)?;
        set(fd, libc::SOL_SOCKET, libc::SO_RXQ_OVFL, &1_i32)?;
        socket.set_nonblocking(true)?;
        // Kernels before 5.0 have no UDP_GRO: then each datagram needs its own call, and `gro` is false.
        let gro = options.gro && set(fd, libc::SOL_UDP, libc::UDP_GRO, &1_i32).is_ok();
        Ok(Self { socket, gro, totals: Totals::default(), senders: Senders::default(), ahead: Ahead::default() })
    }

    pub(super) fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    pub(super) fn gro(&self) -> bool {
        self.gro
    }

    pub(super) fn totals(&self) -> Totals {
        self.totals
    }

    pub(super) fn kernel_buffer_bytes(&self) -> u64 {
        let mut bytes = [0_u32; 1];
        let got = get(self.socket.as_raw_fd(), libc::SO_RCVBUF, &mut bytes);
        if got.is_ok() { u64::from(bytes[0]) } else { 0 }
    }

    pub(super) fn wait(&mut self, timeout: Duration) -> io::Result<bool> {
        let mut asked = libc::pollfd { fd: self.socket.as_raw_fd(), events: libc::POLLIN, revents: 0 };
        let timeout = libc::timespec {
            tv_sec: timeout.as_secs().try_into().unwrap_or(libc::time_t::MAX),
            tv_nsec: timeout.subsec_nanos().into(),
        };
        // SAFETY: one pollfd and the timeout live through the call; no signal mask is given.
        let ready = unsafe { libc::ppoll(&raw mut asked, 1, &raw const timeout, std::ptr::null()) };
        self.ahead.look();
        match ready {
            1.. => Ok(true),
            0 => Ok(false),
            _ => match io::Error::last_os_error() {
                error if error.kind() == io::ErrorKind::Interrupted => Ok(false),
                error => Err(error),
            },
        }
    }

    pub(super) fn receive(&mut self, batch: &mut Batch, ask: bool) -> io::Result<bool> {
        let start = batch.bytes.len();
        let room = batch.bytes.spare_capacity_mut();
        let mut part = libc::iovec { iov_base: room.as_mut_ptr().cast::<c_void>(), iov_len: room.len() };
        let mut control = Control([0; CONTROL_BYTES]);
        // SAFETY: msghdr is plain data, for which all zeros is a valid value (no name, no buffers, no control memory).
        let mut message: libc::msghdr = unsafe { zeroed() };
        message.msg_iov = &raw mut part;
        message.msg_iovlen = 1;
        message.msg_control = from_mut(&mut control).cast::<c_void>();
        message.msg_controllen = CONTROL_BYTES as _;
        let mut sender = Address::default();
        if ask {
            message.msg_name = from_mut(&mut sender).cast::<c_void>();
            message.msg_namelen = size_of_val(&sender) as libc::socklen_t;
        }
        // SAFETY: `message` points to memory that lives through the call: the spare capacity of `batch`, `control`
        // and `sender`.
        let got = unsafe { libc::recvmsg(self.socket.as_raw_fd(), &raw mut message, 0) };
        let Ok(got) = usize::try_from(got) else {
            let error = io::Error::last_os_error();
            return match error.kind() {
                io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted => Ok(false),
                _ => Err(error),
            };
        };
        if ask {
            self.senders.note(sender, &mut self.totals);
        }
        // SAFETY: the kernel wrote `got` bytes into the spare capacity, which is at least as long.
        unsafe { batch.bytes.set_len(start + got) };
        let mut arrived_ns = None;
        let mut segment = 0;
        // SAFETY: `message` was filled by recvmsg and its control memory is alive; the macros stay inside
        // msg_controllen, and each payload is read unaligned, of the type that the kernel writes for that kind.
        unsafe {
            let mut header = libc::CMSG_FIRSTHDR(&raw const message);
            while !header.is_null() {
                let data = libc::CMSG_DATA(header);
                match ((*header).cmsg_level, (*header).cmsg_type) {
                    (libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS) => {
                        let stamp = data.cast::<libc::timespec>().read_unaligned();
                        arrived_ns = Some(stamp.tv_sec * 1_000_000_000 + stamp.tv_nsec + self.ahead.0);
                    }
                    (libc::SOL_SOCKET, libc::SO_RXQ_OVFL) => self.note_dropped(data.cast::<u32>().read_unaligned()),
                    (libc::SOL_UDP, libc::UDP_GRO) => {
                        segment = usize::try_from(data.cast::<c_int>().read_unaligned()).unwrap_or(0);
                    }
                    _ => {}
                }
                header = libc::CMSG_NXTHDR(&raw const message, header);
            }
        }
        // The kernel stamps messages that arrive after SO_TIMESTAMPNS was set; one that was queued before has no stamp.
        batch.note_message(start, segment, arrived_ns.unwrap_or_else(now_ns));
        Ok(true)
    }

    pub(super) fn ask_dropped(&mut self) -> io::Result<()> {
        let mut numbers = [0_u32; MEMINFO_NUMBERS];
        get(self.socket.as_raw_fd(), libc::SO_MEMINFO, &mut numbers)?;
        self.note_dropped(numbers[MEMINFO_DROPS]);
        Ok(())
    }

    /// Whether none waits, or one that arrived since the end was requested was read.
    pub(super) fn has_read_until(&self, stopped_ns: i64, batch: &Batch) -> bool {
        batch.iter().last().is_none_or(|(last, _)| last.arrived_ns >= stopped_ns)
    }

    /// Adds the kernel's count, which has 32 bits and wraps around.
    #[allow(clippy::cast_possible_truncation)]
    fn note_dropped(&mut self, total: u32) {
        let known = self.totals.dropped_by_kernel.known();
        let more = total.wrapping_sub(known as u32);
        // A message may contain an older count than the one that was last read.
        if more <= u32::MAX / 2 {
            self.totals.dropped_by_kernel = KernelDrops(Some(known + u64::from(more)));
        }
    }
}

pub(crate) fn set(fd: RawFd, level: c_int, name: c_int, value: &c_int) -> io::Result<()> {
    let length = size_of::<c_int>() as libc::socklen_t;
    // SAFETY: `value` lives through the call and `length` is its size.
    let done = unsafe { libc::setsockopt(fd, level, name, from_ref(value).cast::<c_void>(), length) };
    if done == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

fn get(fd: RawFd, name: c_int, numbers: &mut [u32]) -> io::Result<()> {
    let mut length = size_of_val(numbers) as libc::socklen_t;
    // SAFETY: `numbers` lives through the call and `length` is its size in bytes; any bytes are valid u32.
    let done =
        unsafe { libc::getsockopt(fd, libc::SOL_SOCKET, name, numbers.as_mut_ptr().cast::<c_void>(), &raw mut length) };
    if done == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}
