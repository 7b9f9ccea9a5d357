"""The old name of the distribution `taxel_studies`; it is removed in the next version."""

import sys
import warnings
from importlib import import_module

warnings.warn("taxel.studies is taxel_studies now: import that", FutureWarning, stacklevel=2)
try:
    sys.modules[__name__] = import_module("taxel_studies")
except ModuleNotFoundError as error:
    if error.name != "taxel_studies":
        raise
    raise ModuleNotFoundError('taxel.studies is taxel_studies now: pip install "taxel[studies]"') from None
