"""Random order of lines, drawn line by line, against a model of the order alone."""

import numpy as np

from pair import Pair
from taxel.wire import Command, Decoder


class Order:
    """Draw the lines of frames as `taxel_random_lines.sv` words it."""

    def __init__(self):
        self.word = 0xACE1

    def draw(self):
        for _ in range(16):
            bit = (self.word ^ self.word >> 2 ^ self.word >> 3 ^ self.word >> 5) & 1
            self.word = self.word >> 1 | bit << 15
        return self.word

    def lines(self, count):
        order = list(range(count))
        for k in range(count - 1):
            place = k + (self.draw() * (count - k) >> 16)
            order[k], order[place] = order[place], order[k]
        return order


def test_quick_lines_come_in_the_order_that_is_drawn():
    pair, order = Pair(8, 8, CSEL_CLOCKS=1), Order()
    logic = pair.logic
    still = np.zeros((8, 8), np.uint16)
    # A jump shifts through up to 8 lines: the taxels settle after it.
    for command in (Command(4, 100), Command(3, 40 << 16 | 75), Command(0, 0b1001)):
        logic.send(command.to_bytes())
        logic.edge()
    received = []
    for frame in range(40):
        if frame == 25:
            # Later the lines that are left out may be driven too.
            assert not logic.call("shared")
        logic.ticks(still + 30 * (frame % 2 + 1))
        logic.edge()
        received += logic.datagrams()
        if frame == 25:
            logic.send(Command(5, 4 << 16 | 3 << 8).to_bytes())
    assert "bad" not in logic.serial()
    decoder = Decoder()
    drawn = [list(dict.fromkeys(decoder.push(datagram).x.tolist())) for datagram in received]
    # In order until the flag acts; lines that are left out after the write of their number change no draw before it.
    while drawn[0] == list(range(8)):
        drawn.pop(0)
    expected = [order.lines(len(lines)) for lines in drawn]
    assert drawn == expected
    assert {len(lines) for lines in drawn} == {8, 5}
    assert len({tuple(lines) for lines in drawn}) > 30
