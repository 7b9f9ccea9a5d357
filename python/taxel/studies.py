"""The old name of the distribution `taxel_studies`; it is removed in the next version."""

import sys
import warnings
from importlib import import_module

from taxel._base.messages import installing

warnings.warn("taxel.studies is taxel_studies now: import that", FutureWarning, stacklevel=2)  # noqa: TID251  a fixed text
try:
    sys.modules[__name__] = import_module("taxel_studies")
except ModuleNotFoundError as error:
    if error.name != "taxel_studies":
        raise
    raise ModuleNotFoundError(f"taxel.studies is taxel_studies now: {installing('studies')}") from None
