"""Eigenvalues of columns of cells, against numpy's."""

import numpy as np
import pytest

from kernels.codegen.columns_algebra import eigenvalues


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6, 1e12])
def test_eigenvalues_do_not_hang_on_the_units_of_the_states(n, unit):
    random, cells = np.random.default_rng(n), 50
    A = random.normal(size=(cells, n, n))
    true = np.linalg.eigvals(A)
    units = np.where(np.arange(n) % 2, unit, 1.0)
    real, imaginary, _ = eigenvalues(np.moveaxis(A * units[:, None] / units, 0, 2))
    apart = abs(real.T[:, :, None] + 1j * imaginary.T[:, :, None] - (true.real + 1j * abs(true.imag))[:, None])
    assert apart.min(axis=1).max() < 1e-8
    assert apart.min(axis=2).max() < 1e-8
    assert (np.diff(real**2 + imaginary**2, axis=0) < 1e-8).all()
