"""Readers of recordings, one module for each kind of file."""
