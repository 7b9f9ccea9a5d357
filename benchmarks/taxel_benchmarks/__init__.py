"""Benchmarks: a module a question, which measures taxel and its peers in one run.

A benchmark is a module of this package without an underscore: its first lines state the question, the peers, the unit
and the goal; it has a function `run`, which measures, and a function `goals`, which judges a result. Modules with an
underscore are what benchmarks share. `taxel bench` runs them.
"""
