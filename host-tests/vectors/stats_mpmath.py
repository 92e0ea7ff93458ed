"""Reference values of host-tests/vectors/stats_mpmath.csv. Needs mpmath; takes four minutes."""

from mpmath import erfc, exp, findroot, gammainc, inf, log, mp, mpf, nstr, sqrt

mp.dps = 60


def central_lower(k, x):
    return gammainc(mpf(k) / 2, 0, mpf(x) / 2, regularized=True)


def central_upper(k, x):
    return gammainc(mpf(k) / 2, mpf(x) / 2, inf, regularized=True)


def mixture(k, noncentrality, x, central):
    """Poisson mixture of central tails, until 30 digits past the largest term."""
    half = mpf(noncentrality) / 2
    weight, total, largest, j = exp(-half), mpf(0), mpf(0), 0
    while True:
        term = weight * central(k + 2 * j, x)
        total += term
        if term > largest:
            largest = term
        elif term < min(largest, total) * mpf(10) ** -30:
            return total
        j += 1
        weight *= half / j


def normal_tail(x):
    return erfc(mpf(x) / sqrt(mpf(2))) / 2


def root(function, target, first, second):
    return findroot(
        lambda x: log(function(x)) - log(mpf(target)), (first, second), solver="secant", tol=1e-40
    )


def rows():
    for k in [1, 2, 3, 5, 10, 20, 44, 101]:
        for x in ["1e-6", "0.03", "1", "7.5", "40", "150"]:
            yield "central_lower", k, 0, x, central_lower(k, x)
            yield "central_upper", k, 0, x, central_upper(k, x)
    pairs = [("0.5", "2"), ("5", "1e-3"), ("67.14", "26.05"), ("90", "5"), ("150", "40")]
    pairs += [("150", "400"), ("300", "60"), ("2500", "1800"), ("2500", "3300"), ("9000", "8000")]
    for k in [1, 2, 3, 7, 18, 44]:
        for noncentrality, x in pairs:
            yield "noncentral_lower", k, noncentrality, x, mixture(k, noncentrality, x, central_lower)
            yield "noncentral_upper", k, noncentrality, x, mixture(k, noncentrality, x, central_upper)
    for k in [1, 4, 18, 41]:
        for p_fa in ["1e-12", "3.3333e-7", "1e-2"]:
            threshold = root(lambda t: central_upper(k, t), p_fa, k + 30, k + 45)
            yield "central_upper_quantile", k, 0, p_fa, threshold
            if k > 4 and p_fa == "1e-2":
                continue
            for p_md, z in [("1e-12", 7.03), ("1e-7", 5.2), ("1e-3", 3.09)]:
                guess = (float(threshold) ** 0.5 + z) ** 2 * (0.9 if k > 4 else 1)
                found = root(lambda l: mixture(k, l, threshold, central_lower), p_md, guess, guess * 1.05)
                yield "noncentrality:" + p_md, k, p_fa, nstr(threshold, 20), found
    for p in ["1e-12", "1e-50", "1e-299", "3e-9", "0.3", "0.499999", "0.75", "0.999"]:
        guess = 0.1 if mpf(p) > 0.2 else float(sqrt(-2 * log(mpf(p)))) * 0.97
        yield "normal_quantile", 0, 0, p, root(normal_tail, p, guess, guess + 0.1)
    for x in ["-5", "-0.2", "0", "1e-9", "3", "12", "37"]:
        yield "normal_tail", 0, 0, x, normal_tail(x)


print("""# Tails and quantiles of the normal and chi-square distributions.
# Origin: computed for surefix with mpmath 1.3.0 at 60 digits from the definitions (regularised
#   incomplete gamma function; Poisson mixture for the non-central case; secant roots), independent of core.
# Command: python3 host-tests/vectors/stats_mpmath.py > host-tests/vectors/stats_mpmath.csv   (22 November 2026)
# Tolerance: 1e-9 relative; tails from 1e-12 down to 1e-300 included.
# Columns: quantity, degrees of freedom, non-centrality (noncentrality rows: P_FA), argument (noncentrality rows: threshold), value
quantity,k,lambda,argument,value""")
for *fields, value in rows():
    print(*fields, nstr(value, 20), sep=",")
