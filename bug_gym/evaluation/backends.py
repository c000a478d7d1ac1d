"""Who does the jobs of an evaluation: this process, or several processes of this machine (joblib's loky).

A backend is a function of a function, the jobs and the number of workers that yields the results in order of arrival.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

J = TypeVar("J")
R = TypeVar("R")


def each(function: Callable[[J], R], jobs: Sequence[J], workers: int) -> Iterator[R]:
    """What a function makes of each job, in order of arrival."""
    if workers == 1 or len(jobs) < 2:
        yield from map(function, jobs)
        return
    from joblib import Parallel, delayed, parallel_config

    with parallel_config(backend="loky", inner_max_num_threads=1):
        parallel = Parallel(n_jobs=workers, return_as="generator_unordered")
        yield from parallel(delayed(function)(job) for job in jobs)
