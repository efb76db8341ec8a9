"""The cost model recovers known constants and predicts a bake that it was not fitted to."""

import itertools

import numpy as np
import pytest

from benchmarks.cost_model import PARTS, CostModel, Size, network_seconds, traffic

#: Constants of each part's terms; one of them costs nothing.
TRUE = {part.name: np.linspace(0, 1e-9, len(part.terms) + 1)[1:] * (part.name != "images") for part in PARTS}


def record(patches, samples, workers, groups=1):
    """Return a bake by workers whose times are those of the true constants."""
    size = Size(patches, patches / groups**2, patches / 8, 1000, samples, 5, workers)
    seconds = {
        part.name: sum(c * term(size) for c, term in zip(TRUE[part.name], part.terms.values(), strict=True))
        for part in PARTS
    }
    kinds = {
        "sampled": "shadow rays",
        "find": "finding",
        "gather": "sweeps",
        "final": "last gather",
        "light_at_samples": "points of texels",
    }
    tasks = {kind: {"compute": seconds[name]} for kind, name in kinds.items()}
    busy = {kind: task["compute"] / workers for kind, task in tasks.items()}
    stages = {
        "patches": seconds["patches"],
        "direct": busy["sampled"] + seconds["shadow rays, client and way"],
        "hemicubes": sum(busy[kind] for kind in ("find", "gather", "final"))
        + seconds["squares and bounces, client and way"],
        "texels": busy["light_at_samples"] + seconds["points of texels, client and way"],
        "outputs": seconds["images"],
    }
    facts = {"groups": groups, "workers": workers, "triangles": 1000, "patches": patches, "samples": samples}
    facts["points"] = patches / 8
    return facts | {"sweeps": 5, "tasks": tasks, "stages": stages}


def test_constants_foretell_a_bake_that_was_left_out():
    known = [record(*size) for size in itertools.product([100_000, 900_000], [256, 2048], [1, 2])]
    known += [record(*size, groups=4) for size in itertools.product([800_000, 3_000_000], [512], [1, 2])]
    model = CostModel(known)
    for left_out in (record(5_000_000, 1024, 4), record(5_000_000, 1024, 4, groups=4)):
        told = sum(model.seconds(Size.of(left_out)).values())
        assert told == pytest.approx(sum(left_out["stages"].values()), rel=0.02)


def test_no_constant_is_negative():
    random = np.random.default_rng(3)
    known = [record(patches, 512, workers) for patches in (1000, 50_000) for workers in (1, 2)]
    for bake in known:
        for stage in bake["stages"]:
            bake["stages"][stage] *= random.uniform(0.2, 3)
    assert all((constants >= 0).all() for constants in CostModel(known).constants.values())


def test_samples_of_a_device_fall_with_their_number_until_there_are_no_more_blocks():
    held = [
        traffic(Size(1e9, 1e9 / 16, 4e6, 1e6, 2048, 6, workers))["samples on each device"]
        for workers in (1, 10, 100)
    ]
    assert held[0] / 11 < held[1] < held[0] / 9
    size = Size(1e9, 1e9 / 16, 4e6, 1e6, 2048, 6, 239)
    more = Size(1e9, 1e9 / 16, 4e6, 1e6, 2048, 6, 1000)
    told, of_more = traffic(size), traffic(more)
    assert told.pop("memory of each worker") > of_more.pop("memory of each worker")
    assert told == of_more
    assert network_seconds(more, 1e9) > network_seconds(size, 1e9)
