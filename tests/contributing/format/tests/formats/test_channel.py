"""The format of CONTRIBUTING: one force channel."""

from refusal import refused

from taxel import FormatError
from taxel._base.errors import Place
from taxel.formats import channel

from .making import write_channel


def test_a_line_that_is_no_number_is_named(tmp_path):
    file = write_channel(tmp_path)
    (trial,) = channel.trials(file)
    assert trial.frames.values[3, 0, 0] == 3.0
    file.write_text(file.read_text().replace("8000 4", "8000 four"))
    with refused(FormatError, place=Place("walk.channel", line=6)):
        list(channel.trials(file))
