"""Pages with pictures, each one file that needs no other."""

from taxel.report.information import write_information

__all__ = ["write_information"]
