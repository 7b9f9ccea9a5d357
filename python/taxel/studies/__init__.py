"""Studies: a protocol, its parameters, the published values as data, and a runner that gives all of them the rest."""
