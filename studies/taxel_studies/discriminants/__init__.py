"""Linear discriminants: of features (`LDA`), of the trials' inner products (`GramLDA`), of all folds but one."""

from taxel_studies.discriminants.fold_sums import FoldSums, fold_predictions
from taxel_studies.discriminants.lda import LDA, GramLDA

__all__ = ["LDA", "FoldSums", "GramLDA", "fold_predictions"]
