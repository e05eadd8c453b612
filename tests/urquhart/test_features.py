import struct

import numpy as np
import pytest

from tests.urquhart import forests
from urquhart import Config, Features, FeaturesError, LandmarkError, describe


def features(seed: int = 0) -> Features:
    return describe(forests.uniform(np.random.default_rng(seed)) + 5_000_000.0, Config())


@pytest.mark.parametrize("seed", range(5))
def test_packing_loses_nothing(seed: int) -> None:
    original = features(seed)
    copy = Features.unpack(original.pack())
    assert copy.counts() == original.counts()
    assert copy.fingerprint == original.fingerprint == Config().fingerprint()
    for name in ("landmarks", "origin", "density", "descriptors"):
        np.testing.assert_array_equal(getattr(copy, name), getattr(original, name))
    for name in ("triangles", "quads", "hull", "vertices", "vertex_offsets", "members", "member_offsets"):
        np.testing.assert_array_equal(getattr(copy.tessellation, name), getattr(original.tessellation, name))
    assert copy.pack() == original.pack()


def test_submaps_without_a_polygon_are_packed_too() -> None:
    original = describe([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]], Config())
    copy = Features.unpack(original.pack())
    assert copy.counts() == original.counts()
    assert copy.counts()["polygons"] == 0


def test_every_damage_is_noticed() -> None:
    blob = features().pack()
    rng = np.random.default_rng(1)
    for position in rng.integers(0, len(blob), 300).tolist():
        broken = bytearray(blob)
        broken[position] ^= 1 << int(rng.integers(0, 8))
        with pytest.raises(FeaturesError):
            Features.unpack(bytes(broken))
    for length in (0, 3, 60, len(blob) - 1):
        with pytest.raises(FeaturesError):
            Features.unpack(blob[:length])
    with pytest.raises(FeaturesError, match="format 9"):
        Features.unpack(blob[:4] + struct.pack("<H", 9) + blob[6:])


def test_origin_and_landmarks_give_back_what_was_posted() -> None:
    posted = forests.uniform(np.random.default_rng(2)) + np.array([432_100.25, 5_310_000.5])
    described = describe(posted, Config())
    np.testing.assert_allclose(described.landmarks + described.origin, posted, atol=1e-9)
    assert np.abs(described.landmarks.mean(axis=0)).max() < 1e-8


def test_density_follows_thickets_and_clearings() -> None:
    rng = np.random.default_rng(3)
    thick, thin = rng.uniform(0.0, 20.0, (200, 2)), rng.uniform([40.0, 0.0], [140.0, 100.0], (100, 2))
    density = describe(np.concatenate([thick, thin]), Config()).density
    assert np.median(density[:200]) == pytest.approx(0.5, rel=0.35)
    assert np.median(density[200:]) == pytest.approx(0.01, rel=0.35)


def test_the_same_input_gives_the_same_bytes() -> None:
    assert features(4).pack() == features(4).pack()


def test_bad_landmarks_are_refused() -> None:
    with pytest.raises(LandmarkError):
        describe([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], Config())
