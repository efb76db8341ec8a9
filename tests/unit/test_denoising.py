"""Denoised lightmaps: input of the filter, and the accepted part of its change."""

import numpy as np
import pytest

from engine.errors import DenoiseError
from engine.postprocess import denoising
from engine.postprocess.denoising import Denoising, _spans
from engine.progress import finished
from engine.settings import Settings
from tests.tools.real_denoiser import LIBRARY, needs_library


def known_texels(resolution=53, atlases=2):
    """Return two charts in each atlas, apart from one another."""
    known = np.zeros((atlases, resolution, resolution), bool)
    known[:, 3:23, 5:40] = known[:, 27:48, 2:19] = True
    return known


class FakeDevice:
    """Fake filter that adds 1 and records its input."""

    name = "Fake"

    def __init__(self, library, kind):
        self.kind, self.seen, self.released = kind, [], False
        FakeDevice.last = self

    def filtered(self, image):
        self.seen.append(image)
        return image + 1

    def release(self):
        self.released = True


@pytest.fixture
def fake(monkeypatch):
    monkeypatch.setattr(denoising, "DenoiseLibrary", lambda path: None)
    monkeypatch.setattr(denoising, "DenoiseDevice", FakeDevice)
    return FakeDevice


def denoised(known, images, **settings):
    step = Denoising(known, Settings(denoise_library="there", **settings))
    return finished(step.run(images)), step


@pytest.mark.parametrize("size", [1, 7, 97, 1024, 2047, 2048, 2049, 4099, 8192, 16384])
def test_windows_are_of_one_size_and_their_cores_cover_every_texel_once(size):
    spans = _spans(size)
    assert len({whole.stop - whole.start for whole, _ in spans}) == 1
    assert [texel for _, core in spans for texel in range(core.start, core.stop)] == list(range(size))
    for whole, core in spans:
        assert 0 <= whole.start <= core.start < core.stop <= whole.stop <= size
        assert core.start - whole.start >= 128 or core.start == 0
        assert whole.stop - core.stop >= 128 or core.stop == size


def test_the_filter_sees_no_gutters_and_changes_known_texels_alone(fake):
    known = known_texels()
    image = np.where(known[..., None], np.float32(0.7), 0) * np.ones(3, np.float32)
    quiet, step = denoised(known, {"combined": image, "direct": 5 * image})
    for seen in fake.last.seen:
        np.testing.assert_allclose(seen, 0.18, rtol=1e-5)
    assert len(fake.last.seen) == 4 and fake.last.released and not step.warnings
    np.testing.assert_allclose(quiet["combined"][known], 0.7 + 0.7 / 0.18, rtol=1e-5)
    np.testing.assert_allclose(quiet["direct"][known], 5 * (0.7 + 0.7 / 0.18), rtol=1e-5)
    assert not quiet["combined"][~known].any()


def test_windows_of_a_large_lightmap_fit_together(fake, monkeypatch):
    monkeypatch.setattr(denoising, "_WINDOW", 31)
    monkeypatch.setattr(denoising, "_MARGIN", 5)
    monkeypatch.setattr(FakeDevice, "filtered", lambda self, image: 2 * image)
    known = known_texels(101, 1)
    image = np.where(known[..., None], np.random.default_rng(1).random((1, 101, 101, 3)), 0)
    quiet, _ = denoised(known, {"combined": image.astype(np.float32)})
    np.testing.assert_allclose(quiet["combined"], 2 * image, rtol=1e-5)


def test_a_failure_leaves_the_light_and_is_a_warning(fake, monkeypatch):
    def fail(self, image):
        raise DenoiseError("Open Image Denoise failed while filtering: out of memory.")

    monkeypatch.setattr(FakeDevice, "filtered", fail)
    images = {"combined": np.ones((2, 53, 53, 3), np.float32)}
    quiet, step = denoised(known_texels(), images)
    assert quiet is images and fake.last.released
    assert step.warnings == [
        "The lightmaps were not denoised. Open Image Denoise failed while filtering: out of memory."
    ]


def test_charts_of_any_brightness_look_alike_to_the_filter(fake):
    """Each is seen in parts of its mean, in each channel, and gets that back."""
    known = known_texels(atlases=1)
    image = np.zeros((1, 53, 53, 3), np.float32)
    image[:, 3:23, 5:40], image[:, 27:48, 2:19] = (0.2, 3, 0.7), (11, 0.01, 1)
    quiet, _ = denoised(known, {"combined": image})
    np.testing.assert_allclose(fake.last.seen[0], 0.18, rtol=1e-5)
    np.testing.assert_allclose(quiet["combined"], image * (1 + 1 / 0.18), rtol=1e-4)


@needs_library
def test_noise_goes_from_many_small_charts_of_different_brightness():
    random, resolution = np.random.default_rng(2), 97
    truth = np.zeros((1, resolution, resolution, 3), np.float32)
    for row in range(1, resolution - 12, 13):
        for column in range(1, resolution - 12, 13):
            height, width = random.integers(4, 12, 2)
            slope = np.exp(0.02 * np.add.outer(np.arange(height), np.arange(width)))
            light = np.exp(0.7 * random.normal()) * slope[..., None] * np.array([1, 0.95, 0.9])
            truth[0, row : row + height, column : column + width] = light
    known = truth[..., 0] > 0
    noise = 1 + 0.045 * random.normal(size=truth.shape[:3])
    noisy = (truth * noise[..., None]).astype(np.float32)
    step = Denoising(known, Settings(denoise_library=str(LIBRARY)))
    quiet = finished(step.run({"combined": noisy}))["combined"]
    errors = [np.sqrt(np.mean((image - truth)[known] ** 2)) for image in (noisy, quiet)]
    assert errors[1] < errors[0] / 1.7 and not step.warnings


def test_a_cancel_between_two_windows_frees_the_device(fake):
    step = Denoising(known_texels(), Settings(denoise_library="there"))
    work = step.run({"combined": np.ones((2, 53, 53, 3), np.float32)})
    assert [next(work), next(work)] == [0.0, 0.5]
    work.close()
    assert fake.last.released and len(fake.last.seen) == 1 and not step.warnings


def test_a_card_that_is_not_there_is_a_warning_and_the_processor_denoises(fake, monkeypatch):
    class OnlyProcessor(FakeDevice):
        def __init__(self, library, kind):
            if kind != "cpu":
                raise DenoiseError("Open Image Denoise has no device of type CUDA.")
            super().__init__(library, kind)

    monkeypatch.setattr(denoising, "DenoiseDevice", OnlyProcessor)
    images = {"combined": np.ones((2, 53, 53, 3), np.float32)}
    quiet, step = denoised(known_texels(), images, denoise_device="cuda")
    assert (quiet["combined"][known_texels()] > 1).all()
    (warning,) = step.warnings
    assert "type CUDA" in warning and "The CPU denoised instead" in warning


def test_without_a_library_the_warning_names_the_remedy(monkeypatch):
    monkeypatch.setattr(denoising, "library_of_packages", lambda: None)
    step = Denoising(known_texels(), Settings())
    images = {"combined": np.ones((2, 53, 53, 3), np.float32)}
    assert finished(step.run(images)) is images
    (warning,) = step.warnings
    assert "not denoised. There is no Open Image Denoise" in warning and "pyoidn" in warning


@needs_library
@pytest.mark.parametrize("brightness", [1e-12, 1.0, 1e12])
def test_real_filter_is_the_same_in_any_unit_of_light(brightness):
    known = known_texels()
    random = np.random.default_rng(5)
    light = np.where(known[..., None], random.normal(3, 0.5, (*known.shape, 3)), 0) * brightness
    step = Denoising(known, Settings(denoise_library=str(LIBRARY)))
    quiet = finished(step.run({"combined": light.astype(np.float32)}))["combined"]
    assert "Open Image Denoise 2" in step.reasons[0] and not step.warnings
    assert np.abs(quiet[known] / brightness - 3).std() < 0.15


@needs_library
def test_black_lightmaps_stay_black():
    known = known_texels()
    black = np.zeros((*known.shape, 3), np.float32)
    step = Denoising(known, Settings(denoise_library=str(LIBRARY)))
    assert not finished(step.run({"combined": black}))["combined"].any() and not step.warnings
