"""NumPy's generator in compiled code: number for number what NumPy itself draws."""

import numpy as np
import pytest
from compiled import for_python

from bug_gym.kernels.generator import drawn_below, drawn_between, give_back, next_word, taken


def generators(seed: int) -> tuple[np.random.Generator, np.random.Generator]:
    """Two that draw the same."""
    return np.random.default_rng([1, seed, 0]), np.random.default_rng([1, seed, 0])


@pytest.mark.parametrize("seed", range(5))
def test_words_are_those_of_numpy(seed: int) -> None:
    plain, rng = generators(seed)
    words, draw = taken(rng), for_python(next_word)
    assert words is not None
    assert [int(draw(words)) for _ in range(500)] == plain.bit_generator.random_raw(500).tolist()


def test_numbers_of_both_kinds_in_turns_are_those_of_numpy_and_it_goes_on_from_there() -> None:
    """A whole number takes half a word, and the other half waits while others are drawn."""
    plain, rng = generators(7)
    words, below, between = taken(rng), for_python(drawn_below), for_python(drawn_between)
    assert words is not None
    kinds = np.random.default_rng(0)
    for bound in (*range(1, 40), 3_000_000_000, 4_294_967_295, 2_147_483_649, *kinds.integers(1, 2**31, 300).tolist()):
        assert below(words, bound) == plain.integers(bound)
        if kinds.random() < 0.5:
            low, high = sorted(kinds.normal(0.0, 10.0, 2).tolist())
            assert between(words, low, high) == plain.uniform(low, high)
            assert between(words, 0.0, 1.0) == plain.random()
    assert plain.bit_generator.state != rng.bit_generator.state
    give_back(rng, words)
    assert plain.bit_generator.state == rng.bit_generator.state
    assert plain.normal() == rng.normal()


def test_other_generators_are_not_taken() -> None:
    assert taken(np.random.Generator(np.random.Philox(3))) is None
