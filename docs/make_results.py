"""Writes the pages of results: `python docs/make_results.py`.

A page for each reproduction, out of docs/results/NAME.json, and an index. What a page asks is the docstring of the
reproduction's module; every number on it is looked up in the JSON or, of trained models, in the record beside their
weights. Claims are checked again here; a JSON that says otherwise of itself is an error.
"""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bug_gym.evaluation.intervals import exact_mcnemar
from bug_gym.reproductions import (
    REPRODUCTIONS,
    barn,
    bug_bounds,
    bug_no_way,
    hd_bug_dynamic,
    hd_bug_real,
    hd_bug_tables,
    hd_bug_targets,
    odometry_drift,
    scripted_and_learned,
)

RESULTS = Path(__file__).parent / "results"
TRAINED = Path(__file__).resolve().parents[1] / "agents" / "trained"

Record = Mapping[str, Any]
"""A JSON object."""


class Page(NamedTuple):
    """What a page says of a reproduction beside its head."""

    tables: Sequence[str]
    """Tables and pictures in Markdown, each with its title."""
    reading: str = ""
    """What the numbers say."""
    claims: Sequence[tuple[str, bool]] = ()
    """Each claim, and whether it was found true."""


# ------------------------------------------------------------------------------------------------ numbers as text


def percent(share: float) -> str:
    """A share in percent, as many digits as it has."""
    return f"{100 * share:.4g}"


def between(low: float, high: float) -> str:
    """An interval of shares in percent."""
    return f"{100 * low:.1f} - {100 * high:.1f}"


def share(one: Record) -> str:
    """Success in percent with its 95 % interval."""
    return f"{percent(one['success'])} ({between(*one['success_interval'])})"


def number(value: float | None, digits: int = 2) -> str:
    """A number; a dash for none."""
    return "-" if value is None else f"{value:,.{digits}f}"


def listed(values: Iterable[str]) -> str:
    """Some words in a row: a, b and c."""
    *some, last = values
    return f"{', '.join(some)} and {last}" if some else last


def code(names: Iterable[str]) -> str:
    """Names in a row, set as code."""
    return listed(f"`{name}`" for name in names)


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown under its title."""
    lines = [header, ["---"] * len(header), *rows]
    return f"**{title}**\n\n" + "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def picture(name: str, says: str) -> str:
    """A picture beside the page."""
    return f"![{says}]({name}.png)"


RUN_HEADER = (
    *("worlds", "reached [%] (95 %)", "other ends", "time [s]", "path [m]", "path / shortest", "turns"),
    *("a decision [ms]", "99 % [ms]", "a run [s]"),
)
RUN_NOTE = (
    "Time, path, ratio and turns are means over the worlds reached. A decision, the 99 % of decisions that are quicker, "
    "and all decisions of a run are times on the machine of that run, as busy as it then was."
)


def run(one: Record) -> list[str]:
    """The cells of RUN_HEADER of the episodes of one policy in one kind of world."""
    others = ", ".join(f"{count} {end.replace('_', ' ')}" for end, count in one["outcomes"].items() if end != "success")
    return [
        str(one["n"]),
        share(one),
        others or "-",
        number(one["time"]),
        number(one["path_length"]),
        number(one["path_ratio"], 4),
        number(one["turns"], 1),
        *(number(1e3 * one[f"decision_time_{kind}"]) for kind in ("mean", "p99")),
        number(one["decision_time_total"]),
    ]


def only_one(mine: Record, other: Record) -> tuple[int, int]:
    """In how many worlds only the first arrives, and only the other."""
    missed, others = ({tuple(world) for world in one["missed_seeds"]} for one in (mine, other))
    return len(others - missed), len(missed - others)


def p_value(mine: Record, other: Record) -> str:
    """Exact McNemar's p that both arrive equally often."""
    return f"{exact_mcnemar(*only_one(mine, other)):.2g}"


def points(mine: Record, other: Record) -> float:
    """Success minus the other's [percent]."""
    return float(100 * (mine["success"] - other["success"]))


# ------------------------------------------------------------------------------------------------ the Bug family


def oni_wang_table_1(found: Record) -> Page:
    """Lengths beside the printed and the ideal ones."""
    cells = found["cells"]
    kinds = {"printed": "printed", "ideal, square": "sharp", "ideal, rounded": "rounded", "ours": "length"}
    rows = []
    for policy, routes in cells.items():
        for label, key in kinds.items():
            lengths = [one[key] for one in routes.values()]
            texts = ["F" if length is None else f"{length:.2f}" for length in lengths]
            if key == "length":
                texts = [
                    text + ("" if one["agrees"] else " !") for text, one in zip(texts, routes.values(), strict=True)
                ]
            total = f"{sum(length for length in lengths if length is not None):.2f}"
            rows.append([f"`{policy}`", label, *texts, total])
    routes = next(iter(cells.values()))
    everything = [one for routes in cells.values() for one in routes.values()]
    agree = sum(one["agrees"] for one in everything)
    return Page(
        [table("Distance travelled [m]", ["policy", "", *routes, "total"], rows)],
        "F: cycles for ever. The total leaves those routes out. Bug1 goes back to its leave point the way it came, as "
        "printed. An `!` marks a cell of ours that is farther from the rounded ideal than 1.5 % or three steps.\n\n"
        f"{agree} of {len(everything)} cells agree.",
        [("every length is within 1.5 % or three steps of the ideal one, and F stands where F is printed",
          agree == len(everything))],
    )  # fmt: skip


def bounds(found: Record) -> Page:
    """Guarantees and length bounds."""
    policies = found["policies"]
    header = list(next(iter(policies.values())))
    complete = [policies[name] for name in bug_bounds.COMPLETE]
    arrived = {name: float(one["success [%]"].split()[0]) for name, one in policies.items()}
    return Page(
        [
            table(
                f"{found['seeds']} random worlds at a clearance of {found['clearance']:g} m",
                ["policy", *header],
                [[f"`{name}`", *one.values()] for name, one in policies.items()],
            )
        ],
        f"{sum(value == 100.0 for value in arrived.values())} of {len(policies)} algorithms arrive in all "
        f"{found['seeds']} worlds, with {sum(int(one['collisions']) for one in policies.values())} collisions and "
        f"{len(found['faults'])} broken claims. Bug1 comes to {policies['bug1']['largest share of bound']} of its bound, "
        f"Bug2 to {policies['bug2']['largest share of bound']}.",
        [
            ("the complete algorithms arrive always", all(one["success [%]"].startswith("100.0 ") for one in complete)),
            *(
                (f"`{name}` arrives in at least {percent(asked)} % of the worlds", arrived[name] >= 100 * asked)
                for name, asked in bug_bounds.NEARLY.items()
            ),
            ("nobody touches anything", all(one["collisions"] == "0" for one in policies.values())),
            ("no path is longer than its bound or shorter than the shortest, and distances at hit and leave points fall",
             not found["faults"]),
        ],
    )  # fmt: skip


def no_way(found: Record) -> Page:
    """Verdicts against the configuration space."""
    policies = found["policies"]
    header = list(next(iter(policies.values())))
    rows = [
        [f"`{name}`", "yes" if name in bug_no_way.PROVEN else "no", *map(str, one.values())]
        for name, one in policies.items()
    ]
    right = [
        name
        for name, one in policies.items()
        if one["reached"] == one["with a way"] and one["unreachable"] == one["without"]
    ]
    ended = all(
        sum(one[end] for end in ("reached", "unreachable", "looping", "stuck")) == one["with a way"] + one["without"]
        for one in policies.values()
    )
    ways = next(iter(policies.values()))
    return Page(
        [
            table(
                f"{found['seeds']} random worlds at a clearance of {found['clearance']:g} m",
                ["policy", "complete", *header],
                rows,
            )
        ],
        f"{ways['with a way']} of the worlds have a way and {ways['without']} have none. "
        f"{len(right)} algorithms are right in all of them: {code(right)}. The others come to an end everywhere and "
        f"make {len(found['wrong'])} wrong claims.",
        [
            ("the complete algorithms are right both ways", set(bug_no_way.PROVEN) <= set(right)),
            ("the incomplete ones come to an end, and call no goal unreachable that is not",
             ended and not found["wrong"]),
        ],
    )  # fmt: skip


def barn_worlds(found: Record) -> Page:
    """The BARN benchmark for both robots."""
    results = found["results"]
    robots: dict[str, dict[str, Record]] = {}
    for key, one in results.items():
        robot, policy = key.split(" ")
        robots.setdefault(robot, {})[policy] = one
    rows = [
        [
            f"`{policy}`", robot, str(one["worlds"]), share(one), percent(one["in_time"]), str(one["collisions"]),
            number(one["score"], 4), number(one["time"], 1),
            ", ".join(f"{world}: {end}" for world, end in one["missed"].items()) or "-",
        ]
        for robot, policies in robots.items()
        for policy, one in policies.items()
    ]  # fmt: skip
    header = [
        *("policy", "robot", "worlds", "reached [%] (95 %)", f"in {barn.SCORED:g} s [%]", "collisions", "score"),
        *("time of successes [s]", "missed"),
    ]
    fewest = {
        robot: min(round(one["success"] * one["worlds"]) for one in mine.values()) for robot, mine in robots.items()
    }
    worlds = next(iter(results.values()))["worlds"]
    claims = [
        (f"as the {robot} robot every bug reaches at least {percent(barn.SUCCESS_ASKED[robot])} % of the worlds",
         all(one["success"] >= barn.SUCCESS_ASKED[robot] for one in mine.values()))
        for robot, mine in robots.items()
    ]  # fmt: skip
    still = all(one["collisions"] == 0 for one in robots["holonomic"].values())
    return Page(
        [table("Worlds of the BARN benchmark", header, rows)],
        f"Of {worlds} worlds every bug reaches at least {fewest['holonomic']} as a holonomic robot, and at least "
        f"{fewest['jackal']} as the benchmark's, a disc of {barn.ROBOTS['jackal']['radius']} m that drives at up to "
        f"{barn.ROBOTS['jackal']['max_speed']:g} m/s. A run of over {barn.SCORED:g} s is a failure in the benchmark and "
        f"scores nothing here; it goes on to its end. For context: {barn.DWA}",
        [*claims, ("none collides as the holonomic robot", still)],
    )


def sweep_tables(found: Record, titles: Sequence[str]) -> list[str]:
    """Success and path ratio of each sweep, against its value."""
    tables = []
    for title, sweep in zip(titles, found["sweeps"], strict=True):
        header = ["policy", *(f"{value:g}" for value in sweep["values"])]
        worlds = next(iter(sweep["policies"].values()))[0]["n"]
        where = f"{worlds} runs each, in {code(sweep['scenarios'])}"
        success = [[f"`{name}`", *map(share, row)] for name, row in sweep["policies"].items()]
        ratio = [[f"`{name}`", *(number(one["path_ratio"]) for one in row)] for name, row in sweep["policies"].items()]
        tables.append(table(f"{title}: success [%] (95 %) against {sweep['label']}; {where}", header, success))
        tables.append(table(f"{title}: path over shortest path of the successes", header, ratio))
    return tables


def success_at(sweep: Record, value: float) -> dict[str, float]:
    """Success of each policy at a value of a sweep."""
    index = sweep["values"].index(value)
    return {name: row[index]["success"] for name, row in sweep["policies"].items()}


def lidar_density(found: Record) -> Page:
    """Beams and range noise."""
    beams, noise = found["sweeps"]
    few, enough = success_at(beams, 8), success_at(beams, 16)
    last, before = success_at(noise, noise["values"][-1]), success_at(noise, 0.02)
    best = max(last, key=lambda name: last[name])
    return Page(
        [
            picture("lidar-density", "Success against the number of beams and against range noise"),
            *sweep_tables(found, ["LIDAR density", "Range noise"]),
        ],
        f"With 8 beams the bugs arrive in {percent(min(few.values()))} to {percent(max(few.values()))} % of the runs, with "
        f"16 in at least {percent(min(enough.values()))} %. Range noise of 0.02 m leaves all at "
        f"{percent(min(before.values()))} % or more; at {noise['values'][-1]:g} m `{best}` is left with "
        f"{percent(last[best])} %, the others with {percent(min(last.values()))} to "
        f"{percent(max(value for name, value in last.items() if name != best))} %. The clearance is the default one, "
        "which knows nothing of the noise.",
    )


def drift(found: Record) -> Page:
    """Which bugs survive drift."""
    beacon, computed = found["sweeps"]
    survives = odometry_drift.SURVIVES
    most = beacon["values"][-1]
    dips = []
    for name, row in beacon["policies"].items():
        lowest = min(row, key=lambda one: one["success"])
        if lowest["success"] < survives:
            value = beacon["values"][row.index(lowest)]
            dips.append(f"`{name}` falls to {percent(lowest['success'])} % at {value:g}")
    surviving = [name for name, value in success_at(beacon, most).items() if value >= survives]
    lines = []
    for value in computed["values"][1:]:
        order = sorted(success_at(computed, value).items(), key=lambda item: -item[1])
        (first, best), (last, worst) = order[0], order[-1]
        lines.append(f"at {value:g} m/sqrt(m) {percent(worst)} % (`{last}`) to {percent(best)} % (`{first}`)")
    final = success_at(computed, most).values()
    return Page(
        [
            picture("odometry-drift", "Success against odometry drift"),
            *sweep_tables(found, [one.title for one in odometry_drift.SWEEPS]),
        ],
        f"With a beacon at the goal {len(surviving)} of {len(beacon['policies'])} bugs survive odometry noise of {most:g} "
        f"m/sqrt(m), which is to say that at least {percent(survives)} % arrive"
        + (f", though {listed(dips)}" if dips else "")
        + f". Where the goal itself is computed from odometry "
        f"{sum(value >= survives for value in final) or 'none'} do. There "
        f"arrive {listed(lines)}.",
    )


# ------------------------------------------------------------------------------------------------ HD-BUG


def hd_tables(found: Record) -> Page:
    """Nine algorithms in still fields."""
    results = found["results"]
    ranges = sorted({key.split(", ")[0] for key in results}, key=lambda text: -float(text.split()[0]))
    counts = [str(count) for count in hd_bug_tables.OBSTACLES]
    policies = list(dict.fromkeys(key.split(", ")[2] for key in results))
    others = [name for name in policies if name != "hd_bug"]
    tables, longer = [], []
    for lidar in ranges:
        rows = []
        for count in counts:
            ours = results[f"{lidar}, {count}, hd_bug"]
            for name in policies:
                one = results[f"{lidar}, {count}, {name}"]
                both = one["success"] == ours["success"] == 1.0
                more = one["path_length"] - ours["path_length"] if both else None
                longer += [] if name == "hd_bug" else [more]
                told = hd_bug_tables.PRINTED.get(int(count), {}).get(name)
                printed = [f"{told[0]:.2f}", "yes" if told[3] else "no"] if told else ["-", "-"]
                rows.append([count, f"`{name}`", *run(one), "" if name == "hd_bug" else number(more), *printed])
        header = [
            "obstacles",
            "policy",
            *RUN_HEADER,
            "path minus `hd_bug`'s [m]",
            "printed path [m]",
            "printed reached",
        ]
        tables.append(table(f"LIDAR of {lidar}", header, rows))
    ours = {key: one for key, one in results.items() if key.endswith(", hd_bug")}
    ratios = []
    for lidar in ranges:
        of_range = [ours[f"{lidar}, {count}, hd_bug"]["path_ratio"] for count in counts]
        ratios.append(f"{listed(f'{ratio:.3f}' for ratio in of_range)} with a LIDAR of {lidar}")
    dense = {name: results[f"{ranges[0]}, 500, {name}"]["path_length"] for name in policies}
    walks = listed(
        f"`{name}` walks {dense[name] - dense['hd_bug']:.1f} m more" for name in ("tangent_bug", "e_bug", "k_bug")
    )
    shorter = [more for more in longer if more is not None and more >= 0.0]
    return Page(
        tables,
        f"Ours are {next(iter(ours.values()))['n']} worlds a line. {RUN_NOTE} The printed failures are those of "
        "implementations that stop after some 700 or 800 steps, and of a PointBug that finds no point; ours stop at the "
        f"goal, a proof, or {hd_bug_tables.TIME_LIMIT:,.0f} s.\n\n"
        f"At {listed(counts)} obstacles the path of `hd_bug` over the shortest path is {', and '.join(ratios)}. Its mean "
        f"path is the shorter one in {len(shorter)} of {len(longer)} comparisons. At 500 obstacles and {ranges[0]} "
        f"{walks}.",
        [
            ("`hd_bug` reaches the goal in every world", all(one["success"] == 1.0 for one in ours.values())),
            (f"its path is within {100 * (hd_bug_tables.RATIO_ASKED - 1):.0f} % of the shortest, in the mean",
             all(one["path_ratio"] <= hd_bug_tables.RATIO_ASKED for one in ours.values())),
            (f"its mean path is no longer than that of any of the {len(others)} others", len(shorter) == len(longer)),
        ],
    )  # fmt: skip


def hd_dynamic(found: Record) -> Page:
    """Movers, with each predictor."""
    results = found["results"]
    worlds = hd_bug_dynamic.WORLDS
    names = hd_bug_dynamic.PREDICTORS
    rows = [
        [world, f"`{name}`", *run(one), str(one["avoidable_collisions"])]
        for world in worlds
        for name in names
        if (one := results[f"{world}, {name}"])
    ]
    paired = [
        [world, f"`{name}`", f"{points(one, base):+.1f}", *map(str, only_one(one, base)), p_value(one, base)]
        for world in worlds
        if (base := results[f"{world}, kalman"])
        for name in names
        if name != "kalman" and (one := results[f"{world}, {name}"])
    ]
    slow = [world for world in worlds if world != "rush"]
    said = listed(
        f"`{name}` {listed(percent(results[f'{world}, {name}']['success']) + ' %' for world in slow)}" for name in names
    )
    certain = [
        f"`{name}` {world} (p = {p_value(one, base)})"
        for world in slow
        if (base := results[f"{world}, kalman"])
        for name in names
        if (one := results[f"{world}, {name}"]) and exact_mcnemar(*only_one(one, base)) < 0.05
    ]
    rush = {name: results[f"rush, {name}"] for name in names}
    apart = listed(f"`{name}` {percent(one['success'])} %" for name, one in rush.items())
    hits = sum(one["outcomes"].get("collision", 0) for one in results.values())
    avoidable = sum(one["avoidable_collisions"] for one in results.values())
    return Page(
        [
            table("20 of 40 obstacles moving", ["movers", "predictor", *RUN_HEADER, "avoidable collisions"], rows),
            table(
                "Success paired with that of `kalman`, world by world",
                ["movers", "predictor", "points", "only it arrives", "only `kalman`", "p (McNemar, exact)"],
                paired,
            ),
        ],
        f"{RUN_NOTE} A collision could have been avoided when, from the state two seconds before, at least one of 1,000 "
        f"control sequences survives: that is so of {avoidable} of all {hits}.\n\n"
        f"Among slow movers, {listed(slow)}, all predictors arrive: {said}. Only these differ from `kalman` for certain "
        f"there: {listed(certain) if certain else 'none'}. In `rush`, with movers as fast as the robot, they come apart: "
        f"{apart}. There `rl` reaches "
        f"{points(rush['rl'], rush['kalman']):.1f} points more than `kalman` "
        f"(p = {p_value(rush['rl'], rush['kalman'])}) and collides {rush['rl']['outcomes']['collision']} times instead of "
        f"{rush['kalman']['outcomes']['collision']}.",
        [
            (f"with `kalman` HD-BUG reaches at least {percent(asked)} % among movers of {world}",
             results[f"{world}, kalman"]["success"] >= asked)
            for world, (_, asked) in worlds.items()
            if asked > 0.0
        ],
    )  # fmt: skip


def hd_targets(found: Record) -> Page:
    """Moving targets beside pure pursuit."""
    results = found["results"]
    rows, sooner, ratios, caught = [], {}, {}, []
    for target in hd_bug_targets.TARGETS:
        ours, pursuit = results[f"{target}, hd_bug"], results[f"{target}, pure pursuit"]
        both = ours["success"] == pursuit["success"] == 1.0
        sooner[target] = pursuit["time"] - ours["time"] if both else None
        ratios[target] = ours["time_ratio"]
        caught.append(ours["success"])
        for label, one in (("`hd_bug`", ours), ("pure pursuit", pursuit)):
            rows.append([target.replace("_", " "), label, *run(one), number(one["time_ratio"], 3)])
    gains = [value for value in sooner.values() if value is not None]
    said = listed(f"{ratio:.2f} for {target.replace('_', ' ')}" for target, ratio in ratios.items())
    return Page(
        [table("Targets among 40 still obstacles", ["target", "policy", *RUN_HEADER, "`time_ratio`"], rows)],
        f"{RUN_NOTE} Pure pursuit is the same robot, heading for where the target is instead of where it can be met.\n\n"
        f"HD-BUG intercepts at least {percent(min(caught))} % of each kind. `time_ratio` is {said}. It is sooner than pure "
        f"pursuit by {listed(f'{gain:.2f}' for gain in gains)} s, in the same order.",
        [
            (f"at least {percent(hd_bug_targets.SUCCESS_ASKED)} % of each kind are intercepted",
             min(caught) >= hd_bug_targets.SUCCESS_ASKED),
            (f"`time_ratio` is at least {hd_bug_targets.TIME_RATIO_ASKED:g}",
             min(ratios.values()) >= hd_bug_targets.TIME_RATIO_ASKED),
            ("each kind is met sooner than by pure pursuit", len(gains) == len(sooner) and min(gains) > 0.0),
        ],
    )  # fmt: skip


def hd_traps(found: Record) -> Page:
    """Traps that are left, and one that has no way out."""
    results = {key.removesuffix(", hd_bug"): one for key, one in found["results"].items()}
    left = [name for name in results if name != "ring"]
    ring = results["ring"]["outcomes"].get("gave_up unreachable", 0)
    counts = listed(f"{results[name]['outcomes'].get('success', 0)} of `{name}`" for name in left)
    hits = sum(one["outcomes"].get("collision", 0) for one in results.values())
    return Page(
        [table("Traps", ["trap", *RUN_HEADER], [[f"`{name}`", *run(one)] for name, one in results.items()])],
        f"{RUN_NOTE}\n\nOf {results['ring']['n']} worlds each HD-BUG leaves {counts}, finds {ring} of `ring` closed, and "
        f"collides {hits} times. There is a way in every world but those of `ring`, where there is none.",
        [
            ("every trap with a way is left", all(results[name]["success"] == 1.0 for name in left)),
            ("every `ring` is found to be closed", ring == results["ring"]["n"]),
        ],
    )


def hd_real(found: Record) -> Page:
    """BARN's worlds and recorded pedestrians."""
    results = dict(found["results"])
    barn_one = results.pop("barn")
    rows = [
        [*key.split(", "), *run(one), str(one["avoidable_collisions"]), str(one["of_them_sudden"])]
        for key, one in results.items()
    ]
    crossings = sum(one["n"] for one in results.values())
    untouched = sum(one["outcomes"].get("success", 0) for one in results.values())
    hits = sum(one["outcomes"].get("collision", 0) for one in results.values())
    avoidable = sum(one["avoidable_collisions"] for one in results.values())
    sudden = sum(one["of_them_sudden"] for one in results.values())
    faults = avoidable - sudden
    return Page(
        [
            table("BARN, the differential robot", [*RUN_HEADER, "score"], [[*run(barn_one), number(barn_one["score"], 4)]]),
            table(
                "Crossings of recorded pedestrians",
                ["scene", "predictor", *RUN_HEADER, "avoidable collisions", "of them sudden"],
                rows,
            ),
        ],
        f"{RUN_NOTE} BARN's score is at most 0.25. For context: {barn.DWA}\n\n"
        f"{barn_one['outcomes'].get('success', 0)} of {barn_one['n']} worlds of BARN are reached, with a score of "
        f"{barn_one['score']:.4f}. Recorded pedestrians make no way: {untouched} of {crossings} crossings touch nobody. "
        f"Of the {hits} collisions {avoidable} could have been avoided by somebody who knows the future; in {sudden} of "
        "these somebody had come into the recording less than a second before, on top of the robot. So "
        f"{crossings - faults} of {crossings} are without its fault. (That rule was made after an earlier run had been "
        "seen.)",
        [
            (f"at least {percent(hd_bug_real.SUCCESS_ASKED)} % of the BARN worlds are reached",
             barn_one["success"] >= hd_bug_real.SUCCESS_ASKED),
            (f"the score there is at least {hd_bug_real.SCORE_ASKED:g}", barn_one["score"] >= hd_bug_real.SCORE_ASKED),
            (f"at least {percent(hd_bug_real.FAULTLESS_ASKED)} % of the crossings are without the robot's fault",
             faults <= (1.0 - hd_bug_real.FAULTLESS_ASKED) * crossings),
        ],
    )  # fmt: skip


def hd_ablation(found: Record) -> Page:
    """What each part is worth."""
    results = found["results"]
    worlds = list(dict.fromkeys(key.split(", ")[0] for key in results))
    variants = list(dict.fromkeys(key.split(", ")[1] for key in results))
    rows = []
    for world in worlds:
        whole = results[f"{world}, whole"]
        for variant in variants:
            one = results[f"{world}, {variant}"]
            paired = ["", ""] if variant == "whole" else [f"{points(one, whole):+.0f}", p_value(one, whole)]
            rows.append([world, variant, *run(one), *paired])

    def reached(world: str, variant: str = "whole") -> str:
        return percent(results[f"{world}, {variant}"]["success"]) + " %"

    header = ["worlds", "HD-BUG", *RUN_HEADER, "points against the whole", "p (McNemar, exact)"]
    return Page(
        [
            table(
                f"The whole, and the whole without one part, {results['rush, whole']['n']} worlds a line", header, rows
            )
        ],
        f"{RUN_NOTE} Seeds from 20,000 on, on which no parameter was set. Path over shortest path leaves moving goals "
        "out.\n\n"
        f'Without memory ("without backtracking") {reached("maze", "without backtracking")} of the mazes and '
        f"{reached('rooms', 'without backtracking')} of the rooms are reached instead of {reached('maze')} and "
        f"{reached('rooms')}. Without prediction it is {reached('dynamic', 'predictor none')} of `dynamic` instead of "
        f"{reached('dynamic')}, and {reached('rush', 'predictor none')} of `rush` instead of {reached('rush')}. Without the "
        f"adaptive radius it is {reached('dynamic', 'without adaptive radius')} of `dynamic`. With the learned predictors "
        f"`supervised` and `rl` it is {reached('rush', 'predictor supervised')} and {reached('rush', 'predictor rl')} of "
        f"`rush`. Without the fear of shadows ({reached('rush', 'without shadow')} of `rush`), and with "
        f"`constant_velocity` ({reached('rush', 'predictor constant_velocity')}), there is no difference to the whole that "
        "so many worlds show.",
    )


# ------------------------------------------------------------------------------------------------ learning


def learned(found: Record) -> Page:
    """The shipped models in held-out worlds, beside the records of their trainings."""
    rows, trainings = [], []
    for name, scenarios in found["models"].items():
        record = json.loads((TRAINED / name / "config.json").read_text(encoding="utf-8"))
        runs, settings = record["runs"], record["settings"]
        for scenario, held in scenarios.items():
            seeds = [percent(one["held_out"][scenario]["success"]) for one in runs.values()]
            ends = [percent(held[end]) for end in ("collision", "timeout")]
            success = f"{percent(held['success'])} ({between(held['low'], held['high'])})"
            rows.append([f"`{name}`", f"`{scenario}`", success, *ends, number(held["time"], 1), ", ".join(seeds)])
        last = [one["curve"][-1] for one in runs.values()]
        memory = f"what changed in {listed(map(str, record['history']))} steps" if record["history"] else "-"
        trainings.append(
            [
                f"`{name}`", settings["algo"].upper(), memory,
                f"`{settings['start_from']}`" if settings["start_from"] else "-",
                f"{last[0]['steps']:,}", ", ".join(f"{one['cpu_seconds'] / 60:.1f}" for one in last),
                str(record["seed"]), record["machine"]["cpu"],
            ]
        )  # fmt: skip
    rush = json.loads((TRAINED / "ppo_rush" / "config.json").read_text(encoding="utf-8"))
    card = rush["runs"][str(rush["seed"])]["held_out"]["rush"]["success"]
    ours = found["models"]["ppo_rush"]["rush"]["success"]
    return Page(
        [
            table(
                f"The shipped model of each name in {found['worlds']:,} held-out worlds",
                ["name", "scenario", "success [%] (95 %)", "collision [%]", "timeout [%]", "time [s]", "by seed [%]"],
                rows,
            ),
            table(
                "How they were trained",
                [
                    "name",
                    "algorithm",
                    "memory",
                    "begun from",
                    "steps",
                    "minutes of one core",
                    "shipped seed",
                    "machine",
                ],
                trainings,
            ),
        ],
        "The shipped model is the one of three training seeds that did best in its validation. The last column of the "
        "first table is the same measure of all three, made by torch when they were trained; it and the second table "
        "come from the records in `agents/trained`.\n\n"
        f"The two numbers of the shipped seed of `ppo_rush`, {percent(card)} and {percent(ours)} %, are one model, played "
        "by torch for its record and by onnxruntime here. Their actions agree but for rounding; among twenty fast movers "
        "such a difference grows to another episode within seconds, and so many worlds tell success to no better than a "
        "point.",
        [
            (f"`{name}` reaches at least {percent(asked)} % of `{scenario}`", held["success"] >= asked)
            for name, asked in found["targets"].items()
            for scenario, held in found["models"][name].items()
        ],
    )


def ppo_curve(found: Record) -> Page:
    """Success over the time of one core."""
    gate = found["gate"]

    def after(curve: Sequence[Record], asked: float) -> str:
        return number(next((one["seconds"] for one in curve if one["success"] >= asked), None), 0)

    rows = [
        [
            str(seed), f"{curve[-1]['steps']:,}", number(curve[-1]["seconds"], 0), percent(curve[-1]["success"]),
            after(curve, 0.9), after(curve, 0.98),
        ]
        for seed, curve in enumerate(found["curves"])
    ]  # fmt: skip
    last = [curve[-1]["success"] for curve in found["curves"]]
    return Page(
        [
            picture("ppo-curve", "Success of PPO on BugGym/Dynamic-v0 over the seconds of its training"),
            table(
                "PPO on `dynamic`",
                ["seed", "steps", "seconds of one core", "success [%]", "90 % after [s]", "98 % after [s]"],
                rows,
            ),
        ],
        "Validation does not count as time. The step size falls to 0 at the last step: this is a whole training, not the "
        "beginning of a longer one.",
        [(f"each training ends with at least {percent(gate)} % in validation worlds", min(last) >= gate)],
    )


def ratio_table(title: str, found: Record, names: Sequence[str]) -> str:
    """Mean error up to the last time ahead over the Kalman filter's."""
    rows = [
        [
            label, str(one["tracks"]), str(one["worlds"]), number(one["mean"]["kalman"][-1]["value"]),
            *(
                f"{ratio['value']:.2f} ({ratio['low']:.2f} - {ratio['high']:.2f})"
                for name in names
                for ratio in one["mean_ratio"][name][-1:]
            ),
        ]
        for label, one in found.items()
    ]  # fmt: skip
    header = ["movers", "tracks", "worlds", "Kalman [m]", *(f"`{name}` / Kalman (95 %)" for name in names)]
    return table(title, header, rows)


def predictor_training() -> str:
    """A sentence on how the shipped predictors came to their cost."""
    rl, supervised = (
        json.loads((TRAINED / f"{name}_predictor" / "predictor.json").read_text(encoding="utf-8"))
        for name in ("rl", "supervised")
    )
    curves = [rl["curve"], *rl["repeats"].values()]
    costs = listed(f"{curve[-1]['cost']:.3f}" for curve in curves)
    minutes = listed(f"{curve[-1]['cpu_seconds'] / 60:.0f}" for curve in curves)
    return (
        f"The shipped `rl` learnt by PPO of stable-baselines3, {rl['settings']['tries']} answers tried to each question, "
        "what was tried at a horizon judged there by the mean of the others. Before it had learnt anything its "
        f"validation cost was about the filter's, {rl['curve'][0]['cost']:.2f}; after {rl['curve'][-1]['samples']:,} samples "
        f"it was {costs} with three seeds, the first the shipped one, in {minutes} minutes of one core. Supervision came to "
        f"{supervised['curve'][-1]['cost']:.3f} with {supervised['curve'][-1]['samples']:,} samples in "
        f"{supervised['curve'][-1]['cpu_seconds'] / 60:.0f} minutes of one core (the records in `agents/trained`)."
    )


def predictor_errors(found: Record) -> Page:
    """Errors of all predictors about the same tracks."""
    errors, other = found["errors"], found["other_scene"]
    ahead = found["times"][-1]
    names = [name for name in errors["bounce"]["mean"] if name != "kalman"]
    tables = [ratio_table(f"Mean error up to {ahead:g} s over the Kalman filter's", errors, names)]
    for tested, one in other.items():
        tables.append(
            ratio_table(
                f"{tested}, as shipped and trained on with the other scene", {tested: one}, list(one["mean_ratio"])
            )
        )
    for kind, says in (("mean", "in the mean over the times up to"), ("final", "at")):
        rows = [
            [label, f"`{name}`", *(f"{one['value']:.2f} ({one['low']:.2f} - {one['high']:.2f})" for one in row)]
            for label, of in errors.items()
            for name, row in of[kind].items()
        ]
        header = ["movers", "predictor", *(f"{time:g} s" for time in found["times"])]
        tables.append(table(f"Displacement error [m] (95 %) {says} each time ahead", header, rows))
    hotel = errors["hotel"]["mean_ratio"]["rl"][-1]
    after = other["hotel"]["mean_ratio"]["rl, trained on with ETH"][-1]
    return Page(
        tables,
        "Learning pays on laws that were seen, and on people once people were seen. At the hotel, without them, the mean "
        f"error of `rl` is {hotel['value']:.2f} ({hotel['low']:.2f} - {hotel['high']:.2f}) times the filter's; trained on "
        f"with ETH it is {after['value']:.2f} ({after['low']:.2f} - {after['high']:.2f}). Reinforcement nearly matches "
        f"supervision and gains nothing beyond it.\n\n{predictor_training()} Other ways to learn, and the second stage "
        "through HD-BUG's own runs, are on the page of [trials](../trials.md). (Eight of the recorded crossings were "
        "looked at while the training data was designed; none was trained on.) What a better prediction is worth inside "
        "HD-BUG says the page of [hd-bug-dynamic](hd-bug-dynamic.md).",
        list(found["claims"].items()),
    )


SHOWN = ("bug2", "tangent_bug", "hd_bug", "ppo_dynamic", "ppo_mixed", "ppo_rush", "sac_dynamic", "dqn_candidates")
"""Policies of the short table of scripted and learned ones."""


def side_by_side(found: Record) -> Page:
    """Scripted and learned policies in the same worlds."""
    scenarios = list(found["collisions"])
    by = {(one["policy"], one["scenario"]): one for one in found["summaries"]}
    short = [
        [f"`{name}`", *(percent(by[name, place]["success"]) if (name, place) in by else "-" for place in scenarios)]
        for name in SHOWN
    ]
    tables = [table(f"Success [%] of {found['worlds']} worlds", ["", *scenarios], short)]
    header = ["policy", "success [%] (95 %)", "SPL", "time [s]", "collision [%]", "timeout [%]", "gave up [%]"]
    for place in scenarios:
        rows = []
        for (name, scenario), one in by.items():
            if scenario != place:
                continue
            kinds = ", ".join(f"{count} {kind}" for kind, count in found["collisions"][place][name].items())
            success = f"{percent(one['success'])} ({between(one['success_low'], one['success_high'])})"
            ends = [percent(one[end]) for end in ("collision", "timeout", "gave_up")]
            decision = number(1e3 * one["decision_time"], 3)
            rows.append(
                [f"`{name}`", success, number(one["spl"]), number(one["time"], 1), *ends, decision, kinds or "-"]
            )
        tables.append(table(place, [*header, "a decision [ms]", "collisions with"], rows))
    base = scripted_and_learned.BASELINE
    paired = [
        [
            one["scenario"], f"`{one['policy']}`", f"{100 * one['mean']:+.0f}",
            "-" if one["low"] is None else f"{100 * one['low']:+.0f} to {100 * one['high']:+.0f}", f"{one['p_value']:.2g}",
        ]
        for one in found["differences"]
    ]  # fmt: skip
    tables.append(table(f"Success minus that of `{base}` [points]", ["", "policy", "mean", "95 %", "p"], paired))

    def says(name: str, *places: str) -> str:
        return listed(f"{percent(by[name, place]['success'])} % of `{place}`" for place in places)

    nets = [name for name in SHOWN if not name.endswith("bug") and name != "bug2"]
    best = {place: max(by[name, place]["success"] for name in nets) for place in ("maze", "rooms", "u_trap")}
    return Page(
        tables,
        f"The worlds are the same for all; SPL where the goal stands, times of successes. The intervals say "
        "what so many worlds tell apart. The real maps were scanned by robots.\n\n"
        "Among fast and many movers the networks win, for they learnt what a scan of movers means: `ppo_mixed` reaches "
        f"{says('ppo_mixed', 'rush', 'denser', 'faster')}. HD-BUG, which tracks and predicts them, comes near: "
        f"{says('hd_bug', 'rush', 'denser', 'faster')} (and more with a learned predictor, see "
        "[hd-bug-dynamic](hd-bug-dynamic.md)). In mazes, rooms and traps, where one has to remember, the networks "
        f"fail: the best of those above reaches {listed(f'{percent(value)} % of `{place}`' for place, value in best.items())}. "
        f"HD-BUG reaches {says('hd_bug', *best)} within the time limit. The networks do well on the map that looks like "
        f"what they learnt on (`ppo_mixed`: {says('ppo_mixed', 'map depot')}) and worse in the narrow one "
        f"({says('ppo_mixed', 'map tb3_sandbox')}). They also are bound to the robot and scanner of their training.",
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------ the pages

PAGES: dict[str, Callable[[Record], Page]] = {
    "oni-wang-table-1": oni_wang_table_1,
    "bug-bounds": bounds,
    "bug-no-way": no_way,
    "barn": barn_worlds,
    "lidar-density": lidar_density,
    "odometry-drift": drift,
    "hd-bug-tables": hd_tables,
    "hd-bug-dynamic": hd_dynamic,
    "hd-bug-targets": hd_targets,
    "hd-bug-traps": hd_traps,
    "hd-bug-real": hd_real,
    "hd-bug-ablation": hd_ablation,
    "learned": learned,
    "ppo-curve": ppo_curve,
    "predictors": predictor_errors,
    "scripted-and-learned": side_by_side,
}
"""Name of a reproduction -> what its page says."""

WITH_DATA = ("barn", "hd-bug-real", "predictors", "scripted-and-learned")
"""Reproductions that were given somebody else's data."""

MADE = "by `python docs/make_results.py`; edit that script, not this page."


def command(name: str) -> str:
    """What runs a reproduction."""
    return f"bug-gym reproduce {name}{' --data PATH' if name in WITH_DATA else ''} --out docs/results/{name}.json"


def asked(name: str) -> tuple[str, str]:
    """The first sentence of the docstring of a reproduction, and the rest of it."""
    module = importlib.import_module(f"bug_gym.reproductions.{REPRODUCTIONS[name]}")
    first, _, rest = str(module.__doc__).strip().partition("\n\n")
    return " ".join(first.split()), rest


def verdict(holds: bool | None) -> str:
    """What came of the claims of a reproduction."""
    return {True: "true", False: "**false**", None: "claims nothing"}[holds]


def page(name: str, found: Record) -> str:
    """The page of a reproduction.

    Raises:
        ValueError: its claims, checked again, are not what the JSON says of itself.
    """
    told = PAGES[name](found)
    holds = all(true for _, true in told.claims) if told.claims else None
    if holds != found["holds"]:
        raise ValueError(f"{name}: the JSON says {found['holds']!r} of its claims, its numbers say {holds!r}")
    first, rest = asked(name)
    made = (
        f"Numbers: [{name}.json]({name}.json), made at commit `{found['commit']}` with bug_gym {found['bug_gym']} and "
        f"Python {found['python']}. This page is made of it {MADE}"
    )
    claims = table("Claims", ["claim", "found"], [[claim, verdict(true)] for claim, true in told.claims])
    parts = [
        f"# {name}", first, rest, f"```bash\n{command(name)}\n```", made,
        claims if told.claims else "It claims nothing.",
        "## What it says", told.reading, "## Numbers", *told.tables,
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def index(everything: Mapping[str, Record]) -> str:
    """The list of the pages."""
    rows = []
    for name, found in everything.items():
        claims = PAGES[name](found).claims
        count = f"{sum(true for _, true in claims)} of {len(claims)} claims true" if claims else "claims nothing"
        rows.append([f"[{name}]({name}.md)", asked(name)[0], count])
    return (
        "# Results\n\nWhat papers report and what this package claims, run again: a page each, with the command, the "
        "commit, the tables and what was found. A claim that was found false stands as false. `bug-gym list "
        "reproductions` names them. Somebody else's data (`--data`: the worlds of the BARN benchmark, recorded "
        "pedestrians, maps of ROS's map_server) is not part of this package.\n\n"
        f"These pages are made {MADE.replace('this page', 'the pages')}\n\n"
        + table("Reproductions", ["name", "asks", "found"], rows).split("\n\n", 1)[1]
        + "\n\nHow fast the package is: [speed](../speed.md). What was tried and not kept: [trials](../trials.md).\n"
    )


def pages() -> dict[str, str]:
    """Text by file name below docs/results."""
    everything = {
        name: json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
        for name in REPRODUCTIONS
        if (RESULTS / f"{name}.json").exists()
    }
    return {"README.md": index(everything), **{f"{name}.md": page(name, found) for name, found in everything.items()}}


if __name__ == "__main__":
    written = pages()
    for name, text in written.items():
        (RESULTS / name).write_text(text, encoding="utf-8")
    sys.stdout.write(f"{len(written)} pages in {RESULTS}\n")
