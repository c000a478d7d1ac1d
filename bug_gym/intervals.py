"""How sure a figure is: intervals of shares and of means, an exact test of paired successes, and what many tests leave of it.

Sources: Wilson 1927 (score interval of a share); Agarwal et al. 2021, "Deep Reinforcement Learning at the Edge of the
Statistical Precipice" (interquartile mean, resampling within strata); McNemar 1947, in its exact binomial form; Holm 1979,
"A Simple Sequentially Rejective Multiple Test Procedure".
"""

from collections.abc import Callable, Sequence
from math import nan, sqrt
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bug_gym.geometry import F64

Statistic = Callable[[F64], F64]
"""Samples (B, n), one a row, to their statistics (B,)."""

_BLOCK = 1_000_000
"""Values resampled at a time: bounds the memory of a bootstrap over many rows."""


class Interval(NamedTuple):
    """Two bounds; both NaN where the sample says nothing about its own spread."""

    low: float
    high: float


def wilson_interval(successes: int, n: int, *, confidence: float = 0.95) -> Interval:
    """Interval of a share whose score test does not reject it; honest at 0 and n successes, where others collapse."""
    if n < 1 or not 0 <= successes <= n:
        raise ValueError(f"expected n >= 1 and 0 <= successes <= n, came successes={successes}, n={n}")
    z = NormalDist().inv_cdf(1.0 - _tail(confidence))
    share, width = successes / n, z * z / n
    centre = (share + width / 2.0) / (1.0 + width)
    half = sqrt(share * (1.0 - share) * width + width * width / 4.0) / (1.0 + width)
    # Written out at the ends: rounding would leave a bound just inside or outside [0, 1].
    return Interval(0.0 if successes == 0 else centre - half, 1.0 if successes == n else centre + half)


def interquartile_mean(values: ArrayLike) -> float:
    """Mean of the middle half of the values (n,): a quarter of them, rounded down, is cut off at either end."""
    return float(interquartile_means(_sample("values", values)[None, :])[0])


def interquartile_means(samples: F64) -> F64:
    """Interquartile mean of each row of samples (B, n), as (B,)."""
    n = samples.shape[1]
    cut = n // 4
    middle = np.partition(samples, (cut, n - cut - 1), axis=1)[:, cut : n - cut]
    return np.asarray(middle.mean(axis=1), dtype=np.float64)


def means(samples: F64) -> F64:
    """Mean of each row of samples (B, n), as (B,)."""
    return np.asarray(samples.mean(axis=1), dtype=np.float64)


def stratified_bootstrap(
    strata: Sequence[ArrayLike], statistic: Statistic, *, resamples: int = 2000, seed: int = 0, confidence: float = 0.95
) -> Interval:
    """Percentile interval of a statistic of all values, each stratum resampled within itself.

    A stratum keeps its size in every resample, so the differences between strata do not widen the interval. The bounds
    are NaN where no stratum has two values: resampling a single value would only feign certainty.

    Args:
        strata: Values of each stratum, (n_s,) each; all finite.
        statistic: Of the values of all strata pooled, row by row: (B, sum of n_s) to (B,).
        resamples: How many resamples.
        seed: Of the resampling; the same seed gives the same interval.
        confidence: Share of the resampled statistics between the bounds.
    """
    if len(strata) == 0 or resamples < 1:
        raise ValueError(f"expected strata and resamples >= 1, came {len(strata)} strata, resamples={resamples}")
    tail = _tail(confidence)
    groups = [_sample(f"stratum {index}", values) for index, values in enumerate(strata)]
    if max(len(group) for group in groups) < 2:
        return Interval(nan, nan)
    rng = np.random.default_rng(seed)
    block = max(1, _BLOCK // sum(len(group) for group in groups))
    counts = [min(block, resamples - done) for done in range(0, resamples, block)]
    estimates = np.concatenate([_statistics(statistic, _resample(groups, count, rng)) for count in counts])
    low, high = np.quantile(estimates, (tail, 1.0 - tail))
    return Interval(float(low), float(high))


def exact_mcnemar(only_a: int, only_b: int) -> float:
    """Two-sided p value that a and b succeed equally often, from the pairs in which only one of them did."""
    if only_a < 0 or only_b < 0:
        raise ValueError(f"expected counts >= 0, came only_a={only_a}, only_b={only_b}")
    if only_a + only_b == 0:
        return 1.0
    from scipy.stats import binomtest  # a second of import, for this line only

    return float(binomtest(only_a, only_a + only_b, 0.5).pvalue)


def holm(p_values: Sequence[float]) -> list[float]:
    """P values of many tests as one has to read them where all were looked at, in the same order.

    Whoever rejects what is below a level here rejects nothing true in all with that probability at most, whatever the tests
    have to do with one another.
    """
    if not all(0.0 <= one <= 1.0 for one in p_values):
        raise ValueError(f"p values must lie between 0 and 1, came {list(p_values)}")
    adjusted, so_far = [0.0] * len(p_values), 0.0
    for rank, index in enumerate(sorted(range(len(p_values)), key=lambda index: p_values[index])):
        so_far = max(so_far, min(1.0, (len(p_values) - rank) * p_values[index]))
        adjusted[index] = so_far
    return adjusted


def _tail(confidence: float) -> float:
    """Share outside a two-sided interval, on either side."""
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must lie between 0 and 1, came {confidence}")
    return (1.0 - confidence) / 2.0


def _sample(name: str, values: ArrayLike) -> F64:
    """Values as an array (n,), n >= 1, all finite."""
    sample = np.asarray(values, dtype=np.float64)
    if sample.ndim != 1 or sample.size == 0:
        raise ValueError(f"{name} must be a list of at least one number, came shape {sample.shape}")
    if not np.isfinite(sample).all():
        raise ValueError(f"{name} must be finite, came {sample[~np.isfinite(sample)][0]}")
    return sample


def _resample(groups: Sequence[F64], count: int, rng: np.random.Generator) -> F64:
    """Count resamples, (count, sum of sizes), each group drawn from itself with replacement."""
    return np.concatenate([group[rng.integers(len(group), size=(count, len(group)))] for group in groups], axis=1)


def _statistics(statistic: Statistic, samples: F64) -> F64:
    """The statistic of each row, its shape checked: np.mean, say, would give one number for all of them."""
    estimates = np.asarray(statistic(samples), dtype=np.float64)
    if estimates.shape != samples.shape[:1]:
        raise ValueError(f"statistic must map {samples.shape} to {samples.shape[:1]}, it gave {estimates.shape}")
    return estimates
