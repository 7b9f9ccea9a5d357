"""What drives modules: their clock and reset, and sources and sinks of streams that pause at random."""

import itertools
import random
from collections.abc import Callable, Iterable
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer
from cocotbext.axi import AxiStreamBus, AxiStreamSink

#: In how many clocks a side of a stream is willing.
PACES = (0.1, 0.5, 1.0)
#: Of the numbers that are drawn between limits, how many are one of these, one less or one more.
AT_LIMITS = 0.3


def within(low: int, high: int, *limits: int) -> int:
    """Return a number from low to high: `AT_LIMITS` of them at these two or further limits, one below or one above."""
    if random.random() < AT_LIMITS:
        near = [limit + k for limit in (low, high, *limits) for k in (-1, 0, 1)]
        return random.choice([number for number in near if low <= number <= high])
    return random.randint(low, high)


class Pace:
    """Whether something happens in a clock: in `often` of them, at random."""

    often = 1.0

    def __call__(self) -> bool:
        return random.random() < self.often


async def begin(dut: Any, **inputs: int) -> None:
    """Start a module's clock, set its inputs, and hold it in reset for some clocks; inputs change as it falls."""
    Clock(dut.clk, 10, "ns").start()
    await reset(dut, **inputs)


async def reset(dut: Any, **inputs: int) -> None:
    """Set inputs, and hold a module in reset for some clocks."""
    for name, value in inputs.items():
        dut[name].value = value
    dut.reset.value = 1
    await clocks(dut.clk, 4)
    dut.reset.value = 0


async def clocks(clk: Any, count: int) -> None:
    """Wait for so many falls of a clock."""
    for _ in range(count):
        await FallingEdge(clk)


async def settled() -> None:
    """Wait until what depends on inputs has followed them, within half a clock."""
    await Timer(1, "ns")


async def vary(clk: Any, count: int, *paces: Pace) -> None:
    """Run for so many clocks with each combination of paces."""
    for combination in itertools.product(PACES, repeat=len(paces)):
        for pace, often in zip(paces, combination, strict=True):
            pace.often = often
        await clocks(clk, count)


async def offer(
    clk: Any, valid: Any, ready: Any, put: Callable[[Any], None], values: Iterable[Any], pace: Pace
) -> None:
    """Offer values one after the other: each stands until it is taken, and pauses come between."""
    for value in values:
        while not pace():
            await FallingEdge(clk)
        put(value)
        valid.value = 1
        taken = False
        while not taken:
            await settled()
            taken = bool(int(ready.value))
            await FallingEdge(clk)
        valid.value = 0


async def stands(dut: Any) -> None:
    """Assert of a module's stream of beats that what is offered stands until it is taken."""
    signals = [dut[name] for name in ("tdata", "tkeep", "tlast") if hasattr(dut, name)]
    stood = None
    while True:
        await RisingEdge(dut.clk)
        offered = [int(signal.value) for signal in signals] if int(dut.tvalid.value) else None
        assert stood is None or stood == offered, f"{stood} was offered, then {offered}"
        taken = int(dut.tready.value) or int(dut.reset.value)
        stood = None if taken else offered


class Sink(AxiStreamSink):
    """Takes the datagrams of a module's stream of beats, with pauses."""

    def __init__(self, dut: Any, pace: Pace) -> None:
        super().__init__(AxiStreamBus.from_entity(dut), dut.clk, dut.reset)
        self.set_pause_generator(not pace() for _ in itertools.count())
        cocotb.start_soon(stands(dut))

    def datagrams(self) -> list[bytes]:
        """Return the datagrams that ended since this was last asked; a last beat may leave out its last bytes."""
        whole = []
        while not self.empty():
            frame = self.recv_nowait(compact=False)
            kept = frame.tkeep or [1] * len(frame.tdata)
            count = sum(kept)
            assert kept == [1] * count + [0] * (len(kept) - count), kept
            assert len(kept) - count < self.byte_lanes, kept
            whole.append(bytes(frame.tdata[:count]))
        return whole


def same(came: list[Any], expected: list[Any]) -> None:
    """Compare what came with what was expected, and name the first that differs."""
    for k, (one, other) in enumerate(zip(came, expected, strict=False)):
        assert one == other, f"number {k}: {one!r} came, {other!r} was expected"
    assert len(came) == len(expected), f"{len(came)} came, {len(expected)} were expected"
