"""Small glTF files. Standard library only."""
import base64
import json
import struct

FORMATS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Gltf:
    """A file with one scene of one node, until more is added; `json` may be changed at will before it is written."""

    def __init__(self):
        self.binary = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [], "accessors": [], "bufferViews": []}

    def view(self, data):
        self.binary += bytes(-len(self.binary) % 4)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)})
        self.binary += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, kind, numbers, component=5126, **more):
        data = struct.pack(f"<{len(numbers)}{FORMATS[component]}", *numbers)
        self.json["accessors"].append({"bufferView": self.view(data), "componentType": component, "count": len(numbers) // SIZES[kind], "type": kind, **more})
        return len(self.json["accessors"]) - 1

    def add(self, key, item):
        self.json.setdefault(key, []).append(item)
        return len(self.json[key]) - 1

    def mesh(self, positions, indices=None, normals=None, uvs=None, material=None, **more):
        primitive = {"attributes": {"POSITION": self.accessor("VEC3", positions)}, **more}
        if normals:
            primitive["attributes"]["NORMAL"] = self.accessor("VEC3", normals)
        if uvs:
            primitive["attributes"]["TEXCOORD_0"] = self.accessor("VEC2", uvs)
        if indices:
            primitive["indices"] = self.accessor("SCALAR", indices, 5123)
        if material is not None:
            primitive["material"] = material
        return self.add("meshes", {"primitives": [primitive]})

    def node(self, **fields):
        self.json["scenes"][0]["nodes"].append(self.add("nodes", fields))
        return len(self.json["nodes"]) - 1

    def text(self):
        """.gltf with the data inside"""
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.binary).decode()
        return json.dumps({**self.json, "buffers": [{"byteLength": len(self.binary), "uri": uri}]})

    def container(self):
        """.glb"""
        text = json.dumps({**self.json, "buffers": [{"byteLength": len(self.binary)}]}).encode()
        return glb(text + b" " * (-len(text) % 4), self.binary + bytes(-len(self.binary) % 4))


def glb(text, binary, version=2, length=None):
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return b"glTF" + struct.pack("<II", version, 12 + len(chunks) if length is None else length) + chunks


def triangle(**more):
    """One triangle."""
    scene = Gltf()
    scene.node(mesh=scene.mesh([0, 0, 0, 1, 0, 0, 0, 1, 0], **more))
    return scene
