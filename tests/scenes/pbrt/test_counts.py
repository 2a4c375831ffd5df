"""Every parameter with every small number of values: an error of the file's at most, never one of ours."""

from __future__ import annotations

import pytest

from scenes.errors import SceneError
from scenes.pbrt.parser import parse

# Directive and kind, then the parameters that are read, as "type name".
OPTIONS = {
    'Camera "perspective"': (
        "float fov, float screenwindow, float frameaspectratio, float lensradius, float focaldistance"
    ),
    'Camera "orthographic"': "float screenwindow, float lensradius, float focaldistance, float shutteropen",
    'Film "rgb"': (
        "integer xresolution, float cropwindow, integer pixelbounds, string sensor, float iso, bool savefp16"
    ),
    'PixelFilter "gaussian"': "float xradius, float sigma",
    'Sampler "stratified"': "integer xsamples, bool jitter, integer seed",
    'Integrator "ambientocclusion"': "float maxdistance, bool cossample",
    'Integrator "path"': "integer maxdepth, string lightsampler, bool regularize",
}
WORLD = {
    'LightSource "infinite"': (
        "rgb L, spectrum L, blackbody L, float scale, float illuminance, point3 portal, string filename"
    ),
    'LightSource "spot"': "rgb I, point3 from, point3 to, float coneangle, float conedeltaangle, float power",
    'LightSource "distant"': "rgb L, point3 from, float illuminance",
    'LightSource "goniometric"': "rgb I, string filename, float power",
    'LightSource "projection"': "string filename, float fov, float power, float scale",
    'AreaLightSource "diffuse"': "rgb L, bool twosided, float power, string filename",
    'Material "diffuse"': "rgb reflectance, spectrum reflectance, texture reflectance, string normalmap",
    'Material "conductor"': "rgb eta, spectrum k, float roughness, bool remaproughness, texture roughness",
    'Texture "t" "spectrum" "checkerboard"': (
        "integer dimension, rgb tex1, texture tex2, string mapping, float uscale"
    ),
    'Texture "t" "float" "scale"': "float tex, texture scale",
    'Texture "t" "spectrum" "imagemap"': "string filename, string wrap, float scale, bool invert",
    'Shape "trianglemesh"': (
        "point3 P, integer indices, normal N, point2 uv, vector3 S, float alpha, integer faceIndices"
    ),
    'Shape "bilinearmesh"': "point3 P, integer indices, normal N, point2 uv",
    'Shape "loopsubdiv"': "point3 P, integer indices, integer levels, string scheme",
    'Shape "sphere"': "float radius, float zmin, float phimax",
    'Shape "disk"': "float radius, float height, float innerradius",
    'Shape "plymesh"': "string filename, texture displacement",
}
CASES = [(False, head, one) for head, names in OPTIONS.items() for one in names.split(", ")]
CASES += [(True, head, one) for head, names in WORLD.items() for one in names.split(", ")]
VALUES = {"string": '"none"', "texture": '"none"', "bool": "true"}


@pytest.mark.parametrize(
    ("world", "head", "parameter"), CASES, ids=[f"{head} {one}" for _, head, one in CASES]
)
def test_any_number_of_values_is_read_or_refused_in_words(world: bool, head: str, parameter: str) -> None:
    for count in (0, 1, 2, 3, 4, 5, 6, 7, 9, 12):
        for value in ("0", "1", "-1"):
            values = " ".join([VALUES.get(parameter.split()[0], value)] * count)
            text = f'{head} "{parameter}" [ {values} ]\n'
            try:
                parse("WorldBegin\n" + text if world else text + "WorldBegin\n")
            except SceneError as error:
                assert error.location is not None, error
