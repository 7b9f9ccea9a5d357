"""Weights from examples, in scikit-learn's manners: parameters in the constructor, `fit`, results end in `_`."""

from taxel.learn.cone_r import ConeR, ConeRProblem

__all__ = ["ConeR", "ConeRProblem"]
