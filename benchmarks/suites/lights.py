"""Measures direct light of 1 to 1,000 lights."""

from __future__ import annotations

from typing import Any

from benchmarks import baking
from benchmarks.configurations import settings
from benchmarks.options import Options
from benchmarks.rooms import dark_box
from benchmarks.tables import table

_LAMPS = (1, 10, 100, 1000)

#: One small gather follows: only the direct light is of interest.
_VALUES = {"samples": 16, "hemicube": 8, "light_samples": 64, "max_bounces": 1, "tolerance": 0.0}


def run(options: Options) -> list[dict[str, Any]]:
    """Bake a room with more and more lamps of the same light in all."""
    resolution = 512 if options.gpu else (192 if options.full else 96)
    chosen = settings(_VALUES, resolution=resolution)
    baking.timed(dark_box(resolution, 1), chosen)
    records = []
    for lamps in _LAMPS:
        seconds, lightmap = baking.timed(dark_box(resolution, lamps), chosen)
        facts = baking.facts(lightmap)
        records.append({"lamps": lamps, "resolution": resolution, "light_samples": chosen.light_samples,
                        "seconds": seconds, **facts})  # fmt: skip
    return records


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return seconds of stage direct."""
    titles = ("lamps", "patches", "shadow rays per light", "direct, s", "whole bake, s", "µs per patch")
    rows = [
        (
            record["lamps"], record["patches"], record["light_samples"], record["stages"]["direct"],
            record["seconds"], 1e6 * record["stages"]["direct"] / record["patches"],
        )
        for record in records
    ]  # fmt: skip
    return table(titles, rows)
