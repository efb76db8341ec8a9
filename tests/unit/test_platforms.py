"""Portability: no module on the add-on's path needs a single operating system."""

import ast
import ctypes
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[2]

#: What Windows lacks, and what only Linux has.
POSIX_MODULES = {"fcntl", "grp", "pwd", "pty", "resource", "termios", "tty"}
POSIX_NAMES = {
    "os": {
        "chown", "chroot", "fchmod", "fork", "forkpty", "geteuid", "getgid", "getloadavg", "getpgid",
        "getuid", "kill", "killpg", "lchown", "mkfifo", "nice", "setpgid", "setsid", "statvfs", "sysconf",
        "uname", "wait", "waitpid",
    },
    "signal": {
        "SIGALRM", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGUSR1", "SIGUSR2", "alarm",
        "pthread_kill", "pthread_sigmask", "setitimer", "sigwait",
    },
}  # fmt: skip
POSIX_PREFIXES = {"os": ("sched_", "posix_", "memfd_", "eventfd")}
POSIX_FOLDERS = ("/proc", "/dev/", "/sys/", "/tmp", "/etc", "/usr", "/var", "/run")
POSIX_OPTIONS = {"preexec_fn", "pass_fds", "start_new_session", "process_group"}

PLATFORM = "sys.platform"


def sources() -> list[Path]:
    return [
        path for part in ("engine", "operators", "panels") for path in sorted((ROOT / part).rglob("*.py"))
    ]


def posix_only(tree: ast.Module) -> list[ast.AST]:
    """Return nodes of a module that need one operating system, outside of branches on `sys.platform`."""
    guarded = {id(inner) for node in ast.walk(tree) for part in branches(node) for inner in ast.walk(part)}
    return [node for node in ast.walk(tree) if id(node) not in guarded and is_posix_only(node)]


def branches(node: ast.AST) -> list[ast.AST]:
    """Return the parts of a node that run on one platform: of an `if`, an `and`, or after an early return."""
    if isinstance(node, ast.If | ast.IfExp) and PLATFORM in ast.unparse(node.test):
        parts = [node.test, node.body, node.orelse]
        return [part for group in parts for part in (group if isinstance(group, list) else [group])]
    if isinstance(node, ast.BoolOp) and PLATFORM in ast.unparse(node.values[0]):
        return node.values
    if isinstance(node, ast.FunctionDef):
        return after_early_return(node.body)
    return []


def after_early_return(body: list[ast.stmt]) -> list[ast.stmt]:
    """Return the statements behind the first `if sys.platform ...` that ends by leaving the function."""
    for index, statement in enumerate(body):
        leaves = isinstance(statement, ast.If) and isinstance(statement.body[-1], ast.Return | ast.Raise)
        if leaves and PLATFORM in ast.unparse(statement.test):
            return body[index + 1 :]
    return []


def is_posix_only(node: ast.AST) -> bool:
    """Return True if a node imports, names or opens something that some platforms lack."""
    if isinstance(node, ast.Import):
        return any(alias.name in POSIX_MODULES for alias in node.names)
    if isinstance(node, ast.ImportFrom):
        return node.module in POSIX_MODULES
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        module = node.value.id
        named = node.attr in POSIX_NAMES.get(module, ())
        return named or node.attr.startswith(POSIX_PREFIXES.get(module, ("\0",)))
    if isinstance(node, ast.keyword):
        return node.arg in POSIX_OPTIONS
    return isinstance(node, ast.Constant) and str(node.value).startswith(POSIX_FOLDERS)


@pytest.mark.parametrize("path", sources(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_nothing_of_one_system_is_on_the_path_of_another(path):
    found = posix_only(ast.parse(path.read_text(encoding="utf-8")))
    assert not [f"line {node.lineno}: {ast.unparse(node)}" for node in found]


@pytest.mark.parametrize(
    "code",
    [
        "import fcntl",
        "from resource import getrlimit",
        "os.fork()",
        "os.sched_getaffinity(0)",
        "def kill(pid):\n    os.kill(pid, signal.SIGKILL)",
        "Path('/proc/self/status')",
        "if sys.platform == 'linux':\n    pass\nos.getuid()",
        "subprocess.Popen(command, pass_fds=(3,))",
    ],
)
def test_the_check_finds(code):
    assert posix_only(ast.parse(code))


@pytest.mark.parametrize(
    "code",
    [
        "if sys.platform == 'win32':\n    import msvcrt\nelse:\n    import fcntl",
        "def lock():\n    if sys.platform == 'win32':\n        return None\n    return os.getuid()",
        "deadly = sys.platform != 'win32' and signal.SIGPIPE",
        "os.replace(a, b); os.cpu_count(); '/lightmaps'",
    ],
)
def test_the_check_accepts(code):
    assert not posix_only(ast.parse(code))


@pytest.mark.parametrize(
    ("system", "options"),
    [
        ("linux", {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}),
        ("win32", {}),
        ("darwin", {}),
    ],
)
def test_opengl_is_started_with_egl_on_linux_and_else_with_what_the_system_has(monkeypatch, system, options):
    from engine.device import gl_context

    asked = []

    def create_context(**keywords):
        asked.append(keywords)
        raise RuntimeError("no driver")

    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(gl_context.moderngl, "create_context", create_context)
    with pytest.raises(gl_context.DeviceError, match=r"No OpenGL 4\.1 driver"):
        gl_context.GraphicsContext()
    assert asked == [{"require": version, "standalone": True, **options} for version in (450, 410)]


@pytest.mark.parametrize(
    ("system", "loader", "library"),
    [
        ("linux", "CDLL", "libEGL.so.1"),
        ("win32", "WinDLL", "opengl32"),
        ("darwin", "CDLL", "/System/Library/Frameworks/OpenGL.framework/OpenGL"),
    ],
)
def test_opengl_functions_are_found_as_the_system_does(monkeypatch, system, loader, library):
    from engine.device import raw_gl

    loaded = []

    def load(name):
        loaded.append(name)
        return SimpleNamespace(
            wglGetProcAddress=lambda name: 0x1000,
            eglGetProcAddress=lambda name: 0x1000,
            glClear=ctypes.c_int(7),
        )

    load_library = SimpleNamespace(**{loader: load}, cast=ctypes.cast, c_void_p=ctypes.c_void_p)
    load_library.c_char_p = ctypes.c_char_p
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(raw_gl, "ctypes", load_library)
    address_of = raw_gl._address_finder()
    assert loaded == [library]
    if system != "darwin":
        assert address_of("glClear") == 0x1000
    assert system == "linux" or address_of("glNothing") in (None, 0x1000)


@pytest.mark.parametrize("system", ["linux", "win32", "darwin"])
def test_a_missing_opencl_driver_has_a_remedy_of_its_system(system):
    from engine.device.cl_device import remedy

    package_managers = {"apt", "dnf", "pacman", "pip"}
    named = package_managers & set(remedy(system).split())
    assert named == ({"apt", "dnf", "pacman"} if system == "linux" else set())


def test_names_of_shared_memory_are_short_enough_for_macos():
    from engine.worker.messages import PackedMessage
    from engine.worker.shared_block import SharedBlock

    with SharedBlock(PackedMessage("anything")) as block:
        assert len(f"/{block.name}".encode()) <= 31
