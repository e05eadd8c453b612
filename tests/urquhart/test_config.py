import dataclasses

import pytest

from urquhart import Config, ConfigError


def test_a_configuration_survives_its_own_dictionary() -> None:
    config = Config(samples=32, squared=True, gamma=15)
    assert Config.from_dict(config.to_dict()) == config


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"sample": 3}, "unknown parameter 'sample'"),
        ({"samples": "20"}, "samples must be a whole number"),
        ({"samples": 20.5}, "samples must be a whole number"),
        ({"samples": True}, "samples must be a whole number"),
        ({"samples": 1}, "from 4 to 256"),
        ({"squared": 1}, "squared must be true or false"),
        ({"sigma": float("nan")}, "sigma must be a number"),
        ({"sigma": 10**400}, "sigma must be a number"),
        ({"sigma": None}, "sigma must be a number"),
        ({"gamma": 0}, "gamma must be a whole number"),
        ({"eta": 1.5}, "eta must be a number from 0 to 1"),
    ],
)
def test_bad_values_are_refused_with_what_is_allowed(values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Config.from_dict(values)


_SHAPING: dict[str, object] = {"samples": 32, "squared": True, "keep_hull": True}


def test_only_what_shapes_features_is_in_the_fingerprint() -> None:
    default = Config().fingerprint()
    assert len(default) == 16
    assert Config(sigma=0.1, gamma=5, candidates=3).fingerprint() == default
    changed = {Config.from_dict({name: value}).fingerprint() for name, value in _SHAPING.items()}
    assert len(changed | {default}) == 4


def test_every_parameter_is_explained() -> None:
    for field in dataclasses.fields(Config):
        assert field.metadata["doc"], field.name
        assert field.metadata["low"] <= (field.default if field.default is not None else 1) <= field.metadata["high"]
