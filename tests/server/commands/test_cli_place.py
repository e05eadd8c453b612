"""`urquhart locate --at`: where trees were observed, roughly."""

import json
import math
from pathlib import Path

import pytest

from tests.server.commands.cli_helpers import POSE, Urquhart, refused

SEARCH = ("--collection", "stand")


def test_a_plot_is_found_near_its_place(urquhart: Urquhart, indexed: Path, observation: Path) -> None:
    place = ("--at", f"{POSE.x + 2},{POSE.y - 1}", "--at-sigma", 2, "--heading", -math.degrees(POSE.yaw))
    said = urquhart("locate", observation, *SEARCH, "--database", indexed, *place, "--noise", 0.3, "--json")
    answer = json.loads(said.out)
    assert (answer["verdict"], answer["search"]["stopped_by"]) == ("matched", "window")
    found = answer["candidates"][0]["map_pose"]
    assert (found["x"], found["y"]) == pytest.approx((POSE.x, POSE.y), abs=0.3)


def test_elsewhere_it_is_not_found(urquhart: Urquhart, indexed: Path, observation: Path) -> None:
    place = ("--at", "60,60", "--at-sigma", 1, "--heading", -math.degrees(POSE.yaw))
    said = urquhart("locate", observation, *SEARCH, "--database", indexed, *place)
    assert said.code == 0
    assert "every pose of the prior's window was tried, and none outside of it" in said.out
    assert "effort" not in said.out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--at", "east"), "--at must be two numbers in metres"),
        (("--at", "1,2,3"), "--at must be two numbers in metres"),
        (("--heading", "90"), "--heading needs --at"),
        (("--at-sigma", "1"), "--at-sigma needs --at"),
        (("--heading-sigma", "1"), "--heading-sigma needs --at"),
        (("--at", "0,0", "--heading-sigma", "1"), "--heading-sigma needs --heading"),
        (("--at", "0,0", "--about", "448000,5411000"), "km from its trees: say which point"),
        (("--at", "0,0", "--frame", "nowhere"), "there are 'longleaf'"),
        (("--at", "0,0", "--at-sigma", "900"), "give a heading or a smaller standard deviation"),
    ],
)
def test_a_place_that_cannot_be_used_is_refused(
    urquhart: Urquhart, indexed: Path, observation: Path, options: tuple[str, ...], words: str
) -> None:
    said = urquhart("locate", observation, *SEARCH, "--database", indexed, *options)
    refused(said, words)
