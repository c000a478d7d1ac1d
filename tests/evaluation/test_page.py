"""The page about an evaluation: what it says, that it stands alone, and that its script sorts and filters."""

import base64
import hashlib
import json
import re
import shlex
import shutil
import subprocess
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bug_gym.agents import Spec, make_policy
from bug_gym.assignments import assignments
from bug_gym.cli import main
from bug_gym.evaluation import evaluate, make_plan
from bug_gym.evaluation.by_name import (
    HEADER,
    POLICY_OBJECT,
    SCENARIO_DATA,
    differing_names,
    policy_words,
    scenario_words,
)
from bug_gym.evaluation.entries import PolicyEntry
from bug_gym.evaluation.page import PAGE, page, write_page
from bug_gym.evaluation.page.distributions import BINS, HEIGHT, counts, histogram
from bug_gym.evaluation.page.failures import told_seeds
from bug_gym.evaluation.page.findings import results, watched
from bug_gym.evaluation.page.markup import Markup, element
from bug_gym.evaluation.page.recorded import Key
from bug_gym.evaluation.replays import chosen, record_episode
from bug_gym.evaluation.report import FEWER_PAIRS
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import compare, summarise
from bug_gym.replay.packing import unpacked
from bug_gym.task import OUTCOMES

BLANK = EpisodeRow(
    "bug2", "box", 0, 0, "success", "", True, 8.0, 80, 8.0, 0.2, 8.0, 0.9, nan, 0.5, 0, 0.0, 0.004, 0.01, 0.1
)
HOSTILE = "</script></td><img src=x onerror=alert(1)>&amp;\"'$style\u2028"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def rows_of(policy: str, scenario: str, ends: str) -> list[EpisodeRow]:
    """A row a letter: success, collision, timeout or gave up."""
    rows = []
    for seed, letter in enumerate(ends):
        outcome, verdict = {"s": ("success", ""), "c": ("collision", ""), "t": ("timeout", "")}.get(
            letter, ("gave_up", "stuck")
        )
        spl = 0.9 if letter == "s" else 0.0
        rows.append(
            replace(
                BLANK,
                policy=policy,
                scenario=scenario,
                seed=seed,
                outcome=outcome,
                verdict=verdict,
                success=letter == "s",
                spl=spl,
                time=8.0 + seed,
            )
        )
    return rows


ROWS = [
    *rows_of("middling", "box", "ssct"),
    *rows_of("middling", "maze", "ssgg"),
    *rows_of("best", "box", "ssss"),
    *rows_of("best", "maze", "sssc"),
    *rows_of("worst", "box", "cccc"),
    *rows_of("worst", "maze", "tsct"),
]


class Reader(HTMLParser):
    """What is in a page: elements with their attributes, and the texts of each element."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.tables: list[list[list[str]]] = []
        self.texts: dict[str, str] = {}
        self._open = ["start"]
        self._is_in_cell = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._open.append(dict(attrs).get("id") or tag)
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
            self._is_in_cell = True

    def handle_endtag(self, tag: str) -> None:
        if tag in ("td", "th"):
            self._is_in_cell = False

    def handle_data(self, data: str) -> None:
        self.texts[self._open[-1]] = self.texts.get(self._open[-1], "") + data
        if self._is_in_cell:
            self.tables[-1][-1][-1] += data


def page_of(rows: list[EpisodeRow], title: str = "box and maze", baseline: str | None = None) -> str:
    """The page about some rows."""
    return page(title, rows, summarise(rows, resamples=10), compare(rows, baseline or rows[0].policy, resamples=10))


def kept(text: str) -> dict[str, Any]:
    """The rows that a page holds as JSON."""
    (found,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert not set("<>&") & set(found)  # whatever a browser makes of them within a script
    return dict(json.loads(found))


def script_of(text: str) -> str:
    return str(re.findall(r"<script>(.*?)</script>", text, re.DOTALL)[-1])


def test_the_page_begins_with_the_matrix_the_most_successful_policy_first() -> None:
    header, *lines = Reader(page_of(ROWS)).tables[0]
    assert header == ["policy", "all scenarios", "box", "maze"]
    assert [line[0] for line in lines] == ["best", "middling", "worst"]
    # Wilson's lower bound at 4 of 4 is 4 / (4 + 1.96^2) = 0.51.
    assert lines[0][2] == "100 [51, 100]" and lines[2][2] == "0 [0, 49]"


def test_a_cell_is_coloured_by_its_share_and_leads_to_its_failures() -> None:
    elements = Reader(page_of(ROWS)).elements
    shares = [float(str(one["style"]).partition(":")[2]) for _, one in elements if one.get("class") == "share"]
    assert shares == [0.875, 1.0, 0.75, 0.5, 0.5, 0.5, 0.125, 0.0, 0.25]
    links = [str(one["href"]) for _, one in elements if "href" in one]
    marks = [one["id"] for _, one in elements if one.get("id")]
    assert len(marks) == len(set(marks)) and {link.removeprefix("#") for link in links} <= set(marks)
    assert sum(link.startswith("#failed-") for link in links) == 5  # one in each cell of the six below 100 %


def test_failures_are_told_by_kind_with_their_seeds() -> None:
    header, *lines = Reader(page_of(ROWS)).tables[-1]
    assert header == ["scenario", "policy", "how", "episodes", "seeds"]
    assert ["maze", "middling", "gave up: stuck", "2", "2, 3"] in lines
    assert ["maze", "worst", "time was up", "2", "0, 3"] in lines
    assert ["box", "worst", "collision", "4", "0 to 3"] in lines
    assert sum(int(line[3]) for line in lines) == sum(not row.success for row in ROWS)


def test_differences_are_to_the_baseline_that_was_asked_for() -> None:
    text = page_of(ROWS, baseline="best")
    assert "Difference to best in the same worlds." in text
    (table,) = [table for table in Reader(text).tables if table[0][:2] == ["policy", "pairs"]]
    by_policy = {line[0]: line for line in table[1:]}
    assert set(by_policy) == {"middling", "worst"}
    assert by_policy["worst"][2].startswith("-75.0 [")  # 1 of 8 against 7 of 8
    assert by_policy["worst"][1] == "8" and by_policy["worst"][-1].endswith(" (1)") and FEWER_PAIRS in text


def test_a_policy_alone_that_always_succeeds_has_nothing_to_compare_and_no_failures() -> None:
    text = page_of(rows_of("one", "box", "sss"))
    assert "nothing to compare" in text and "Every episode succeeded" in text


def test_every_row_is_kept_and_seeds_beyond_the_whole_numbers_of_javascript_as_text() -> None:
    rows = [*ROWS, replace(BLANK, policy="best", seed=2**60, min_clearance=inf)]
    data = kept(page_of(rows))
    policies, scenarios, _, _, ends = data["names"]
    found = [(policies[row[0]], scenarios[row[1]], row[2], ends[row[4]]) for row in data["rows"]]
    names = {"success": "success", "collision": "collision", "timeout": "time was up", "gave_up": "gave up: stuck"}
    assert found[:-1] == [(row.policy, row.scenario, row.seed, names[row.outcome]) for row in ROWS]
    assert found[-1] == ("best", "box", str(2**60), "success")
    assert data["rows"][-1][data["columns"].index("clearance [m]")] is None


def test_hostile_names_are_text_and_change_nothing_else() -> None:
    plain = [
        replace(row, policy=row.policy.replace("best", "x"), scenario=row.scenario.replace("box", "y")) for row in ROWS
    ]
    named = {"x": HOSTILE + "1", "y": HOSTILE + "2"}
    hostile = [
        replace(row, policy=named.get(row.policy, row.policy), scenario=named.get(row.scenario, row.scenario))
        for row in plain
    ]
    text = page_of(hostile, title=HOSTILE)
    one, other = Reader(page_of(plain, title="z")), Reader(text)
    assert [tag for tag, _ in one.elements] == [tag for tag, _ in other.elements]
    assert [set(attributes) for _, attributes in one.elements] == [set(attributes) for _, attributes in other.elements]
    assert other.texts["title"].removesuffix("\n") == HOSTILE and other.tables[0][1][0] == HOSTILE + "1"
    assert kept(text)["names"][0][1] == HOSTILE + "1"


def test_the_page_loads_nothing_and_runs_its_own_script_only() -> None:
    text = page_of(ROWS)
    for tag, attributes in Reader(text).elements:
        assert tag not in ("link", "img", "iframe", "object", "base") and "src" not in attributes
        assert str(attributes.get("href", "#")).startswith("#")
        assert not any(name.startswith("on") for name in attributes)
    assert not re.search(r"https?://|url\(|@import", text)
    digest = base64.b64encode(hashlib.sha256(script_of(text).encode()).digest()).decode()
    assert "default-src 'none'" in text and f"script-src 'sha256-{digest}'" in text


class Nesting(HTMLParser):
    """Whether each element is ended before that around it is; `wrong` has those that are not."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.wrong: list[str] = []
        self._open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("input", "meta"):
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if self._open.pop() != tag:
            self.wrong.append(tag)


def test_each_element_ends_within_that_around_it_lest_a_path_of_a_drawing_hide_the_next() -> None:
    assert "<path" in page_of(ROWS) and not Nesting(page_of(ROWS)).wrong


def test_the_page_is_for_phones_and_for_the_dark() -> None:
    text = page_of(ROWS)
    assert 'name="viewport"' in text and "prefers-color-scheme: dark" in text


def test_thirty_policies_in_eight_worlds_of_two_hundred_episodes_stay_below_20_megabytes(tmp_path: Path) -> None:
    rows = [
        replace(row, seed=17 * row.seed, time=row.time * 1.2345678, min_clearance=0.1234567)
        for policy in range(30)
        for scenario in range(8)
        for row in rows_of(f"a_policy_of_number_{policy}", f"scenario_{scenario}", "sctg" * 50)
    ]
    write_page(tmp_path / PAGE, "large", rows, summarise(rows, resamples=1), compare(rows, rows[0].policy, resamples=1))
    assert len(rows) == 48_000 and (tmp_path / PAGE).stat().st_size < 20_000_000


@given(st.sets(st.integers(0, 60)))
def test_told_seeds_are_the_seeds(seeds: set[int]) -> None:
    told: set[int] = set()
    for part in filter(None, told_seeds(seeds).split(", ")):
        first, _, last = part.partition(" to ")
        told |= set(range(int(first), int(last or first) + 1))
    assert told == seeds


@given(st.lists(st.floats(-5.0, 5.0), min_size=1), st.floats(-1.0, 0.0), st.floats(0.0, 1.0))
def test_a_histogram_counts_each_value_once(values: list[float], low: float, high: float) -> None:
    found = counts(values, (low, high))
    assert len(found) == BINS and sum(found) == len(values)
    heights = [float(height) for height in re.findall(r"v-([\d.]+)h", histogram(values, (low, high)))]
    assert max(heights) == HEIGHT and len(heights) <= sum(count > 0 for count in found)


def test_a_histogram_has_equal_bins_and_what_lies_beyond_in_the_last() -> None:
    found = counts([0.0, 0.49, 1.0, 23.5, 24.0, 99.0], (0.0, 24.0))
    assert (found[0], found[1], found[-1]) == (2, 1, 3)
    assert counts([3.0, 3.0], (3.0, 3.0))[0] == 2


def test_only_markup_is_not_escaped() -> None:
    inner = element("b", "<&>")
    assert inner == "<b>&lt;&amp;&gt;</b>" and isinstance(inner, Markup)
    assert (
        element("a", inner, "'", href='"', hidden=True, id=None)
        == '<a href="&quot;" hidden><b>&lt;&amp;&gt;</b>&#x27;</a>'
    )


def test_an_evaluation_ends_with_the_page(tmp_path: Path) -> None:
    world = {"world": {"family": "empty", "start": [0, 0, 0], "goal": [2, 0]}}
    evaluate(["bug0", "go_to_goal"], world, episodes=2, out=tmp_path)
    text = (tmp_path / PAGE).read_text(encoding="utf-8")
    assert Counter(row[0] for row in kept(text)["rows"]) == {0: 2, 1: 2}


def test_the_command_of_the_report_drives_the_episode_of_a_row(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Overrides of a suite and of a caller, a label, and the mark of those that read the map stand in no name."""
    slow = {"scenario": "u_trap", "label": "slow", "overrides": {"world.rotation": "random", "robot.max_speed": 0.5}}
    left = {"name": "bug2", "label": "left", "parameters": {"turn": "left"}}
    suite = {"scenarios": [slow], "policies": ["a_star", left], "seeds": {"count": 2}}
    rows = evaluate(None, suite, out=tmp_path / "out", overrides={"goal.radius": 0.4})
    header, *lines = next(
        one for one in Reader((tmp_path / "out" / PAGE).read_text(encoding="utf-8")).tables if one[0][0] == HEADER[0]
    )
    words = {label: shlex.split(told) for label, told in lines}
    assert {row.policy for row in rows} | {row.scenario for row in rows} == set(words)
    assert all(f"| {told} |" in (tmp_path / "out" / "summary.md").read_text(encoding="utf-8") for _, told in lines)
    for row in rows:
        command = ["render", *words[row.policy], *words[row.scenario], "--seed", str(row.seed)]
        assert main([*command, "--out", str(tmp_path / "one.html")]) == 0
        assert f" after {row.time:.1f} s and {row.path_length:.2f} m" in capsys.readouterr().out


@pytest.mark.parametrize("value", ["random", "5", "a b'c", "", 5, 5.0, 1e-05, True, None, [0, 1.5], {"a": [1]}])
def test_words_of_a_scenario_and_of_a_policy_are_read_back_as_they_were(value: Any) -> None:
    name, option, pair = shlex.split(scenario_words("my world.yaml", {"key": value}, trust=False))
    assert (name, option) == ("my world.yaml", "--set")
    assert json.dumps(assignments([pair])) == json.dumps({"key": value})
    (text,) = shlex.split(policy_words(PolicyEntry("mine", "bug2", {"turn": value})))
    assert json.dumps(Spec.of(text).options) == json.dumps({"turn": value})


def test_what_has_no_name_has_no_words_and_code_needs_trust() -> None:
    assert scenario_words({"world": {}}, {}, trust=False) == scenario_words("empty", {"a": nan}, trust=False) == ""
    assert scenario_words("empty", {"a": Path()}, trust=False) == ""
    assert scenario_words("mine.yaml", {}, trust=True) == "mine.yaml --trust"
    assert policy_words(PolicyEntry.of(make_policy("bug2", "empty"))) == ""
    plan = make_plan([make_policy("bug2", "empty")], [{"world": {"family": "empty"}}], episodes=1)
    assert [told for _, told in differing_names(plan.policies, plan.scenarios)] == [POLICY_OBJECT, SCENARIO_DATA]


# What a reader would do: sort the matrix by a column, filter by policy, choose an outcome, and look at what is left.
STEPS = """
{
const matrix = document.querySelector("#success table");
const shown = (table) => [...table.tBodies[0].rows].filter((row) => !row.hidden).map((row) => row.cells[0].textContent);
const told = {};
const maze = matrix.tHead.rows[0].cells[3].firstChild;
maze.click(); told.descending = shown(matrix);
maze.click(); told.ascending = shown(matrix);
matrix.tHead.rows[0].cells[0].firstChild.click(); told.named = shown(matrix);
const episodes = document.querySelector("#rows table");
told.all = shown(episodes).length;
const filter = document.getElementById("filter");
filter.value = "WORST, best"; filter.dispatchEvent(new Event("input"));
told.filtered = shown(matrix); told.fewer = shown(episodes).length;
const select = document.querySelectorAll("#choices select")[2];
select.value = [...select.options].find((option) => option.textContent === "collision").value;
select.dispatchEvent(new Event("change"));
told.collisions = shown(episodes);
const times = [...episodes.tHead.rows[0].cells].find((head) => head.textContent === "time [s]");
times.firstChild.click();
told.times = [...episodes.tBodies[0].rows].map((row) => Number(row.cells[times.cellIndex].textContent));
told.wide = document.documentElement.scrollWidth <= window.innerWidth;
document.title = JSON.stringify(told);
}
"""


def browsed(text: str, folder: Path, steps: str) -> dict[str, Any]:
    """What a script at the end of a page has written into its title, in a browser that opened it from disk."""
    digest = base64.b64encode(hashlib.sha256(steps.encode()).digest()).decode()
    text = text.replace("script-src ", f"script-src 'sha256-{digest}' ").replace(
        "</body>", f"<script>{steps}</script></body>"
    )
    (folder / PAGE).write_text(text, encoding="utf-8")
    assert CHROMIUM is not None
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--window-size=600,900", "--enable-logging=stderr"]
    command = [CHROMIUM, *options, f"--user-data-dir={folder}/user", "--virtual-time-budget=20000", "--dump-dom"]
    done = subprocess.run([*command, (folder / PAGE).as_uri()], capture_output=True, text=True, check=True, timeout=120)
    assert "CONSOLE" not in done.stderr, done.stderr
    return dict(json.loads(Reader(done.stdout).texts["title"]))


# ---------------------------------------------------------------------------------------------- replays


def test_the_first_failure_of_each_kind_is_recorded_and_the_best_policy_that_arrived_there() -> None:
    found = [(row.policy, row.scenario, row.seed) for row in chosen(ROWS, 99)]
    # One failure of `best`, of `middling` one of each of three kinds, of `worst` one of each of three.
    assert found[:3] == [("best", "maze", 3), ("middling", "box", 2), ("best", "box", 2)]
    failures = {(row.policy, row.scenario, row.outcome, row.verdict) for row in ROWS if not row.success}
    recorded = [row for row in chosen(ROWS, 99) if not row.success]
    assert {(row.policy, row.scenario, row.outcome, row.verdict) for row in recorded} == failures
    assert len(recorded) == len(failures) and len(set(found)) == len(found)
    assert {("best", "box", 0), ("best", "maze", 2)} <= set(found)
    assert [(row.policy, row.scenario, row.seed) for row in chosen(ROWS, 4)] == found[:4] and chosen(ROWS, 0) == []
    kinds = {(row.policy, row.scenario) for row in chosen(ROWS, 99, successes=True) if row.success}
    assert kinds == {(row.policy, row.scenario) for row in ROWS if row.success}


def evaluated(folder: Path, **options: Any) -> tuple[list[EpisodeRow], str]:
    """Rows and page of two policies before a wall, the one of which stops there."""
    rows = evaluate(["go_to_goal", "bug2"], "disc", episodes=2, out=folder, overrides={"time.limit": 40}, **options)
    return rows, (folder / PAGE).read_text(encoding="utf-8")


def test_a_report_replays_what_happened_and_holds_no_more_than_it_may(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows, text = evaluated(tmp_path / "one")
    keys = [(row.policy, row.scenario, row.seed) for row in chosen(rows, 24)]
    letters = re.findall(r'<script id="replay-\d+" type="text/plain">(.*?)</script>', text)
    assert len(letters) == len(keys) == 2
    by_key = {(row.policy, row.scenario, row.seed): row for row in rows}
    for key, packed in zip(keys, letters, strict=True):
        data = unpacked(packed)
        assert (data["title"], data["scenario"], data["seed"]) == (key[0], key[1], str(key[2]))
        assert OUTCOMES[sum(data["outcomes"])] == by_key[key].outcome
        assert sum(data["times"]) == pytest.approx(1000 * by_key[key].time)
    assert "data-replay" not in evaluated(tmp_path / "none", replays=0)[1].partition("<script>")[0]
    monkeypatch.setattr("bug_gym.evaluation.replays.MOST_LETTERS", len(letters[0]))
    assert evaluated(tmp_path / "small")[1].count('id="replay-') == 1


def test_long_episodes_are_recorded_in_longer_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bug_gym.evaluation.replays.MOST_FRAMES", 100)
    rows, text = evaluated(tmp_path)
    letters = re.findall(r'<script id="replay-\d+" type="text/plain">(.*?)</script>', text)
    assert len(letters) == len(chosen(rows, 24)) == 2
    for packed in letters:
        data = unpacked(packed)
        (steps,) = {row.steps for row in rows if (row.policy, str(row.seed)) == (data["title"], data["seed"])}
        assert 50 < data["frames"] <= 102 < steps


# What a reader would do: press the button of a failure, look, put another policy beside it, play to the end, close.
REPLAYED = """
{
const told = {};
const until = async (is) => { for (let n = 0; n < 300 && !is(); n += 1) await new Promise((done) => setTimeout(done, 20)); };
(async () => {
  const dialog = document.getElementById("replay"), beside = document.getElementById("beside");
  const titles = () => [...dialog.querySelectorAll("figcaption b")].map((title) => title.textContent);
  told.wasOpen = dialog.open;
  const button = document.querySelector("#failures button[data-replay]");
  told.seed = button.textContent; button.click();
  await until(() => titles().length === 1);
  told.isOpen = dialog.open; told.alone = titles();
  told.offered = [...beside.options].map((option) => option.textContent);
  beside.selectedIndex = 1; beside.dispatchEvent(new Event("change"));
  await until(() => titles().length === 2);
  told.both = titles();
  const root = dialog.querySelector(".replay");
  root.dispatchEvent(new KeyboardEvent("keydown", { key: "End" }));
  told.states = [...dialog.querySelectorAll(".state")].map((state) => state.textContent);
  const isWide = () => document.documentElement.scrollWidth > window.innerWidth || dialog.scrollWidth > dialog.clientWidth;
  await until(() => !isWide());  // canvases take their size when the layout is told to them
  told.isWide = isWide();
  document.getElementById("close").click(); told.isClosed = !dialog.open;
  told.inTable = document.querySelectorAll("#rows button[data-replay]").length;
  document.title = JSON.stringify(told);
})();
}
"""


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (apt install chromium)")
def test_a_browser_replays_a_failure_and_another_policy_beside_it(tmp_path: Path) -> None:
    rows, text = evaluated(tmp_path)
    told = browsed(text, tmp_path, REPLAYED)
    assert (told["wasOpen"], told["isOpen"], told["isClosed"], told["isWide"]) == (False, True, True, False)
    assert told["seed"] == "0" and told["alone"] == ["go_to_goal"]
    assert told["offered"] == ["nothing", "bug2, disc, seed 0"] and told["both"] == ["go_to_goal", "bug2"]
    assert "timeout" in told["states"][0] and "success" in told["states"][1] and told["inTable"] == 2


# ---------------------------------------------------------------------------------------------- of a reproduction


def findings_page(replays: dict[Key, str], rows: list[EpisodeRow]) -> str:
    """The page of a reproduction with a table about policies and one about something else."""
    tables = [
        ("lengths", ["policy", "length [m]"], [["bug2", "12.0"], [HOSTILE, "7.5"]]),
        ("planners", ["planner", "ms"], [["a_star", "1.0"]]),
    ]
    first = [results(tables, ["lengths are " + HOSTILE], holds=False), *watched(rows, replays)]
    return page("of a paper", [], [], replays=replays, first=first)


def test_the_page_of_a_reproduction_has_its_tables_and_says_nothing_of_replays_where_there_are_none() -> None:
    text = findings_page({}, [])
    reader = Reader(text)
    assert [table[0] for table in reader.tables] == [["policy", "length [m]"], ["planner", "ms"]]
    assert reader.tables[0][2] == [HOSTILE, "7.5"] and "NOT every claim holds" in text
    assert not {"img", "script"} & {tag for tag, _ in reader.elements[:-2]}  # the data and the page's own script
    links = [str(one["href"]) for _, one in reader.elements if "href" in one]
    assert links == ["#results"] and "<h2>Watch" not in text and "data-replay" not in text.partition("<script")[0]
    filtered = [one["data-policy"] for _, one in reader.elements if "data-policy" in one]
    assert filtered == ["bug2", HOSTILE]  # planners are no policies


def test_episodes_to_watch_are_told_with_how_they_ended() -> None:
    failed, arrived = ROWS[3], ROWS[8]
    keys = [(row.policy, row.scenario, row.seed) for row in (failed, arrived)]
    text = findings_page(dict.fromkeys(keys, "letters"), [failed, arrived])
    assert Reader(text).tables[-1][1:] == [["box", "middling", "time was up", "3"], ["box", "best", "success", "0"]]
    assert "The first failure of each kind" in text and "Nothing failed" not in text
    assert "Nothing failed" in findings_page({keys[1]: "letters"}, [arrived])
    # What found no room in the page is not offered.
    assert len(Reader(findings_page({keys[0]: "letters"}, [failed, arrived])).tables[-1]) == 2


# What a reader would do: filter by policy, look at what is left, and watch.
WATCHED = """
{
const told = {};
const until = async (is) => { for (let n = 0; n < 300 && !is(); n += 1) await new Promise((done) => setTimeout(done, 20)); };
(async () => {
  const filter = document.getElementById("filter");
  filter.value = "bug2"; filter.dispatchEvent(new Event("input"));
  told.left = [...document.querySelectorAll("#results tbody tr")].filter((row) => !row.hidden).length;
  document.querySelector("#watch tr:not([hidden]) button[data-replay]").click();
  const titles = () => [...document.querySelectorAll("#replay figcaption b")].map((title) => title.textContent);
  await until(() => titles().length === 1);
  told.played = titles();
  told.isShown = document.getElementById("episodes").offsetHeight > 0;
  told.isWide = document.documentElement.scrollWidth > window.innerWidth;
  document.title = JSON.stringify(told);
})();
}
"""


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (apt install chromium)")
def test_a_browser_plays_what_a_reproduction_has_to_watch(tmp_path: Path) -> None:
    episodes = [record_episode(policy, "disc", overrides={"time.limit": 10}) for policy in ("go_to_goal", "bug2")]
    rows = [replace(BLANK, policy=one.title, scenario="disc") for one in episodes]
    replays = {(one.title, "disc", 0): one.packed for one in episodes}
    told = browsed(findings_page(replays, rows), tmp_path, WATCHED)
    assert told == {"left": 2, "played": ["bug2"], "isShown": False, "isWide": False}


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (apt install chromium)")
def test_a_browser_sorts_and_filters_the_page(tmp_path: Path) -> None:
    told = browsed(page_of(ROWS), tmp_path, STEPS)
    assert told["descending"] == ["best", "middling", "worst"] and told["ascending"] == ["worst", "middling", "best"]
    assert told["named"] == ["best", "middling", "worst"]
    assert (told["all"], told["filtered"], told["fewer"]) == (len(ROWS), ["best", "worst"], 16)
    assert Counter(told["collisions"]) == {"best": 1, "worst": 5}
    assert told["times"] == sorted(told["times"], reverse=True) and len(told["times"]) == 6
    assert told["wide"]
