"""Learners with scikit-learn's interface: parameters in the constructor, `fit`, names of results end in `_`."""

from taxel.learn.certificate import check_certificate as check_certificate
from taxel.learn.certificate import check_gap as check_gap
from taxel.learn.cone_r import ConeR as ConeR
from taxel.learn.cone_r import ConeRProblem as ConeRProblem
from taxel.learn.cone_x import Certificate as Certificate
from taxel.learn.cone_x import ConeX as ConeX
from taxel.learn.cone_x import ConeXProblem as ConeXProblem
from taxel.learn.cone_x import Margin as Margin
from taxel.learn.cone_x import Multipliers as Multipliers
from taxel.learn.cone_x import Row as Row
from taxel.learn.online_cone_r import OnlineConeR as OnlineConeR
from taxel.learn.solution import Checked as Checked
from taxel.learn.solution import check_solution as check_solution

# The imports above are the registry of learners.
__all__ = [name for name, value in sorted(globals().items()) if callable(value)]
