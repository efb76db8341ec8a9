"""Anderson acceleration: mixes recent iterates so that their defects cancel best (Anderson 1965).

For a linear operator this is a Krylov method, which needs few iterations where plain iteration needs many.
"""

from __future__ import annotations

import numpy as np

#: Number of iterates that are mixed.
COLUMNS = 6

#: Ridge added to the normalised inner products, so that dependent columns have a solution.
_RIDGE = 1e-9 * np.eye(COLUMNS)

#: Factor by which the squared defect may grow; above it the history is discarded.
_GROWN = 16.0


class Anderson:
    """Mixing weights of the iterates in a ring of COLUMNS, separately for each colour channel."""

    def __init__(self) -> None:
        self._valid: list[int] = []
        self._last_size = np.inf

    def weights(self, newest: int, products: np.ndarray) -> np.ndarray:
        """Return the weights of all columns, (COLUMNS, 3) float64, with sum 1.

        newest:    index of the latest column
        products:  (COLUMNS, COLUMNS, 3) float64, inner products of the newest defect (its own row and column)
                   and of the differences of the other defects to it

        Minimises |f + sum t_j (f_j - f)| over t. A ridge handles linear dependence, and the history restarts
        after the defect has grown (Walker and Ni 2011).
        """
        size = float(products[newest, newest].sum())
        if size > _GROWN * self._last_size:
            self._valid = []
        self._last_size = size
        older = [column for column in self._valid if column != newest]
        weights = np.zeros((COLUMNS, 3))
        between = products[older][:, older].transpose(2, 0, 1)
        weights[older] = _least_squares(between, products[older, newest].T).T
        weights[newest] = 1 - weights.sum(axis=0)
        self._valid = [*older, newest][-(COLUMNS - 1) :]
        return weights

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the indices of used iterates, oldest first, and the squared norm of the last residual."""
        return np.array(self._valid, np.int64), np.array([self._last_size])

    def restore(self, columns: np.ndarray, size: np.ndarray) -> None:
        """Restore the history from the arrays that `state` returned."""
        self._valid, self._last_size = columns.tolist(), float(size[0])


def _least_squares(gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Solve gram t = -moment for each channel, with columns scaled to unit norm; t is zero for null columns.

    gram: (c, k, k), moment: (c, k). Returns (c, k) float64.
    """
    scale = np.sqrt(np.maximum(gram.diagonal(axis1=1, axis2=2), 1e-60))
    count = scale.shape[1]
    scaled = gram / (scale[:, :, None] * scale[:, None, :]) + _RIDGE[:count, :count]
    solution = np.linalg.solve(scaled, (-moment / scale)[..., None])[..., 0] / scale
    solution[scale <= 1e-25] = 0
    return solution
