"""Scene files: the list of what is refused, stand-ins, and scenes written again."""
import os
import unittest

from gltf import Gltf
from support import Case, run

SENSOR = '<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/></film></sensor>'
OLD = '<scene version="0.6.0"><integrator type="bdpt"><integer name="maxDepth" value="4"/></integrator>' + SENSOR + """
<bsdf type="plastic" id="p"><float name="intIOR" value="1.6"/><rgb name="diffuseReflectance" value="0.5 0.2 0.1"/></bsdf>
<shape type="rectangle"><transform name="toWorld"><translate z="3"/><rotate y="1" angle="180"/></transform><ref id="p"/></shape>
<emitter type="constant"/></scene>"""
BROKEN = '<scene version="3.0.0">' + SENSOR + """
<shape type="sphere"><bsdf type="velvet"/><medium name="interior" type="homogeneous"/><transform name="to_world"><translate z="-5"/></transform></shape>
<shape type="teapot"/>
<emitter type="constant"/></scene>"""


class Scenes(Case):
    def test_check(self):
        file = self.write("s.xml", OLD)
        check = self.ok("info", file, "--check", "--json").json()
        self.assertEqual((check["loads"], check["refused"]), (True, []))
        self.assertEqual(len(check["assumed"]), 2)
        self.assertIn("scene version 0.6.0", check["assumed"][0])
        self.assertIn('"bdpt" read as path', check["assumed"][1])
        self.assertIn("loads\n", self.ok("info", file, "--check").out)
        file = self.write("b.xml", BROKEN)
        result = run("info", file, "--check", "--json")
        self.assertEqual(result.code, 2)
        self.assertIn("3 things cannot be used", result.err)
        broken = result.json()
        self.assertFalse(broken["loads"])
        self.assertEqual([issue["where"].split("b.xml")[1] for issue in broken["refused"]], [":2:22", ":2:43", ":3:1"])
        self.assertIn('bsdf "velvet"', broken["refused"][0]["what"])
        cut = run("info", self.write("c.xml", "<scene"), "--check", "--json")
        self.assertEqual((cut.code, len(cut.json()["refused"])), (2, 1))
        self.fails(3, "none.xml", "info", self.path("none.xml"), "--check")
        self.fails(1, "--check belongs to a scene", "info", "--check")
        self.fails(1, "give one of them", "info", file, "--check", "--permissive")

    def test_permissive(self):
        file = self.write("b.xml", BROKEN)
        for verb in (("info",), ("render", "--integrator", "path", "-o", self.path("o.exr")), ("convert", "-o", self.path("o.xml"))):
            refused = self.fails(2, 'bsdf "velvet" is not supported', verb[0], file, *verb[1:]).err
            self.assertIn("It is one of 3 mistakes: octrad info %s --check lists them." % file, refused)
            self.assertIn("--permissive takes stand-ins", refused)
        for text in ("<scene", OLD.replace('value="1.6"', 'value="none"')):  # one mistake; no stand-in helps with the first text
            refused = self.fails(2, "s.xml:", "info", self.write("s.xml", text)).err
            self.assertNotIn("one of", refused)
            self.assertEqual("stand-ins" in refused, text != "<scene")
        # The command of the hint says the same of the same parameters; a file that cannot be read is a mistake as well.
        os.mkfifo(self.path("none.ply"))
        asked = self.write("a b.xml", BROKEN.replace('"velvet"', '"$model"').replace("<shape", '<default name="model" value="diffuse"/><shape', 1))
        refused = self.fails(2, "velvet", "info", asked, "-D", "model=velvet").err
        self.assertIn("octrad info '%s' --check -D model=velvet lists them" % asked, refused)
        missing = BROKEN.replace('<shape type="teapot"/>', '<shape type="ply"><string name="filename" value="none.ply"/></shape>').replace("velvet", "diffuse")
        refused = self.fails(3, "none.ply", "info", self.write("m.xml", missing.replace('<medium name="interior" type="homogeneous"/>', ""))).err
        self.assertNotIn("one of", refused)
        self.assertIn("--permissive takes stand-ins", refused)
        info = self.ok("info", file, "--json", "--permissive")
        self.assertEqual(info.json()["shapes"], 1)
        self.assertEqual(len(info.json()["refused"]), 3)
        self.assertIn('shape "teapot" is not supported', info.err)
        self.ok("render", file, "--permissive", "--integrator", "path", "--spp", "1", "-o", self.path("o.exr"))
        self.fails(1, "--permissive belongs to a scene", "info", "--permissive")

    def test_convert(self):
        file, out = self.write("s.xml", OLD), self.path("out.xml")
        report = self.ok("convert", file, "-o", out, "--json").json()
        self.assertEqual(report["fingerprint"], self.ok("info", file, "--json").json()["fingerprint"])
        check = self.ok("info", out, "--check", "--json").json()
        self.assertEqual((check["loads"], check["assumed"]), (True, []))
        self.assertEqual(report["fingerprint"], self.ok("info", out, "--json").json()["fingerprint"])
        # What nothing uses is left out.
        unused = self.write("u.xml", OLD.replace("</scene>", '<float name="a" value="1"/><spectrum name="b" value=".6"/></scene>'))
        self.assertEqual(self.ok("convert", unused, "-o", self.path("used.xml"), "--json").json()["fingerprint"], report["fingerprint"])
        with open(out, encoding="utf-8") as with_all, open(self.path("used.xml"), encoding="utf-8") as with_used:
            self.assertEqual(with_used.read(), with_all.read())
        self.fails(2, "velvet", "convert", self.write("b.xml", BROKEN), "-o", self.path("never.xml"))
        self.ok("convert", self.path("b.xml"), "--permissive", "-o", out)
        with open(out, encoding="utf-8") as text:
            self.assertIn('value="1, 0, 1"', text.read())
        self.fails(1, "would overwrite", "convert", file, "-o", file)
        try:
            import mitsuba
        except ImportError:
            return
        mitsuba.set_variant("scalar_rgb")
        mitsuba.load_file(out)

    def test_convert_keeps_the_files_of_others(self):
        """A folder NAME-files that is there already."""
        files = []
        for name, size in (("a", 1), ("b", 2)):
            g = Gltf()
            g.node(mesh=g.mesh([0, 0, 0, size, 0, 0, 0, size, 0]))
            files.append(self.write(name + ".gltf", g.text()))
        out, mesh = self.path("scene.xml"), os.path.join(self.path("scene-files"), "mesh0.ply")
        self.ok("convert", files[0], "-o", out)
        self.ok("convert", files[1], "-o", out)  # its own files are replaced with it
        with open(mesh, "rb") as before:
            bytes_before = before.read()
        self.fails(1, "which is not a file of", "convert", files[0], "-o", self.path("scene"))
        with open(mesh, "rb") as after:
            self.assertEqual(after.read(), bytes_before)

    def test_plugins(self):
        plugins = self.ok("info", "--plugins", "--json").json()
        self.assertIn("diffuse", plugins["bsdf"])
        self.assertIn("bitmap", plugins["texture"])
        self.assertEqual(list(plugins.pop("help")), list(plugins))
        self.assertEqual(self.ok("info", "--plugins", "all", "--json").json(), self.ok("info", "--plugins", "--json").json())
        text = self.ok("info", "--plugins").out
        self.assertTrue(all(len(line) <= 100 for line in text.splitlines()))
        self.assertNotRegex(text, r"`|\]\(")
        for tag, types in plugins.items():
            self.assertIn("\n%s\n" % tag, "\n" + text)
            for name in types:
                self.assertRegex(text, r"(?m)^  (\w+, )*%s\b" % name)

    def test_one_plugin(self):
        one = self.ok("info", "--plugins", "roughplastic", "--json").json()
        self.assertEqual(one["bsdf"], ["roughplastic"])
        self.assertEqual((list(one), list(one["help"])), (["bsdf", "help"], ["bsdf"]))
        text = self.ok("info", "--plugins", "roughplastic").out
        self.assertRegex(text, r"^bsdf\n  roughplastic +diffuse_reflectance \(0.5\)")  # with those of plastic
        self.assertIn("alpha (0.1)", text)
        self.assertIn("to_world", self.ok("info", "--plugins=merge").out)  # what all shapes have
        self.assertIn("its shapes", self.ok("info", "--plugins", "merge").out)  # also a verb
        self.assertEqual(list(self.ok("info", "--plugins", "rfilter", "--json").json()), ["help", "rfilter"])
        self.fails(1, 'did you mean "roughplastic"', "info", "--plugins", "roughplastik")
        self.fails(1, 'did you mean "emitter"', "info", "--plugins", "emiter")
        self.fails(1, "takes nothing else", "info", "--plugins", "--keys")
        self.fails(1, "takes nothing else", "info", "--plugins", "bsdf", "scene.xml")
        self.fails(1, "takes nothing else", "info", "scene.xml", "--plugins")


if __name__ == "__main__":
    unittest.main()
