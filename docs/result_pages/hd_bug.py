"""Pages of HD-BUG and the navigator: fields, movers, targets, traps, real data, and what each part is worth."""

from __future__ import annotations

from collections.abc import Sequence

from bug_gym.intervals import exact_mcnemar, holm
from bug_gym.reproductions import avoidable as avoidable_rule
from bug_gym.reproductions import (
    barn,
    claims,
    hd_bug_ablation,
    hd_bug_dynamic,
    hd_bug_real,
    hd_bug_tables,
    hd_bug_targets,
    navigator,
)
from result_pages import Page, Record
from result_pages.words import (
    RUN_HEADER,
    RUN_NOTE,
    listed,
    number,
    only_one,
    p_value,
    percent,
    points,
    run,
    share,
    table,
)


def tables(found: Record) -> Page:
    """The paper's nine algorithms, and the map planner, in still fields."""
    results = found["results"]
    ranges = sorted({key.split(", ")[0] for key in results}, key=lambda text: -float(text.split()[0]))
    counts = [str(count) for count in hd_bug_tables.OBSTACLES]
    policies = list(dict.fromkeys(key.split(", ")[2] for key in results))
    others = [name for name in policies if name not in ("hd_bug", "hd_bug_map")]
    tables, longer = [], []
    for lidar in ranges:
        one_range, compared = field_table(found, lidar, counts, policies, others)
        tables.append(one_range)
        longer += compared
    for lidar in ranges:
        tables += paired_table(found, lidar)
    ours = {key: one for key, one in results.items() if key.endswith(", hd_bug")}
    ratios = []
    for lidar in ranges:
        of_range = [ours[f"{lidar}, {count}, hd_bug"]["path_ratio"] for count in counts]
        ratios.append(f"{listed(f'{ratio:.3f}' for ratio in of_range)} with a LIDAR of {lidar}")
    dense = {name: results[f"{ranges[0]}, 500, {name}"]["path_length"] for name in policies}
    gaps = {name: dense[name] - dense["hd_bug"] for name in ("tangent_bug", "e_bug", "k_bug")}
    walks = listed(f"`{name}` walks {abs(gap):.1f} m {'more' if gap >= 0.0 else 'less'}" for name, gap in gaps.items())
    planned = [results[f"{ranges[0]}, {count}, hd_bug_map"]["path_ratio"] for count in counts]
    shorter = [more for more in longer if more is not None and more >= 0.0]
    return Page(
        tables,
        f"Ours are {next(iter(ours.values()))['n']} worlds a line. {RUN_NOTE} The printed failures are those of "
        "implementations that stop after some 700 or 800 steps, and of a PointBug that finds no point; ours stop at the "
        f"goal, a proof, or {hd_bug_tables.TIME_LIMIT:,.0f} s.\n\n"
        f"At {listed(counts)} obstacles the path of `hd_bug` over the shortest path is {', and '.join(ratios)}. Its mean "
        f"path is no longer than the other's in {len(shorter)} of {len(longer)} comparisons. At 500 obstacles and {ranges[0]} "
        f"{walks}. `hd_bug_map`, which is no bug, plans on a map of all that it has seen: its path over the shortest is "
        f"{listed(f'{one:.3f}' for one in planned)} with a LIDAR of {ranges[0]}.",
        [
            ("`hd_bug` reaches the goal in every world", all(one["success"] == 1.0 for one in ours.values())),
            (f"its path is within {100 * (hd_bug_tables.RATIO_ASKED - 1):.0f} % of the shortest, in the mean",
             all(one["path_ratio"] <= hd_bug_tables.RATIO_ASKED for one in ours.values())),
            (f"its mean path is no longer than that of any of the {len(others)} others", len(shorter) == len(longer)),
        ],
    )  # fmt: skip


def field_table(
    found: Record, lidar: str, counts: Sequence[str], policies: Sequence[str], others: Sequence[str]
) -> tuple[str, list[float | None]]:
    """Everybody's runs with one scanner, and by how much the paths of others are longer than `hd_bug`'s [m]."""
    rows, longer = [], []
    for count in counts:
        ours = found["results"][f"{lidar}, {count}, hd_bug"]
        for name in policies:
            one = found["results"][f"{lidar}, {count}, {name}"]
            both = one["success"] == ours["success"] == 1.0
            more = one["path_length"] - ours["path_length"] if both else None
            longer += compared_path(found, f"{lidar}, {count}, {name}", more) if name in others else []
            told = hd_bug_tables.PRINTED.get(int(count), {}).get(name)
            printed = [f"{told[0]:.2f}", "yes" if told[3] else "no"] if told else ["-", "-"]
            rows.append([count, f"`{name}`", *run(one), "" if name == "hd_bug" else number(more), *printed])
    header = [
        *("obstacles", "policy", *RUN_HEADER),
        *("path minus `hd_bug`'s [m]", "printed path [m]", "printed reached"),
    ]
    return table(f"LIDAR of {lidar}", header, rows), longer


def paired_table(found: Record, lidar: str) -> list[str]:
    """Differences world by world with one scanner; nothing of a record from before there were any."""
    pairs = [
        [*key.split(", ")[1:], *gap_cells(one["success"], 100.0, 0), *gap_cells(one["path_length"])]
        for key, one in found.get("paired", {}).items()
        if key.startswith(f"{lidar}, ")
    ]
    return [table(f"`hd_bug` minus the other, LIDAR of {lidar}", ["obstacles", "other", *GAPS], pairs)] * bool(pairs)


def compared_path(found: Record, key: str, more: float | None) -> list[float | None]:
    """By how much another's mean path is longer than `hd_bug`'s where both reach the goal [m]; nothing where none does.

    A record from before there were paired differences says it only where both reach all (`more`).
    """
    if "paired" not in found:
        return [more]
    gap = found["paired"][key]["path_length"]
    return [-gap["mean"]] if gap["n"] else []


GAPS = ["success [points]", "95 %", "p (McNemar)", "path where both reach [m]", "95 %", "p (sign test)"]


def gap_cells(difference: Record, scale: float = 1.0, digits: int = 1) -> list[str]:
    """Mean, interval and p of a paired difference."""
    return list(claims.told(difference, scale, digits))


def dynamic(found: Record) -> Page:
    """Movers, with each predictor."""
    results = found["results"]
    worlds = hd_bug_dynamic.WORLDS
    names = hd_bug_dynamic.PREDICTORS
    rows = [
        [world, f"`{name}`", *run(one), str(one["avoidable_collisions"])]
        for world in worlds
        for name in (hd_bug_dynamic.PAPER, *names)
        if (one := results.get(f"{world}, {name}"))
    ]
    paired = [
        [world, f"`{name}`", f"{points(one, base):+.1f}", *map(str, only_one(one, base)), p_value(one, base)]
        for world in worlds
        if (base := results[f"{world}, kalman"])
        for name in (hd_bug_dynamic.PAPER, *names)
        if name != "kalman" and (one := results.get(f"{world}, {name}"))
    ]
    slow = [world for world in worlds if world != "rush"]
    said = listed(
        f"`{name}` {listed(percent(results[f'{world}, {name}']['success']) + ' %' for world in slow)}" for name in names
    )
    tests = [
        (f"`{name}` {world}", exact_mcnemar(*only_one(results[f"{world}, {name}"], results[f"{world}, kalman"])))
        for world in slow
        for name in names
        if name != "kalman"
    ]
    adjusted = holm([p for _, p in tests])
    certain = [f"{told} (p = {p:.2g})" for (told, _), p in zip(tests, adjusted, strict=True) if p < 0.05]
    rush = {name: results[f"rush, {name}"] for name in names}
    apart = listed(f"`{name}` {percent(one['success'])} %" for name, one in rush.items())
    gain = points(rush["rl"], rush["kalman"])
    than_kalman = (
        "arrives as often as `kalman`"
        if abs(gain) < 0.05
        else f"reaches {abs(gain):.1f} points {'more' if gain > 0.0 else 'less'} than `kalman`"
    )
    hits = sum(one["outcomes"].get("collision", 0) for one in results.values())
    avoidable = sum(one["avoidable_collisions"] for one in results.values())
    return Page(
        [
            table(
                "20 of 40 obstacles moving",
                ["movers", "`hd_bug`, or `hd_bug_map` with", *RUN_HEADER, "avoidable collisions"],
                rows,
            ),
            table(
                "Success paired with that of `kalman`, world by world",
                ["movers", "line", "points", "only it arrives", "only `kalman`", "p (McNemar, exact)"],
                paired,
            ),
        ],
        f"{RUN_NOTE} A collision could have been avoided when, from the state {avoidable_rule.BEFORE:g} s before, at "
        f"least one of {avoidable_rule.SEQUENCES:,} control sequences survives: that is so of {avoidable} of all {hits}.\n\n"
        f"Among slow movers, {listed(slow)}, nearly all arrive whatever predicts: {said}. With Holm's correction "
        f"for these {len(tests)} tests a difference from `kalman` is left for: {listed(certain) if certain else 'none'}. In "
        f"`rush`, with movers as fast as the robot, they come apart: {apart}. There `rl` "
        f"{than_kalman} (p = {p_value(rush['rl'], rush['kalman'])}) and collides "
        f"{rush['rl']['outcomes']['collision']} times instead of {rush['kalman']['outcomes']['collision']}.",
        [
            (f"with `kalman` the map planner reaches at least {percent(asked)} % among movers of {world}",
             results[f"{world}, kalman"]["success"] >= asked)
            for world, (_, asked) in worlds.items()
            if asked > 0.0
        ],
    )  # fmt: skip


def navigator_in_all_kinds(found: Record) -> Page:
    """The navigator beside the planner and the network that it is made of."""
    results, gaps, worse = found["results"], found["paired"], found["worse"]
    ours, kinds, parts = navigator.OURS, navigator.KINDS, navigator.PARTS
    success = [[f"`{policy}`", *(share(results[f"{kind}, {policy}"]) for kind in kinds)] for policy in (ours, *parts)]
    runs = [[kind, f"`{policy}`", *run(results[f"{kind}, {policy}"])] for kind in kinds for policy in (ours, *parts)]
    paired = [
        [
            *(kind, f"`{part}`", *gap_cells(gaps[f"{kind}, {part}"]["success"], 100.0)),
            *map(str, only_one(results[f"{kind}, {ours}"], results[f"{kind}, {part}"])),
        ]
        for kind in kinds
        for part in parts
    ]
    adjusted = holm([one["success"]["p_value"] for one in gaps.values()])
    certain = [name for name, p in zip(gaps, adjusted, strict=True) if p < navigator.LEVEL]
    better = [name for name in certain if name not in worse]
    least = min(kinds, key=lambda kind: results[f"{kind}, {ours}"]["success"])

    def told(names: Sequence[str]) -> str:
        return (
            listed(f"`{part}` in {kind}" for kind, part in (name.split(", ") for name in names)) if names else "nobody"
        )

    return Page(
        [
            table("Reached [%] (95 %)", ["policy", *kinds], success),
            table(
                "The navigator minus its parts, world by world",
                ["worlds", "part", "points", "95 %", "p (McNemar)", "only `navigator` arrives", "only the part"],
                paired,
            ),
            table("Runs", ["worlds", "policy", *RUN_HEADER], runs),
        ],
        f"{RUN_NOTE}\n\nWith Holm's correction for {len(gaps)} tests `{ours}` arrives surely more often than {told(better)}, "
        f"and surely less often than {told(worse)}. It does worst in {least}: {share(results[f'{least}, {ours}'])}.",
        [
            *(
                (f"in {kind} it arrives no less often than the better part", not any(n.startswith(f"{kind}, ") for n in worse))
                for kind in kinds
            ),
            ("where nothing moves it goes the planner's way, as long and as late", not any(found["other_ways"].values())),
        ],
    )  # fmt: skip


def targets(found: Record) -> Page:
    """Moving targets beside pure pursuit."""
    results = found["results"]
    rows, sooner, ratios, caught = [], {}, {}, []
    for target in hd_bug_targets.TARGETS:
        ours, pursuit = results[f"{target}, hd_bug_map"], results[f"{target}, pure pursuit"]
        both = ours["success"] == pursuit["success"] == 1.0
        sooner[target] = pursuit["time"] - ours["time"] if both else None
        ratios[target] = ours["time_ratio"]
        caught.append(ours["success"])
        for label in ("hd_bug", "hd_bug_map", "pure pursuit"):
            one, gap = results[f"{target}, {label}"], found["paired"].get(f"{target}, {label}")
            rows.append([target.replace("_", " "), label if label == "pure pursuit" else f"`{label}`", *run(one)])
            rows[-1] += [number(one["time_ratio"], 3), *(claims.told(gap["time"]) if gap else [""] * 3)]
    said = listed(f"{ratio:.2f} for {target.replace('_', ' ')}" for target, ratio in ratios.items())
    ahead = listed(
        f"{gain:.3f} s for {target.replace('_', ' ')}" for target, gain in sooner.items() if gain is not None
    )
    papers = [results[f"{target}, hd_bug"] for target in hd_bug_targets.TARGETS]
    its_ratios = listed(f"{one['time_ratio']:.2f}" for one in papers)
    compared = ["minus pure pursuit's [s]", "95 %", "p (sign test)"]
    return Page(
        [table("Targets among 40 still obstacles", ["target", "policy", *RUN_HEADER, "`time_ratio`", *compared], rows)],
        f"{RUN_NOTE} Pure pursuit is the map planner, heading for where the target is instead of where it can be met. All keep "
        f"{claims.CLEARANCE:g} m from walls where there is room.\n\n"
        f"`hd_bug_map` intercepts at least {percent(min(caught))} % of each kind. `time_ratio` is {said}. It is sooner than "
        f"pure pursuit, in the mean, by {ahead} (below 0: later). `hd_bug` intercepts at least "
        f"{percent(min(one['success'] for one in papers))} % of each kind, with a `time_ratio` of {its_ratios}.",
        [
            (f"at least {percent(hd_bug_targets.SUCCESS_ASKED)} % of each kind are intercepted",
             min(caught) >= hd_bug_targets.SUCCESS_ASKED),
            (f"`time_ratio` is at least {hd_bug_targets.TIME_RATIO_ASKED:g}",
             min(ratios.values()) >= hd_bug_targets.TIME_RATIO_ASKED),
            ("each kind is met sooner than by pure pursuit (95 %)",
             all(hd_bug_targets.is_sooner(found["paired"][f"{target}, hd_bug_map"]["time"]) for target in sooner)),
        ],
    )  # fmt: skip


def traps(found: Record) -> Page:
    """Traps that are left, and one that has no way out."""
    results = found["results"]
    policies = list(dict.fromkeys(key.split(", ")[1] for key in results))
    said = []
    for policy in policies:
        mine = {key.split(", ")[0]: one for key, one in results.items() if key.endswith(f", {policy}")}
        ring = mine["ring"]["outcomes"].get("gave_up unreachable", 0)
        left = [f"{one['outcomes'].get('success', 0)} of `{name}`" for name, one in mine.items() if name != "ring"]
        hits = sum(one["outcomes"].get("collision", 0) for one in mine.values())
        said.append(
            f"Of {mine['ring']['n']} worlds each `{policy}` leaves {listed(left)}, finds {ring} of `ring` closed, and "
            f"collides {hits} times."
        )
    rows = [[f"`{name}`" for name in key.split(", ")] + run(one) for key, one in results.items()]
    with_way = [one["success"] == 1.0 for key, one in results.items() if not key.startswith("ring")]
    rings = [one["outcomes"].get("gave_up unreachable", 0) == one["n"] for key, one in results.items()
             if key.startswith("ring")]  # fmt: skip
    tables = [table("Traps", ["trap", "policy", *RUN_HEADER], rows)]
    if pairs := found.get("paired"):
        gaps = [
            [f"`{name}`", *gap_cells(one["success"], 100.0), *gap_cells(one["path_length"])]
            for name, one in pairs.items()
        ]
        tables.append(table("`hd_bug` minus `hd_bug_map`, in the same worlds", ["trap", *GAPS], gaps))
    return Page(
        tables,
        f"{RUN_NOTE} Both keep {claims.CLEARANCE:g} m from walls where there is room.\n\n{' '.join(said)} "
        "There is a way in every world but those of `ring`, where there is none.",
        [("every trap with a way is left", all(with_way)), ("every `ring` is found to be closed", all(rings))],
    )


def street(key: str) -> list[str]:
    """Scene and line of a key of the results."""
    scene, line = key.split(", ")
    return [scene, f"`{line}`"]


def of_networks(found: Record) -> str:
    """How many crossings of all scenes each policy made with the robot of the networks, in a sentence."""
    made: dict[str, list[int]] = {}
    for key, one in found.items():
        counts = made.setdefault(key.split(", ")[1], [0, 0, 0])
        for place, count in enumerate((one["outcomes"].get("success", 0), one["n"], one["faults"])):
            counts[place] += count
    told = [f"`{policy}` makes {won} of {asked} crossings ({faults} collisions by its fault)"
            for policy, (won, asked, faults) in made.items()]  # fmt: skip
    return f"{listed(told)}."


def worse_than_planner(found: Record) -> str:
    """Where the switch certainly arrives less often than the map planner alone, in a sentence."""
    where = [
        f"{key.split(', ')[0]} ({100.0 * gap['mean']:+.0f} points, p = {gap['p_value']:.2g})"
        for key, one in found.items()
        if key.endswith(", hd_bug_map") and (gap := one["navigator_minus"])["interval"][1] < 0.0
    ]
    return f" The switch arrives less often than the planner alone in {listed(where)}." if where else ""


def real(found: Record) -> Page:
    """BARN's worlds and recorded pedestrians."""
    results = dict(found["results"])
    barn_one = results.pop("barn")
    pairs, networks = found.get("paired", {}), found["networks_robot"]
    rows = [
        [*street(key), *run(one), str(one["avoidable_collisions"]), str(one["of_them_sudden"]),
         *(gap_cells(pairs[key]["success"], 100.0) if key in pairs else [""] * 3)]
        for key, one in results.items()
    ]  # fmt: skip
    papers = [results.pop(key) for key in list(results) if key.endswith(f", {hd_bug_real.PAPER}")]
    arrived = f"{sum(one['outcomes'].get('success', 0) for one in papers)} of {sum(one['n'] for one in papers)}"
    its_faults = sum(one["avoidable_collisions"] - one["of_them_sudden"] for one in papers)
    crossings = sum(one["n"] for one in results.values())
    untouched = sum(one["outcomes"].get("success", 0) for one in results.values())
    hits = sum(one["outcomes"].get("collision", 0) for one in results.values())
    avoidable = sum(one["avoidable_collisions"] for one in results.values())
    sudden = sum(one["of_them_sudden"] for one in results.values())
    faults = avoidable - sudden
    metrics = {"score": "score_2024", "score of 2022": "score"}
    scores = {title: key for title, key in metrics.items() if key in barn_one}
    return Page(
        [
            table(
                "BARN, the differential robot",
                [*RUN_HEADER, *scores],
                [[*run(barn_one), *(number(barn_one[key], 4) for key in scores.values())]],
            ),
            table(
                "Crossings of recorded pedestrians",
                ["scene", "`hd_bug`, or `hd_bug_map` with", *RUN_HEADER, "avoidable collisions", "of them sudden",
                 "points to `kalman`", "95 %", "p (McNemar)"],
                rows,
            ),
            table(
                "The same streets, the robot of the networks: differential, 1 m/s, 64 beams to 5 m",
                ["scene", "policy", *RUN_HEADER, "collisions by its fault", "`navigator` minus this", "95 %", "p (McNemar)"],
                [[*street(key), *run(one), str(one["faults"]),
                  *(gap_cells(one["navigator_minus"], 100.0) if one["navigator_minus"] else [""] * 3)]
                 for key, one in networks.items()],
            ),
        ],
        f"{RUN_NOTE} BARN's score is at most 0.5 since 2024, and was at most 0.25. For context: {barn.DWA}\n\n"
        f"{barn_one['outcomes'].get('success', 0)} of {barn_one['n']} worlds of BARN are reached, with a score of "
        f"{barn_one['score']:.4f} by the metric of 2022. Recorded pedestrians make no way: "
        f"{untouched} of {crossings} crossings touch nobody. "
        f"Of the {hits} collisions {avoidable} could have been avoided by somebody who knows the future; in {sudden} of "
        f"these somebody had come into the recording less than {avoidable_rule.SUDDEN:g} s before, on top of the robot. So "
        f"{crossings - faults} of {crossings} are without its fault. (That rule was made after an earlier run had been "
        f"seen.) `hd_bug`, which keeps as far from walls, arrives {arrived} times; {its_faults} of its collisions are its "
        "fault. In BARN's worlds it stands in [barn](barn.md).\n\n"
        f"The robot that the networks were trained for is slower than many who walk there and sees half as far. "
        f"{of_networks(networks)} The network never saw recorded people.{worse_than_planner(networks)}",
        [
            (f"at least {percent(hd_bug_real.SUCCESS_ASKED)} % of the BARN worlds are reached",
             barn_one["success"] >= hd_bug_real.SUCCESS_ASKED),
            (f"the score of 2022 there is at least {hd_bug_real.SCORE_ASKED:g}", barn_one["score"] >= hd_bug_real.SCORE_ASKED),
            (f"at least {percent(hd_bug_real.FAULTLESS_ASKED)} % of the crossings are without the robot's fault",
             faults <= (1.0 - hd_bug_real.FAULTLESS_ASKED) * crossings),
        ],
    )  # fmt: skip


def ablation(found: Record) -> Page:
    """What each part is worth."""
    results = found["results"]
    worlds = list(dict.fromkeys(key.split(", ")[0] for key in results))
    parts = [name for name in dict.fromkeys(key.split(", ")[1] for key in results) if name != hd_bug_ablation.WHOLE]
    beside = hd_bug_ablation.MAP
    rows = []
    for world in worlds:
        for variant in (hd_bug_ablation.WHOLE, *parts):
            name = f"(`{variant}`)" if variant == beside else variant.replace("_", " ")
            rows.append([world, name, *run(one := results[f"{world}, {variant}"])])
            rows[-1] += [""] * 5 if variant == hd_bug_ablation.WHOLE else differences(one)
    header = ["worlds", "without", *RUN_HEADER, "points", "p", "path [m]", "p", "changed"]
    own = [part for part in parts if part != beside]
    tests = [(part, *one) for world in worlds for part in own for one in tested(results[f"{world}, {part}"])]
    adjusted = holm([p for *_, p in tests])
    sure = [(part, gain) for (part, gain, _), p in zip(tests, adjusted, strict=True) if p < 0.05]
    idle = [part.replace("_", " ") for part in own if part not in {name for name, _ in sure}]
    worse = [part.replace("_", " ") for part in own if (gains := [gain for name, gain in sure if name == part])
             and min(gains) > 0.0]  # fmt: skip
    nothing_shown = (
        f"What is left for {listed(worse)} is shorter ways without them, or more success: these worlds do not show that "
        "they are worth anything. " if worse else ""
    )  # fmt: skip
    still = [
        part.replace("_", " ") for part in own if not any(results[f"{world}, {part}"]["changed"] for world in worlds)
    ]
    return Page(
        [
            table(
                f"The whole of `hd_bug`, and the whole without one part, {results[f'{worlds[0]}, whole']['n']} worlds a line",
                header, rows,
            )
        ],
        f"{RUN_NOTE} Seeds from {2 * claims.FIRST_SEED:,} on, on which no parameter was set. Points: success minus the "
        "whole's, with its 95 % interval and McNemar's p; path: paired, over the worlds that both reach, with the sign "
        f"test's p; `{beside}`: the map planner, whole, in the same worlds; changed: in how many worlds the "
        "outcome or the length is another one. Path over shortest path leaves moving goals out. What rests on a part goes "
        "with it: without the path list nothing older is light and there is no way back, without candidates there is no "
        "cost. Without the prediction movers are taken to stay in both phases; what starts the first one, and the risk of "
        "doors, reckon with their velocity.\n\n"
        f"{f'These change no run: {listed(still)}.' if still else 'Every part changes runs.'} Of {len(tests)} tests of success "
        "and length some fall below 0.05 by chance; with Holm's correction for their number no difference in any kind of "
        f"world is left for: {listed(idle) if idle else 'none'}. {nothing_shown}The intervals and p of the "
        "table are not corrected.",
    )  # fmt: skip


def differences(one: Record) -> list[str]:
    """What a part's loss changes, with intervals."""
    gap, low, high = (100.0 * value for value in one["success_minus_whole"])
    path = one["path_minus_whole"]
    longer = f"{path[0]:+.1f} [{path[1]:+.1f}, {path[2]:+.1f}]" if path else "-"
    p_of_path = one.get("path_p_value")
    return [
        f"{gap:+.0f} [{low:+.0f}, {high:+.0f}]",
        f"{one['p_value']:.2g}",
        longer,
        "-" if p_of_path is None else f"{p_of_path:.2g}",
        f"{one['changed']} of {one['n']}",
    ]


def tested(one: Record) -> list[tuple[float, float]]:
    """What is gained by a part's loss, in success or by shorter ways in the mean, and p; of length where there are pairs."""
    found = [(one["success_minus_whole"][0], one["p_value"])]
    if one["path_p_value"] is not None:
        longer = one["path_minus_whole"]
        found.append((-longer[0] if longer else 0.0, one["path_p_value"]))
    return found
