"""Doctor tries things; what it finds out here must agree with what the tests find out by themselves."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from pipeline import doctor
from pipeline.doctor import Part, verdict
from tests.system_parts import chromium


def test_embree_and_images_work_here() -> None:
    (python,), (embree,), (images,) = doctor.system(), doctor.embree(), doctor.images()
    assert (python.works, embree.works, images.works) == (True, True, True)
    assert sys.version.split()[0] in python.detail


def test_a_part_that_breaks_is_told_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "renderer.geometry.triangles", None)
    (part,) = doctor.embree()
    assert not part.works
    assert part.detail.startswith("ModuleNotFoundError")
    assert "embreex" in part.remedy


def test_a_part_that_gives_wrong_answers_does_not_work(monkeypatch: pytest.MonkeyPatch) -> None:
    import scenes.images.exr

    real = scenes.images.exr.write_exr
    monkeypatch.setattr(
        scenes.images.exr, "write_exr", lambda path, channels: real(path, {"R": channels["R"] * 2})
    )
    (part,) = doctor.images()
    assert (part.works, part.detail) == (False, "an EXR is not read back as written")


def test_a_run_needs_one_part_of_each_group() -> None:
    def part(works: bool, needed: str) -> Part:
        return Part("p", works, "", "", needed)

    assert verdict([part(False, "M"), part(True, "M"), part(False, "")]) == []
    assert verdict([part(False, "M"), part(False, "M"), part(True, "E")]) == ["M"]


@pytest.mark.usefixtures("opengl")
def test_pyrender_draws_a_triangle() -> None:
    (part,) = doctor.rasteriser()
    assert part.works, part.detail


@pytest.mark.usefixtures("browser")
def test_the_browser_shows_a_page() -> None:
    (part,) = doctor.browser()
    assert part.works, part.detail
    assert str(chromium()) in part.detail


@pytest.mark.usefixtures("processes")
def test_no_browser_and_one_that_fails(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    (none,) = doctor.browser()
    assert not none.works
    assert "install" in none.remedy
    (tmp_path / "chromium").symlink_to(
        "/bin/false" if Path("/bin/false").exists() else str(shutil.which("false"))
    )
    (failing,) = doctor.browser()
    assert not failing.works
    assert "ended with code 1" in failing.detail


@pytest.mark.usefixtures("opengl")
def test_egl_is_tried() -> None:
    (part,) = doctor.opengl()
    assert part.works == part.detail.startswith("EGL 1.")
    assert part.works or part.remedy
