"""Pages with pictures, each one file that needs no other."""

from taxel._base.files import write_whole
from taxel._base.provenance import Sources, installed_sources
from taxel.report.information import write_information
from taxel.report.listening import Listened, write_listening

__all__ = ["Listened", "Sources", "installed_sources", "write_information", "write_listening", "write_whole"]
