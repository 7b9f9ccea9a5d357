"""Pages with pictures, each one file that needs no other."""

from taxel._base.files import write_whole
from taxel.report.detections import write_detections
from taxel.report.information import write_information

__all__ = ["write_detections", "write_information", "write_whole"]
