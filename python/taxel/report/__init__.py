"""Pages with pictures; each page is one file that needs no other file."""

from taxel._base.files import write_whole
from taxel.report.detections import write_detections
from taxel.report.information import write_information

__all__ = ["write_detections", "write_information", "write_whole"]
