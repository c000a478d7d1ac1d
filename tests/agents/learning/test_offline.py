"""Offline learning: losses and values against closed forms and dynamic programming, DAgger's questions, folders that play."""

from __future__ import annotations

import json
import logging
import math
import re
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")

import torch
from stable_baselines3.common.policies import ActorCriticPolicy

from bug_gym.agents import make_policy
from bug_gym.agents.learning import iql, offline
from bug_gym.agents.learning.cloning import Cloning, WithDriver
from bug_gym.agents.learning.dagger import ask, make_expert
from bug_gym.agents.learning.folder import read_config
from bug_gym.agents.learning.history import with_history
from bug_gym.agents.learning.iql import IQL, expectile_loss
from bug_gym.agents.learning.offline import Samples, make_actor, make_learner, train_offline, train_offline_seeds
from bug_gym.agents.learning.recorded import Recorded, joined
from bug_gym.agents.learning.regression import Batch, follow, mean_action, near_moves, regression_loss, target_of, value
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.agents.learning.settings import AnySettings, load_settings
from bug_gym.agents.learning.td3_bc import TD3BC, actor_loss, held
from bug_gym.agents.learning.training import rebuild, robot_of, train
from bug_gym.cli import main
from bug_gym.config import ScenarioError, load
from bug_gym.held_out import TEST_SEEDS, TRAINING_SEEDS, VALIDATION_SEEDS, play
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

SHORT = {"time.limit": 6.0}
"""What keeps episodes short."""
SCENARIO = load("dynamic", SHORT)
TINY = {
    "scenarios": ["dynamic"],
    "overrides": SHORT,
    "n_timesteps": 40,
    "eval_freq": 20,
    "batch_size": 32,
    "eval_episodes": 4,
    "test_episodes": 4,
}
DATA = {"policies": ["bug2", "random"], "episodes": 3}


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    """Threads of torch cost more than they give where networks are this small."""
    torch.set_num_threads(1)


def tiny(algo: str, **changes: Any) -> Any:
    """Settings of a training of a second."""
    own = {"expert": "bug2", "episodes_per_round": 3} if algo == "dagger" else {"data": DATA}
    return load_settings({"algo": algo, **TINY, **own, **changes})


def answered(count: int = 10, learner: Any = None, expert: str = "go_to_goal") -> Recorded:
    """What a scripted policy says in some worlds."""
    seeds = range(TRAINING_SEEDS, TRAINING_SEEDS + count)
    return ask(make_expert(expert, SCENARIO), learner, SCENARIO, seeds, 4)


def weights(folder: Path) -> dict[str, torch.Tensor]:
    from safetensors.torch import load_file

    return load_file(folder / "policy.safetensors")


def same(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


# --------------------------------------------------------------------------------------------------- recorded episodes


def hand_made() -> Recorded:
    """Two episodes, of two steps (terminated) and of three (cut off); observation k says k."""
    return Recorded(
        np.arange(7, dtype=np.float32)[:, None],
        np.zeros((5, 2), dtype=np.float32),
        np.array([1.0, 2.0, 4.0, 8.0, 16.0]),
        np.array([2, 3]),
        np.array([True, False]),
    )


def test_steps_know_what_they_were_decided_from_and_what_came_of_them() -> None:
    episodes = hand_made()
    assert episodes.seen.tolist() == [0, 1, 3, 4, 5]
    assert episodes.is_final.tolist() == [False, True, False, False, False]
    assert episodes.scores().tolist() == [3.0, 28.0]


@pytest.mark.parametrize("steps", [1, 2, 3, 9])
def test_sums_of_some_steps_end_with_their_episode(steps: int) -> None:
    episodes, gamma = hand_made(), 0.5
    sums, following, worth = episodes.summed(steps, gamma)
    ends = np.repeat(episodes.ends, episodes.steps).tolist()
    for number, end in enumerate(ends):
        taken = range(number, min(number + steps, end))
        assert sums[number] == sum(gamma**k * episodes.rewards[step] for k, step in enumerate(taken))
        assert following[number] == episodes.seen[number] + len(taken)
        is_over = number + steps >= 2 and number < 2  # the first episode of two steps terminated
        assert worth[number] == (0.0 if is_over else gamma ** (len(taken) - 1))


@pytest.mark.parametrize("steps", [1, 4])
def test_the_true_values_solve_the_equation_of_several_steps(steps: int) -> None:
    episodes, gamma = answered(4), 0.9
    sums, following, worth = episodes.summed(steps, gamma)
    values = np.zeros(len(episodes.observations))  # of what follows, along the episodes as they were recorded
    for step in range(len(episodes.rewards) - 1, -1, -1):
        values[episodes.seen[step]] = episodes.rewards[step] + gamma * values[episodes.seen[step] + 1]
    assert sums + gamma * worth * values[following] == pytest.approx(values[episodes.seen])


def test_the_best_episodes_are_those_of_the_highest_scores() -> None:
    episodes = hand_made()
    best = episodes.best(0.5)
    assert best.observations.ravel().tolist() == [3, 4, 5, 6] and best.rewards.tolist() == [4, 8, 16]
    assert best.steps.tolist() == [3] and best.terminated.tolist() == [False]
    both = joined([episodes.best(0.1), episodes.chosen(np.array([0]))])
    assert both.scores().tolist() == [28.0, 3.0] and both.seen.tolist() == [0, 1, 2, 4, 5]
    assert np.array_equal(episodes.best(1.0).observations, episodes.observations)


def test_a_recorded_history_is_that_of_a_policy_in_play() -> None:
    robot, episodes = RobotModel.of(Sensors.of(SCENARIO)), answered(3)
    found = episodes.with_history(robot, (2, 4))
    first = 0
    for steps in episodes.steps.tolist():
        state: Any = None
        for number in range(first, first + steps + 1):
            seen, state = with_history(episodes.observations[number][None], state, None, robot=robot, lags=(2, 4))
            assert np.array_equal(seen[0], found.observations[number])
        first += steps + 1
    assert first == len(found.observations)


# -------------------------------------------------------------------------------------------------------------- losses


@pytest.mark.parametrize("expectile", [0.1, 0.5, 0.8])
def test_the_expectile_of_two_and_of_three_numbers_is_that_of_the_formula(expectile: float) -> None:
    # Of 0 and 1: t (1 - m) = (1 - t) m. Of 0, 0 and 1: t (1 - m) = 2 (1 - t) m.
    for numbers, expected in (
        ([0.0, 1.0], expectile),
        ([0.0, 0.0, 1.0], expectile / (expectile + 2.0 * (1.0 - expectile))),
    ):
        guess = torch.tensor(expected, requires_grad=True)
        (slope,) = torch.autograd.grad(expectile_loss(torch.tensor(numbers) - guess, expectile), guess)
        assert slope.item() == pytest.approx(0.0, abs=1e-6)


def one_hot_actor(features: int) -> ActorCriticPolicy:
    """An actor of plain features, in place of a robot's."""
    torch.manual_seed(0)
    box, actions = gym.spaces.Box(-1.0, 1.0, (features,)), gym.spaces.Box(-1.0, 1.0, (2,))
    return ActorCriticPolicy(
        box, actions, lambda _: 1e-3, net_arch=[32], activation_fn=torch.nn.Tanh, log_std_init=-0.5
    )


def test_the_regression_is_the_negative_likelihood_of_a_gaussian() -> None:
    actor, features = one_hot_actor(3), torch.eye(3)
    actions, some = torch.tensor([[0.1, -0.2], [0.5, 1.0], [-1.0, 0.0]]), torch.tensor([1.0, 0.0, 2.0])
    gaussian = torch.distributions.Normal(mean_action(actor, features), actor.log_std.exp())
    densities = gaussian.log_prob(actions)  # type: ignore[no-untyped-call]
    expected = -densities.sum(dim=1) - math.log(2.0 * math.pi)
    assert torch.isclose(regression_loss(actor, features, actions), expected.mean())
    assert torch.isclose(regression_loss(actor, features, actions, some), (some * expected).mean())


def test_numbers_of_actions_are_learnt_by_their_likelihood() -> None:
    torch.manual_seed(0)
    box = gym.spaces.Box(-1.0, 1.0, (3,))
    actor = ActorCriticPolicy(box, gym.spaces.Discrete(5), lambda _: 1e-3, net_arch=[16])
    actions, some = torch.tensor([4, 0, 2]), torch.tensor([1.0, 0.0, 2.0])
    features = actor.extract_features(torch.eye(3), actor.pi_features_extractor)
    expected = -actor.get_distribution(torch.eye(3)).log_prob(actions)
    assert isinstance(features, torch.Tensor)
    assert torch.isclose(regression_loss(actor, features, actions), expected.mean())
    assert torch.isclose(regression_loss(actor, features, actions, some), (some * expected).mean())


def test_of_two_ways_round_one_is_taken_and_not_the_middle() -> None:
    """A place where half went far to the left and a little fewer to the right."""
    torch.manual_seed(0)
    ones, actions = torch.ones(11, 1), torch.tensor([0] * 5 + [4] * 6)
    box = gym.spaces.Box(-1.0, 1.0, (1,))
    actor = ActorCriticPolicy(box, gym.spaces.Discrete(5), lambda _: 1e-3, net_arch=[16])
    learner = Cloning(actor, GAMMA)
    learner.optimizers[0].param_groups[0]["lr"] = 1e-2
    nothing = torch.zeros(11)
    for _ in range(200):
        learner.update(Batch(ones, actions, nothing, ones, nothing))
    chances = torch.softmax(mean_action(actor, ones[:1]), dim=1)[0]
    assert chances[[0, 4]].tolist() == pytest.approx([5 / 11, 6 / 11], abs=0.03)
    assert actor.predict(np.ones((1, 1), dtype=np.float32), deterministic=True)[0].tolist() == [4]


MOVES = np.array([[1.0, 0.0], [1.0, 0.2], [1.0, -0.2], [-1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
"""Three ways to drive on, and turns to the left, twice the same, and to the right."""


def test_an_answer_is_worth_to_each_move_what_a_bell_over_their_distance_says() -> None:
    worth = near_moves(MOVES, 0.4).numpy()
    assert (worth[:, 4] == 0.0).all() and np.array_equal(
        worth[3], worth[4]
    )  # the first of two that are the same has it
    assert worth[0, 1] == pytest.approx(math.exp(-0.5 * 0.2**2 / 0.4**2))
    assert worth[1, 2] == pytest.approx(math.exp(-0.5 * 0.4**2 / 0.4**2))
    assert near_moves(MOVES, 1e-3).numpy() == pytest.approx(np.eye(6)[[0, 1, 2, 3, 3, 5]])


@pytest.mark.parametrize(("width", "taken"), [(0.0, 3), (0.4, 0)])
def test_what_most_answers_come_near_to_is_done_before_what_is_said_most(width: float, taken: int) -> None:
    """A place where three in ten turned on the spot, and seven drove on, each a little otherwise."""
    torch.manual_seed(0)
    ones, nothing, actions = (
        torch.ones(10, 1),
        torch.zeros(10),
        torch.tensor([3] * 3 + [0] * 2 + [1] * 2 + [2] * 2 + [5]),
    )
    actor = ActorCriticPolicy(gym.spaces.Box(-1.0, 1.0, (1,)), gym.spaces.Discrete(6), lambda _: 1e-3, net_arch=[16])
    worth = near_moves(MOVES, width) if width else None
    learner = Cloning(actor, GAMMA, worth)
    learner.optimizers[0].param_groups[0]["lr"] = 1e-2
    for _ in range(200):
        learner.update(Batch(ones, actions, nothing, ones, nothing))
    expected = (np.eye(6) if worth is None else worth.numpy())[actions.numpy()].mean(axis=0)
    expected /= expected.sum()
    chances = torch.softmax(mean_action(actor, ones[:1]), dim=1)[0]
    assert chances.tolist() == pytest.approx(expected.tolist(), abs=0.03)
    assert actor.predict(np.ones((1, 1), dtype=np.float32), deterministic=True)[0].tolist() == [taken]


def test_dagger_keeps_what_learns_by_moves_and_drives_with_what_learns_numbers() -> None:
    settings = tiny("dagger", action="discrete", answer_width=0.8)
    actor = make_actor(settings, 0)
    learner = make_learner(settings, actor)
    assert isinstance(learner, WithDriver) and learner.kept.actor is actor is not learner.driver.actor
    assert learner.kept.worth is not None and (learner.kept.worth > 0.0).any(dim=0).sum() == 22  # moves of 128 numbers
    samples = Samples(actor, settings, 0)
    seeds = range(TRAINING_SEEDS, TRAINING_SEEDS + 3)
    samples.add(ask(make_expert("bug2", SCENARIO, discrete=True), None, SCENARIO, seeds, 3))
    alone = Cloning(make_actor(settings, 0), settings.gamma)
    for _ in range(3):
        batch = samples.draw()
        learner.update(batch)
        alone.update(batch)
    assert same(learner.driver.actor.state_dict(), alone.actor.state_dict())
    assert not same(actor.state_dict(), alone.actor.state_dict())
    for changes in ({"action": "discrete"}, {}):
        plain = tiny("dagger", **changes)
        assert isinstance(make_learner(plain, make_actor(plain, 0)), Cloning)


def test_the_driver_is_who_drives_and_another_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from bug_gym.agents.learning import offline

    drivers: list[dict[str, torch.Tensor]] = []

    def asked(expert: Any, learner: Any, scenario: Any, seeds: range, rows: int) -> Recorded:
        if learner is not None:
            drivers.append({name: value.clone() for name, value in learner.model.state_dict().items()})
        return ask(expert, learner, scenario, seeds, rows)

    monkeypatch.setattr(offline, "ask", asked)
    for width in (0.0, 0.8):
        train_offline(tiny("dagger", action="discrete", answer_width=width), tmp_path / str(width))
    plain, driver = drivers
    assert same(plain, driver)  # it learns as it did without
    assert not same(weights(tmp_path / "0.0"), weights(tmp_path / "0.8"))


def test_td3_bc_weighs_values_by_their_own_size() -> None:
    values, answers = torch.tensor([1.0, -3.0], requires_grad=True), torch.tensor([[0.0, 0.0], [1.0, 1.0]])
    actions = torch.tensor([[0.0, 2.0], [1.0, 1.0]])
    # lambda = 2.5 / 2, the mean value is -1, the squared distances are 0, 4, 0 and 0.
    assert actor_loss(values, answers, actions, 2.5).item() == pytest.approx(2.5 / 2.0 + 1.0)
    slopes = [
        torch.autograd.grad(actor_loss(scale * values, answers, actions, 2.5), values)[0] for scale in (1.0, 50.0)
    ]
    assert torch.allclose(slopes[0], slopes[1])
    assert torch.allclose(slopes[0], torch.full((2,), -1.25 / 2.0))


def test_an_answer_that_went_too_far_is_led_back_and_no_farther() -> None:
    answers = torch.tensor([-2.0, -2.0, 0.5, 2.0, 2.0], requires_grad=True)
    worth = torch.tensor([1.0, -1.0, 1.0, 1.0, -1.0])  # slopes of what is to be climbed
    cut = held(answers)
    (slopes,) = torch.autograd.grad((-worth * cut).sum(), answers)
    assert cut.tolist() == [-1.0, -1.0, 0.5, 1.0, 1.0]
    assert slopes.tolist() == [-1.0, 0.0, -1.0, 0.0, 1.0]


def test_a_target_follows_by_its_share() -> None:
    network = torch.nn.Linear(1, 1)
    target = target_of(network)
    before = network.weight.item()
    with torch.no_grad():
        network.weight += 1.0
    follow(target, network, 0.25)
    assert next(target.parameters()).item() == pytest.approx(before + 0.25)


# ------------------------------------------------------------------------------------------ values against known worlds


LENGTH, GAMMA = 4, 0.9


def chain() -> Batch:
    """A line of places, both ways tried at each equally often; -0.1 a step, 1 for the step out at its right end.

    To the left of the first place is the first place. The action's first number says the way.
    """
    rows = [(place, way) for place in range(LENGTH) for way in (-1.0, 1.0)]
    places, ways = torch.tensor([place for place, _ in rows]), torch.tensor([way for _, way in rows])
    following = (places + ways.long()).clamp(0, LENGTH - 1)
    leaves = (places == LENGTH - 1) & (ways > 0.0)
    eye = torch.eye(LENGTH)
    actions = torch.stack([ways, torch.zeros_like(ways)], dim=1)
    return Batch(eye[places], actions, leaves.float() - 0.1, eye[following], (~leaves).float())


def chain_values(expectile: float) -> np.ndarray[Any, Any]:
    """Values of the places: the fixed point of IQL's two equations over the table, by repetition."""
    values = np.zeros(LENGTH)
    for _ in range(500):
        left = -0.1 + GAMMA * values[np.maximum(np.arange(LENGTH) - 1, 0)]
        right = -0.1 + np.append(GAMMA * values[1:], 1.0)
        low, high = np.minimum(left, right), np.maximum(left, right)
        values = expectile * high + (1.0 - expectile) * low  # of two equally frequent numbers
    return values


@pytest.mark.parametrize("expectile", [0.5, 0.9])
def test_iql_finds_the_values_of_a_chain_and_the_way_out(expectile: float) -> None:
    settings = tiny("iql", expectile=expectile, gamma=GAMMA, beta=20.0, tau=0.05, policy_kwargs={"net_arch": [32]})
    actor, batch = one_hot_actor(LENGTH), chain()
    learner = IQL(actor, settings)
    for optimizer in learner.optimizers:
        optimizer.param_groups[0]["lr"] = 5e-3
    for _ in range(900):
        learner.update(batch)
    found = value(actor, torch.eye(LENGTH)).detach().numpy()
    assert found == pytest.approx(chain_values(expectile), abs=0.03)
    if expectile > 0.5:  # where advantages are of the better way, it is taken
        assert (mean_action(actor, torch.eye(LENGTH))[:, 0] > 0.5).all()


def test_the_chains_oracle_tells_a_random_walkers_values_and_nears_the_best() -> None:
    transitions = np.zeros((LENGTH, LENGTH))
    for place in range(LENGTH):
        transitions[place, max(place - 1, 0)] += 0.5
        if place + 1 < LENGTH:
            transitions[place, place + 1] += 0.5
    rewards = np.full(LENGTH, -0.1) + 0.5 * (np.arange(LENGTH) == LENGTH - 1)
    assert chain_values(0.5) == pytest.approx(np.linalg.solve(np.eye(LENGTH) - GAMMA * transitions, rewards))
    best = [0.9 * GAMMA**n - 0.1 * sum(GAMMA**k for k in range(n)) for n in (3, 2, 1, 0)]
    assert chain_values(0.9999) == pytest.approx(best, abs=1e-3)


@pytest.mark.parametrize(("alpha", "expected"), [(1e-6, -0.25), (100.0, 1.0)])
def test_td3_bc_goes_from_what_was_done_to_what_is_worth_most_with_alpha(alpha: float, expected: float) -> None:
    """One place, one step: actions of -0.25 in the mean were done, the larger the better."""
    torch.manual_seed(0)
    settings = tiny("td3_bc", alpha=alpha, tau=0.05, policy_kwargs={"net_arch": [32], "activation_fn": "tanh"})
    actor = one_hot_actor(1)
    learner = TD3BC(actor, settings)
    for optimizer in learner.optimizers:
        optimizer.param_groups[0]["lr"] = 1e-2
    done = torch.cat([torch.linspace(-1.0, 0.0, 40), torch.linspace(-1.0, 1.0, 40)])
    actions = torch.stack([done, torch.linspace(-1.0, 1.0, 80).flip(0)], dim=1)
    ones, nothing = torch.ones(80, 1), torch.zeros(80)
    batch = Batch(ones, actions, done, ones, nothing)
    for _ in range(300):
        learner.update(batch)
    assert done.mean().item() == pytest.approx(-0.25)
    assert mean_action(actor, ones[:1])[0, 0].clamp(-1.0, 1.0).item() == pytest.approx(expected, abs=0.12)


class Differing(torch.nn.Module):
    """Two critics that tell 1 + 3 a and 2 - a of the first number a of an action: the first is the lower one below 1/4."""

    def forward(self, features: torch.Tensor, actions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return 1.0 + 3.0 * actions[:, 0], 2.0 - actions[:, 0]


def set_to(actor: Any, answer: list[float], worth: float) -> None:
    """Let an actor answer the same everywhere, and have every place be worth the same."""
    with torch.no_grad():
        for layer, constant in ((actor.action_net, answer), (actor.value_net, [worth])):
            layer.weight.zero_()
            layer.bias.copy_(torch.tensor(constant))


def test_iql_learns_from_the_lower_critic_and_weighs_no_action_by_more_than_a_hundred(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    losses: list[float] = []
    monkeypatch.setattr(iql, "descend", lambda optimizer, loss: losses.append(loss.item()))
    monkeypatch.setattr(iql, "follow", lambda target, network, tau: None)
    actor = one_hot_actor(1)
    set_to(actor, [0.5, 0.0], -1.5)
    settings = tiny("iql", beta=4.0, expectile=0.7, gamma=0.9, policy_kwargs={"net_arch": [8], "activation_fn": "tanh"})
    learner: Any = IQL(actor, settings)
    learner.targets = Differing()
    for parameter in learner.critics.parameters():
        torch.nn.init.zeros_(parameter)
    actions, rewards, goes_on = [-1.0, 0.0, 1.0], [0.5, -1.0, 2.0], [1.0, 0.0, 0.5]
    places = torch.ones(3, 1)
    both = torch.tensor([[a, 0.2] for a in actions])
    learner.update(Batch(places, both, torch.tensor(rewards), places, torch.tensor(goes_on)))
    # 1 - 3, 1 + 0 and 2 - 1, against a value of -1.5; exp(4 * 2.5) is 22,026.
    advantages = [-2.0 + 1.5, 1.0 + 1.5, 1.0 + 1.5]
    of_value, of_actor, of_critics = losses
    assert of_value == pytest.approx((0.3 * 0.5**2 + 0.7 * 2.5**2 + 0.7 * 2.5**2) / 3)
    weights_, spread = [math.exp(4.0 * advantages[0]), 100.0, 100.0], math.exp(-0.5)
    told = [0.5 * (((a - 0.5) / spread) ** 2 + (0.2 / spread) ** 2) + 2.0 * -0.5 for a in actions]
    assert of_actor == pytest.approx(sum(w * loss for w, loss in zip(weights_, told, strict=True)) / 3, rel=1e-5)
    aims = [r + 0.9 * on * -1.5 for r, on in zip(rewards, goes_on, strict=True)]
    assert of_critics == pytest.approx(2.0 * sum(aim**2 for aim in aims) / 3)


def test_td3_bc_aims_at_the_lower_critic_of_the_next_action_blurred_by_a_noise_that_is_cut() -> None:
    """Noise that is nearly always beyond its cut of 0.25 leaves two actions: 0.8 - 0.25, and 0.8 + 0.25, which is cut to 1."""
    torch.manual_seed(0)
    actor = one_hot_actor(1)
    set_to(actor, [0.8, 0.0], 0.0)
    few = {"net_arch": [8], "activation_fn": "tanh"}
    learner: Any = TD3BC(actor, tiny("td3_bc", gamma=0.9, policy_noise=1e5, noise_clip=0.25, policy_kwargs=few))
    learner.target_critics = Differing()
    places, halves = torch.ones(64, 1), torch.full((64,), 0.5)
    batch = Batch(places, torch.zeros(64, 2), torch.full((64,), 3.0), places, halves)
    found = set(learner._target(batch).numpy().round(4).tolist())
    # The lower of 1 + 3 a and 2 - a.
    expected = [3.0 + 0.9 * 0.5 * min(1.0 + 3.0 * a, 2.0 - a) for a in (0.55, 1.0)]
    assert sorted(found) == pytest.approx(sorted(expected), abs=1e-4)


# ------------------------------------------------------------------------------------------------------------- cloning


def test_a_clone_of_ten_episodes_does_what_they_did() -> None:
    settings = tiny("bc", batch_size=128)
    actor, samples = make_actor(settings, 0), Samples(make_actor(settings, 0), settings, 0)
    episodes = answered(10)
    samples.add(episodes)
    learner = Cloning(actor, settings.gamma)
    for step in range(800):
        learner.optimizers[0].param_groups[0]["lr"] = 3e-3 * (1.0 - step / 800)
        learner.update(samples.draw())
    answers, _ = actor.predict(episodes.observations[episodes.seen], deterministic=True)
    assert np.abs(answers - episodes.actions).mean() < 0.03 < 0.3 < np.abs(episodes.actions).mean()


@pytest.mark.parametrize(("terminated", "expected"), [(False, 1.0 / (1.0 - GAMMA)), (True, 1.9)])
@pytest.mark.parametrize("algo", ["bc", "dagger"])
def test_what_a_clone_makes_of_a_place_goes_on_after_a_cut_and_ends_with_an_episode(
    algo: str, terminated: bool, expected: float
) -> None:
    """A place that each step leads back to, for a reward of 2 in each, by episodes of a step and of two."""
    settings = tiny(algo, gamma=GAMMA, reward_scale=0.5)
    actor = make_actor(settings, 0)
    place = answered(1).observations[:1]
    lengths, ended = np.array([1, 2]), np.full(2, terminated)
    samples, learner = Samples(actor, settings, 0), make_learner(settings, actor)
    samples.add(
        Recorded(np.repeat(place, 5, axis=0), np.zeros((3, 2), dtype=np.float32), np.full(3, 2.0), lengths, ended)
    )
    for _ in range(1500):
        learner.optimizers[0].param_groups[0]["lr"] = 1e-2
        learner.update(samples.draw())
    found = value(actor, actor.pi_features_extractor(torch.from_numpy(place)))
    # Of what terminated: 1, 1 and 1 + gamma to its end, each equally often.
    assert found.item() == pytest.approx((2.0 + expected) / 3 if terminated else expected, rel=0.02)


def test_batches_are_scaled_steps_of_the_episodes() -> None:
    settings = tiny("iql", n_steps=1, batch_size=400, reward_scale=0.5)
    samples, episodes = Samples(make_actor(settings, 0), settings, 0), answered(3)
    samples.add(episodes)
    batch = samples.draw()
    encode = make_actor(settings, 0).pi_features_extractor
    features = encode(torch.from_numpy(episodes.observations))
    for number in range(0, 400, 40):
        step = int((features[torch.from_numpy(episodes.seen)] == batch.features[number]).all(dim=1).nonzero()[0])
        assert torch.equal(batch.following[number], features[episodes.seen[step] + 1])
        assert torch.equal(batch.actions[number], torch.from_numpy(episodes.actions[step]))
        assert batch.rewards[number].item() == pytest.approx(0.5 * episodes.rewards[step], abs=1e-6)
        assert batch.goes_on[number].item() == float(not episodes.is_final[step])


# -------------------------------------------------------------------------------------------------------------- DAgger


class Straight:
    """Drives ahead, whatever it sees."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        return np.tile(np.array([1.0, 0.3], dtype=np.float32), (len(observation), 1)), None


@pytest.mark.parametrize("expert", ["bug2", "hd_bug"])
def test_the_experts_memory_runs_along_the_learners_way(expert: str) -> None:
    found = answered(5, Straight(), expert)
    env = gym.make("BugGym/Dynamic-v0", overrides=SHORT, observation="flat")
    first = taken = 0
    for number, steps in enumerate(found.steps.tolist()):
        seen, _ = env.reset(seed=TRAINING_SEEDS + number)
        policy, state, terminated = make_policy(expert, SCENARIO), None, False
        for step in range(steps):
            assert np.array_equal(seen, found.observations[first + step])
            answer, state = policy.predict(seen, state)
            assert np.array_equal(answer, found.actions[taken + step])
            seen, reward, terminated, _, _ = env.step(np.array([1.0, 0.3], dtype=np.float32))
            assert reward == found.rewards[taken + step]
        assert np.array_equal(seen, found.observations[first + steps]) and terminated == found.terminated[number]
        first, taken = first + steps + 1, taken + steps
    assert len(set(found.steps.tolist())) > 1  # rows began again at different times


def test_numbers_of_actions_are_asked_for_and_driven() -> None:
    env = gym.make("BugGym/Dynamic-v0", overrides=SHORT, observation="flat", action="discrete")
    seeds = range(TRAINING_SEEDS, TRAINING_SEEDS + 3)
    found = ask(make_expert("bug2", SCENARIO, discrete=True), None, SCENARIO, seeds, 2)
    assert found.actions.dtype.kind == "i" and found.actions.shape == found.rewards.shape
    first = taken = 0
    for seed, steps in zip(seeds, found.steps.tolist(), strict=True):
        seen, _ = env.reset(seed=seed)
        policy, state = make_policy("bug2", env), None
        for step in range(steps):
            assert np.array_equal(seen, found.observations[first + step])
            answer, state = policy.predict(seen, state)
            assert answer == found.actions[taken + step]
            seen, reward, *_ = env.step(answer)
            assert reward == found.rewards[taken + step]
        first, taken = first + steps + 1, taken + steps


def test_the_expert_drives_where_nobody_else_does() -> None:
    found, seeds = answered(4, None, "bug2"), range(TRAINING_SEEDS, TRAINING_SEEDS + 4)
    played = play(make_policy("bug2", SCENARIO), SCENARIO, seeds)
    assert found.steps.tolist() == np.rint(played.time[:, 0] / 0.1).astype(int).tolist()


@pytest.mark.parametrize(
    ("expert", "said"), [("a_star", "reads the map"), ("ppo_dynamic", "scripted"), ("hd_bugg", "hd_bug")]
)
def test_an_expert_that_cannot_be_asked_is_refused(expert: str, said: str, tmp_path: Path) -> None:
    settings = load_settings({"algo": "dagger", "scenarios": ["dynamic"], "expert": expert})
    with pytest.raises(ValueError, match=said):
        train_offline(settings, tmp_path / "model")  # type: ignore[arg-type]
    assert not (tmp_path / "model").exists()


def test_an_expert_is_asked_about_one_robot() -> None:
    with pytest.raises(ValueError, match="an expert is asked about one robot, dynamic has 2"):
        make_expert("bug2", load(SCENARIO, {"robots.count": 2}))


# ----------------------------------------------------------------------------------------------- trainings and folders


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cloned model's folder."""
    folder = tmp_path_factory.mktemp("clone") / "model"
    train_offline(tiny("bc"), folder, episodes=answered(3))
    return folder


@pytest.mark.parametrize("name", ["bc_hd_bug", "iql_mixed", "td3_bc_mixed", "dagger_hd_bug"])
def test_each_training_by_name_makes_a_folder_that_plays(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    is_dagger = name == "dagger_hd_bug"
    if not is_dagger:
        pytest.importorskip("minari", reason="minari comes with the extra `data`")
    changes = {key: value for key, value in TINY.items() if key != "scenarios"}
    changes |= {"episodes_per_round": 3, "expert": "bug2"} if is_dagger else {"data": DATA}
    words = [word for key, value in changes.items() for word in ("--set", f"{key}={json.dumps(value)}")]
    assert main(["train", name, *words]) == 0
    folder = tmp_path / "results" / "train" / name
    assert f"results/train/{name}" in capsys.readouterr().out
    config = read_config(folder)
    assert config["settings"] == json.loads(load_settings(name, changes).model_dump_json())
    assert [point["steps"] for point in config["runs"]["0"]["curve"]] == [20, 40]
    card = (folder / "card.md").read_text(encoding="utf-8")
    assert f"bug-gym train {name}" in card and "of stable-baselines3" not in card and "Learnt from: " in card
    if not is_dagger:
        expected = {"scenario": "dynamic", "first_seed": TRAINING_SEEDS, "episodes": 6}
        assert {key: config["data"][key] for key in expected} == expected
        assert "6 episodes of bug2, random in worlds of dynamic" in card
    simulation = Simulation(SCENARIO)
    played = play(make_policy(f"{folder}/", simulation), SCENARIO, range(3))
    assert (played.outcome > 0).all()
    made_at = (folder / "policy.onnx").stat().st_mtime_ns
    assert main(["train", name, *words]) == 0
    assert (folder / "policy.onnx").stat().st_mtime_ns == made_at  # what is done is not done again


@pytest.mark.parametrize("algo", ["bc", "iql", "td3_bc", "dagger"])
def test_the_same_seed_makes_the_same_model_and_another_one_another(algo: str, tmp_path: Path) -> None:
    settings = tiny(algo, history=[2])
    episodes = None if algo == "dagger" else answered(3)
    for name, seed in (("one", 3), ("again", 3), ("other", 4)):
        train_offline(settings, tmp_path / name, episodes=episodes, seed=seed)
    one, again, other = (weights(tmp_path / name) for name in ("one", "again", "other"))
    assert same(one, again) and not same(one, other)


def test_a_folder_that_learnt_from_other_episodes_is_refused(clone: Path) -> None:
    again = answered(3)
    train_offline_seeds(tiny("bc"), clone, episodes=again)  # is done already
    other = replace(again, origin={"policy": "bug1"})
    for train_it in (train_offline, train_offline_seeds):
        with pytest.raises(ValueError, match="other episodes.*policy"):
            train_it(tiny("bc"), clone, episodes=other)


def test_the_graph_answers_as_the_network(clone: Path) -> None:
    settings = load_settings(read_config(clone)["settings"])
    actor = make_actor(settings, 9)  # type: ignore[arg-type]
    actor.load_state_dict(weights(clone))
    seen = answered(2).observations
    answers, _ = make_policy(f"{clone}/", SCENARIO).predict(seen)
    assert np.allclose(answers, actor.predict(seen, deterministic=True)[0], atol=1e-5)


def test_a_ppo_training_begins_with_a_clone_and_a_clone_with_a_ppo_model(clone: Path, tmp_path: Path) -> None:
    still = {"n_timesteps": 128, "learning_rate": 1e-30, "start_from": str(clone)}
    worlds = {"n_envs": 8, "n_steps": 16, "batch_size": 32, "eval_episodes": 4, "test_episodes": 4}
    settings = load_settings({"algo": "ppo", "scenarios": ["dynamic"], "overrides": SHORT, **worlds, **still})
    train(settings, tmp_path / "ppo", threads=1, tensorboard=False)
    first, second = weights(clone), weights(tmp_path / "ppo")
    assert first.keys() == second.keys() and all(torch.allclose(first[name], second[name]) for name in first)
    back = tiny("bc", learning_rate=1e-30, start_from=str(tmp_path / "ppo"))
    train_offline(back, tmp_path / "back", seed=7, episodes=answered(2))
    third = weights(tmp_path / "back")
    assert all(torch.allclose(first[name], third[name]) for name in first)
    wide = tiny("bc", policy_kwargs={"net_arch": [8]}, start_from=str(clone))
    with pytest.raises(ValueError, match="is of another network: policy_kwargs.net_arch was"):
        train_offline(wide, tmp_path / "wide", episodes=answered(2))
    with pytest.raises(ValueError, match="trained offline"):
        rebuild(clone)


def test_worlds_of_dagger_are_those_of_trainings_and_never_the_same_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bug_gym.agents.learning import offline

    seen: list[range] = []

    def asked(expert: Any, learner: Any, scenario: Any, seeds: range, rows: int) -> Recorded:
        seen.append(seeds)
        return ask(expert, learner, scenario, seeds, rows)

    monkeypatch.setattr(offline, "ask", asked)
    for seed in (0, 1):
        train_offline(tiny("dagger"), tmp_path / str(seed), seed=seed)
    worlds = [number for seeds in seen for number in seeds]
    assert len(set(worlds)) == len(worlds) == 12
    assert min(worlds) >= TRAINING_SEEDS and max(worlds) < VALIDATION_SEEDS


def test_minutes_end_a_training_at_a_validation(tmp_path: Path) -> None:
    kept = train_offline(tiny("bc"), tmp_path, episodes=answered(2), minutes=1e-9)
    assert [point.steps for point in kept.points] == [20]
    assert read_config(tmp_path)["runs"]["0"]["curve"][-1]["steps"] == 20


@pytest.mark.parametrize("algo", ["bc", "dagger"])
def test_what_minutes_ended_is_not_begun_again(algo: str, tmp_path: Path) -> None:
    episodes = None if algo == "dagger" else answered(2)
    train_offline_seeds(tiny(algo), tmp_path, episodes=episodes, seeds=[0, 1], minutes=1e-9)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("seed-*/[cp]*")}
    train_offline_seeds(tiny(algo), tmp_path, episodes=episodes, seeds=[0, 1], minutes=1e-9)  # both are done
    with pytest.raises(ValueError, match="seed-0 holds a model whose training was ended after 20 of 40 steps by --min"):
        train_offline_seeds(tiny(algo), tmp_path, episodes=episodes, seeds=[0, 1])
    with pytest.raises(ValueError, match="it cannot be gone on with: give a new --out"):
        train_offline(tiny(algo), tmp_path / "seed-0", episodes=episodes)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("seed-*/[cp]*")} == before


@pytest.mark.parametrize("origins", [({}, {}), ({"policy": "bug1"}, {"policy": "bug2"})])
def test_what_is_left_of_other_episodes_is_refused(
    origins: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*arguments: Any, **keywords: Any) -> None:
        raise KeyboardInterrupt

    one, other = (replace(answered(count), origin=origin) for count, origin in zip((2, 3), origins, strict=True))
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(offline, "write_best", stopped)
        train_offline(tiny("bc"), tmp_path, episodes=one)
    (left,) = tmp_path.glob("best-*")
    before = weights(left)
    for train_it in (train_offline, train_offline_seeds):
        with pytest.raises(ValueError, match=r"best-\d+ is of another training: it learnt from other episodes"):
            train_it(tiny("bc"), tmp_path, episodes=other)
    assert same(weights(left), before)
    train_offline(tiny("bc"), tmp_path, episodes=one)
    assert not left.exists() and read_config(tmp_path)["runs"]["0"]["held_out"]


def test_the_command_on_a_card_names_a_dataset_that_was_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("minari", reason="minari comes with the extra `data`")
    monkeypatch.chdir(tmp_path)
    changes = {key: value for key, value in TINY.items() if key != "scenarios"} | {"data": DATA}
    words = [word for key, value in changes.items() for word in ("--set", f"{key}={json.dumps(value)}")]
    assert main(["train", "bc_hd_bug", *words, "--out", "collected"]) == 0
    (given,) = {
        path.parents[1].as_posix() for path in Path().rglob("*_flat-v0/data/metadata.json") if "mixed" in str(path)
    }
    changed = [*words[:-2], "--set", 'data={"policies": ["hd_bug"], "episodes": 9}']  # `data` came last
    assert main(["train", "bc_hd_bug", *changed, "--dataset", given, "--out", "given"]) == 0
    told = {}
    for name in ("collected", "given"):
        found = re.search("Made again by `(.*)`;", Path(name, "card.md").read_text(encoding="utf-8"))
        assert found is not None
        told[name] = shlex.split(found[1])
    assert "--dataset" not in told["collected"]
    assert told["given"][told["given"].index("--dataset") + 1] == given
    for name, command in told.items():
        assert main([*command[1:], "--out", f"{name}-again"]) == 0
        assert same(weights(Path(name)), weights(Path(f"{name}-again")))


@pytest.mark.parametrize(
    ("first", "counts", "known"),
    [
        (0, (3,), 3),
        (2, (3,), 2),
        (0, (9,), 4),
        (1, (2, 3), 3),  # two policies, in the same worlds
        (4, (3,), 0),
        (TRAINING_SEEDS, (3,), 0),
    ],
)
def test_worlds_that_a_model_has_learnt_from_are_not_called_held_out(
    first: int, counts: tuple[int, ...], known: int, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    about = {"scenario": "dynamic", "first_seed": first}
    parts = {f"driver {count}": {**about, "policy": f"driver {count}", "episodes": count} for count in counts}
    (alone, *others) = parts.values()
    origin = alone | ({"policy": "mixed", "episodes": sum(counts), "of": parts} if others else {})
    episodes = replace(answered(3), origin=origin)
    assert len(range(max(first, TEST_SEEDS), min(first + max(counts), TEST_SEEDS + 4))) == known  # 4 test_episodes
    with caplog.at_level(logging.WARNING, logger="bug_gym"):
        train_offline(tiny("bc", name=f"from {first} {counts}"), tmp_path, episodes=episodes)
    card = (tmp_path / "card.md").read_text(encoding="utf-8")
    is_told = (
        f"{known} of the 4 worlds that from {first} {counts} is judged in are those of its episodes" in caplog.text
    )
    assert is_told == (f"of which {known} of 4 are not held out" in card) == (known > 0)
    assert ("Results in worlds held out from training" in card) == (known == 0)


def test_a_card_says_with_which_parameters_its_drivers_drove(tmp_path: Path) -> None:
    told = {"policy": "bug2", "parameters": {"turn": "right"}, "scenario": "dynamic", "first_seed": TRAINING_SEEDS}
    episodes = replace(answered(3), origin={**told, "episodes": 3})
    train_offline(tiny("bc"), tmp_path, episodes=episodes)
    assert "Learnt from: 3 episodes of bug2:turn=right in worlds" in (tmp_path / "card.md").read_text(encoding="utf-8")


def test_the_command_on_a_card_says_that_episodes_were_handed_in(clone: Path) -> None:
    assert "bug-gym train custom.yaml --dataset DATASET --threads 1`" in (clone / "card.md").read_text(encoding="utf-8")


# ------------------------------------------------------------------------------------------------------------ bad input


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"scenarios": ["dynamic", "static"]}, "scenarios"),
        ({"action": "discrete"}, "action"),
        ({"expectile": 1.5}, "expectile"),
        ({"alpha": 1.0}, "alpha"),
        ({"data": {"policies": [], "episodes": 3}}, "policies"),
        ({"data": {"policy": "bug2"}}, "policies"),
    ],
)
def test_a_setting_that_cannot_be_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        tiny("iql", **changes)


@pytest.mark.parametrize("policy", ["mine.py:Mine", "mine:Mine:turn=left", "model.zip:trust=true"])
@pytest.mark.parametrize("algo", ["bc", "iql", "td3_bc", "dagger"])
def test_a_training_grants_no_trust_to_the_policies_that_it_names(algo: str, policy: str) -> None:
    own = {"expert": policy} if algo == "dagger" else {"data": {"policies": ["bug2", policy], "episodes": 3}}
    with pytest.raises(ScenarioError, match=f"policy '{policy}': to ask it runs its code: .*--trust"):
        tiny(algo, **own)
    load_settings({"algo": algo, **TINY, **own}, trust=True)


@pytest.mark.parametrize(("algo", "episodes"), [("bc", None), ("dagger", hand_made())])
def test_a_training_without_what_it_learns_from_is_refused(algo: str, episodes: Any, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=f"{algo}: expected"):
        train_offline(tiny(algo), tmp_path, episodes=episodes)


@pytest.mark.parametrize("name", ["ppo_dynamic", "dagger_hd_bug"])
def test_a_training_that_takes_no_dataset_says_so(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["train", name, "--dataset", str(tmp_path)]) == 2
    assert "dataset" in capsys.readouterr().err


def test_each_trainer_refuses_the_others_settings(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="bc learns offline"):
        train(tiny("bc"), tmp_path / "model")
    assert not (tmp_path / "model").exists()


def test_offline_settings_are_those_of_the_table() -> None:
    settings: AnySettings = load_settings("bc_hd_bug")
    assert robot_of(settings.loaded).beams == 64 and settings.history == ()


@pytest.mark.parametrize("algo", ["bc", "td3_bc"])
def test_a_training_that_diverges_says_which_when_and_at_what_rate(algo: str, tmp_path: Path) -> None:
    told = rf"^custom \({algo}, seed 2\) has diverged after \d+ of 40 steps: its network answers with NaN .* learning_rate is 1"
    with pytest.raises(ValueError, match=told):
        train_offline(tiny(algo, learning_rate=1e9), tmp_path, episodes=answered(), seed=2)
