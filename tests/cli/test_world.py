"""Sensors, lights without extent, round shapes and instances of scene files, through the verbs."""
import unittest

from support import Case, measured

WORLD = """<scene version="3.0.0"><sensor type="thinlens"><float name="aperture_radius" value="0.05"/><float name="focus_distance" value="4"/><transform name="to_world">
<lookat origin="0, 1, 4" target="0, 0, 0" up="0, 1, 0"/></transform><film type="hdrfilm"><integer name="width" value="20"/><integer name="height" value="12"/>
<integer name="crop_offset_x" value="4"/><integer name="crop_width" value="10"/><rfilter type="lanczos"/></film></sensor>
<sensor type="orthographic"><transform name="to_world"><scale x="2" y="2"/><lookat origin="0, 4, 0.1" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="6"/><rfilter type="box"/></film></sensor>
<shape type="shapegroup" id="g"><shape type="cylinder"><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape><shape type="disk"/></shape>
<shape type="instance"><ref id="g"/></shape><shape type="instance"><ref id="g"/><transform name="to_world"><scale value="0.5"/><translate x="-1"/></transform></shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" y="0" z="0" angle="-90"/><scale value="3"/></transform></shape>
<emitter type="point"><point name="position" x="0" y="3" z="1"/><rgb name="intensity" value="9"/></emitter></scene>"""


class World(Case):
    def test_sensors_lights_and_instances(self):
        """Each sensor has its own film; a scene of instances under a lamp without extent is rendered and trained."""
        file, out = self.write("w.xml", WORLD), self.path("o.exr")
        info = self.ok("info", file, "--json").json()
        self.assertEqual((info["delta_lights"], info["lights"], info["shapes"]), (1, 1, 5))
        for sensor, size in ((0, (10, 12)), (1, (8, 6))):
            report = self.ok("render", file, "-o", out, "--integrator", "path", "--spp", "16", "--sensor", str(sensor), "--json").json()
            self.assertEqual((report["width"], report["height"]), size)
        red = {c["name"]: c for c in self.ok("info", out, "--json").json()["channels"]}["R"]
        self.assertGreater(red["mean"], 0.05)
        self.fails(1, "the sensor is orthographic", "render", file, "-o", out, "--integrator", "path", "--spp", "1", "--sensor", "1", "--fov", "30")
        self.ok("train", file, "-o", self.path("m.octrad"), "--steps", "2", "-D", "octree.levels=3", "-D", "train.points=256")
        self.ok("render", file, "-o", out, "--model", self.path("m.octrad"), "--integrator", "lhs", "--spp", "1")
        again = self.path("again.xml")
        self.ok("convert", file, "-o", again)
        self.assertEqual(self.ok("info", again, "--json").json()["fingerprint"], info["fingerprint"])

    def test_instances_share_their_mesh(self):
        """A thousand instances take less than two more copies of the mesh would."""
        side = 300
        rows = [f"{x} {y} {(x * y) % 7}" for y in range(side) for x in range(side)]
        faces = [f"3 {i} {i + 1} {i + side}" for y in range(side - 1) for i in range(y * side, y * side + side - 1)]
        self.write("m.ply", f"ply\nformat ascii 1.0\nelement vertex {len(rows)}\nproperty float x\nproperty float y\nproperty float z\nelement face {len(faces)}\n"
                   "property list uchar int vertex_indices\nend_header\n" + "\n".join(rows + faces) + "\n")
        mesh = '<shape type="ply"><string name="filename" value="m.ply"/></shape>'
        group = f'<shape type="shapegroup" id="g">{mesh}</shape>'

        def peak(shapes):
            file = self.write("s.xml", '<scene version="3.0.0"><sensor type="perspective"/>' + shapes + '<emitter type="constant"/></scene>')
            code, bytes, _ = measured("render", file, "-o", self.path("o.exr"), "--integrator", "path", "--spp", "1", "--width", "16", "--height", "16", "-q")
            self.assertEqual(code, 0)
            return bytes

        instances = [f'<shape type="instance"><ref id="g"/><transform name="to_world"><translate x="{400 * i}"/></transform></shape>' for i in range(1000)]
        one, many, copies = peak(group + instances[0]), peak(group + "".join(instances)), peak(3 * mesh)
        limit = 2 * (len(faces) * 12 + len(rows) * 24)
        self.assertLess(many - one, limit, (one, many))
        self.assertGreater(copies - one, limit, (one, copies))  # copies are seen


if __name__ == "__main__":
    unittest.main()
