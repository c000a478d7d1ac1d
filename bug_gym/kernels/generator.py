"""NumPy's generator PCG64, gone on with in compiled code: what `numpy.random.Generator` draws, number for number.

O'Neill, PCG (2014): a linear congruence of 128 bits, of which "XSL RR" makes 64. Lemire, Fast Random Integer Generation
in an Interval (2019): whole numbers, of 32 bits each.

A generator is six numbers `g` (6,) uint64: state and increment, the higher half of each first, then whether half of a
number is left over (a whole number below a bound takes 32 bits), and that half.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bug_gym.compiling import called, inlined

Words = npt.NDArray[np.uint64]

FACTOR_HIGH, FACTOR_LOW = np.uint64(0x2360ED051FC65DA4), np.uint64(0x4385DF649FCCF645)
ONE, HALF, LOWER = np.uint64(1), np.uint64(32), np.uint64(0xFFFFFFFF)
SHIFT, TURN, WORD = np.uint64(11), np.uint64(58), np.uint64(64)
STATE_HIGH, STATE_LOW, STEP_HIGH, STEP_LOW, IS_LEFT, LEFT = range(6)


def taken(rng: np.random.Generator) -> Words | None:
    """The numbers (6,) of a generator, a copy; None where it is another than PCG64."""
    state = rng.bit_generator.state
    if state["bit_generator"] != "PCG64":
        return None
    inner, mask = state["state"], 0xFFFFFFFFFFFFFFFF
    words = [word for value in (inner["state"], inner["inc"]) for word in (value >> 64, value & mask)]
    return np.array([*words, state["has_uint32"], state["uinteger"]], dtype=np.uint64)


def give_back(rng: np.random.Generator, words: Words) -> None:
    """Let a generator go on from numbers (6,)."""
    state_high, state_low, step_high, step_low, is_left, left = words.tolist()
    inner = {"state": state_high << 64 | state_low, "inc": step_high << 64 | step_low}
    rng.bit_generator.state = {"bit_generator": "PCG64", "state": inner, "has_uint32": is_left, "uinteger": left}


@inlined
def high_product(a: np.uint64, b: np.uint64) -> np.uint64:
    """The upper 64 bits of a product."""
    a_low, a_high, b_low, b_high = a & LOWER, a >> HALF, b & LOWER, b >> HALF
    first = a_high * b_low + ((a_low * b_low) >> HALF)
    second = a_low * b_high + (first & LOWER)
    return np.uint64(a_high * b_high + (first >> HALF) + (second >> HALF))


@called
def next_word(g: Words) -> np.uint64:
    """The next 64 bits."""
    high, low = g[STATE_HIGH], g[STATE_LOW]
    product = low * FACTOR_LOW
    new_low = product + g[STEP_LOW]
    carry = ONE if new_low < product else np.uint64(0)
    new_high = high_product(low, FACTOR_LOW) + high * FACTOR_LOW + low * FACTOR_HIGH + g[STEP_HIGH] + carry
    g[STATE_HIGH], g[STATE_LOW] = new_high, new_low
    mixed, turn = new_high ^ new_low, new_high >> TURN
    return np.uint64((mixed >> turn) | (mixed << ((WORD - turn) & (WORD - ONE))))


@inlined
def drawn_between(g: Words, low: float, high: float) -> float:
    """As `Generator.uniform(low, high)`."""
    return low + (high - low) * (np.float64(next_word(g) >> SHIFT) * 2.0**-53)


@inlined
def next_half(g: Words) -> np.uint64:
    """The next 32 bits: the lower half of a word, then the upper one."""
    if g[IS_LEFT] != np.uint64(0):
        g[IS_LEFT] = np.uint64(0)
        return np.uint64(g[LEFT])
    word = next_word(g)
    g[IS_LEFT], g[LEFT] = ONE, word >> HALF
    return word & LOWER


@called
def drawn_below(g: Words, bound: int) -> int:
    """As `Generator.integers(bound)`, for bounds of less than 32 bits; nothing is drawn where there is no choice."""
    if bound == 1:
        return 0
    count = np.uint64(bound)
    product = next_half(g) * count
    if product & LOWER < count:
        threshold = (LOWER + ONE - count) % count
        while product & LOWER < threshold:
            product = next_half(g) * count
    return int(np.int64(product >> HALF))
