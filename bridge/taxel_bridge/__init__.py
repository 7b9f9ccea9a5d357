"""Boards published to other computers, and received from them, over Zenoh."""

from taxel_bridge.bridge import Bridge
from taxel_bridge.remote import Address, Remote

__all__ = ["Address", "Bridge", "Remote"]
