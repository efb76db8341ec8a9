"""Settings of Hemibake from coarse to fine."""

from __future__ import annotations

from typing import Any

from engine import Settings

#: Rays a patch sends out, shadow rays a patch sends to each light, tolerance, whether light is interpolated.
_RAYS = (
    (16, 2, 0.02, True), (24, 3, 0.02, True), (32, 4, 0.02, False), (32, 4, 0.02, True),
    (64, 8, 0.01, False), (64, 8, 0.01, True), (128, 16, 0.005, False), (128, 16, 0.005, True),
    (256, 32, 0.005, False), (256, 32, 0.005, True), (512, 64, 0.002, False), (1024, 128, 0.002, False),
    (2048, 256, 0.001, False), (4096, 512, 0.001, False),
)  # fmt: skip

#: Width of the hemicubes, shadow rays a patch sends to each light, tolerance.
_HEMICUBES = (
    (8, 4, 0.02), (16, 8, 0.01), (16, 32, 0.01), (32, 32, 0.005), (32, 128, 0.005), (32, 512, 0.005),
    (64, 128, 0.002), (64, 512, 0.001),
)  # fmt: skip


def configurations() -> list[dict[str, Any]]:
    """Return values of settings, the coarsest first: rays, then hemicubes."""
    names = ("samples", "light_samples", "tolerance", "adaptive")
    rays = [dict(zip(names, row, strict=True)) for row in _RAYS]
    hemicubes = [
        dict(zip(("hemicube", "light_samples", "tolerance"), row, strict=True)) for row in _HEMICUBES
    ]
    return [{"visibility": "rays", **row} for row in rays] + [
        {"visibility": "raster", **row, "adaptive": False} for row in hemicubes
    ]


def finest() -> dict[str, Any]:
    """Return settings with an error far below that of all other configurations."""
    return {"visibility": "rays", "samples": 16384, "light_samples": 2048, "tolerance": 1e-4, "seed": 99}


def fine() -> dict[str, Any]:
    """Return settings with an error below most other configurations, for slow lightmaps."""
    return {**finest(), "samples": 8192, "light_samples": 1024}


def label(values: dict[str, Any]) -> str:
    """Return values in a few words."""
    return ", ".join(f"{name} {value}" for name, value in values.items())


def settings(values: dict[str, Any], **more: Any) -> Settings:
    """Return settings with these values."""
    return Settings(intermediates=False, **values, **more)
