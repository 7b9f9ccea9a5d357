"""The live panel: a page in the browser for a board or recordings, and the server of the page."""

from taxel.panel.panel import Panel

__all__ = ["Panel"]
