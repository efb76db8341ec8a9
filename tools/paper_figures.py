"""Draws the paper's Fig. 4 and Fig. 5 from stored results, beside the paper's values.

What `make bench` and `make bench-gpu` stored in benchmarks/results, the newest of each kind of device, beside
benchmarks/paper_fig5.json; the differences to Gauss-Seidel are those of tools/convergence.py.

    python tools/paper_figures.py [--out docs/design/paper]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
WIDTHS, LAYERS = (32, 64, 128), (1, 2, 4, 8)


class Times:
    """Milliseconds of an iteration of the room with 10,700 patches, the paper's and ours.

    devices:  our devices' names, by "gpu" and "cpu"
    """

    def __init__(self) -> None:
        paper = json.loads((ROOT / "benchmarks/paper_fig5.json").read_text(encoding="utf-8"))
        self._paper = {row["hemicube"]: row for row in paper["iterations"]}
        self._ours: dict[str, list[dict[str, Any]]] = {}
        self.devices: dict[str, str] = {}
        for path in sorted((ROOT / "benchmarks/results").glob("*-[cg]pu-*.json")):
            stored = json.loads(path.read_text(encoding="utf-8"))
            records = stored["suites"].get("fig5", {}).get("records", [])
            if records:
                kind = "gpu" if stored["machine"]["opencl"]["gpu"] else "cpu"
                self._ours[kind], self.devices[kind] = records, stored["machine"]["opencl"]["device"]

    def paper(self, kind: str, hemicube: int, layers: int) -> float:
        """Return the paper's time."""
        return self._paper[hemicube][kind][str(layers)]

    def drawn(self, kind: str, hemicube: int, layers: int) -> float:
        """Return ours if hemicubes are drawn in every iteration, as the paper does."""
        return self._record(kind, hemicube, layers, "paper")["ms"]

    def kept(self, kind: str, hemicube: int) -> tuple[float, float]:
        """Return our times of the first iteration and of later ones, with cached visibility."""
        record = self._record(kind, hemicube, None, "cached")
        return record["first_ms"], record["ms"]

    def _record(self, kind: str, hemicube: int, layers: int | None, method: str) -> dict[str, Any]:
        wanted = (hemicube, layers, method)
        records = self._ours[kind]
        return next(r for r in records if (r["hemicube"], r["layers"], r["method"]) == wanted)


def main() -> None:
    """Draw both."""
    import matplotlib

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/paper"))
    out = parser.parse_args().out
    matplotlib.use("Agg")
    times = Times()
    _fig4(times, out / "fig4.png")
    _fig5(times, out / "fig5.png")


def _fig4(times: Times, picture: Path) -> None:
    """Draw times over layers for each width, and the differences to Gauss-Seidel over iterations."""
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.5, 4.2), layout="constrained")
    for n, colour in zip(WIDTHS, ("C0", "C1", "C2"), strict=True):
        paper, ours = ([of("gpu", n, k) for k in LAYERS] for of in (times.paper, times.drawn))
        left.loglog(LAYERS, paper, "o--", color=colour, label=f"paper, N = {n}")
        left.loglog(LAYERS, ours, "s-", color=colour, label=f"ours, N = {n}")
        left.axhline(times.kept("gpu", n)[1], ls=":", color=colour)
    left.text(8, times.kept("gpu", 128)[1] * 1.2, "ours, visibility kept", ha="right", fontsize=8)
    left.set_xticks(LAYERS, LAYERS)
    left.minorticks_off()
    left.set_xlabel("layers of a 1024 × 1024 texture array")
    left.set_ylabel("ms per iteration, 10,700 patches")
    left.set_title(f"paper: GTX 550 Ti; ours: {times.devices['gpu']}", fontsize=9)
    left.legend(fontsize=7, ncols=3)

    stored = json.loads((ROOT / "docs/design/paper/convergence.json").read_text(encoding="utf-8"))
    for curve in stored["curves"]:
        percent = [100 * value for value in curve["difference"]]
        right.semilogy(range(1, len(percent) + 1), percent, label=f"N = {curve['hemicube']}")
    right.set_xlabel("iteration")
    right.set_title("mean difference of E/π to Gauss–Seidel, % of the mean", fontsize=9)
    right.legend(fontsize=8)
    for axes in (left, right):
        axes.grid(which="both", alpha=0.2)
    figure.savefig(picture, dpi=100)
    pyplot.close(figure)


def _fig5(times: Times, picture: Path) -> None:
    """Draw times on processor and graphics card as bars, the paper's beside ours, with the speed-up."""
    import numpy as np
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, 3, figsize=(10.5, 4.4), sharey=True, layout="constrained")
    names = ["CPU, 1 layer", *(f"GPU, {k} layer{'s' if k > 1 else ''}" for k in LAYERS), "GPU, kept"]
    for axes, n in zip(panels, WIDTHS[::-1], strict=True):
        paper = [times.paper("cpu", n, 1), *(times.paper("gpu", n, k) for k in LAYERS)]
        ours = [
            times.drawn("cpu", n, 1),
            *(times.drawn("gpu", n, k) for k in LAYERS),
            times.kept("gpu", n)[1],
        ]
        places = np.arange(len(names))
        for shift, values, label in ((-0.2, paper, "paper"), (0.2, ours, "ours")):
            bars = axes.bar(places[: len(values)] + shift, values, 0.4, label=label)
            speed_ups = [f"{values[0] / value:,.{0 if values[0] > 100 * value else 1}f}×" for value in values]
            axes.bar_label(bars, speed_ups, fontsize=6, rotation=90, padding=2)
        axes.set_yscale("log")
        axes.set_ylim(0.1, 1e5)
        axes.set_xticks(places, names, rotation=40, ha="right", fontsize=8)
        axes.set_title(f"N = {n}", fontsize=10)
        axes.grid(axis="y", alpha=0.25)
    panels[0].set_ylabel("ms per iteration (above bars: speed-up over the own CPU)", fontsize=8)
    panels[0].legend(fontsize=8)
    figure.suptitle(
        f"paper: Core i5 750, GTX 550 Ti; ours: {times.devices['cpu']}, {times.devices['gpu']}", fontsize=9
    )
    figure.savefig(picture, dpi=100)
    pyplot.close(figure)


if __name__ == "__main__":
    main()
