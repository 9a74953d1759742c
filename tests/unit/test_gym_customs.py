"""What CartPole and Gymnasium's synchronous vector environment do with what users give them, ours do too."""

import copy
import pickle
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import ClipAction, RescaleAction
from phototaxis_sim import arenas

OURS, MEASURE = "phototaxis_gym:phototaxis/LightSeeker-v0", "CartPole-v1"
SYNC = {"num_envs": 3, "vectorization_mode": "sync"}
MASK = np.array([True, False, True])
Case = Callable[[Callable[..., Any]], Any]


def one_seed(seed: Any) -> Case:
    def case(make: Callable[..., Any]) -> Any:
        """Whether the seed gives the same observations twice, in the episodes that follow, too."""
        environment = make()
        episodes = [[environment.reset(seed=seed)[0], environment.reset()[0], environment.reset()[0]] for _ in range(2)]
        return seed is None or np.array_equal(episodes[0], episodes[1])

    return case


def one_action(action: Any) -> Case:
    def case(make: Callable[..., Any]) -> Any:
        environment = make()
        environment.reset(seed=1)
        _, reward, terminated, truncated, info = environment.step(action)
        return type(float(reward)), type(terminated), type(truncated), type(info)

    return case


def many_actions(actions: Any) -> Case:
    def case(make: Callable[..., Any]) -> Any:
        environment = make()
        environment.reset(seed=1)
        return [(part.dtype, part.shape) for part in environment.step(actions)[1:4]]

    return case


def reset_with(**given: Any) -> Case:
    def case(make: Callable[..., Any]) -> Any:
        environment = make()
        before, _ = environment.reset(seed=7)
        given_ = copy.deepcopy(given)
        after, info = environment.reset(**given_)
        return np.shape(after)[:1] == np.shape(before)[:1], np.array_equal(info.get("_pose", MASK), MASK)

    return case


def calls(*names: str, **options: Any) -> Case:
    """Methods one after another, on the environment as `make` wraps it."""

    def case(make: Callable[..., Any]) -> Any:
        environment = make(**options)
        arguments = {"step": ([0, 0, 0] if hasattr(environment, "num_envs") else 0,)}
        for name in names:
            getattr(environment, name)(*arguments.get(name, ()))
        return True

    return case


def drawn_seed_can_be_given_back(make: Callable[..., Any]) -> Any:
    environment = make()
    first, _ = environment.reset()
    seed = environment.unwrapped.np_random_seed
    return np.array_equal(first, environment.reset(seed=seed)[0])


def generator_of_the_user(make: Callable[..., Any]) -> Any:
    environment, found = make(), []
    for _ in range(2):
        environment.reset()
        environment.unwrapped.np_random = np.random.default_rng(5)
        found.append([environment.reset()[0], environment.reset()[0]])
    return np.array_equal(found[0], found[1])


def copied(by: Callable[[Any], Any]) -> Case:
    def case(make: Callable[..., Any]) -> Any:
        environment = make()
        environment.reset(seed=3)
        for _ in range(3):
            environment.step(1)
        other = by(environment)
        return all(np.array_equal(environment.step(1)[0], other.step(1)[0]) for _ in range(5))

    return case


def limit_of_steps(steps: Any, tried: int, **options: Any) -> Case:
    """Which of the steps truncates; actions that neither terminate CartPole's episode nor ours so soon."""

    def case(make: Callable[..., Any]) -> Any:
        environment = make(max_episode_steps=steps, **options)
        environment.reset(seed=1)
        action = [0, 0, 0] if hasattr(environment, "num_envs") else 0
        return [np.all(environment.step(action)[3]) for _ in range(tried)]

    return case


def warned(make: Callable[..., Any]) -> Any:
    environment = make()
    environment.reset(seed=1)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        return environment.render(), len([one for one in caught if "render" in str(one.message)]) > 0


ONE = {
    **{f"seed {seed!r}": one_seed(seed) for seed in (
        0, True, 2**53, 2**53 + 1, 2**63, 2**100, None, -1, 1.5, "7", np.int64(5), np.array(3), [1],
    )},
    **{f"action {action!r}": one_action(action) for action in (
        0, np.int64(1), np.uint8(1), np.array(1), True, np.array([1]), [1], 1.0, "1", 99, -1, None, np.bool_(1),
    )},
    "a drawn seed": drawn_seed_can_be_given_back,
    "a generator of the user": generator_of_the_user,
    "deepcopy": copied(copy.deepcopy),
    "pickle": copied(lambda environment: pickle.loads(pickle.dumps(environment))),  # noqa: S301
    "step before reset": calls("step"),
    "render before reset": calls("render", render_mode="rgb_array"),
    "render without a mode": warned,
    "closed twice": calls("reset", "close", "close"),
    "step after close": calls("reset", "close", "step"),
    "a list of frames": calls("reset", "step", "render", render_mode="rgb_array_list"),
    "no checker": calls("reset", "step", disable_env_checker=True),
    "an unknown option": calls("reset", nonsense=1),
    "an unknown reset option": reset_with(options={"nonsense": 1}),
    "reset options of no kind": reset_with(options=3),
    **{f"max_episode_steps {steps!r}": limit_of_steps(steps, 4) for steps in (4, None, -1, 0, -2, 2.5, "4")},
}  # fmt: skip

MANY = {
    **{f"seed {seed!r}": one_seed(seed) for seed in (
        0, True, 2**53 - 1, 2**63, 2**100, [1, 2, 3], (1, 2, 3), [5, 5, 5], [2**70, 1, 2],
        -1, 1.5, "7", "777", np.int64(5), np.array([1, 2, 3]), [1], [1, -2, 3], [1, 2.5, 3],
    )},
    **{f"actions {actions!r}": many_actions(actions) for actions in (
        [0, 1, 0], (0, 1, 0), np.array([0, 1, 0]), np.array([0, 1, 0], np.uint8), [np.array(0), np.int64(1), 0],
        [True, False, True], np.array([True, False, True]), np.array([0.0, 1.0, 0.0]), [0, 1], [0, 1, 0, 1],
        [0, 1, 99], [0, -1, 0], np.array([[0], [1], [0]]), np.zeros((3, 2)), None, 0, "010",
    )},
    **{f"reset {given}": reset_with(**given) for given in (
        {"options": {"reset_mask": MASK}}, {"options": {"reset_mask": MASK}, "seed": 5},
        {"options": {"reset_mask": MASK}, "seed": [1, None, 2]},
        {"options": {"reset_mask": MASK.tolist()}}, {"options": {"reset_mask": MASK[:2]}},
        {"options": {"reset_mask": MASK * 1}}, {"options": {"reset_mask": MASK & False}},
        {"options": {"reset_mask": None}},
    )},
    "a drawn seed": drawn_seed_can_be_given_back,
    "deepcopy": lambda make: copied_many(make, copy.deepcopy),
    "step before reset": calls("step"),
    "render before reset": calls("render", render_mode="rgb_array"),
    "closed twice": calls("reset", "close", "close"),
    "step after close": calls("reset", "close", "step"),
    "no checker": calls("reset", "step", disable_env_checker=True),
    "an unknown option": calls("reset", nonsense=1),
    **{f"max_episode_steps {steps!r}": limit_of_steps(steps, 4) for steps in (4, None, -1, 0, -2, 2.5, "4")},
}  # fmt: skip


def copied_many(make: Callable[..., Any], by: Callable[[Any], Any]) -> Any:
    environment = make()
    environment.reset(seed=3)
    other = by(environment)
    return all(np.array_equal(environment.step([1, 1, 1])[0], other.step([1, 1, 1])[0]) for _ in range(5))


def outcome(case: Case, make: Callable[..., Any]) -> Any:
    """What a case answers, or the error that it raises."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return case(make)
    except Exception as error:
        return error


def compare(measured: Any, ours: Any) -> None:
    if isinstance(measured, Exception):
        assert isinstance(ours, type(measured)), f"{measured!r} is measured, {ours!r} is ours"
    else:
        assert ours == measured


@pytest.mark.parametrize("case", ONE.values(), ids=ONE.keys())
def test_one_robot_does_what_cartpole_does(case: Case):
    compare(outcome(case, partial(gymnasium.make, MEASURE)), outcome(case, partial(gymnasium.make, OURS)))


@pytest.mark.parametrize("case", MANY.values(), ids=MANY.keys())
def test_many_robots_do_what_the_synchronous_environment_does(case: Case):
    measured = outcome(case, partial(gymnasium.make_vec, MEASURE, **SYNC))
    compare(measured, outcome(case, partial(gymnasium.make_vec, OURS, num_envs=3)))


@pytest.mark.parametrize("mode", AutoresetMode)
def test_ends_masks_and_infos_are_those_of_the_synchronous_environment(mode: AutoresetMode, quiet: str):
    """Many robots against Gymnasium's loop over single ones, in every mode, with every key of `info`."""
    options = {"percept": "sensors", "arena": quiet, "max_episode_steps": 40, "num_envs": 4}
    ours: Any = gymnasium.make_vec(OURS, **options, autoreset_mode=mode)
    sync: Any = gymnasium.make_vec(
        OURS, **options, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode.value}
    )
    rng, ends = np.random.default_rng(0), 0
    assert ours.metadata == sync.metadata
    same(ours.reset(seed=[4, 2**80, 9, 9]), sync.reset(seed=[4, 2**80, 9, 9]))
    for step in range(300):
        actions = rng.integers(9, size=4)
        mine, theirs = ours.step(actions), sync.step(actions)
        same(mine, theirs, step)
        over = theirs[2] | theirs[3]
        ends += over.sum()
        if mode == AutoresetMode.DISABLED and over.any():
            with pytest.raises(AssertionError, match="have ended"):  # the other one steps some robots before it fails
                ours.step(actions)
            same(ours.reset(options={"reset_mask": over}), sync.reset(options={"reset_mask": over.copy()}), step)
        elif step % 67 == 66:
            mask, pose = rng.random(4) < 0.5, (5.0 + rng.random(), 5.0, 1.0)
            mask[0] = True
            seed = (None, 5, [5, None, 6, None])[rng.integers(3)]
            for environment in (ours, sync):
                found = environment.reset(seed=seed, options={"reset_mask": mask.copy(), "pose": pose})
                assert found[1]["pose"][mask] == pytest.approx(np.array([pose] * mask.sum()))
            same(ours.reset(), sync.reset(), step)
    assert ends > 10


def same(ours: Any, theirs: Any, step: int = -1) -> None:
    """Compare answers of both; which keys there are, who has them, and their values where somebody has them."""
    assert type(ours) is type(theirs), step
    if isinstance(theirs, tuple):
        for mine, its in zip(ours, theirs, strict=True):
            same(mine, its, step)
    elif isinstance(theirs, dict):
        assert ours.keys() == theirs.keys(), step
        for key in theirs:
            if key == "final_obs":
                same(tuple(ours[key][ours["_final_obs"]]), tuple(theirs[key][theirs["_final_obs"]]), step)
            elif key in ("tick", "_tick"):  # single robots count for themselves
                continue
            elif isinstance(theirs[key], dict) or key.startswith("_"):
                same(ours[key], theirs[key], step)
            else:
                same(ours[key][theirs["_" + key]], theirs[key][theirs["_" + key]], step)
    else:
        np.testing.assert_allclose(np.asarray(ours, float), np.asarray(theirs, float), atol=1e-4, err_msg=str(step))


@pytest.mark.parametrize(
    "action",
    [
        [0.5, -0.5], (0.5, -0.5), np.array([0.5, -0.5]), np.array([0.5, -0.5], np.float32), [1, 0],
        np.array([1, 0], np.int8), np.array([1.0000001, -1.0000001]), [np.float64(0.5), 1],
    ],
)  # fmt: skip
def test_wheels_take_every_type_of_number(action):
    one, many = gymnasium.make(OURS, action="continuous"), gymnasium.make_vec(OURS, num_envs=2, action="continuous")
    one.reset(seed=1)
    many.reset(seed=1)
    pose = one.step(action)[4]["pose"]
    np.testing.assert_allclose(many.step([action, action])[4]["pose"][0], pose)
    np.testing.assert_allclose(many.step(np.array([action, action]))[4]["pose"][0], one.step(action)[4]["pose"])


@pytest.mark.parametrize(
    "action", [[0.5], [0.5, 0.5, 0.5], 0.5, [1.1, 0], [np.nan, 0], "no", ["0.5", "0"], None, [[0.5, 0.5]]]
)
def test_what_are_no_wheels_is_refused(action):
    one, many = gymnasium.make(OURS, action="continuous"), gymnasium.make_vec(OURS, num_envs=2, action="continuous")
    for environment in (one, many):
        environment.reset(seed=1)
    with pytest.raises(AssertionError, match="is not in Box"):
        one.unwrapped.step(action)
    with pytest.raises(AssertionError, match="is not in Box"):
        many.step([action, action])


def test_wrappers_of_actions_fit():
    wheels: Any = gymnasium.make(OURS, action="continuous")
    for wrapped, action in (
        (ClipAction(wheels), np.array([3.0, 0.5])),
        (RescaleAction(wheels, np.float32(0), np.float32(1)), np.array([1.0, 0.5])),
    ):
        wrapped.reset(seed=1)
        wrapped.step(action)


@pytest.mark.parametrize("steps", [1, 60, 150])
@pytest.mark.parametrize("by", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])  # noqa: S301
def test_a_copy_goes_on_as_the_original_does_to_the_last_bit(steps, by):
    """With robots that press against walls, and with episodes that began at different times."""
    rng = np.random.default_rng(steps)
    one = gymnasium.make(OURS, percept="sensors", max_episode_steps=100)
    many = gymnasium.make_vec(OURS, num_envs=20, percept="sensors", max_episode_steps=40)
    for environment, size in ((one, None), (many, 20)):
        environment.reset(seed=2, options={"pose": (5.0, 5.0, 0.3)})
        environment.reset(seed=3)
        for _ in range(steps):
            if environment.step(rng.choice([1, 3, 4, 4, 4], size=size))[3] is True:
                environment.reset()
        other = by(environment)
        for _ in range(90):
            actions = rng.choice([1, 3, 4, 4, 4, 8], size=size)
            for mine, its in zip(environment.step(actions), other.step(actions), strict=True):
                np.testing.assert_equal(mine, its)
        np.testing.assert_equal(environment.reset(), other.reset())


def test_more_steps_than_usual_are_given_as_gymnasium_has_it():
    one = gymnasium.make(OURS, max_episode_steps=400)
    many = gymnasium.make_vec(OURS, num_envs=2, max_episode_steps=400)
    endless = gymnasium.make_vec(OURS, num_envs=2, max_episode_steps=-1)
    for environment, action in ((one, 0), (many, [0, 0]), (endless, [0, 0])):
        environment.reset(seed=1)
        cut = [np.all(environment.step(action)[3]) for _ in range(400)]
        assert not any(cut[:-1])
        assert cut[-1] == (environment is not endless)
    assert gymnasium.spec("phototaxis/LightSeeker-v0").max_episode_steps == 300
    with pytest.raises(gymnasium.error.Error, match="max_episode_steps 0: an episode has at least one step"):
        gymnasium.make_vec(OURS, num_envs=2, max_episode_steps=0)
    with pytest.raises(TypeError, match=r"max_episode_steps 2\.5: it must be a whole number"):
        gymnasium.make_vec(OURS, num_envs=2, max_episode_steps=2.5)


def test_success_is_told_at_the_light_and_at_the_cap():
    environment = gymnasium.make(OURS, max_episode_steps=60)
    rng, told = np.random.default_rng(0), set()
    environment.reset(seed=0)
    for _ in range(3000):
        _, _, terminated, truncated, info = environment.step(rng.integers(9))
        assert info["is_success"] is terminated
        if terminated or truncated:
            told.add(info["is_success"])
            environment.reset()
    assert told == {True, False}


POSES = [
    ("x", "the heading in rad are needed"), ((1, 2), "are needed"), ((1, 2, 3, 4), "are needed"),
    ((1, 2, float("nan")), "are needed"), (None, "are needed"), ((-1, 2, 0), "no room for the robot there"),
    ((0.1, 5, 0), "no room"), ((1e9, 5, 0), "no room"),
]  # fmt: skip


@pytest.mark.parametrize(("pose", "line"), POSES)
@pytest.mark.parametrize("make", [partial(gymnasium.make, OURS), partial(gymnasium.make_vec, OURS, num_envs=2)])
def test_a_pose_without_room_is_one_line(make, pose, line):
    environment = make()
    environment.reset(seed=1)
    with pytest.raises(ValueError, match=line):
        environment.reset(options={"pose": pose})


def test_a_pose_is_where_an_episode_begins():
    one, many = gymnasium.make(OURS), gymnasium.make_vec(OURS, num_envs=2)
    for seed in (None, 3):
        seen, info = one.reset(seed=seed, options={"pose": (2.0, 3.0, 7.0)})
        assert info["pose"] == pytest.approx((2.0, 3.0, 7.0 - 2 * np.pi))
        assert one.observation_space.contains(seen)
    rows = np.array([[2.0, 3.0, 0.5], [7.0, 6.0, -1.0]])
    for seed in (None, 3):
        _, info = many.reset(seed=seed, options={"pose": rows})
        np.testing.assert_array_equal(info["pose"], rows)
    one.reset()
    np.testing.assert_array_equal(one.reset(seed=3)[1]["pose"], many.reset(seed=3)[1]["pose"][0])


def test_films_run_in_real_time_and_frames_can_be_drawn_upon(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    for arena, rate in (("paper", 2.0), ("pyro-realtime", 10.0)):
        one = gymnasium.make(OURS, arena=arena, render_mode="rgb_array")
        many: Any = gymnasium.make_vec(OURS, num_envs=3, arena=arena, render_mode="rgb_array")
        for environment in (one, many):
            environment.reset(seed=1)
            assert environment.metadata["render_fps"] == pytest.approx(rate)
        pictures = many.render()
        assert len(pictures) == 3
        np.testing.assert_array_equal(pictures[0], one.render())
        pictures[0][:9, :9] = 0
        assert not np.array_equal(pictures[0], many.render()[0])
    window: Any = gymnasium.make_vec(OURS, num_envs=3, render_mode="human", arena="pyro-realtime")
    window.reset(seed=1)
    window.step([4, 4, 4])
    assert window.render() == (None, None, None)
    window.close()


def test_a_step_too_many_is_warned_of():
    environment = gymnasium.make(OURS)
    _, info = environment.reset(seed=1)
    light: Any = arenas.load("paper").lights[0].position
    environment.reset(options={"pose": (light[0] - 0.4, light[1], 0.0)})
    assert environment.step(0)[2]
    with pytest.warns(UserWarning, match="after the episode has terminated"):
        environment.step(0)
    assert info["is_success"] is False
