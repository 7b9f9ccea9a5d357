"""What a recording shows: rest, pressure, and the health of its taxels."""
