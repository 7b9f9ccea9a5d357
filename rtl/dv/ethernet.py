"""What a frame of Ethernet holds, by a parser of its own: RFC 791, RFC 768, IEEE 802.3."""

from __future__ import annotations

import struct
import zlib

#: The least gap between frames, byte times.
GAP = 12
#: What the sender has built in: MAC addresses of receiver and sender, IP addresses of sender and receiver, both ports.
MACS = b"\xff" * 6 + b"\x02TAX\0\0"
IPS = bytes([192, 168, 52, 8, 192, 168, 52, 1])
PORTS = struct.pack(">HH", 5208, 5208)


def payload_of(frame: bytes, *, macs: bytes = MACS, ips: bytes = IPS, ports: bytes = PORTS) -> bytes:
    """Return the payload of a frame with preamble and check sequence, after looking at all that goes with it."""
    assert frame[:8] == b"\x55" * 7 + b"\xd5"
    body, check = frame[8:-4], frame[-4:]
    assert check == struct.pack("<I", zlib.crc32(body))
    assert len(body) >= 60
    assert body[:14] == macs + b"\x08\x00"
    packet = body[14:]
    total = sum(struct.unpack(">10H", packet[:20]))
    assert (total & 0xFFFF) + (total >> 16) == 0xFFFF
    version, length, fragment, hops, protocol = struct.unpack(">HH2xHBB", packet[:10])
    assert (version, fragment, hops, protocol) == (0x4500, 0x4000, 64, 17)
    assert packet[12:24] == ips + ports
    udp_length, udp_checksum = struct.unpack(">HH", packet[24:28])
    assert (udp_length, udp_checksum) == (length - 20, 0)
    # What pads a short frame is zeros, and no more of them than it takes.
    assert packet[length:] == bytes(max(46 - length, 0))
    return packet[28:length]
