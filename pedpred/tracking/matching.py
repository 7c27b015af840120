"""The cheapest pairs of rows and columns: the linear assignment problem."""

from __future__ import annotations

import numpy as np

from pedpred.compiled import compiled


def distances_m(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """How far places [N, 2] are from other ones [M, 2], m. [N, M]."""
    return np.asarray(np.linalg.norm(first[:, None] - second, axis=-1))


def cheapest_pairs(costs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pair each row with a column of its own, or each column with a row where there are fewer columns.

    The sum of the costs is the least one. The same pairs as `scipy.optimize.linear_sum_assignment`, also
    where several have that sum; a robot needs no SciPy for it.

    Args:
        costs: finite. [R, C]

    Returns:
        Rows, ascending, and their columns. [min(R, C)] each
    """
    tall = costs.shape[0] > costs.shape[1]
    column = _columns(np.ascontiguousarray(costs.T if tall else costs, np.float64))
    rows = np.arange(len(column))
    if not tall:
        return rows, column
    order = np.argsort(column)
    return column[order], order


@compiled
def _columns(costs):  # pragma: no cover (compiled)
    """Shortest augmenting paths (Crouse 2016, "On implementing 2D rectangular assignment algorithms").

    Of costs [R, C] with R <= C, the column of each row. [R]
    """
    count, width = costs.shape
    u, v = np.zeros(count), np.zeros(width)
    column_of, row_of, before = np.full(count, -1), np.full(width, -1), np.full(width, -1)
    for start in range(count):
        remaining, open_count = np.arange(width - 1, -1, -1), width
        seen_row, seen_column = np.zeros(count, np.bool_), np.zeros(width, np.bool_)
        shortest = np.full(width, np.inf)
        least, row, sink = 0.0, start, -1
        while sink < 0:
            seen_row[row] = True
            best, lowest = -1, np.inf
            for place in range(open_count):
                column = remaining[place]
                reduced = least + costs[row, column] - u[row] - v[column]
                if reduced < shortest[column]:
                    before[column], shortest[column] = row, reduced
                if shortest[column] < lowest or (shortest[column] == lowest and row_of[column] < 0):
                    best, lowest = place, shortest[column]
            least, column = lowest, remaining[best]
            if row_of[column] < 0:
                sink = column
            else:
                row = row_of[column]
            seen_column[column] = True
            open_count -= 1
            remaining[best] = remaining[open_count]
        u[start] += least
        for row in range(count):
            if seen_row[row] and row != start:
                u[row] += least - shortest[column_of[row]]
        for column in range(width):
            if seen_column[column]:
                v[column] -= least - shortest[column]
        column, row = sink, -1
        while row != start:
            row = before[column]
            row_of[column] = row
            column_of[row], column = column, column_of[row]
    return column_of
