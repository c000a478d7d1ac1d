"""What a training is, as data: configs/train/*.yaml with the key names of rl-baselines3-zoo."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticSerializationError

from bug_gym.agents.learning.beside import beside
from bug_gym.agents.learning.curriculum import Curriculum, Stage, require_stages
from bug_gym.agents.learning.history import Lags
from bug_gym.agents.model_places import model_digest, policy_digest
from bug_gym.agents.outside import Spec, imported_class, reference_by_name
from bug_gym.config import (
    SCENARIO_FOLDER,
    Scenario,
    ScenarioError,
    dump,
    expanded,
    explain,
    load,
    names_file,
    read_yaml,
)
from bug_gym.naming import nearest_hint
from bug_gym.references import code_digest, is_reference
from bug_gym.scenario_code import data_digest, own_code
from bug_gym.schema.errors import shortened, wrong
from bug_gym.schema.values import (
    AtLeastOne,
    Coefficient,
    Count,
    Episodes,
    Name,
    NotNegative,
    Number,
    Part,
    Samples,
    Share,
    Steps,
    Width,
)

TRAIN_FOLDER = SCENARIO_FOLDER.parent / "train"

LearningRate = Coefficient | str
"""A number, or "lin_NUMBER": from there straight down to 0 at the end, as rl-zoo writes it."""


class PolicyKwargs(Part):
    """The network behind the encoding of the observation."""

    net_arch: tuple[Width, ...] = (128, 128)
    """Widths of the hidden layers; actor and critic have their own."""
    activation_fn: Literal["relu", "tanh"] = "relu"
    """Between the layers."""
    log_std_init: Number = -0.5
    """Logarithm of the standard deviation of PPO's actions at the start."""


class Settings(Part):
    """What all trainings have. Keys that rl-zoo has too are named as there."""

    name: Name = "custom"
    """What the model is called; a file's stem where the file gives none."""
    scenarios: tuple[str | dict[str, Any], ...] = Field(min_length=1)
    """Scenarios to train in, each with the same share of the worlds; they need the same robot. Paths are relative to the
    training's file, as all in it."""
    overrides: dict[str, Any] = {}
    """Values by dotted key that replace those of every scenario: most of all the weights of the reward."""
    action: Literal["continuous", "discrete"] = "continuous"
    """Which actions the robot takes."""
    policy: Literal["MlpPolicy"] = "MlpPolicy"
    """Class of the policy in stable-baselines3; observations are flat."""
    n_envs: AtLeastOne
    """Worlds side by side."""
    n_timesteps: Steps
    """Environment steps of the whole training."""
    gamma: Share = 0.99
    """Discount of a step."""
    learning_rate: LearningRate = "lin_1e-3"
    """Step size of the optimiser."""
    batch_size: Samples
    """Samples of a gradient step."""
    policy_kwargs: PolicyKwargs = PolicyKwargs()
    """The network."""
    encoding: Literal["clearance", "linear"] = "clearance"
    """How ranges are encoded."""
    history: Lags = ()
    """How many steps ago a History looks; empty: the policy has no memory."""
    start_from: str | None = None
    """Name or folder of a model of ours with the same network (layers, activation, encoding, action, history), whose weights it
    begins with; none: from scratch."""
    eval_freq: Steps = 500_000
    """Environment steps from one validation to the next."""
    eval_episodes: Episodes = 1000
    """Validation worlds of each scenario."""
    test_episodes: Episodes = 2000
    """Held-out worlds of each scenario in which the best model is judged at the end."""
    save_freq: Steps = 250_000
    """Environment steps from one checkpoint to the next."""
    _trust: bool = PrivateAttr(default=False)  # no key: data cannot grant itself trust
    _said: dict[str, tuple[dict[str, Any], ...]] = PrivateAttr(default_factory=dict)  # by `worlds`, see `_as_read`
    _read: dict[str, tuple[Scenario, ...]] = PrivateAttr(default_factory=dict)  # likewise, of this process
    _made_of: dict[str, str] = PrivateAttr(default_factory=dict)  # likewise

    @property
    def loaded(self) -> tuple[Scenario, ...]:
        """The scenarios with their overrides; their own functions are imported where `load_settings` was told to trust."""
        return self._as_read("scenarios", lambda: tuple(load(source, self.overrides) for source in self.scenarios))

    @property
    def worlds(self) -> dict[str, tuple[Scenario, ...]]:
        """All scenarios that are learned in, by the key that names them."""
        return {"scenarios": self.loaded}

    @property
    def named(self) -> dict[str, str]:
        """Models and policies that the training learns from, by the key that names them."""
        return {} if self.start_from is None else {"start_from": self.start_from}

    @property
    def made_of(self) -> dict[str, str]:
        """Digests of what the settings only name, as it was when first asked.

        That are scenarios, their own code and files, and what is `named`, where it is not the package's.

        Raises:
            ValueError: a file of code was changed after it was imported, or code is named that nobody has trusted.
        """
        if not self._made_of:
            of_named = {key: told for key, policy in self.named.items() if (told := _digest_of(policy))}
            self._made_of |= _digests(self.worlds) | of_named
        return self._made_of

    def _as_read(self, key: str, read: Callable[[], tuple[Scenario, ...]]) -> tuple[Scenario, ...]:
        """Scenarios as their files said when first read: these may change while a training runs, or waits for a worker."""
        if key not in self._read:
            if key not in self._said:
                self._said[key] = tuple(map(dump, read()))
            self._read[key] = tuple(load(said, trust=self._trust) for said in self._said[key])
        return self._read[key]

    def __getstate__(self) -> dict[Any, Any]:
        """Without what holds imported code, which another process imports by itself."""
        state = super().__getstate__()
        kept = {"_trust": self._trust, "_said": self._said, "_read": {}, "_made_of": {}}
        return {**state, "__pydantic_private__": kept}

    def trusting(self, trust: bool) -> Self:
        """The same settings, whose scenarios may run the functions that they name or not."""
        copy = self.model_copy()
        copy._trust, copy._read, copy._made_of = trust, {}, {}
        return copy

    def rate(self, remaining: float) -> float:
        """The step size where a share `remaining` of the training is left."""
        if isinstance(self.learning_rate, str):
            return remaining * _linear_start(self.learning_rate)
        return self.learning_rate


def _digests(worlds: Mapping[str, Sequence[Scenario]]) -> dict[str, str]:
    """Of scenarios, and of their own code and files where they have some, by where they stand."""
    told: dict[str, str] = {}
    for key, scenarios in worlds.items():
        for number, scenario in enumerate(scenarios):
            place = f"{key}.{number}"
            told[place] = scenario.digest
            told |= {f"{place}.{name}": digest for name, digest in own_code(scenario).items()}
            told |= {f"{place}.data": data} if (data := data_digest(scenario)) else {}
    return told


def _digest_of(policy: str) -> str:
    """Of the code or the model that a policy is named by, and the models among its parameters; "" where there is none."""
    spec = Spec.of(policy)
    reference = reference_by_name(spec.name)
    own = code_digest(imported_class(reference)) if reference else model_digest(spec.name)
    return policy_digest(own, spec.parameters)


def _linear_start(text: str) -> float:
    match = re.fullmatch(r"lin_(\d+(?:\.\d*)?(?:e-?\d+)?)", text)
    if match is None or float(match[1]) <= 0.0:
        raise ValueError(
            f"learning_rate: got {shortened(text)}, expected a number, or lin_ and a number, such as lin_1e-3"
        )
    return float(match[1])


class PPOSettings(Settings):
    """Proximal policy optimisation, Schulman et al. 2017."""

    algo: Literal["ppo"]
    n_envs: AtLeastOne = 1024
    batch_size: Annotated[Samples, Field(ge=2)] = 8192
    """Samples of a gradient step; their advantages are set against one another."""
    n_steps: AtLeastOne = 32
    """Steps of each world from one update to the next."""
    n_epochs: AtLeastOne = 4
    """Times that an update goes through its samples."""
    gae_lambda: Share = 0.95
    """Of generalised advantage estimation."""
    clip_range: Coefficient = 0.2
    """How far an update may change the probability of an action, as a share."""
    ent_coef: NotNegative = 0.0
    """Weight of the entropy."""
    vf_coef: NotNegative = 0.5
    """Weight of the value's error."""
    max_grad_norm: Coefficient = 0.5
    """Gradients are cut to this length."""
    curriculum: Curriculum = ()
    """Stages of the worlds that it learns in, before or instead of `scenarios`, by which it is judged; empty: `scenarios`."""

    @model_validator(mode="after")
    def _stages_follow_one_another(self) -> Self:
        require_stages(self.curriculum)
        return self

    @model_validator(mode="after")
    def _compares_samples(self) -> Self:
        if self.n_steps * self.n_envs < 2:
            raise wrong("got 1 with n_envs 1, expected 2 samples or more from one update to the next", "n_steps")
        return self

    @model_serializer(mode="wrap")
    def _shortest(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data: dict[str, Any] = handler(self)
        return data if self.curriculum else {key: value for key, value in data.items() if key != "curriculum"}

    @property
    def stages(self) -> tuple[tuple[Scenario, ...], ...]:
        """The scenarios of each stage of the curriculum."""
        return tuple(
            self._as_read(f"curriculum.{number}.scenarios", partial(self._stage, stage))
            for number, stage in enumerate(self.curriculum)
        )

    def _stage(self, stage: Stage) -> tuple[Scenario, ...]:
        sources = stage.scenarios or self.scenarios
        return tuple(load(load(source, self.overrides), stage.overrides) for source in sources)

    @property
    def worlds(self) -> dict[str, tuple[Scenario, ...]]:
        """All scenarios that are learned in or judged by, by the key that names them."""
        stages = {f"curriculum.{number}.scenarios": stage for number, stage in enumerate(self.stages)}
        return super().worlds | stages


class OffPolicySettings(Settings):
    """What algorithms with a replay buffer have."""

    n_envs: AtLeastOne = 64
    batch_size: Samples = 512
    learning_rate: LearningRate = 1e-3
    buffer_size: Samples = 300_000
    """Steps that are kept."""
    learning_starts: Count = 10_000
    """Steps before the first update."""
    train_freq: AtLeastOne = 1
    """Steps of each world from one update to the next."""
    gradient_steps: AtLeastOne = 4
    """Gradient steps of an update."""
    tau: Share = 0.005
    """Share by which the target network follows."""

    @model_validator(mode="after")
    def _learns_at_all(self) -> Self:
        at_once = self.n_envs * self.train_freq
        steps = at_once * -(-self.n_timesteps // at_once)
        if self.learning_starts >= steps:
            took = f"the training has {steps:,} steps, and would learn nothing"
            raise wrong(f"got {self.learning_starts}, expected less: {took}", "learning_starts")
        return self


class SACSettings(OffPolicySettings):
    """Soft actor-critic, Haarnoja et al. 2018."""

    algo: Literal["sac"]
    action: Literal["continuous"] = "continuous"
    """Which actions the robot takes."""
    ent_coef: str | Coefficient = "auto_0.05"
    """Weight of the entropy; "auto_X" learns it from X on."""
    target_entropy: Number = -2.0
    """Entropy that "auto" keeps."""

    @model_validator(mode="after")
    def _entropy_has_a_weight(self) -> Self:
        if isinstance(self.ent_coef, str) and self.ent_coef != "auto" and not _is_weight(self.ent_coef):
            came = f"got {shortened(self.ent_coef)}"
            raise wrong(
                f"{came}, expected a number, auto, or auto_ and a number above 0, such as auto_0.05", "ent_coef"
            )
        return self


def _is_weight(text: str) -> bool:
    try:
        return 0.0 < float(text.removeprefix("auto_")) < math.inf
    except ValueError:
        return False


class DQNSettings(OffPolicySettings):
    """Deep Q-learning, Mnih et al. 2015, over the discrete actions."""

    algo: Literal["dqn"]
    action: Literal["discrete"] = "discrete"
    """Which actions the robot takes."""
    target_update_interval: AtLeastOne = 64
    """Steps of the worlds from one update of the target network to the next."""
    n_steps: AtLeastOne = 1
    """Steps whose rewards are summed before the value of what follows is added."""
    exploration_fraction: Share = 0.3
    """Share of the training over which random actions grow rare."""
    exploration_final_eps: Share = 0.05
    """Share of random actions from then on."""


class Data(Part):
    """Episodes that an offline training learns from, collected first where it is given none."""

    policies: tuple[str, ...] = Field(min_length=1)
    """Who drives, NAME[:PARAMETER=VALUE...]; several: the dataset of all their episodes."""
    episodes: Episodes
    """Worlds, an episode of each policy."""


class OfflineSettings(Settings):
    """What trainings have that learn from what others did, not from trying."""

    scenarios: tuple[str | dict[str, Any], ...] = Field(min_length=1, max_length=1)
    """The scenario of the episodes, in which the model is judged."""
    n_envs: AtLeastOne = 64
    """Worlds side by side, where worlds are driven in."""
    n_timesteps: Steps = 4_000
    """Gradient steps of the whole training."""
    batch_size: Samples = 256
    """Steps of episodes that a gradient step learns from."""
    eval_freq: Steps = 2_000
    """Gradient steps from one validation to the next; in DAgger as well from one round of questions to the next."""
    eval_episodes: Episodes = 500
    """Validation worlds."""
    test_episodes: Episodes = 1000
    """Held-out worlds in which the best model is judged at the end."""
    gamma: Share = 0.99
    """Discount of a step."""
    reward_scale: Coefficient = 0.1
    """Rewards are multiplied by it, so that returns are a few units [1]."""


class FromDataSettings(OfflineSettings):
    """What offline trainings have that are given episodes."""

    data: Data
    """What it learns from."""

    @property
    def named(self) -> dict[str, str]:
        """As Settings have it, and the policies whose episodes they are."""
        drivers = {f"data.policies.{number}": policy for number, policy in enumerate(self.data.policies)}
        return {**super().named, **drivers}


class CloningSettings(FromDataSettings):
    """Behaviour cloning, Pomerleau 1991."""

    algo: Literal["bc"]
    action: Literal["continuous"] = "continuous"
    """Which actions the robot takes."""
    keep_best: Share = 1.0
    """Share of the episodes, those with the highest returns, that it learns from."""


class CriticSettings(FromDataSettings):
    """What offline trainings have that ask what an action is worth."""

    action: Literal["continuous"] = "continuous"
    """Which actions the robot takes."""
    n_steps: AtLeastOne = 10
    """Steps whose rewards are summed before the value of what follows is added. A step of 0.1 s is a hundredth of an episode:
    one at a time, what a collision costs would need thousands of gradient steps to be known a second before it."""
    tau: Share = 0.02
    """Share by which the target networks follow."""


class IQLSettings(CriticSettings):
    """Implicit Q-learning, Kostrikov, Nair and Levine 2021."""

    algo: Literal["iql"]
    expectile: Share = 0.9
    """Of what recorded actions are worth, which a state is worth: 0.5 is their mean, 1 their maximum."""
    beta: NotNegative = 20.0
    """How much more actions weigh that were worth more, in exp(beta * advantage) [1]; of a second of driving one is worth some
    hundredths more than another."""


class TD3BCSettings(CriticSettings):
    """TD3+BC, Fujimoto and Gu 2021."""

    algo: Literal["td3_bc"]
    alpha: Coefficient = 2.5
    """Weight of the values against nearness to the recorded actions [1]."""
    policy_delay: AtLeastOne = 2
    """Gradient steps of the critics for one of the actor."""
    policy_noise: NotNegative = 0.2
    """Standard deviation of the noise on the next action that the critics learn from [1]."""
    noise_clip: NotNegative = 0.5
    """That noise is cut to this [1]."""


class DaggerSettings(OfflineSettings):
    """DAgger, Ross, Gordon and Bagnell 2011: the expert is asked again, along the learner's own ways."""

    algo: Literal["dagger"]
    action: Literal["continuous", "discrete"] = "continuous"
    """Which actions the robot takes; of discrete ones a probability is learnt, so that two ways round are not made one."""
    expert: str
    """Name of a scripted policy that is asked."""
    episodes_per_round: Episodes = 50
    """Worlds that are driven in before every `eval_freq` gradient steps, the first of them by the expert."""
    answer_width: NotNegative = 0.0
    """Of discrete actions: how far from an answer another action is still partly right, as the standard deviation of a bell
    over what is driven, whose numbers go from -1 to 1 [1]; 0: none is. Where it is not 0 a second network, for which none is,
    drives in the worlds of training."""

    @property
    def named(self) -> dict[str, str]:
        """As Settings have it, and the expert."""
        return {**super().named, "expert": self.expert}


FromData = CloningSettings | IQLSettings | TD3BCSettings
"""Of an offline training that is given episodes."""
AnyOffline = FromData | DaggerSettings
"""Of an offline training."""
AnySettings = PPOSettings | SACSettings | DQNSettings | AnyOffline
"""Of a training."""

ALGORITHMS: dict[str, type[AnySettings]] = {
    "ppo": PPOSettings,
    "sac": SACSettings,
    "dqn": DQNSettings,
    "bc": CloningSettings,
    "iql": IQLSettings,
    "td3_bc": TD3BCSettings,
    "dagger": DaggerSettings,
}
"""Settings by `algo`."""


def training_names() -> list[str]:
    """Names of the trainings that come with the package, sorted."""
    return sorted(path.stem for path in TRAIN_FOLDER.glob("*.yaml"))


def load_settings(
    source: str | Path | Mapping[str, Any], overrides: Mapping[str, Any] | None = None, *, trust: bool = False
) -> AnySettings:
    """The settings of a training.

    Args:
        source: a name from `training_names()`, the path of a YAML file, or a mapping that says the same.
        overrides: values by key that replace the file's; `overrides` replaces all of the training's own, a key below it
            such as `overrides.world.obstacles` that one alone, as `policy_kwargs.net_arch` does below `policy_kwargs`.
        trust: whether code that its scenarios name may be imported, which runs the code of their modules, and whether it may
            name policies that are code.

    Raises:
        ScenarioError: where something is unknown, missing or not allowed.
    """
    label, data = _read(source)
    data = _changed(label, data, overrides or {})
    algo = data.get("algo")
    if algo is None:
        raise ScenarioError(f"{label}: algo: missing, expected one of {', '.join(map(repr, ALGORITHMS))}")
    if not isinstance(algo, str) or algo not in ALGORITHMS:
        raise ScenarioError(f"{label}: algo: got {shortened(algo)}, expected one of {', '.join(map(repr, ALGORITHMS))}")
    try:
        settings = ALGORITHMS[algo].model_validate(data).trusting(trust)
        settings.rate(1.0)
        asked = json.loads(settings.model_dump_json())
        if not trust and (named := policies_of_code(asked)):
            why = "to ask it runs its code: pass trust=True (--trust) if you know where it comes from"
            raise ValueError(f"policy {shortened(named[0])}: {why}")
    except ValidationError as error:
        raise ScenarioError(explain(error, label)) from None
    except PydanticSerializationError:
        expected = "a training is plain data: name functions, such as my_module:my_function"
        raise ScenarioError(f"{label}: got what JSON cannot hold; {expected}") from None
    except ValueError as error:
        raise ScenarioError(f"{label}: {error}") from None
    try:
        _ = settings.worlds
    except ScenarioError as error:
        raise ScenarioError(f"{label}: {error}") from None
    return settings


def policies_of_code(settings: Mapping[str, Any]) -> list[str]:
    """The policies that a training names, as data, and that run code of their own: classes by name, and zips that it trusts."""
    data = settings.get("data") or {}
    named = [settings.get("expert"), *data.get("policies", ())]
    specs = [(policy, Spec.of(policy)) for policy in named if policy is not None]
    return [policy for policy, spec in specs if is_reference(spec.name) or "trust" in spec.options]


def _changed(label: str, data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The data of a training with other values; one below a key, such as `policy_kwargs.net_arch`, is added to its own.

    Raises:
        ScenarioError: it is below a key that has no keys.
    """
    changed = {**data, **{key: value for key, value in overrides.items() if "." not in key}}
    for key, value in overrides.items():
        part, dot, below = key.partition(".")
        if dot:
            own = changed.get(part, {})
            if not isinstance(own, Mapping):
                raise ScenarioError(f"{label}: {part}: got {shortened(own)}, expected keys and values, as {key} is one")
            changed[part] = {**own, below: value}
    return changed


def read_curriculum(source: str | Path) -> Any:
    """The stages that a training, or a YAML file with the key `curriculum`, says.

    Raises:
        ScenarioError: there is none, or it says nothing of stages.
    """
    label, data = _read(source)
    if not data.get("curriculum"):
        raise ScenarioError(f"{label}: got no curriculum, expected the key `curriculum` with a list of stages")
    return data["curriculum"]


def _read(source: str | Path | Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    if isinstance(source, Mapping):
        return "training", dict(source)
    if isinstance(source, str) and not names_file(source):
        if source not in training_names():
            known = ", ".join(training_names())
            raise ScenarioError(
                f"no training {shortened(source, 300)}{nearest_hint(source, training_names())} (known: {known})"
            )
        source = TRAIN_FOLDER / f"{source}.yaml"
    path = expanded(source)
    return path.name, beside(path.parent, read_yaml(path, training_names()))
