"""Weights from examples, in scikit-learn's manners: parameters in the constructor, `fit`, results end in `_`."""

from taxel.learn.certificate import check_certificate
from taxel.learn.chronotron import Chronotron
from taxel.learn.cone_r import ConeR, ConeRProblem
from taxel.learn.cone_x import Certificate, ConeX, ConeXProblem, Margin, Row
from taxel.learn.filt import FILT
from taxel.learn.fp import FP
from taxel.learn.htp import HTP
from taxel.learn.inst import INST
from taxel.learn.online_cone_r import OnlineConeR
from taxel.learn.psd import PSD
from taxel.learn.resume import ReSuMe
from taxel.learn.skim import SKIM
from taxel.learn.span import SPAN
from taxel.learn.tempotron import Tempotron

__all__ = [
    "FILT",
    "FP",
    "HTP",
    "INST",
    "PSD",
    "SKIM",
    "SPAN",
    "Certificate",
    "Chronotron",
    "ConeR",
    "ConeRProblem",
    "ConeX",
    "ConeXProblem",
    "Margin",
    "OnlineConeR",
    "ReSuMe",
    "Row",
    "Tempotron",
    "check_certificate",
]
