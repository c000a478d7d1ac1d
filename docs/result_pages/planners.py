"""Pages of the planners: what it costs not to know the map."""

from __future__ import annotations

import math
from collections.abc import Sequence

from bug_gym.reproductions import price_of_not_knowing as price
from result_pages import Page, Record
from result_pages.words import number, picture, share, table


def price_of_not_knowing(found: Record) -> Page:
    """Path over optimum of everybody, and the worth of a range."""
    policies: Record = found["policies"]
    scenarios = list(next(iter(policies.values())))
    tables = []
    for label in scenarios:
        mine = {policy: one[label] for policy, one in policies.items() if label in one}
        order = sorted(mine, key=lambda policy: -mine[policy]["share_of_optimum"][0])
        rows = [
            [
                f"`{policy}`",
                share(mine[policy]),
                with_interval(mine[policy]),
                spread(mine[policy]),
                price.memory_of(policy),
            ]
            for policy in order
        ]
        header = ["policy", "reached [%] (95 %)", "path / shortest", "share of the optimum", "remembers"]
        tables.append(table(f"{label}, {found['worlds']} worlds", header, rows))
    ranges: Record = found["ranges"]
    for label in price.SCENARIOS:
        by_policy = {
            policy: [of_range[label][policy] for of_range in ranges.values()] for policy in seers(found, label)
        }
        rows = [[f"`{policy}`", *map(spread, cells)] for policy, cells in by_policy.items()]
        tables.append(table(f"{label}: share of the optimum by range of the LIDAR [m]", ["policy", *ranges], rows))
    tables.append(picture("price-of-not-knowing", "Share of the optimum against the range of the LIDAR"))
    return Page(tables, reading(found), [("no path is shorter than the shortest", not found["too_short"])])


def seers(found: Record, label: str) -> list[str]:
    """Who was driven with each range."""
    return list(next(iter(found["ranges"].values()))[label]) if found["ranges"] else []


def with_interval(one: Record) -> str:
    """Path over shortest path with its 95 % interval."""
    low, high = one["path_ratio_interval"]
    return f"{number(one['path_ratio'], 3)} ({number(low, 3)} - {number(high, 3)})"


def spread(one: Record) -> str:
    """Share of the optimum with its 95 % interval."""
    middle, low, high = one["share_of_optimum"]
    return f"{number(middle, 3)} ({number(low, 3)} - {number(high, 3)})"


def reading(found: Record) -> str:
    """What the numbers say, of those that were not given the map."""
    sentences = []
    for label in next(iter(found["policies"].values())):
        blind = {
            policy: one[label]["share_of_optimum"][0]
            for policy, one in found["policies"].items()
            if label in one and not policy.endswith("(privileged)")
        }
        first = max(blind, key=lambda policy: blind[policy])
        sentences.append(f"in {label} `{first}` comes to {number(blind[first], 3)} of the optimum")
    told = f"Of those that are not given the map, {'; '.join(sentences)}."
    gains = gained(found)
    if gains:
        told += (
            f" From a LIDAR of {min(price.RANGES):g} m to one of {max(price.RANGES):g} m the share of the optimum, a mean "
            f"over {', '.join(price.SCENARIOS)}, changes by "
            + ", ".join(f"{gain:+.3f} (`{policy}`)" for policy, gain in gains)
            + "."
        )
    return told + (
        "\n\nShare of the optimum: shortest path over path, 0 for who did not arrive, a mean over all worlds. Path over "
        "shortest is of those that arrived. The shortest path is that of the same disc and may be 1.1 % too long."
        + left_out(found)
    )


def left_out(found: Record) -> str:
    """What the command would do that this run has not done."""
    told, worlds = "", found["worlds"]
    if worlds < price.WORLDS:
        told += (
            f" This run was of {worlds} worlds a scenario (`--seeds {worlds}`) of the {price.WORLDS} that the command takes "
            "unless told, so its intervals are wide."
        )
    scenarios = next(iter(found["policies"].values()))
    if not any(label.startswith("map ") for label in scenarios):
        told += " It was without maps (`--data`)."
    return told


def gained(found: Record) -> Sequence[tuple[str, float]]:
    """By how much the longest range is better than the shortest, by policy."""
    ranges: Record = found["ranges"]
    if not ranges:
        return []
    least, most = (ranges[f"{metres:g}"] for metres in (min(price.RANGES), max(price.RANGES)))
    labels = list(price.SCENARIOS)
    gains = []
    for policy in seers(found, labels[0]):
        each = [
            most[label][policy]["share_of_optimum"][0] - least[label][policy]["share_of_optimum"][0] for label in labels
        ]
        gains.append((policy, math.fsum(each) / len(each)))
    return gains
