"""Geometric algebras: multivectors as arrays of coefficients, one for each basis blade, and their product.

A multivector of an algebra over n basis vectors has shape (..., 2**n). Blades are named as in the paper, "e12" for e1
e2, and ordered by bit mask: bit i stands for the algebra's i-th basis vector.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


class Algebra:
    """The algebra that basis vectors with these squares generate.

    Parameters
    ----------
    squares : mapping of str to int
        Each basis vector's index, as it stands in a blade's name, and its square: 1, 0 or -1.
    """

    def __init__(self, squares: Mapping[str, int]) -> None:
        self._bit = {name: 1 << i for i, name in enumerate(squares)}
        masks = np.arange(1 << len(squares))
        self.size = len(masks)
        grades = np.array([int(mask).bit_count() for mask in masks])
        self._reversal = np.where(grades // 2 % 2 == 0, 1.0, -1.0)
        # e_I e_J is a multiple of e_(I xor J), so entry k of a product pairs entry i with entry i xor k.
        self._partner = masks[:, None] ^ masks[None, :]
        self._sign = np.array(
            [[self._product_sign(int(i), int(i ^ k), tuple(squares.values())) for k in masks] for i in masks],
            dtype=float,
        )

    @staticmethod
    def _product_sign(first: int, second: int, squares: tuple[int, ...]) -> int:
        swaps = sum((first >> shift & second).bit_count() for shift in range(1, first.bit_length() + 1))
        sign = -1 if swaps % 2 else 1
        for i, square in enumerate(squares):
            if first & second & 1 << i:
                sign *= square
        return sign

    def index(self, blade: str) -> int:
        """Where a blade's coefficient stands: "1", or "e" with rising indices, such as "e12"."""
        return 0 if blade == "1" else sum(self._bit[name] for name in blade[1:])

    def indices(self, *blades: str) -> list[int]:
        """`index` of each."""
        return [self.index(blade) for blade in blades]

    def multivector(self, **coefficients: np.ndarray | float) -> np.ndarray:
        """Return a multivector from its blades' coefficients, all of one shape (...,); the scalar is called `one`."""
        values = np.broadcast_arrays(*coefficients.values())
        result = np.zeros((*values[0].shape, self.size))
        for blade, value in zip(coefficients, values, strict=True):
            result[..., self.index("1" if blade == "one" else blade)] = value
        return result

    def product(self, *factors: np.ndarray) -> np.ndarray:
        """Return the geometric product of multivectors (..., size), from left to right."""
        result = factors[0]
        for factor in factors[1:]:
            result = np.einsum("...i,...ik,ik->...k", result, factor[..., self._partner], self._sign)
        return result

    def reverse(self, a: np.ndarray) -> np.ndarray:
        """Return the factors of each blade in reverse order; the inverse of a unit versor."""
        return a * self._reversal
