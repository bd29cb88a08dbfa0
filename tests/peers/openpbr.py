# SPDX-License-Identifier: BSD-3-Clause
"""Does a MaterialX document hold to OpenPBR 1.1? usage: openpbr.py FILE.mtlx

The table is of the inputs that open_pbr_surface has in MaterialX 1.39 and of the nodes that a tangent frame takes: their
types and bounds. What is misspelt, of another type, out of bounds or connected to nothing is named; exit status 1."""
import sys
import xml.etree.ElementTree as tree

UNIT, ANY = (0, 1), (0, float("inf"))
NODES = {
    "open_pbr_surface": ("surfaceshader", {
        "base_weight": ("float", UNIT), "base_color": ("color3", UNIT), "base_diffuse_roughness": ("float", UNIT),
        "base_metalness": ("float", UNIT), "specular_weight": ("float", ANY), "specular_color": ("color3", UNIT),
        "specular_roughness": ("float", UNIT), "specular_ior": ("float", (1, float("inf"))),
        "specular_roughness_anisotropy": ("float", UNIT), "fuzz_weight": ("float", UNIT), "fuzz_color": ("color3", UNIT),
        "fuzz_roughness": ("float", UNIT), "coat_weight": ("float", UNIT), "coat_color": ("color3", UNIT),
        "coat_roughness": ("float", UNIT), "coat_roughness_anisotropy": ("float", UNIT), "coat_ior": ("float", (1, float("inf"))),
        "coat_darkening": ("float", UNIT), "geometry_opacity": ("float", UNIT), "geometry_normal": ("vector3", None),
        "geometry_tangent": ("vector3", None), "geometry_coat_normal": ("vector3", None), "geometry_coat_tangent": ("vector3", None)}),
    "surfacematerial": ("material", {"surfaceshader": ("surfaceshader", None)}),
    "tangent": ("vector3", {"space": ("string", None), "index": ("integer", None)}),
    "normal": ("vector3", {"space": ("string", None)}),
    "rotate3d": ("vector3", {"in": ("vector3", None), "amount": ("float", (-360, 360)), "axis": ("vector3", None)}),
}


def faults(path):
    root = tree.parse(path).getroot()
    if root.tag != "materialx" or root.get("version") != "1.39":
        yield "no materialx document of version 1.39"
    there = {node.get("name"): node for node in root}
    if len(there) != len(root):
        yield "a name stands twice"
    if not any(node.tag == "surfacematerial" for node in root):
        yield "no surfacematerial"
    for node in root:
        kind, inputs = NODES.get(node.tag, (None, {}))
        if kind is None or node.get("type") != kind:
            yield f"{node.tag}: type {node.get('type')}, expected {kind}"
        for one in node:
            where, (kind, bounds) = f"{node.tag}.{one.get('name')}", inputs.get(one.get("name"), (None, None))
            if one.tag != "input" or kind is None or one.get("type") != kind:
                yield f"{where}: type {one.get('type')}, expected {kind}"
            elif one.get("nodename") is not None:
                source = there.get(one.get("nodename"))
                if source is None or source.get("type") != kind:
                    yield f"{where}: comes from '{one.get('nodename')}', which is no {kind}"
            else:
                values = [float(v) for v in one.get("value").split(",")] if kind in ("float", "color3") else []
                if len(values) != {"float": 1, "color3": 3}.get(kind, 0):
                    yield f"{where}: value '{one.get('value')}'"
                if bounds is not None and not all(bounds[0] <= v <= bounds[1] for v in values):
                    yield f"{where}: {one.get('value')}, expected {bounds[0]} to {bounds[1]}"


found = list(faults(sys.argv[1]))
print("\n".join(found))
sys.exit(bool(found))
