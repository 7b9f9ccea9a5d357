"""Files of makers and of recorders: a module for each, which taxel finds by an entry point of `taxel.formats`."""

__all__: list[str] = []
