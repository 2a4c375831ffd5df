"""The wheel as a stranger gets it: built, installed by plain pip in a fresh environment, used from an empty
folder.

pip resolves and installs all that the wheel asks for: what it forgets to ask for is missing here, though not
in the environment of the tests. The extras stay away. The Python that runs the tests is tried by `make test`;
the others that are found, and the demo, by `make test-all`.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from email.parser import Parser
from functools import cache
from importlib.metadata import version
from pathlib import Path
from zipfile import ZipFile

import pytest
from filelock import FileLock

from penumbra.rooms import ROOMS
from scenes import library

pytestmark = pytest.mark.usefixtures("processes")

ROOT = Path(__file__).parent.parent
RUNNING = f"{sys.version_info.major}.{sys.version_info.minor}"
OTHERS = [each for each in ("3.11", "3.12", "3.13") if each != RUNNING]
CORE = ("Python", "Embree", "OpenImageIO", "Mitsuba")  # by doctor's names; Mitsuba in two variants
# Modules of the extras and of the tests' tools.
ABSENT = ("pyrender", "OpenGL", "pyvista", "vtk", "simpleimageio", "pytest", "beartype")
SMALL = ("-D", "xresolution=32", "-D", "yresolution=24")
VERSION = version("penumbra")


def _run(
    command: Sequence[str | Path], folder: Path, seconds: float = 300
) -> subprocess.CompletedProcess[str]:
    """In `folder`, with nothing of the tests' environment but the way to pip's packages."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    environment.pop("VIRTUAL_ENV", None)
    environment["COLUMNS"] = "200"
    return subprocess.run(
        list(map(str, command)),
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=seconds,
    )


def _done(command: Sequence[str | Path], folder: Path, seconds: float = 300) -> str:
    done = _run(command, folder, seconds)
    told = f"{' '.join(map(str, command))}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    if "No matching distribution found for hatchling" in done.stderr and not os.environ.get(
        "PENUMBRA_STRICT"
    ):
        pytest.skip("pip reaches no packages from here")
    assert done.returncode == 0, told
    return done.stdout


def _base() -> str:
    """The interpreter that the environment of the tests was made of."""
    return str(Path(sys.base_prefix) / "bin" / f"python{RUNNING}")


@cache
def _works(python: str, wanted: str) -> bool:
    """Whether this is that version, and can make environments."""
    code = "import sys, venv, ensurepip; print('%d.%d' % sys.version_info[:2])"
    done = subprocess.run([python, "-c", code], capture_output=True, text=True)
    return done.stdout.strip() == wanted


def _python(wanted: str) -> str | None:
    """An interpreter of this version, or None.

    pyenv's names on the path lead nowhere until one is chosen; its versions lie beside them.
    """
    name = f"python{wanted}"
    found = _base() if wanted == RUNNING else shutil.which(name)
    if found is None:
        return None
    beside = sorted(Path(found).parent.parent.glob(f"versions/{wanted}.*/bin/{name}"))
    return next((path for path in map(str, [found, *beside]) if _works(path, wanted)), None)


def _environment(version: str, folder: Path) -> Path:
    """A fresh environment of this Python in `folder`; its bin folder."""
    python = _python(version)
    if python is None:
        pytest.skip(f"there is no Python {version} with venv here")
    _done([python, "-m", "venv", "env"], folder)
    return folder / "env" / "bin"


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """One folder for all workers: what is built and installed there serves each of them. The last one to end
    removes it, 800 MB.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "wheel"
    own = folder / f"user-{os.getpid()}"
    lock = FileLock(f"{folder}.lock")
    with lock:
        folder.mkdir(exist_ok=True)
        own.touch()
    yield folder
    with lock:
        own.unlink()
        if not list(folder.glob("user-*")):
            shutil.rmtree(folder)


@pytest.fixture(scope="module")
def wheel(shared: Path) -> Path:
    with FileLock(f"{shared}.lock"):
        if not (shared / "dist").exists():
            pip = _environment(RUNNING, shared) / "pip"
            _done([pip, "wheel", "--quiet", "--no-deps", "--wheel-dir", "building", ROOT], shared)
            (shared / "building").rename(shared / "dist")
    (built,) = (shared / "dist").iterdir()
    return built


@pytest.fixture(scope="module", params=[RUNNING, *(pytest.param(v, marks=pytest.mark.slow) for v in OTHERS)])
def installed(wheel: Path, shared: Path, request: pytest.FixtureRequest) -> Path:
    """The environment's bin folder. Bytecode is left to the first use."""
    folder = shared if request.param == RUNNING else shared / request.param
    with FileLock(f"{shared}.lock"):
        if not (folder / "installed").exists():
            folder.mkdir(exist_ok=True)
            env = folder / "env" / "bin" if request.param == RUNNING else _environment(request.param, folder)
            _done([env / "pip", "install", "--quiet", "--no-compile", wheel], folder, seconds=600)
            (folder / "installed").touch()
    return folder / "env" / "bin"


def test_the_wheel_holds_the_packages_and_their_data_and_nothing_else(wheel: Path) -> None:
    """A scene, a sweep, a template or a bundled script left behind would be missed at its first use only."""
    names = ZipFile(wheel).namelist()
    files = [path for room in (*ROOMS, "penumbra") for path in (ROOT / room).rglob("*") if path.is_file()]
    ours = {path.relative_to(ROOT).as_posix() for path in files if path.suffix != ".pyc"}
    assert ours ^ {name for name in names if not name.startswith(f"penumbra-{VERSION}.dist-info/")} == set()


def test_the_wheel_asks_for_extras_only_under_their_names(wheel: Path) -> None:
    (name,) = (name for name in ZipFile(wheel).namelist() if name.endswith(".dist-info/METADATA"))
    told = Parser().parsestr(ZipFile(wheel).read(name).decode())
    required = told.get_all("Requires-Dist") or []
    core = [line for line in required if "extra ==" not in line]
    assert any(line.startswith("numpy") for line in core)
    assert [line for line in core if line.lower().startswith(("pyrender", "pyvista", "simpleimageio"))] == []
    assert set(told.get_all("Provides-Extra") or []) == {"preview", "baseline", "all"}
    assert set((told["Requires-Python"] or "").split(",")) == {">=3.11", "<3.14"}


def test_pip_s_installation_renders_from_an_empty_folder(installed: Path, tmp_path: Path) -> None:
    penumbra = installed / "penumbra"
    assert "no broken requirements" in _done([installed / "pip", "check"], tmp_path).lower()
    assert "Usage: penumbra" in _done([penumbra, "--help"], tmp_path)
    listed = _done([penumbra, "list", "scenes"], tmp_path)
    assert [scene.name for scene in library() if scene.name not in listed] == []
    _done([penumbra, "render", "soft-shadow", "--spp", "1", *SMALL, "-o", "x.png"], tmp_path)
    assert (tmp_path / "x.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.png"]


def test_doctor_finds_the_core_whole_and_says_how_to_get_each_extra(installed: Path, tmp_path: Path) -> None:
    """The parts that pip alone brings work: Embree, OpenImageIO, both variants of Mitsuba."""
    told = json.loads(_done([installed / "penumbra", "doctor", "--json", "--quiet"], tmp_path))
    assert told["missing"] == []
    parts = {part["name"]: part for part in told["parts"]}
    core = {name: parts[name]["works"] for name in parts if name.split()[0] in CORE}
    assert len(core) == len(CORE) + 1 and all(core.values()), parts
    assert {name: parts[name]["remedy"] for name in ("pyrender", "preview")} == {
        "pyrender": "pip install 'penumbra[baseline]'",
        "preview": "pip install 'penumbra[preview]'",
    }


def test_the_face_is_imported_without_extras_and_names_the_one_that_a_command_lacks(
    installed: Path, tmp_path: Path
) -> None:
    code = f"""
from importlib.util import find_spec
import penumbra as pn
print([name for name in {ABSENT} if find_spec(name)])
image = pn.render(pn.load("touching-light", {{"xresolution": 8.0, "yresolution": 6.0}}), spp=1)
print(image.image.shape, all(getattr(pn, name) for name in pn.__all__))
"""
    assert _done([installed / "python", "-c", code], tmp_path) == "[]\n(6, 8, 3) True\n"
    for command, module, extra in (("preview", "pyvista", "preview"), ("baseline", "pyrender", "baseline")):
        done = _run([installed / "penumbra", command, "soft-shadow", "-o", "x.png", "--quiet"], tmp_path)
        assert done.returncode == 2
        assert f"pip install 'penumbra[{extra}]'" in done.stderr and module in done.stderr
        assert done.stderr.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("installed", [RUNNING], indirect=True)
def test_the_demo_runs_to_its_report(installed: Path, tmp_path: Path) -> None:
    """Without the extras: the rasterised baseline is left out, and the report says why."""
    told = _done([installed / "penumbra", "demo"], tmp_path, seconds=3600)
    report = tmp_path / told.splitlines()[-1]
    assert report.is_file() and "penumbra[baseline]" in report.read_text(encoding="utf-8")
