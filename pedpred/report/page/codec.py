"""A short code for tables of whole numbers, which `codec.js` reads.

A column is predicted from the columns before it, and an adaptive arithmetic coder packs what is left. What
the decoder repeats is done in whole numbers, or in operations that every machine rounds alike.
"""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError

_SOURCES = 8  # columns that a prediction uses, at most
_UNIT = 1024  # weights are whole multiples of 1 / _UNIT
_NOISE = 4.0  # ridge of the fit, squared units: what rounding adds to a column
_LEVELS = 32  # contexts of a model
_SLOTS = 216  # chances of a context: 24 for the number of bits, then 8 for each such number


class Coder:
    """Collects numbers, each in a context of a model; numbers in one context share their statistics."""

    def __init__(self) -> None:
        self._parts: list[tuple[np.ndarray, np.ndarray]] = []
        self._models = 0

    def model(self) -> int:
        """Add a model, about which nothing is known yet."""
        self._models += 1
        return self._models - 1

    def add(self, model: int, values: np.ndarray, contexts: np.ndarray) -> None:
        """Append whole numbers, [N], in contexts 0 to 31 of a model, [N]."""
        largest = int(np.abs(values).max(initial=0))
        if largest >= 2**22:
            raise ValueRuleError("replay", largest, "the player keeps whole numbers below 2^22")
        self._parts.append((values.astype(np.int64), model * _LEVELS + contexts.astype(np.int64)))

    def numbers(self, values: np.ndarray) -> None:
        """Append whole numbers in a model of their own, in the context of the one before. [N]."""
        self.add(self.model(), values, _level(np.abs(np.append(0, values)[:-1])))

    def changes(self, values: np.ndarray) -> None:
        """Append an array that is mostly 0: how many values are not, the gaps between them, their values."""
        places = np.flatnonzero(values)
        for part in (np.array([len(places)]), np.diff(places, prepend=0), values.ravel()[places]):
            self.numbers(part)

    def text(self) -> str:
        """Everything in letters without "<": two of 91 hold 13 bits, so it is 8 % shorter than base 64."""
        values, contexts = (np.concatenate(parts) for parts in zip(*self._parts, strict=True))
        bits = np.unpackbits(_arithmetic(values, contexts, self._models * _LEVELS))
        words = np.pad(bits, (0, -len(bits) % 13)).reshape(-1, 13) @ (1 << np.arange(12, -1, -1))
        letters = 35 + np.stack(np.divmod(words, 91), axis=1)
        return bytes(np.where(letters == ord("<"), ord("~"), letters).astype(np.uint8)).decode("ascii")


class PointColumns:
    """Columns of points [W, 2], each predicted from those before it and from its own previous row."""

    def __init__(self, coder: Coder, track: np.ndarray):
        """Begin a table; rows are sorted by track [W], and the previous row is one of the same track."""
        self._coder, self._sources = coder, coder.model()
        self._before = np.where(np.diff(track, prepend=-1) == 0, np.arange(len(track)) - 1, -1)
        self._columns: list[np.ndarray] = []
        self._sizes = [np.zeros(len(track), np.int64)] * 2

    def know(self, values: np.ndarray) -> None:
        """Append a column that the decoder can compute. [W, 2] int."""
        self._columns.append(values)

    def add(self, values: np.ndarray, step: int = 1, kept: np.ndarray | None = None) -> np.ndarray:
        """Append a column [W, 2], exact to half a step; returns what the decoder gets, [W, 2] int.

        Rows that are not `kept` ([W] bool, known to the decoder; all by default) get what is predicted.
        """
        kept = np.full(len(values), True) if kept is None else kept
        own = np.where(self._before[:, None] >= 0, values[self._before], 0.0)
        known = np.array([own, *self._columns[::-1]]).reshape(1 + len(self._columns), -1)
        old = np.repeat(kept & (self._before >= 0), 2)
        chosen, weights = _fitted(known[:, old].T, values.ravel()[old])
        memory, others = int(weights[chosen == 0].sum()), chosen > 0
        expected = (weights[others] @ known[chosen[others]]).astype(np.int64).reshape(values.shape)
        codes, decoded = _rounded(values.astype(float), expected, memory, self._before, step, kept)
        about = np.append(len(chosen), np.stack([chosen, weights], axis=1))
        self._coder.add(self._sources, about, np.append(0, np.tile([0, 1], len(chosen))))
        size = np.abs(codes).sum(axis=1)
        around = np.where(self._before >= 0, size[self._before], 0) + self._sizes[-1] + self._sizes[-2]
        contexts = [_level(around), 16 + _level((around + 3 * np.abs(codes[:, 0])) >> 1)]
        self._coder.add(self._coder.model(), codes[kept].ravel(), np.stack(contexts, axis=1)[kept].ravel())
        self._sizes.append(size)
        self._columns.append(decoded)
        return decoded


def _level(size: np.ndarray) -> np.ndarray:
    """Context of a size: its number of bits and its second bit, 0 to 15."""
    bits = np.frexp(np.maximum(size, 1))[1] - 1
    return np.minimum(np.where(size < 2, size, 2 * bits + (size >> np.maximum(bits - 1, 0) & 1)), 15)


def _fitted(known: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Choose columns of `known` [n, S] that predict values [n], and weights in parts of `_UNIT`. [C] each.

    One after the other, the column is taken that removes most of the squares that are left. Weights then give
    least absolute errors, so that people who turn do not bend the prediction of all others.
    """
    table = np.column_stack([known, values])
    left = table.T @ table + _NOISE * len(values) * np.eye(len(table.T))
    least, chosen = 1e-3 * np.diag(left)[:-1] + _NOISE * len(values), np.zeros(0, np.int64)
    for _ in range(_SOURCES):
        spread = np.diag(left)[:-1]
        gain = np.where(spread > least, left[:-1, -1] ** 2 / np.maximum(spread, 1e-9), 0.0)
        best = int(gain.argmax())
        if gain[best] <= _NOISE or best in chosen:
            break
        chosen = np.append(chosen, best)
        left = left - np.outer(left[:, best], left[best]) / left[best, best]
    used, trust, weights = known[:, chosen], np.ones(len(values)), np.zeros(len(chosen))
    for _ in range(4):
        moments = (used.T * trust) @ used + _NOISE * trust.sum() * np.eye(len(chosen))
        weights = np.linalg.solve(moments, (used.T * trust) @ values)
        trust = 1.0 / (np.abs(values - used @ weights) + 5.0)
    return chosen, np.rint(_UNIT * weights).astype(np.int64)


@compiled
def _rounded(values, expected, memory, before, step, kept):
    """How many steps values lie beside their prediction, and what that decodes to; [W, 2] int each."""
    codes, decoded = np.zeros(values.shape, np.int64), np.zeros(values.shape, np.int64)
    for row in range(len(values)):
        for axis in range(2):
            found = expected[row, axis] + (memory * decoded[before[row], axis] if before[row] >= 0 else 0)
            found = (found + _UNIT // 2) // _UNIT
            if kept[row]:
                codes[row, axis] = math.floor((values[row, axis] - found) / step + 0.5)
            decoded[row, axis] = found + step * codes[row, axis]
    return codes, decoded


@compiled
def _arithmetic(values, contexts, count):
    """Adaptive binary arithmetic code of numbers [N] in contexts 0 to `count` - 1 [N]. [bytes] uint8.

    Numbers 0, -1, 1, -2, ... become 1, 2, 3, 4, ...; then come the number of their bits without the first, in
    ones and a zero, and these bits. Each bit has a chance that is learned; it halves [low, high] accordingly.
    """
    chance, seen = np.full((count, _SLOTS), 0.5), np.zeros((count, _SLOTS))
    low, high, data = 0, 0xFFFFFFFF, [0]
    for value, context in zip(values, contexts):  # noqa: B905 (numba knows no `strict`)
        number, bits = (-2 * value if value < 0 else 2 * value + 1), 0
        while number >> (bits + 1):
            bits += 1
        for place in range(2 * bits + 1):
            prefix = number >> max(2 * bits + 1 - place, 0)
            slot = place if place <= bits else 24 + 8 * bits + (prefix if prefix < 8 else 0)
            bit = (number >> (2 * bits - place)) & 1 if place > bits else int(place < bits)
            own = chance[context, slot]
            middle = low + math.floor((high - low) * own)
            low, high = (low, middle) if bit else (middle + 1, high)
            seen[context, slot] += 1.0
            own += (bit - own) * max(1.0 / (seen[context, slot] + 1.5), 0.01)
            chance[context, slot] = min(max(own, 0.0005), 0.9995)
            while (low ^ high) >> 24 == 0:
                data.append(high >> 24)
                low, high = (low << 8) & 0xFFFFFFFF, ((high << 8) & 0xFFFFFFFF) | 255
    data += [(high >> 24) & 255, (high >> 16) & 255, (high >> 8) & 255, high & 255]
    return np.array(data[1:], dtype=np.uint8)
