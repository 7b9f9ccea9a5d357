"""Analysis of a recording: rest, pressure, and the health of its taxels."""
