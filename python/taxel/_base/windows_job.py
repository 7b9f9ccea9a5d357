"""Jobs of Windows: a process and its descendants, which end together."""

from __future__ import annotations

import sys

if sys.platform == "win32":
    import ctypes
    import struct

    #: JobObjectExtendedLimitInformation, and its struct JOBOBJECT_EXTENDED_LIMIT_INFORMATION.
    _LIMITS, _STRUCT = 9, struct.Struct("@2q I 2P I P 2I 6Q 4P")
    #: JOB_OBJECT_LIMIT_JOB_MEMORY and JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE.
    _BOUNDS_MEMORY, _ENDS_WITH_HANDLE = 0x200, 0x2000

    _kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    _kernel.CreateJobObjectW.restype = ctypes.c_void_p

    class Job:
        """Processes that end when this process ends or calls `end`.

        Parameters
        ----------
        memory : int, bytes
            How much they may take together; 0: as much as there is.
        """

        def __init__(self, memory: int = 0) -> None:
            self._handle = ctypes.c_void_p(_kernel.CreateJobObjectW(None, None))
            flags = _ENDS_WITH_HANDLE | (_BOUNDS_MEMORY if memory else 0)
            limits = _STRUCT.pack(0, 0, flags, *[0] * 13, memory, 0, 0)
            _check(_kernel.SetInformationJobObject(self._handle, _LIMITS, limits, len(limits)))

        def add(self, process: int) -> None:
            """Add a process, by its handle; processes that it starts later belong to the job too."""
            _check(_kernel.AssignProcessToJobObject(self._handle, ctypes.c_void_p(process)))

        def end(self, code: int) -> None:
            """End all processes with an exit code."""
            if self._handle:
                _kernel.TerminateJobObject(self._handle, code)
                _kernel.CloseHandle(self._handle)
                self._handle = ctypes.c_void_p()

    def _check(succeeded: int) -> None:
        if not succeeded:
            raise ctypes.WinError(ctypes.get_last_error())
