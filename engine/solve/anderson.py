"""Anderson's acceleration: the mixture of iterates whose defects cancel best (Anderson 1965).

For a linear operator this is a Krylov method: few sweeps where plain iteration needs many.
"""

from __future__ import annotations

import numpy as np

#: Iterates that are mixed.
COLUMNS = 6

#: Added to the products relative to their size, so that dependent columns have a solution.
_RIDGE = 1e-9 * np.eye(COLUMNS)

#: Iterates are forgotten if the newest defect is larger than the one before by this factor, squared.
_GROWN = 16.0


class Anderson:
    """Weights of the iterates in a ring of COLUMNS, for each colour channel on its own."""

    def __init__(self) -> None:
        self._valid: list[int] = []
        self._last_size = np.inf

    def weights(self, newest: int, products: np.ndarray) -> np.ndarray:
        """Return the weights of all columns, (COLUMNS, 3) float64, sum 1.

        newest    the column that was written last
        products  (COLUMNS, COLUMNS, 3) float64, inner products: of the newest defect in its own row and
                  column, of the differences to it in all others

        Minimises |f + sum t_j (f_j - f)| over t, with safeguards: a ridge against dependence, and a
        fresh start where the defect has grown (Walker and Ni 2011).
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
        """Return the columns that are mixed, the oldest first, and the size of the last defect, squared."""
        return np.array(self._valid, np.int64), np.array([self._last_size])

    def restore(self, columns: np.ndarray, size: np.ndarray) -> None:
        """Go on from what `state` has returned."""
        self._valid, self._last_size = columns.tolist(), float(size[0])


def _least_squares(gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Return t with gram t = -moment of each channel, columns scaled alike; zero where they vanish.

    gram: (c, k, k), moment: (c, k). Returns (c, k) float64.
    """
    scale = np.sqrt(np.maximum(gram.diagonal(axis1=1, axis2=2), 1e-60))
    count = scale.shape[1]
    scaled = gram / (scale[:, :, None] * scale[:, None, :]) + _RIDGE[:count, :count]
    solution = np.linalg.solve(scaled, (-moment / scale)[..., None])[..., 0] / scale
    solution[scale <= 1e-25] = 0
    return solution
