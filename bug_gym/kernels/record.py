"""The record that describes a row: one for all, or one for each where a scenario draws numbers for each episode.

Fields named like an array of the row hold the index where that array begins, those named see_ and a field of the
observation where that begins; the others are counts and constants of the scenario.
"""

from __future__ import annotations

import numpy as np

from bug_gym.kernels.layout import COUNTS, FLOAT_ARRAYS, FLOAT_CONSTANTS, INT_ARRAYS, INT_CONSTANTS
from bug_gym.kernels.observation import OBSERVATION

SPEC = np.dtype(
    [(name, np.int64) for name in (*FLOAT_ARRAYS, *INT_ARRAYS, *COUNTS, *INT_CONSTANTS)]
    + [(f"see_{name}", np.int64) for name in OBSERVATION]
    + [(name, np.float64) for name in FLOAT_CONSTANTS]
)
