"""Learning rules of the literature, with the manners of taxel's learners."""

from taxel_rules.chronotron import Chronotron as Chronotron
from taxel_rules.filt import FILT as FILT
from taxel_rules.fp import FP as FP
from taxel_rules.htp import HTP as HTP
from taxel_rules.inst import INST as INST
from taxel_rules.psd import PSD as PSD
from taxel_rules.resume import ReSuMe as ReSuMe
from taxel_rules.skim import SKIM as SKIM
from taxel_rules.span import SPAN as SPAN
from taxel_rules.stdp import STDP as STDP
from taxel_rules.tempotron import Tempotron as Tempotron

# The imports above are the registry of rules.
__all__ = [name for name, held in sorted(globals().items()) if callable(held)]
