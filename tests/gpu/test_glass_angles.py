"""Transmittance of glass by the angle of incidence along rays, with OpenCL and with compute shaders."""

import numpy as np
import pytest

from engine import Material, Scene
from engine.device.cl_device import ComputeDevice
from engine.scene.cutouts import BOUNCE, SHADOW, read_cutouts
from engine.scene.transmission import BACK, FRONT, Fresnel, Transmittance, angular_factor
from engine.scene.triangles import join_meshes
from engine.visibility.rays.ray_tracer import RayTracer
from engine.visibility.rays.shaders.shader_tracer import ShaderTracer
from tests.analytic.scenes import quads, rectangle
from tests.transparency import exact_transmittance, uniform_transmission

BLACK = np.zeros(3, np.float32)
ANGLES = np.radians([0.0, 13.0, 31.0, 56.3, 60.0, 75.0, 88.0])


@pytest.fixture(scope="module", params=["opencl", "shaders"])
def tracer(request):
    """Return what makes the ray tracer of triangles and cutouts."""
    if request.param == "opencl":
        device = ComputeDevice()
        return lambda *scene: RayTracer(device, *scene)
    graphics = request.getfixturevalue("graphics")
    return lambda *scene: ShaderTracer(graphics, *scene)


def through(tracer, *transmittances, origin=0.0, backward=False, kind=BOUNCE):
    """Return the transmittance of sheets, one above the other, for rays of ANGLES, (angles, 3)."""
    corners = [(origin - 50, origin - 50, 0.5 * i) for i in range(len(transmittances))]
    sheets = [
        quads(rectangle(corner, (100, 0, 0), (0, 100, 0))[None], [(1, 1, 5, 5)], [i], 16)
        for i, corner in enumerate(corners)
    ]
    materials = tuple(
        Material(f"Glass {i}", BLACK, BLACK, transmission=uniform_transmission(each))
        for i, each in enumerate(transmittances)
    )
    scene = Scene(tuple(sheets), materials)
    triangles = join_meshes(scene)
    turn = np.array([np.cos(0.7), np.sin(0.7)])
    along = np.stack([*(np.sin(ANGLES)[:, None] * turn).T, np.cos(ANGLES)], axis=1) * (-1 if backward else 1)
    middle = np.array([origin + 0.3, origin + 0.2, 0.5]) - triangles.origin
    starts = middle - along * (1.2 / np.cos(ANGLES))[:, None]
    rays = tracer(triangles, read_cutouts(scene))
    return rays.transmittance(starts, 3.0 * along, 100.0, kind)


def glass(*values, **fresnel):
    return Transmittance(np.float32(values), fresnel=Fresnel(**fresnel))


@pytest.mark.parametrize("ior", [1.0, 1.45, 2.4])
@pytest.mark.parametrize(("backward", "kind", "origin"), [(False, BOUNCE, 0.0), (True, SHADOW, 4100.0)])
def test_a_sheet_transmits_less_at_an_angle(tracer, ior, backward, kind, origin):
    found = through(tracer, glass(0.8, 0.8, 0.8, ior=ior), backward=backward, kind=kind, origin=origin)
    expected = 0.8 * exact_transmittance(np.cos(ANGLES), ior) / exact_transmittance(1.0, ior)
    assert found == pytest.approx(np.repeat(expected[:, None], 3, axis=1), abs=2e-4)


def test_a_slab_transmits_all_its_inner_reflections(tracer):
    """1 - F squared, plus what is reflected twice, four times and so on."""
    cosine = np.cos(ANGLES)
    reflected = 1 - 2 * exact_transmittance(cosine, 1.5) ** 2 / (1 + exact_transmittance(cosine, 1.5) ** 2)
    series = (1 - reflected) ** 2 * sum(reflected ** (2 * n) for n in range(200))
    found = through(tracer, *2 * [glass(*3 * [exact_transmittance(1.0, 1.5)], ior=1.5)])
    assert found[:, 1] == pytest.approx(series, abs=3e-4)


def test_light_above_the_critical_angle_is_reflected(tracer):
    """Glass whose outside is the denser medium."""
    found = through(tracer, glass(0.9, 0.9, 0.9, ior=0.75))
    assert ((found[:, 0] > 0) == (np.sin(ANGLES) < 0.75)).all()


def test_tints_shares_and_thin_walls(tracer):
    """Tinted glass keeps its tint, a mix loses its share of glass only, and thin walls have two faces."""
    ratio = exact_transmittance(np.cos(ANGLES), 1.6) / exact_transmittance(1.0, 1.6)
    mix, thin = glass(0.9, 0.6, 0.2, ior=1.6, share=0.25), glass(1, 1, 0.5, ior=1.6, faces=2.0)
    found = through(tracer, mix, thin, Transmittance(np.ones(3)))
    expected = ((1 - 0.25 * (1 - ratio)) * ratio**2)[:, None] * np.float32([0.9, 0.6, 0.1])
    assert found == pytest.approx(expected, abs=2e-4)


def test_the_sides_of_a_body_transmit_as_two_faces(tracer):
    """Rays cross the front and then the back, or the other way round."""
    sides = [glass(0.9, 0.7, 0.7, ior=1.5, body=body) for body in (FRONT, BACK)]
    face = exact_transmittance(np.cos(ANGLES), 1.5) / exact_transmittance(1.0, 1.5)
    found = through(tracer, *sides)
    assert found == pytest.approx(face[:, None] ** 2 * np.float32([0.81, 0.49, 0.49]), abs=3e-4)


def test_the_factor_is_that_of_fresnels_amplitudes():
    cosine = np.linspace(0.02, 1, 53)
    expected = exact_transmittance(cosine, 1.33) / exact_transmittance(1.0, 1.33)
    assert angular_factor(Fresnel(1.33), cosine) == pytest.approx(expected)
    assert angular_factor(Fresnel(1.33), 0.0) == pytest.approx(0)
