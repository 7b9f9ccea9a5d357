"""Files of makers of insoles, plates, mats and skins: a module for each, found by entry points of `taxel.formats`."""

__all__: list[str] = []
