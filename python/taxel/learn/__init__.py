"""Learners with scikit-learn's interface: parameters in the constructor, `fit`, names of results end in `_`."""

from taxel.learn.certificate import check_certificate as check_certificate
from taxel.learn.certificate import check_gap as check_gap
from taxel.learn.chronotron import Chronotron as Chronotron
from taxel.learn.cone_r import ConeR as ConeR
from taxel.learn.cone_r import ConeRProblem as ConeRProblem
from taxel.learn.cone_x import Certificate as Certificate
from taxel.learn.cone_x import ConeX as ConeX
from taxel.learn.cone_x import ConeXProblem as ConeXProblem
from taxel.learn.cone_x import Margin as Margin
from taxel.learn.cone_x import Multipliers as Multipliers
from taxel.learn.cone_x import Row as Row
from taxel.learn.filt import FILT as FILT
from taxel.learn.fp import FP as FP
from taxel.learn.htp import HTP as HTP
from taxel.learn.inst import INST as INST
from taxel.learn.online_cone_r import OnlineConeR as OnlineConeR
from taxel.learn.psd import PSD as PSD
from taxel.learn.resume import ReSuMe as ReSuMe
from taxel.learn.skim import SKIM as SKIM
from taxel.learn.solution import Checked as Checked
from taxel.learn.solution import check_solution as check_solution
from taxel.learn.span import SPAN as SPAN
from taxel.learn.stdp import STDP as STDP
from taxel.learn.tempotron import Tempotron as Tempotron

# The imports above are the registry of learners.
__all__ = [name for name, held in sorted(globals().items()) if callable(held)]
