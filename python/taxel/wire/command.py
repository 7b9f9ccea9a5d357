"""Commands, host to board: five bytes that set a register (thesis, Appendix 1, Table 5.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from taxel import _core
from taxel._base.arguments import buffer_bytes, integer


@dataclass(frozen=True)
class Command:
    """Set one of the board's 32-bit registers: five bytes on the serial line (Table 5.1).

    Parameters
    ----------
    register : int, 0 to 7
    value : int, 0 to 2**32 - 1
        The whole register.

    Raises
    ------
    ProblemError : a register or a value out of these ranges

    Notes
    -----
    Thesis, Appendix 1, Table 5.1.

    Examples
    --------
    >>> Command(1, 300).to_bytes().hex()
    '900000012c'
    >>> Command.from_bytes(bytes.fromhex("900000012c"))
    Command(register=1, value=300)
    """

    register: int
    value: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "register", integer("register", self.register, 0, 7))
        object.__setattr__(self, "value", integer("value", self.value, 0, 2**32 - 1))

    def to_bytes(self) -> bytes:
        """Return the five bytes.

        Returns
        -------
        bytes, 5

        Examples
        --------
        >>> list(Command(7, 1).to_bytes())
        [240, 0, 0, 0, 1]
        """
        return _core.command_bytes(self.register, self.value)

    @classmethod
    def from_bytes(cls, data: Any) -> Command:
        """Read five bytes.

        Parameters
        ----------
        data : bytes, or anything with a contiguous buffer

        Returns
        -------
        Command

        Raises
        ------
        ProblemError : `data` is not bytes
        FormatError : not five bytes, or a byte whose top bit is wrong (names the byte)

        Examples
        --------
        >>> Command.from_bytes(Command(4, 140).to_bytes()).value
        140
        """
        return cls(*_core.command_read(buffer_bytes(data)))
