"""The seat while the robot runs: swapped, inherited, vanished, frozen, run after run."""

import json
import os
import signal

import psutil
import pytest
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.messages import Command, Control
from support import DEADLINE, Process, observer, phototaxis, result, wait, wait_status

EPOCHS = 3000
HASHES = ("state_hash", "learner_hash")


def alone(*words: object) -> dict[str, str]:
    """The hashes of the same run in one process."""
    done = phototaxis("train", *words, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    return {name: found[name] for name in HASHES}


def hashes(found: dict[str, str]) -> dict[str, str]:
    return {name: found[name] for name in HASHES}


def tokens(world: str) -> set[str]:
    """Who is on the bus, as a newcomer sees it."""
    with observer(world) as bus:
        seen = set()
        while (event := bus.receive(timeout=0.5)) is not None:
            if event.topic == "alive":
                seen.add("/".join(event.message))
            if event.topic == "status":
                return seen | set(event.message.alive)
    return seen


def test_successors_of_the_same_kind_inherit_over_the_bus(up):
    found = result(up("--epochs", EPOCHS, "--seed", 7, "--swap", "1000:qtable,2000:qtable"))
    assert [one["from_tick"] for one in found["drivers"]] == [0, 1000, 2000]
    assert len({one["driver"] for one in found["drivers"]}) == 3
    assert hashes(found) == alone("--epochs", EPOCHS, "--seed", 7)


def test_a_net_inherits_with_its_memory_and_its_optimiser(up):
    words = ("--learner", "dqn", "--percept", "continuous", "--epochs", 600, "--seed", 5)
    found = result(up(*words, "--no-recorder", "--swap", "300:dqn"))
    assert [one["from_tick"] for one in found["drivers"]] == [0, 300]
    assert hashes(found) == alone(*words)


def success(checkpoint: str) -> float:
    """Of a frozen policy, on 200 fresh placements."""
    return json.loads(phototaxis("evaluate", checkpoint, "--json").stdout)["success_rate"]


def test_a_net_that_learned_in_the_drivers_shadow_takes_over(up):
    found = result(up("--epochs", 1600, "--seed", 7, "--swap", "1500:dqn", "--no-recorder"))
    assert [(one["learner"], one["from_tick"]) for one in found["drivers"]] == [("qtable", 0), ("dqn", 1500)]
    assert found["learner"] == "dqn"
    driver, shadow = (success(one["checkpoint"]) for one in found["drivers"])
    alone = success(result(up("--epochs", 100, "--seed", 7, "--learner", "dqn", "--no-recorder"))["checkpoint"])
    print(f"driver {driver}; net after 1,500 steps in its shadow and 100 of its own {shadow}; 100 alone {alone}")
    assert shadow > max(0.9, alone)


def test_swap_is_one_command(up, world):
    launcher = up("--epochs", 0, "--speed", 100, "--no-recorder", "--learner", "ann")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 10, launcher)
        done = phototaxis("swap", "qtable", "--learning-rate", 0.5, "--name", world, "--json")
        assert done.returncode == 0, done.stderr
        swapped = json.loads(done.stdout)
        status = wait_status(bus, lambda status: status.driver == swapped["agent"], launcher)
        assert status.drivers[-1].tick == swapped["from_tick"]
        wait_status(bus, lambda status: not any("/ann-" in who for who in status.alive), launcher)  # the old one left
        for words, line in (
            (["magic"], "no learner 'magic'; there are:"),
            (["qtable", "--learning-rate", 9], "--learning-rate 9"),
        ):
            wrong = phototaxis("swap", *words, "--name", world)
            assert wrong.returncode == 2
            assert line in wrong.stderr
            assert wrong.stderr.count("\n") == 1
        assert wait_status(bus, lambda _: True, launcher).driver == swapped["agent"]
    launcher.popen.send_signal(signal.SIGTERM)
    assert [one["learner"] for one in result(launcher)["drivers"]] == ["ann", "qtable"]


def test_without_a_launcher_swap_says_what_to_do(world):
    done = phototaxis("swap", "qtable", "--name", world)
    assert done.returncode == 3
    assert "phototaxis agent --learner qtable --take-over" in done.stderr


@pytest.mark.parametrize("plan", ["soon:qtable", "20:qtable,10:qtable", "10", "5:a,5:b"])
def test_a_plan_of_swaps_that_makes_no_sense_is_one_line(up, plan):
    process = up("--no-recorder", "--swap", plan)
    assert process.end() == 2
    assert f"--swap {plan}: expected TICK:LEARNER" in process.stderr


@pytest.fixture
def team(start, world, tmp_path):
    """A simulation of 3,000 epochs, sensors, and a standby; then its driver."""
    sim = start("sim", "--name", world, "--epochs", EPOCHS, "--seed", 7)
    sensors = start("sensors", "--name", world)
    place = ("agent", "--name", world)
    driver = start(*place, "--ident", "driver", "--checkpoint", tmp_path / "driver.npz")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.driver == "driver", sim, sensors, driver)
        standby = start(*place, "--ident", "heir", "--standby", "--checkpoint", tmp_path / "heir.npz")
        wait_status(bus, lambda status: status.next == ["heir"] and status.tick > 500, sim, sensors, standby)
        yield bus, driver, standby, (sim, sensors)


def finish(bus: Bus, standby: Process, others: tuple[Process, ...], tmp_path) -> dict[str, str]:
    """The hashes of the run when the standby has driven it to its end."""
    status = wait_status(bus, lambda status: status.phase == "finished", standby, *others)
    assert [one.driver for one in status.drivers] == ["driver", "heir"]
    assert standby.stop() == 0
    from phototaxis.runtime.checkpoint import load

    return {"state_hash": status.hash, "learner_hash": load(tmp_path / "heir.npz")[0].learner_hash}


def test_a_standby_goes_on_where_a_killed_driver_was(team, tmp_path):
    bus, driver, standby, others = team
    driver.kill()
    assert finish(bus, standby, others, tmp_path) == alone("--epochs", EPOCHS, "--seed", 7)
    assert "heir: agent of the world '" in standby.stderr
    assert "waits for a simulation and its sensors" in standby.stderr
    assert "heir: stands by; driver drives at tick" in standby.stderr
    assert "heir: drives from tick" in standby.stderr
    assert "is finished, at tick" in others[0].stderr


def test_a_component_alone_says_what_becomes_of_it(start, world):
    sim, sensors = start("sim", "--name", world), start("sensors", "--name", world)
    with observer(world) as bus:
        driver = start("agent", "--name", world, "--ident", "driver")
        status = wait_status(bus, lambda status: status.driver == "driver", sim, sensors, driver)
        third = start("agent", "--name", world, "--ident", "third")
        line = "third: waits until driver leaves the seat; --take-over takes it, --standby inherits it"
        wait_status(bus, lambda _: line in third.stderr, sim, sensors, driver, third)
    assert f"senses in the run {status.run}" in sensors.stderr
    assert f"sim of the world '{world}', on this machine; waits for sensors and an agent" in sim.stderr
    assert f": driver drives in the run {status.run}, from tick 0 on" in sim.stderr


def test_a_frozen_driver_loses_the_seat_and_its_late_command_does_not_count(team, tmp_path):
    bus, driver, standby, others = team
    os.kill(driver.popen.pid, signal.SIGSTOP)
    wait_status(bus, lambda status: status.driver == "heir", standby, *others)
    os.kill(driver.popen.pid, signal.SIGCONT)
    assert driver.end() == 0
    assert "unseated at tick" in driver.stderr
    assert finish(bus, standby, others, tmp_path) == alone("--epochs", EPOCHS, "--seed", 7)


def test_a_driver_that_hangs_with_its_token_on_the_bus_loses_the_seat(start, world):
    sim = start("sim", "--name", world, "--driver-timeout", 0.5)
    sensors = start("sensors", "--name", world)
    options = BusOptions(name=world)
    with (
        open_session("agent", options, "hung") as session,
        Bus(session, world, "agent", "hung") as hung,
        observer(world) as bus,
    ):
        hung.wait_for("sim", 10)
        claim = hung.control(Control(verb="claim", agent="hung"))
        assert claim is not None
        assert claim.ok
        waiting = wait_status(bus, lambda status: status.waiting_for == "the command of hung", sim, sensors)
        assert waiting.driver == "hung"  # nobody else wants the seat: it may take its time
        standby = start("agent", "--name", world, "--ident", "heir", "--standby")
        status = wait_status(bus, lambda status: status.driver == "heir", sim, sensors, standby)
        assert "agent/hung" in status.alive
        later = wait_status(bus, lambda now: now.tick > status.tick + 10, sim, sensors, standby)
        hung.put("command", Command(run=later.run, tick=later.tick, author="hung", left=1.0, right=1.0))
        hung.put("command", Command(run=later.run, tick=0, author="hung", left=1.0, right=1.0))
        wait_status(bus, lambda now: sum(n for why, n in now.refused.items() if "command" in why) >= 2, sim)
    assert "hung has been silent for 0.5 s and loses the seat" in sim.stderr


def test_a_killed_simulation_gives_the_seat_back_to_its_driver(start, world, tmp_path):
    words = (
        "sim",
        "--name",
        world,
        "--epochs",
        EPOCHS,
        "--seed",
        7,
        "--run",
        "r",
        "--journal",
        tmp_path / "sim.journal",
    )
    sim, sensors = start(*words), start("sensors", "--name", world)
    driver = start("agent", "--name", world, "--ident", "driver", "--checkpoint", tmp_path / "driver.npz")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 300, sim, sensors, driver)
        standby = start("agent", "--name", world, "--ident", "heir", "--standby")
        wait_status(bus, lambda status: status.next == ["heir"], sim, sensors, driver, standby)
        sim.kill()
        again = start(*words)
        status = wait_status(bus, lambda status: status.phase == "finished", again, sensors, driver, standby)
        assert [one.driver for one in status.drivers] == ["driver"]
    assert driver.stop() == 0
    from phototaxis.runtime.checkpoint import load

    found = {"state_hash": status.hash, "learner_hash": load(tmp_path / "driver.npz")[0].learner_hash}
    assert found == alone("--epochs", EPOCHS, "--seed", 7)


@pytest.mark.parametrize(
    ("speed", "end", "then"),
    [
        (0, "reset", lambda readings: readings.episode == 1),
        (20, "", lambda readings: readings.tick > 0 and not readings.author),
    ],
    ids=["where an episode begins", "where a silent driver's motors are stopped"],
)
def test_a_killed_simulation_keeps_the_seat(start, world, tmp_path, speed, end, then):
    words = "sim", "--name", world, "--run", "r", "--speed", speed, "--journal", tmp_path / "sim.journal"
    sim, sensors = start(*words), start("sensors", "--name", world)
    options = BusOptions(name=world)
    with open_session("agent", options, "raw") as session, Bus(session, world, "agent", "raw") as bus:
        assert bus.wait_for("sim", DEADLINE)
        assert bus.control(Control(verb="claim", agent="raw"), timeout=DEADLINE)
        asked = wait(bus, lambda event: event.topic == "readings" and event.message.driver == "raw", sim, sensors)
        bus.put("command", Command(run="r", tick=asked.message.tick, author="raw", left=0.0, right=0.0, end=end))
        wait(bus, lambda event: event.topic == "readings" and then(event.message), sim, sensors)
        sim.kill()
        wait(bus, lambda event: event.topic == "gone" and event.message[0] == "sim", sensors)
        again = start(*words)
        wait(bus, lambda event: event.topic == "alive" and event.message[0] == "sim", again, sensors)
        reply = bus.control(Control(verb="claim", agent="other"), timeout=DEADLINE)
    assert reply is not None
    assert reply.reason == "the seat is kept for raw"
    assert reply.status.tick > 0


def test_ten_swaps_leave_nothing_behind(up, world, tmp_path):
    ticks = [97, 210, 211, 340, 503, 700, 777, 922, 1200, 1390]
    plan = ",".join(f"{tick}:qtable" for tick in ticks)
    launcher = up("--epochs", 1400, "--seed", 7, "--swap", plan)
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 700, launcher)
        everyone = [psutil.Process(child.pid) for child in psutil.Process(launcher.popen.pid).children(recursive=True)]
    found = result(launcher)
    assert [one["from_tick"] for one in found["drivers"]] == [0, *ticks]
    assert hashes(found) == alone("--epochs", 1400, "--seed", 7)
    assert not psutil.wait_procs(everyone, timeout=10)[1]
    assert tokens(world) == {"observer/test"}
    left = [path.name for path in (tmp_path / "runs").glob("*/*.new")]
    assert left == []
