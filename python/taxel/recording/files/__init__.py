"""Files of taxel's own, one module for each kind: what reads and what writes it."""
