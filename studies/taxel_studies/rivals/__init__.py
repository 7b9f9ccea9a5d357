"""How many spike times each rule can learn, beside CONE-X, under one criterion at a time.

`rules` states every rule with the constants that the study gives it, `protocols` the two protocols and the search,
`comparison` the study itself.
"""

from taxel_studies.rivals.comparison import STUDY

__all__ = ["STUDY"]
