"""Renders exported files with three.js, in Chromium without a window.

Chromium draws with SwiftShader, so no graphics card is needed. The page gets three.js, the example of
examples/three and the file from a server in this process, and sends it the pixels.
"""

from __future__ import annotations

import contextlib
import mimetypes
import queue
import shutil
import subprocess
import tempfile
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlencode, urlsplit

import numpy as np

HERE = Path(__file__).parent
ROOT = HERE.parents[1]

#: Where npm puts three.js, in the version of package.json.
MODULES = ROOT / "out" / "engines"

_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-extensions", "--no-first-run", "--disable-dev-shm-usage",
)  # fmt: skip

#: Longest time that a page may take, s.
_PATIENCE = 180


def missing() -> str:
    """Return the missing requirements of a render, and how to install them; empty if all are installed."""
    if _browser() is None:
        return "Chromium is not installed (Debian: apt install chromium)"
    if not (MODULES / "node_modules" / "three").is_dir() and shutil.which("npm") is None:
        return "npm is not installed, which brings three.js (Debian: apt install npm)"
    return ""


def install() -> None:
    """Let npm bring three.js; raises CalledProcessError."""
    if (MODULES / "node_modules" / "three").is_dir():
        return
    MODULES.mkdir(parents=True, exist_ok=True)
    for name in ("package.json", "package-lock.json"):
        shutil.copy2(HERE / name, MODULES / name)
    subprocess.run(["npm", "ci", "--no-audit", "--no-fund", "--silent"], cwd=MODULES, check=True)


def render(
    path: Path, width: int, height: int, hide: tuple[str, ...] = (), files: bool = False
) -> np.ndarray:
    """Render a file through its camera with three.js; return (h, w, 3) float32, linear, bottom row first.

    hide:   names of nodes that are not shown
    files:  show the OpenEXR lightmaps beside the file instead of those in it
    """
    asked = {"file": path.name, "width": width, "height": height, "hide": ",".join(hide)}
    answers: queue.Queue[tuple[str, bytes]] = queue.Queue()
    with (
        _served(path.parent, answers) as port,
        _open_browser(
            f"http://127.0.0.1:{port}/show?{urlencode({**asked, **({'files': 1} if files else {})})}"
        ),
    ):
        kind, data = answers.get(timeout=_PATIENCE)
    if kind == "/error":
        raise RuntimeError(data.decode())
    return np.frombuffer(data, np.float32).reshape(height, width, 4)[..., :3].copy()


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
    """Serve the page, three.js, the example and a folder; yields the port."""
    places = {
        "three": MODULES / "node_modules" / "three",
        "example": ROOT / "examples" / "three",
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
    """Gives out files, and takes the pixels."""

    places: dict[str, Path]
    answers: queue.Queue

    def do_GET(self) -> None:
        head, _, rest = unquote(urlsplit(self.path).path).lstrip("/").partition("/")
        path = self.places[head] / rest if head in self.places else HERE / "show.html"
        if not path.is_file():
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
        """Tell nothing."""


def _kind(path: Path) -> str:
    return (
        "text/javascript"
        if path.suffix == ".js"
        else mimetypes.guess_type(path)[0] or "application/octet-stream"
    )
