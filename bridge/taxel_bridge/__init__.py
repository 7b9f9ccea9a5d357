"""A board's datagrams, carried to other computers over Zenoh."""

from taxel_bridge.carrying import PLACE, Bridge

__all__ = ["PLACE", "Bridge"]
