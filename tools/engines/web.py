"""Renders exported files with engines of the web, in Chromium without a window.

Chromium draws with SwiftShader, so no graphics card is needed. The page gets the engine, the loaders of
clients/ and the file from a server in this process, and sends it the pixels.
"""

from __future__ import annotations

import contextlib
import json
import mimetypes
import queue
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlencode, urlsplit

import numpy as np

HERE = Path(__file__).parent
ROOT = HERE.parents[1]

#: Where npm puts the engines, in the versions of package.json.
MODULES = ROOT / "out" / "engines"

_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader",
    "--disable-extensions", "--no-first-run", "--disable-dev-shm-usage",
)  # fmt: skip

#: Longest time that a page may take, s.
_PATIENCE = 600


@dataclass(frozen=True)
class Shown:
    """Picture of a page.

    pixels:    (h, w, 3) float32, linear, bottom row first; of a path (n, h, w, 3)
    problems:  messages of the loader
    """

    pixels: np.ndarray
    problems: list[str]


@dataclass(frozen=True)
class WebEngine:
    """An engine of the web.

    package:  name of its npm package
    module:   file of this folder that renders with it in show.html
    """

    package: str
    module: str

    def missing(self) -> str:
        """Return the missing requirement of a render, and how to install it; empty if all are installed."""
        if _browser() is None:
            return "Chromium is not installed (Debian: apt install chromium)"
        if not self._is_there() and shutil.which("npm") is None:
            return f"npm is not installed, which brings {self.package} (Debian: apt install npm)"
        return ""

    def install(self) -> None:
        """Let npm bring the engines; raises CalledProcessError."""
        if self._is_there():
            return
        MODULES.mkdir(parents=True, exist_ok=True)
        for name in ("package.json", "package-lock.json"):
            shutil.copy2(HERE / name, MODULES / name)
        subprocess.run(["npm", "ci", "--no-audit", "--no-fund", "--silent"], cwd=MODULES, check=True)

    def show(
        self,
        path: Path,
        width: int,
        height: int,
        hide: tuple[str, ...] = (),
        files: bool = False,
        state: str = "",
        seconds: float = 0.0,
        groups: tuple[tuple[str, tuple[float, float, float], float], ...] = (),
        background: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> Shown:
        """Return what the engine shows through a file's camera; raises RuntimeError with the page's error.

        hide:     names of nodes that are not shown
        files:    show the lightmaps beside the file instead of those in it
        state:    light state to show, after a fade of `seconds`
        groups:   name, color and strength of light groups that are set before
        background:  radiance where nothing is shown
        """
        asked = {
            "file": path.name, "width": width, "height": height, "hide": hide, "files": files, "state": state,
            "seconds": seconds, "groups": groups, "background": background, "places": [(0, 0, 0)],
        }  # fmt: skip
        problems, data = self.answer(path.parent, asked)
        return Shown(_pictures(data, width, height)[0], problems)

    def show_path(
        self,
        path: Path,
        width: int,
        height: int,
        moved: str,
        places: Sequence[Sequence[float]],
        hide: tuple[str, ...] = (),
        state: str = "",
        background: Sequence[float] = (0.0, 0.0, 0.0),
        probes: str = "hemibake.json",
    ) -> Shown:
        """Return what three.js shows with a dynamic object at some places, lit by light probes; see `show`.

        moved:   name of the object's node
        places:  its positions, y up, m
        probes:  manifest of the light probes, in the folder of the file
        """
        asked = {
            "file": path.name, "width": width, "height": height, "hide": hide, "files": False, "state": state,
            "seconds": 0.0, "groups": (), "background": background, "moved": moved, "places": places,
            "probes": probes,
        }  # fmt: skip
        problems, data = self.answer(path.parent, asked)
        return Shown(_pictures(data, width, height), problems)

    def answer(self, folder: Path, asked: dict) -> tuple[list[str], bytes]:
        """Return the problems and the bytes that the page answers; raises RuntimeError with the page's error.

        folder:  served as /file
        asked:   question for the page
        """
        answers: queue.Queue[tuple[str, bytes]] = queue.Queue()
        problems: list[str] = []
        question = {"module": self.module, "asked": json.dumps(asked)}
        with (
            _served(folder, answers) as port,
            _open_browser(f"http://127.0.0.1:{port}/page/show.html?{urlencode(question)}"),
        ):
            kind, data = answers.get(timeout=_PATIENCE)
            if kind == "/problems":
                problems = json.loads(data)
                kind, data = answers.get(timeout=_PATIENCE)
        if kind == "/error":
            raise RuntimeError(data.decode())
        return problems, data

    def render(
        self, path: Path, width: int, height: int, hide: tuple[str, ...] = (), files: bool = False
    ) -> np.ndarray:
        """Return the pixels of `show`, (h, w, 3) float32, linear, bottom row first."""
        return self.show(path, width, height, hide, files).pixels

    def _is_there(self) -> bool:
        """Return True if npm has brought the engine in the version of package.json."""
        installed = MODULES / "package.json"
        return (MODULES / "node_modules" / self.package).is_dir() and installed.read_bytes() == (
            HERE / "package.json"
        ).read_bytes()


THREE = WebEngine("three", "show_three.js")
THREE_PROBES = WebEngine("three", "show_probes.js")
THREE_PROBES_WEBGPU = WebEngine("three", "show_probes_webgpu.js")
THREE_REFLECTIONS = WebEngine("three", "show_reflections.js")
BABYLON = WebEngine("@babylonjs/loaders", "show_babylon.js")
PLAYCANVAS = WebEngine("playcanvas", "show_playcanvas.js")


def _pictures(data: bytes, width: int, height: int) -> np.ndarray:
    """Return the pictures of a page, (n, h, w, 3) float32."""
    return np.frombuffer(data, np.float32).reshape(-1, height, width, 4)[..., :3].copy()


def _browser() -> str | None:
    return next(filter(None, map(shutil.which, _BROWSERS)), None)


@contextlib.contextmanager
def _open_browser(url: str):
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [_browser(), *_FLAGS, f"--user-data-dir={profile}", url]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as browser:
            try:
                yield
            finally:
                browser.terminate()


@contextlib.contextmanager
def _served(folder: Path, answers: queue.Queue):
    """Serve show.html, the engines, the clients and a folder; yields the port."""
    places = {
        "modules": MODULES / "node_modules",
        "three": MODULES / "node_modules" / "three",
        "clients": ROOT / "clients",
        "page": HERE,
        "file": folder,
    }
    handler = type("Handler", (_Handler,), {"places": places, "answers": answers})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield server.server_port
        finally:
            server.shutdown()


class _Handler(BaseHTTPRequestHandler):
    """Serves files, and takes the answers."""

    places: dict[str, Path]
    answers: queue.Queue

    def do_GET(self) -> None:
        asked = urlsplit(self.path).path
        head, _, rest = unquote(asked).lstrip("/").partition("/")
        path = self.places[head] / rest if head in self.places else None
        # Many servers refuse encoded slashes.
        if path is None or not path.is_file() or "%2f" in asked.lower():
            self.send_error(404)
            return
        self._answer(path.read_bytes(), _kind(path))

    def do_POST(self) -> None:
        self.answers.put((self.path, self.rfile.read(int(self.headers["Content-Length"]))))
        self._answer(b"", "text/plain")

    def _answer(self, data: bytes, kind: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *arguments: object) -> None:
        """Log nothing."""


def _kind(path: Path) -> str:
    return (
        "text/javascript"
        if path.suffix in (".js", ".mjs")
        else mimetypes.guess_type(path)[0] or "application/octet-stream"
    )
