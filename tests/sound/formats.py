"""Sound calls of `taxel.formats`."""

import taxel
from sound.things import Sound, every

#: A sound call of everything public that takes anything, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.formats.trials": every(taxel.formats.trials, path="pdb", format="gaitpdb"),
}

#: What is not tried, and why.
LEFT_OUT: dict[str, str] = {
    "taxel.formats.Format": "a result",
    "taxel.formats.Trial": "a result",
}
