"""Pages with pictures, each one file that needs no other."""

from taxel._base.commit import code_version
from taxel._base.files import write_whole
from taxel.report.information import write_information
from taxel.report.listening import write_listening

__all__ = ["code_version", "write_information", "write_listening", "write_whole"]
