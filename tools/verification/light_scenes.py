"""Scenes of each kind of lamp, each with its options."""

from __future__ import annotations

from math import radians

from .stage import box, floor, into_collection, lamp, material, plane, show, stage


def point() -> None:
    stage()
    lamp("POINT", energy=60, shadow_soft_size=0)


def point_soft() -> None:
    stage()
    lamp("POINT", energy=60, shadow_soft_size=0.25)


def point_sphere() -> None:
    stage()
    lamp("POINT", energy=60, shadow_soft_size=0.25, use_soft_falloff=False)


def point_scaled() -> None:
    """The scale of the object."""
    stage()
    lamp("POINT", energy=60, shadow_soft_size=0.1, use_soft_falloff=False).scale = (3, 3, 3)


def spot() -> None:
    stage()
    lamp("SPOT", energy=240, shadow_soft_size=0.1, spot_size=radians(110), spot_blend=0.6)


def spot_narrow() -> None:
    """A hard cone whose border is seen."""
    stage()
    lamp("SPOT", energy=120, shadow_soft_size=0.02, spot_size=radians(50), spot_blend=0.1)


def spot_scaled() -> None:
    """An object of unequal scale: the cone is wider one way."""
    stage()
    lamp("SPOT", energy=240, shadow_soft_size=0.1, spot_size=radians(90), spot_blend=0.6).scale = (1.5, 0.7, 1)


def sun() -> None:
    stage()
    lamp("SUN", energy=3, angle=radians(6))


def sun_sharp() -> None:
    stage()
    lamp("SUN", energy=3, angle=0)


def area_square() -> None:
    stage()
    lamp("AREA", energy=60, shape="SQUARE", size=0.6)


def area_rectangle() -> None:
    stage()
    lamp("AREA", energy=60, shape="RECTANGLE", size=0.9, size_y=0.3)


def area_disk() -> None:
    stage()
    lamp("AREA", energy=60, shape="DISK", size=0.6)


def area_ellipse() -> None:
    stage()
    lamp("AREA", energy=60, shape="ELLIPSE", size=0.8, size_y=0.4)


def area_spread() -> None:
    stage()
    lamp("AREA", energy=60, shape="SQUARE", size=0.5, spread=radians(110))


def area_spread_narrow() -> None:
    stage()
    lamp("AREA", energy=60, shape="DISK", size=0.8, spread=radians(40))


def area_scaled() -> None:
    """Unequal scale, one axis mirrored."""
    stage()
    lamp("AREA", energy=60, shape="RECTANGLE", size=0.6, size_y=0.3).scale = (-1.5, 0.7, 1)


def area_near() -> None:
    """A large lamp close above the floor."""
    stage()
    lamp("AREA", location=(-0.8, -0.6, 0.25), aim=(-0.8, -0.6001, 0), energy=10, shape="SQUARE", size=1)


def light_exposure() -> None:
    """Exposure and temperature, where the version has them."""
    stage()
    data = lamp("AREA", energy=60, shape="SQUARE", size=0.7, color=(0.9, 1, 0.6)).data
    if hasattr(data, "exposure"):
        data.exposure, data.use_temperature, data.temperature = 0.5, True, 3200


def light_not_normalized() -> None:
    """Power for each area, where the version has that: an area light, a sphere and a sun."""
    stage()
    lamps = (
        lamp("AREA", energy=20, shape="DISK", size=0.7),
        lamp("POINT", location=(1, -0.8, 1.2), energy=40, shadow_soft_size=0.2, color=(0.2, 0.5, 1)),
        lamp("SPOT", location=(-1, 0.8, 1.5), energy=80, shadow_soft_size=0.2, spot_size=radians(100)),
        lamp("SUN", energy=30, angle=radians(15)),
    )
    for obj in lamps:
        if hasattr(obj.data, "normalize"):
            obj.data.normalize = False


def light_without_shadow() -> None:
    stage()
    lamp("AREA", energy=60, shape="SQUARE", size=0.6, use_shadow=False)


def lights_together() -> None:
    """One of each kind; what is hidden in renders gives nothing."""
    stage()
    lamp("POINT", location=(1.2, -0.9, 1.1), energy=20, shadow_soft_size=0.1, color=(0.2, 0.5, 1))
    lamp("SPOT", location=(-1.2, 1, 1.4), energy=60, spot_size=radians(80), color=(0.3, 1, 0.3))
    lamp("SUN", energy=0.5, angle=radians(3))
    lamp("AREA", energy=20, shape="SQUARE", size=0.4, color=(1, 0.5, 0.2))
    lamp("POINT", energy=500).hide_render = True


def lights_instanced() -> None:
    """A collection with a lamp, shown three times, once scaled."""
    stage()
    lamps = into_collection("Lamps", lamp("AREA", (0, 0, 1.5), (0, 0.001, 0), energy=30, shape="DISK", size=0.3))
    for number in range(3):
        show(lamps, (number - 1, 0.5 - number / 2, 0.2 * number), scale=(1 + number / 2,) * 3)


def light_in_lampshade() -> None:
    """A lamp among walls: light that only bounces in and out."""
    floor()
    box(location=(0.6, 0.6, 0.35))
    shade = material("Shade", (0.8, 0.8, 0.7))
    for x, y, turn in ((0.3, 0, 90), (-0.3, 0, -90), (0, 0.3, -90), (0, -0.3, 90)):
        rotation = (0, radians(-turn), 0) if x else (radians(-turn), 0, 0)
        wall = plane("Shade", shade, 0.6, location=(x, y, 0.9), rotation_euler=rotation)
        wall.hemibake.role = "OCCLUDER"
    lamp("POINT", (0, 0, 0.9), (0, 0.001, 0), energy=30, shadow_soft_size=0.05)


SCENES = (
    point, point_soft, point_sphere, point_scaled, spot, spot_narrow, spot_scaled, sun, sun_sharp,
    area_square, area_rectangle, area_disk, area_ellipse, area_spread, area_spread_narrow, area_scaled,
    area_near, light_exposure, light_not_normalized, light_without_shadow, lights_together, lights_instanced,
    light_in_lampshade,
)  # fmt: skip
