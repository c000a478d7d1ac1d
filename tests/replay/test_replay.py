"""Episodes that are looked at again: what is recorded, what a page holds, and what a browser makes of it."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import math
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bug_gym
from bug_gym.cli import main
from bug_gym.evaluation.replays import record_episode
from bug_gym.policy import Drawing
from bug_gym.replay import Episode, Recorder, write_player
from bug_gym.replay.packing import CENTI, MILLI, changes, runs, unpacked
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
HOSTILE = "</script><img src=x onerror=alert(1)>&amp;\"'$style\u2028"
TWO = Drawing(
    points=[(1.0, 0.0, "hit"), (1.5, 0.25, HOSTILE)],
    segments=[(0.0, 0.0, 2.0, 1.0, "m_line")],
    areas=[(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), "light")],
)


def driven(title: str = "one", drawing: Drawing | None = None, steps: int = 20, scenario: str = "dynamic") -> Episode:
    """An episode of a robot that goes straight ahead for some steps."""
    simulation = Simulation(scenario)
    simulation.reset(seeds=[4])
    recorder = Recorder(simulation, title=title)
    recorder.record(drawing, note="off it goes")
    for _ in range(steps):
        simulation.step([[[0.5, 0.0]]])
        recorder.record(drawing)
    return recorder.episode()


def unchanged(numbers: Sequence[int], frames: int, unit: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The values (T, K) that `changes` was given, to half a unit."""
    columns = np.array(numbers, dtype=np.int64).reshape(-1, frames)
    return np.asarray(unit * columns.cumsum(axis=1).T)


def read(episode: Episode, name: str, unit: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """What is kept of each frame (T, K), read back from the letters."""
    return unchanged(unpacked(episode.packed)[name], episode.frames, unit)


# ---------------------------------------------------------------------------------------------- what is recorded


@given(st.lists(st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3), min_size=1, max_size=20))
def test_changes_are_undone_to_half_a_unit(values: list[list[float]]) -> None:
    found = unchanged(changes(values, MILLI), len(values), MILLI)
    np.testing.assert_allclose(found, values, atol=0.5 * MILLI + 1e-9)


@given(st.lists(st.integers(0, 9)))
def test_runs_tell_the_numbers(numbers: list[int]) -> None:
    found = runs(numbers)
    told = [first + more for first, count in zip(found[::2], found[1::2], strict=True) for more in range(count)]
    assert told == numbers


def test_an_episode_is_what_the_simulation_went_through() -> None:
    """A second simulation of the same seed says what must have been written down."""
    episode, simulation = driven(), Simulation("dynamic")
    simulation.reset(seeds=[4])
    poses, ranges, places = (
        read(episode, name, unit) for name, unit in (("poses", MILLI), ("ranges", CENTI), ("places", MILLI))
    )
    world = simulation.world
    for frame in range(episode.frames):
        np.testing.assert_allclose(poses[frame], world.pose[0, 0], atol=0.51 * MILLI)
        np.testing.assert_allclose(ranges[frame], world.ranges[0, 0], atol=0.51 * CENTI)
        movers = np.array([mover.at for mover in world.layout(0).movers]).ravel()
        np.testing.assert_allclose(places[frame], movers, atol=0.51 * MILLI)
        simulation.step([[[0.5, 0.0]]])
    assert episode.data["seed"] == "4" and episode.data["scenario"] == "dynamic"
    assert len(places[0]) == 2 * len(episode.data["movers"]) > 0


def test_a_mind_is_recorded_in_the_world_and_each_shape_once() -> None:
    episode = driven(drawing=TWO)
    data = unpacked(episode.packed)
    assert data["labels"] == ["light", "m_line", "hit", HOSTILE]
    assert [shape[0] for shape in data["shapes"]] == [2, 1, 0, 0] and len(data["shapes"]) == 4
    assert data["shown"] == [[0, 4], *[0] * (episode.frames - 1)]  # the same in every frame
    x, y, heading = read(episode, "poses", MILLI)[0]
    hit = np.array(data["shapes"][2][2:]) * CENTI
    np.testing.assert_allclose(hit, [x + math.cos(heading), y + math.sin(heading)], atol=0.011)


def test_the_same_drawing_of_two_robots_lies_where_each_of_them_started() -> None:
    simulation = Simulation("crossing_robots", overrides={"robots.count": 2})
    simulation.reset(seeds=[0])
    recorder = Recorder(simulation)
    for _ in range(2):
        recorder.record([Drawing(points=[(0.0, 0.0, "hit")])] * 2)
    data = recorder.episode().data
    starts = [pose[:2] for pose in simulation.world.pose[0]]
    np.testing.assert_allclose([np.array(shape[2:]) * CENTI for shape in data["shapes"]], starts, atol=0.006)
    assert data["shown"] == [[0, 2], 0]


def test_the_same_drawing_of_a_robot_that_starts_again_lies_where_it_did() -> None:
    simulation = Simulation({"world": {"family": "empty", "start": [0, 0, 0], "goal": [0.2, 0]}})
    simulation.reset(seeds=[0])
    recorder, drawing = Recorder(simulation), Drawing(points=[(0.0, 0.0, "hit")])
    recorder.record(drawing)
    simulation.step([[[1.0, 0.0]]])
    simulation.restart_robots(np.array([0]), np.array([[[3.0, -2.0, 0.0]]]))
    recorder.record(drawing)
    shapes = recorder.episode().data["shapes"]
    np.testing.assert_allclose([np.array(shape[2:]) * CENTI for shape in shapes], [[0, 0], [3, -2]], atol=0.006)


@pytest.mark.parametrize("seeds", [None, [4], [5]])
def test_a_second_episode_needs_a_recorder_of_its_own(seeds: list[int] | None) -> None:
    simulation = Simulation("static")
    simulation.reset(seeds=[4])
    recorder = Recorder(simulation)
    for _ in range(2):
        recorder.record()
        simulation.step([[[0.5, 0.0]]])
    recorder.record()
    simulation.reset(seeds=seeds)
    with pytest.raises(ValueError, match="begun another episode"):
        recorder.record()
    assert recorder.episode().frames == 3


def test_a_world_that_is_put_in_the_place_of_another_needs_a_recorder_of_its_own() -> None:
    simulation, other = Simulation("static"), Simulation("static")
    simulation.reset(seeds=[4])
    other.reset(seeds=[5])
    recorder = Recorder(simulation)
    for _ in range(2):
        recorder.record()
    simulation.place([other.world.layout(0)])
    with pytest.raises(ValueError, match="begun another episode"):
        recorder.record()


def test_a_policy_is_replayed_to_its_end_with_its_states_and_its_drawing() -> None:
    episode = record_episode("bug2", "disc", every=7)
    data = unpacked(episode.packed)
    outcomes, times = read(episode, "outcomes", 1.0), read(episode, "times", MILLI)
    assert OUTCOMES[int(outcomes[-1, 0])] == "success" and (outcomes[:-1] == 0).all()
    assert np.diff(times[:-1, 0]) == pytest.approx(episode.step) and times[-1, 0] - times[-2, 0] <= episode.step + 1e-9
    assert "boundary following" in data["noteTexts"] and {"m_line", "hit"} <= set(data["labels"])


def test_an_episode_tells_whose_it_is_and_not_all_that_it_holds() -> None:
    episode = driven()
    assert repr(episode) == f"Episode('{episode.title}', {episode.frames} frames)"


def test_four_hundred_frames_of_64_rays_stay_far_below_a_megabyte() -> None:
    episode = record_episode("hd_bug_map", "dynamic", seed=1, overrides={"lidar.beams": 64})
    assert len(episode.packed) * 400 / episode.frames < 250_000


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bug_gym.show(), "got no episode"),
        (lambda: bug_gym.show(driven(), "bug2"), "got 'bug2' to show, expected episodes"),  # type: ignore[arg-type]
        (lambda: write_player("race.html", Simulation("empty")), "Simulation .* expected episodes"),  # type: ignore[arg-type]
        (lambda: Recorder(Simulation("empty")).episode(), "at least one frame"),
        (lambda: Recorder(Simulation("empty")).record(), "holds no world yet"),
        (lambda: driven(drawing=Drawing(points=[(math.nan, 0.0, "hit")])), "finite places"),
        (lambda: record_episode("bug2", "empty", every=0), "every must be at least 1"),
        (lambda: write_player("race.htm", driven()), "ends in .html"),
    ],
)
def test_what_cannot_be_played_is_refused(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


# ---------------------------------------------------------------------------------------------- the page


def test_the_player_loads_nothing_and_runs_its_own_script_only() -> None:
    text = bug_gym.show(driven(HOSTILE, TWO)).page()
    assert not re.search(r"https?://|url\(|@import|<img|<link|<\w[^>]*\ssrc=", text)
    assert HOSTILE not in text and html.escape(HOSTILE) in text
    *_, script = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'" in text
    assert 'name="viewport"' in text and "prefers-color-scheme: dark" in text


def test_a_notebook_shows_an_episode_in_a_frame_of_its_own() -> None:
    episode = driven()
    shown = episode._repr_html_()
    (inner,) = re.findall(r'srcdoc="(.*?)" sandbox="allow-scripts"', shown, re.DOTALL)
    assert html.unescape(inner) == bug_gym.show(episode).page()


# What a reader would do: look, step, play, scrub, hide what a robot sees, press keys.
STEPS = """
const told = {}, errors = [];
addEventListener("error", (event) => errors.push(event.message));
addEventListener("unhandledrejection", (event) => errors.push(String(event.reason)));
const until = async (is) => { for (let n = 0; n < 400 && !is(); n += 1) await new Promise((done) => setTimeout(done, 20)); };
const look = () => [...document.querySelectorAll("figure canvas")].map((canvas) => canvas.toDataURL());
const press = (key) => document.body.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
(async () => {
  const root = document.getElementById("player");
  await until(() => root.dataset.frame === "0");
  const frame = () => Number(root.dataset.frame), slider = root.querySelector("input[type=range]");
  told.panes = [...root.querySelectorAll("figcaption b")].map((title) => title.textContent);
  told.states = [...root.querySelectorAll(".state")].map((state) => state.textContent);
  told.legend = [...root.querySelectorAll(".legend li")].map((item) => item.textContent);
  told.last = Number(slider.max);
  const [one] = await Replay.unpackAll(JSON.parse(document.getElementById("episodes").textContent));
  for (const name of ["poses", "places", "ranges", "goals"])
    told[name] = [0, 7, 20].map((frame) => [...one[name].at(frame)]);
  told.hit = one.shown[5].find((shape) => one.labels[shape.label] === "hit").places;
  const first = look();
  press("ArrowRight"); told.stepped = frame(); told.hasMoved = look().every((sum, pane) => sum !== first[pane]);
  press("ArrowLeft"); told.back = frame(); told.isSame = look().every((sum, pane) => sum === first[pane]);
  const [scan] = root.querySelectorAll("input[type=checkbox]");
  scan.click(); told.isBare = look().every((sum, pane) => sum !== first[pane]); scan.click();
  slider.value = 15; slider.dispatchEvent(new Event("input")); told.scrubbed = frame();
  press("End"); told.end = frame(); press("Home"); told.home = frame();
  root.querySelector(".play").click(); await until(() => frame() > 2); told.hasPlayed = frame() > 2; press(" ");
  const stopped = frame(); await new Promise((done) => setTimeout(done, 300)); told.isPaused = frame() === stopped;
  told.isWide = document.documentElement.scrollWidth > window.innerWidth;
  told.errors = errors;
  document.title = JSON.stringify(told);
})();
"""


def browsed(text: str, folder: Path, steps: str, *, width: int = 1000) -> dict[str, Any]:
    """What a script that was put to the end of a page has written into its title, in a browser that opened it from disk."""
    digest = base64.b64encode(hashlib.sha256(steps.encode()).digest()).decode()
    page = text.replace("script-src ", f"script-src 'sha256-{digest}' ").replace(
        "</body>", f"<script>{steps}</script></body>"
    )
    (folder / "page.html").write_text(page, encoding="utf-8")
    assert CHROMIUM is not None
    options = ["--headless", "--no-sandbox", "--disable-gpu", f"--window-size={width},800", "--enable-logging=stderr"]
    command = [CHROMIUM, *options, f"--user-data-dir={folder}/user", "--virtual-time-budget=20000", "--dump-dom"]
    done = subprocess.run(
        [*command, (folder / "page.html").as_uri()], capture_output=True, text=True, check=True, timeout=120
    )
    assert "CONSOLE" not in done.stderr, done.stderr
    (title,) = re.findall("<title>(.*?)</title>", done.stdout, re.DOTALL)
    return dict(json.loads(html.unescape(title)))


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (apt install chromium)")
@pytest.mark.parametrize("width", [1000, 500])
def test_a_browser_plays_two_episodes_side_by_side(width: int, tmp_path: Path) -> None:
    one = driven("one", TWO)
    page = bug_gym.show(one, driven(HOSTILE, steps=30)).page()
    told = browsed(page, tmp_path, STEPS, width=width)
    for name, unit in (("poses", MILLI), ("places", MILLI), ("ranges", CENTI), ("goals", MILLI)):
        np.testing.assert_allclose(told[name], read(one, name, unit)[[0, 7, 20]], atol=1e-9)
    np.testing.assert_allclose(told["hit"], [np.array(one.data["shapes"][2][2:]) * CENTI], atol=1e-9)
    assert told["errors"] == []
    assert told["panes"] == ["one", HOSTILE] and told["states"] == ["0.0 s · off it goes"] * 2
    assert told["legend"] == ["light", "m line", "hit", HOSTILE.replace("_", " ")]
    assert (told["last"], told["stepped"], told["back"], told["scrubbed"]) == (30, 1, 0, 15)
    assert (told["end"], told["home"]) == (30, 0)
    assert told["hasMoved"] and told["isSame"] and told["isBare"] and told["hasPlayed"] and told["isPaused"]
    assert not told["isWide"]


# ---------------------------------------------------------------------------------------------- the command


def test_render_writes_a_race_with_policies_named_either_way(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, other = tmp_path / "one.html", tmp_path / "other.html"
    common = ["--every", "10", "--set", "time.limit=60"]
    assert main(["render", "disc", "--policies", "go_to_goal,bug2", *common, "--out", str(one)]) == 0
    said = capsys.readouterr().out
    assert "go_to_goal: timeout" in said and "bug2: success" in said
    assert main(["render", "go_to_goal", "bug2", "disc", *common, "--out", str(other)]) == 0
    assert one.read_text(encoding="utf-8") == other.read_text(encoding="utf-8")
    (kept,) = re.findall(
        r'<script id="episodes" type="application/json">(.*?)</script>', one.read_text(encoding="utf-8")
    )
    assert [unpacked(letters)["title"] for letters in json.loads(kept)] == ["go_to_goal", "bug2"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("render disc --out race.html", "got no policy to drive in disc"),
        ("render bug1 disc --policies bug2 --out race.html", "got bug1 as well as --policies"),
        ("render disc --policies bug2 --out race.htm", "expected a name that ends in .html, .gif, .mp4 or .png"),
    ],
)
def test_a_race_that_cannot_be_is_told_in_one_line(
    arguments: str, message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments.split()) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and message in told and not list(tmp_path.iterdir())
