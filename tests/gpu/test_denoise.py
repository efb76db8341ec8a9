"""Denoised bakes are nearer to the exact light; maps other than light stay unchanged."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Settings
from tests.analytic.drive import drive, drive_with_progress
from tests.analytic.scenes import nine_quad_room
from tests.gpu.test_hide_seams import tiles
from tests.rows import long
from tests.tools.real_denoiser import LIBRARY, needs_library

#: 16 rays a patch are noisy.
NOISY = Settings(
    resolution=53, visibility="rays", samples=16, light_samples=4, max_bounces=2, intermediates=False,
    outputs=("ambient_occlusion", "combined", "direct", "indirect", "shadow_mask"), ao_samples=16,
    denoise_library=str(LIBRARY),
)  # fmt: skip
EXACT = replace(NOISY, samples=4096, light_samples=1024)


def error(lightmap, exact, name):
    off = (lightmap.passes[name] - exact.passes[name])[exact.known]
    return np.sqrt(np.mean(off**2)) / exact.passes[name][exact.known].mean()


@needs_library
def test_denoised_light_is_nearer_to_the_exact_one_and_masks_keep_their_bits():
    """Texels show their centres: after two sweeps points of texels are a sweep ahead of these."""
    scene, (cut, exact) = tiles(), (replace(base, texel_samples=1) for base in (NOISY, EXACT))
    noisy, exact, quiet = (drive(scene, chosen) for chosen in (cut, exact, replace(cut, denoise=True)))
    assert (quiet.image == noisy.image).all() and (quiet.known == noisy.known).all()
    for name in ("combined", "indirect"):
        assert error(quiet, exact, name) < error(noisy, exact, name) / 1.4, name
    for name in ("ambient_occlusion", "shadow_mask Lamp"):
        assert (quiet.passes[name] == noisy.passes[name]).all(), name
    assert any("Open Image Denoise 2" in reason for reason in quiet.report.reasons)
    assert not quiet.report.warnings and quiet.report.seconds["denoising"] > 0


def off_identity(lightmap) -> np.ndarray:
    """Return the difference of L0 + L1 . n from the light, (atlases, r, r), for the best axis n."""
    passes = lightmap.passes
    along = passes["combined"] - passes["L0"]
    off = [np.abs(along - sign * passes[f"L1 {axis}"]).max(axis=-1) for axis in "xyz" for sign in (1, -1)]
    nearest: np.ndarray = np.min(off, axis=0)
    return nearest


@needs_library
@pytest.mark.parametrize("output", ["dominant_direction", long("directional"), long("spherical_harmonics")])
def test_denoised_directional_maps_are_nearer_to_the_exact_ones(output):
    """And L0 + L1 . n is still the light of walls, whose normals are axes of the world."""
    changes = {"outputs": ("combined", output), "resolution": 128, "texel_samples": 1, "hide_seams": False}
    noisy, exact = (drive(nine_quad_room(), replace(base, **changes)) for base in (NOISY, EXACT))
    quiet = drive(nine_quad_room(), replace(NOISY, **changes, denoise=True))
    for name in quiet.passes:
        off = [lightmap.passes[name] - exact.passes[name] for lightmap in (quiet, noisy)]
        errors = [np.sqrt(np.mean(values[exact.known] ** 2)) for values in off]
        assert errors[0] < errors[1] / 1.5, (name, errors)
    if output == "directional":
        counts = quiet.known & (off_identity(noisy) < 1e-5)
        assert counts.mean() > 0.4 and off_identity(quiet)[counts].max() < 1e-4


@needs_library
def test_denoising_is_a_stage_of_the_bake():
    scene, settings = nine_quad_room(), replace(NOISY, resolution=64, outputs=("combined",), denoise=True)
    stages = [progress.stage for progress in drive_with_progress(scene, settings)[1]]
    assert stages.index("Supersampling") < stages.index("Denoising") < stages.index("Finishing lightmaps")
    without = [progress.stage for progress in drive_with_progress(scene, replace(settings, denoise=False))[1]]
    assert "Denoising" not in without


def test_a_library_that_cannot_be_loaded_leaves_the_lightmap_and_is_a_warning(tmp_path):
    settings = replace(NOISY, resolution=64, outputs=("combined",), denoise_library=str(tmp_path / "no.so"))
    noisy, kept = (drive(nine_quad_room(), replace(settings, denoise=on)) for on in (False, True))
    assert (noisy.display == kept.display).all()
    (warning,) = kept.report.warnings
    assert warning.startswith("The lightmaps were not denoised. Open Image Denoise cannot be loaded")
