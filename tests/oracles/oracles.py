"""Truth in 50 digits, by mpmath; imports nothing of ours.

Arguments are float64 and taken as exact.
"""

from mpmath import exp, expm1, log, log1p, mp, mpf, sinh, tanh

DIGITS = 50


def quarter_phase(k):
    """q of q - tanh q = k, k > 0, by Newton from the side on which it is monotone."""
    small = max(0, int(-mp.log10(k)))
    with mp.workdps(DIGITS + small + 10):
        q = k + 1 if k > 1 else (3 * k) ** (mpf(1) / 3) * (1 + (3 * k) ** (mpf(2) / 3))
        for _ in range(200):
            step = (q - tanh(q) - k) / tanh(q) ** 2
            q -= step
            if abs(step) < abs(q) * mpf(10) ** (-DIGITS):
                return +q
    raise AssertionError(f"no root for k = {k}")


def foliot(mu, phi0, a):
    """(period, amplitude, crossing speed, sensitivity, multiplier) of the viscous foliot's limit cycle."""
    mu, phi0, a = mpf(mu), mpf(phi0), mpf(a)
    with mp.workdps(2 * DIGITS):
        k = a * a * phi0 / mu
        q = quarter_phase(k)
        lam = tanh(q)
        return 4 * q / a, phi0 * _log_cosh(q) / k, mu * lam / a, k / (q * lam**2), exp(-2 * q)


def foliot_angle(mu, phi0, a, phase):
    """(angle, speed) at a phase of the period, from the switch at +phi0 on."""
    period, _, v0, _, _ = foliot(mu, phi0, a)
    mu, phi0, a, phase = mpf(mu), mpf(phi0), mpf(a), mpf(phase)
    with mp.workdps(2 * DIGITS):
        sign = 1 if phase < mpf(1) / 2 else -1
        t = period * (phase if sign > 0 else phase - mpf(1) / 2)
        forgotten = -expm1(-a * t) / a
        return sign * (phi0 + (v0 + mu / a) * forgotten - mu / a * t), sign * (v0 - (a * v0 + mu) * forgotten)


def foliot_design(period, amplitude, phi0):
    """(a, mu) of the foliot with that period and amplitude: ln(cosh q)/(q - tanh q) = amplitude/phi0, by bisection."""
    with mp.workdps(2 * DIGITS):
        ratio = mpf(amplitude) / mpf(phi0)
        low, high = mpf(10) ** -12, mpf(10) ** 18
        while high > low * (1 + mpf(10) ** -DIGITS):
            q = (low * high) ** mpf("0.5")
            low, high = (q, high) if _log_cosh(q) > ratio * (q - tanh(q)) else (low, q)
        a = 4 * q / mpf(period)
        return a, a * a * mpf(phi0) / (q - tanh(q))


def _log_cosh(q):
    return log1p(2 * sinh(q / 2) ** 2) if q < 1 else q - log(2) + log1p(exp(-2 * q))
