"""Part `exhaustion`: callers with a valid key who ask for far more than they send.

Each attack meets a service of its own. A robot with another key asks a small query again and again: before the attack,
during it, and after it. The attacker has the lowest priority, since in the field it runs on another machine. Recorded
are the longest request of the attacker, the memory that the service gains, and how much slower the robot's answers
become.
"""

import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks.experiments import Figures
from benchmarks.reliability.exhaustion.attack_outcome import give_way
from benchmarks.reliability.exhaustion.attacked_service import AttackedService
from benchmarks.reliability.exhaustion.attacks import ATTACKS, Attack
from benchmarks.reliability.exhaustion.robot import Robot
from benchmarks.scale.measurement import spread


def run(*, quick: bool, seed: int) -> Figures:
    """Every attack, one after the other."""
    return {"attacks": {name: _measure(attack, quick=quick, seed=seed) for name, attack in ATTACKS.items()}}


def _measure(attack: Attack, *, quick: bool, seed: int) -> Figures:
    """One attack on a service of its own."""
    least = 3.0 if quick else 40.0
    with tempfile.TemporaryDirectory() as folder, AttackedService(Path(folder), attack.limits) as attacked:
        attack.prepare(attacked, quick=quick)
        with Robot(attacked, seed) as robot:
            robot.settle(1.0)
            before = robot.times(least)
            with attacked.watched() as watch:
                robot.begin()
                with ThreadPoolExecutor(1, initializer=give_way) as attacker:
                    outcome = attacker.submit(attack.strike, attacked, least, quick=quick).result()
                during = robot.end()
            after = robot.times(least / 3.0)
        failures = Counter(attacked.server.failures())
        log_megabytes = attacked.server.log.stat().st_size / 1e6
    return {
        "does": attack.does,
        "requests": outcome.requests,
        "statuses": dict(outcome.statuses.most_common()),
        "longest_seconds": outcome.longest,
        "megabytes": watch.peak - watch.start,
        "descriptors": watch.descriptors,
        "log_megabytes": log_megabytes,
        "before": spread(before),
        "during": spread(during),
        "after": spread(after),
        "slower": spread(during)["p99"] / spread(before)["p99"],
        "robot_errors": dict(robot.errors.most_common(5)),
        "more": outcome.more,
        "failures": dict(failures.most_common(5)),
    }
