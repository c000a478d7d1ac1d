"""Pages of HD-BUG: still fields, movers, targets, traps, real data, and what each part is worth."""

from __future__ import annotations

from bug_gym.intervals import exact_mcnemar
from bug_gym.reproductions import avoidable as avoidable_rule
from bug_gym.reproductions import barn, claims, hd_bug_dynamic, hd_bug_real, hd_bug_tables, hd_bug_targets
from result_pages import Page, Record
from result_pages.words import RUN_HEADER, RUN_NOTE, listed, number, only_one, p_value, percent, points, run, table


def tables(found: Record) -> Page:
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
        f"path is no longer than the other's in {len(shorter)} of {len(longer)} comparisons. At 500 obstacles and {ranges[0]} "
        f"{walks}.",
        [
            ("`hd_bug` reaches the goal in every world", all(one["success"] == 1.0 for one in ours.values())),
            (f"its path is within {100 * (hd_bug_tables.RATIO_ASKED - 1):.0f} % of the shortest, in the mean",
             all(one["path_ratio"] <= hd_bug_tables.RATIO_ASKED for one in ours.values())),
            (f"its mean path is no longer than that of any of the {len(others)} others", len(shorter) == len(longer)),
        ],
    )  # fmt: skip


def dynamic(found: Record) -> Page:
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
        f"{RUN_NOTE} A collision could have been avoided when, from the state {avoidable_rule.BEFORE:g} s before, at "
        f"least one of {avoidable_rule.SEQUENCES:,} control sequences survives: that is so of {avoidable} of all {hits}.\n\n"
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


def targets(found: Record) -> Page:
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


def traps(found: Record) -> Page:
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


def real(found: Record) -> Page:
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
        f"these somebody had come into the recording less than {avoidable_rule.SUDDEN:g} s before, on top of the robot. So "
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


def ablation(found: Record) -> Page:
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
        f"{RUN_NOTE} Seeds from {2 * claims.FIRST_SEED:,} on, on which no parameter was set. Path over "
        "shortest path leaves moving goals out.\n\n"
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
