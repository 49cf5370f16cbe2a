"""What kind of scatter a line has: the likelihood of each."""

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize

from sweep.analysis import scatter


@pytest.mark.parametrize("seed", range(3))
def test_outliers_are_judged_by_the_greatest_likelihood_of_students_t(seed):
    rng = np.random.default_rng(seed)
    t = np.linspace(-1.0, 1.0, 40)
    columns = np.stack([np.ones(t.size), t], axis=1)
    z = 0.3 - 0.5 * t + 0.02 * rng.standard_t(3.0, t.size)

    def deviance(numbers):
        return -2 * stats.t.logpdf(z, 3.0, columns @ numbers[:2], np.exp(numbers[2])).sum()

    least = minimize(deviance, [0.3, -0.5, np.log(0.02)], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-9})
    # as a normal scatter's, of which n (1 + ln 2 pi) is left out
    expected = least.fun - t.size * (1 + np.log(2 * np.pi))
    assert scatter._outlying_deviance(columns, z) == pytest.approx(expected, abs=1e-5)
