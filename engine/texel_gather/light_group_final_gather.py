"""Final gather of each light group at receivers that trace their own rays."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np

from ..device.device_array import colors_on_host
from ..gather.light_group_gather import LightGroupPass
from ..plan.choose_gather import static_light
from ..plan.receivers import Receivers, make_final_gather, receiver_job
from ..plan.solve_job import SolveJob
from ..plan.solver_choice import SolverChoice
from ..plan.visibility_trial import make_sampler
from ..progress import run_as_fraction
from ..settings import Settings
from ..solve.reflected_radiance import reflected_light
from ..visibility.sampler import SampleLayout


def of_all_light(settings: Settings) -> Settings:
    """Return settings with the combined map as only output, since light groups have no other maps."""
    return replace(settings, outputs=("combined",))


def gather_light_groups(
    groups: Sequence[SolveJob],
    source_irradiance: Sequence[np.ndarray],
    choice: SolverChoice,
    receivers: Receivers,
    sampled: np.ndarray,
    settings: Settings,
    substitute: np.ndarray | None = None,
) -> Generator[float, None, np.ndarray]:
    """Return E/pi of light groups, (g, n, 3) float32, at n receivers; yield the fraction done.

    All groups without emission in the gather share one set of samples. Each other group samples again, since
    light of back faces is summed while visibility is computed.

    groups:             job of each light group
    source_irradiance:  (m, 3) float32 for each group, E/pi of the senders
    sampled:            (g, n, 3) float32, E/pi of light from shadow rays
    substitute:         (m,) uint32, substitute patches, see `reflected_light`
    """
    light = sampled.copy()
    lit = [number for number, group in enumerate(groups) if group.lit]
    apart = [number for number in lit if groups[number].back_emission.any() or groups[number].emission.any()]
    together = [number for number in lit if number not in apart]
    passes = len(apart) + bool(together)
    if together:
        some = [groups[number] for number in together]
        gather_pass = _gather_pass(some, choice, receivers, settings)
        sent = [
            reflected_light(
                colors_on_host(groups[number].patch_scene.surfaces.reflectance),
                source_irradiance[number],
                substitute,
            )
            for number in together
        ]
        found = yield from run_as_fraction(0.0, 1 / passes, gather_pass.gather(np.stack(sent, axis=1)))
        light[together] += found.transpose(1, 0, 2)
    for count, number in enumerate(apart, bool(together)):
        where = Receivers(receivers.patch_scene, receivers.rays, sampled[number])
        last, _ = make_final_gather(groups[number], choice, where, settings)
        yield from run_as_fraction(
            count / passes, (count + 1) / passes, last.gather(source_irradiance[number], substitute)
        )
        light[number] = last.irradiance
    return light


def _gather_pass(
    groups: Sequence[SolveJob], choice: SolverChoice, receivers: Receivers, settings: Settings
) -> LightGroupPass:
    """Return a gather for light groups without emission, which share one set of visibility samples."""
    jobs = [receiver_job(group, receivers, settings) for group in groups]
    sampler = make_sampler(jobs[0], choice.visibility)
    sampling, first = SampleLayout.of(sampler), jobs[0]
    fitting = max(settings.batch_bytes // sampler.row_bytes, sampler.batch)
    static = [static_light(job, sampling) for job in jobs]
    return LightGroupPass(first.opencl, sampler, first.count, len(first.emission), static, fitting)
