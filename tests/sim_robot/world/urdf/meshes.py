"""One triangle as a file of each kind."""

from __future__ import annotations

import struct

NO_TRIANGLES = (
    b'<triangles count="0"><input offset="0" semantic="VERTEX" source="#v"/><p></p></triangles>'
)
CORNERS = [(-0.01, 0.0, 0.0), (0.03, 0.0, 0.0), (0.0, 0.01, -0.2)]


def binary_stl(corners: list[tuple[float, float, float]]) -> bytes:
    numbers = [0.0, 0.0, 1.0, *(value for corner in corners for value in corner)]
    return bytes(80) + struct.pack("<I12fH", 1, *numbers, 0)


def text_stl(corners: list[tuple[float, float, float]]) -> bytes:
    lines = "".join("vertex {} {} {}\n".format(*corner) for corner in corners)
    return (
        f"solid leg\nfacet normal 0 0 1\nouter loop\n{lines}endloop\nendfacet\nendsolid\n".encode()
    )


def obj(corners: list[tuple[float, float, float]]) -> bytes:
    return ("".join("v {} {} {}\n".format(*corner) for corner in corners) + "f 1 2 3\n").encode()


def dae(corners: list[tuple[float, float, float]]) -> bytes:
    """In centimetres, half a metre to the left in the file and back in the scene."""
    numbers = " ".join(f"{100 * x} {100 * y + 50} {100 * z}" for x, y, z in corners)
    accessor = '<accessor source="#n" count="3" stride="3">' + "".join(
        f'<param name="{axis}" type="float"/>' for axis in "XYZ"
    )
    return f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2026-11-22T00:00:00</created><modified>2026-11-22T00:00:00</modified>
<unit meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="s"><float_array id="n" count="9">{numbers}</float_array>
<technique_common>{accessor}</accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node><translate>0 -50 0</translate>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#w"/></scene></COLLADA>""".encode()
