"""The format of CONTRIBUTING: one force channel."""

import pytest

from taxel import FormatError
from taxel.formats import channel

from .making import write_channel


def test_a_line_that_is_no_number_is_named(tmp_path):
    file = write_channel(tmp_path)
    (trial,) = channel.trials(file)
    assert trial.frames.values[3, 0, 0] == 3.0
    file.write_text(file.read_text().replace("8000 4", "8000 four"))
    with pytest.raises(FormatError, match="line 6: column 'force_n'"):
        list(channel.trials(file))
