"""Tests of the wire and the board, and the slow reading of the reference that judges them."""
