#!/usr/bin/env python3
"""The page of `octrad view`, opened in headless Chromium and driven over its DevTools protocol: walking, integrators, comparison,
inspector, command line, path, reconnection, sizes of windows, dark and light.
Usage: OCTRAD=path/to/octrad test_view_page.py      SCREENSHOTS=folder keeps pictures of it"""
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.parse

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "cli"))
ROOT = pathlib.Path(__file__).resolve().parent.parent
os.environ.setdefault("OCTRAD", str(ROOT / "build" / "octrad"))
import support  # noqa: E402
from exr import read_exr  # noqa: E402
from support import PATIENCE, SMALL, Case, start, wait_for  # noqa: E402
from test_view import trained  # noqa: E402
from web_client import WebSocket, request  # noqa: E402

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)


class Browser:
    def __init__(self, folder):
        log = pathlib.Path(folder + ".log")  # a pipe that nobody reads would stop it once it is full
        with open(log, "wb") as err:
            self.process = subprocess.Popen([BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--remote-debugging-port=0",
                                             "--user-data-dir=" + folder, "about:blank"], stderr=err)
        address = lambda: re.search(rb"ws://([\d.]+):(\d+)(/\S+)\n", log.read_bytes())
        assert wait_for(lambda: address() or self.process.poll() is not None) and address(), log.read_text(errors="replace")
        found = address()
        self.address = (found.group(1).decode(), int(found.group(2)))
        self.web = WebSocket(self.address, found.group(3).decode())
        self.count = 0

    def close(self):
        self.web.close()
        self.process.kill()
        self.process.wait()

    def call(self, method, session=None, **parameters):
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        self.web.send(message)
        while True:
            answer = self.web.receive()
            if answer.get("id") == self.count:
                if "error" in answer:
                    raise RuntimeError("%s: %s" % (method, answer["error"]["message"]))
                return answer["result"]


class Page:
    """A tab."""

    def __init__(self, browser, url, width=1280, height=720, dark=False, mobile=False):
        self.browser = browser
        target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.target = target
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=mobile)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])
        self.call("Page.enable")
        self.call("Page.navigate", url=url)

    def call(self, method, **parameters):
        return self.browser.call(method, self.session, **parameters)

    def js(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise AssertionError(result["exceptionDetails"].get("exception", {}).get("description", str(result)))
        return result["result"].get("value")

    def wait(self, expression, seconds=PATIENCE):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if self.js("(() => { try { return !!(%s); } catch { return false; } })()" % expression):
                return
            time.sleep(0.03)
        raise AssertionError("never true: %s; %s" % (expression, self.js("document.getElementById('message') && document.getElementById('message').textContent")))

    def key(self, code, key, until="true"):
        """It is held until the expression is true: keys that move do so with the page's animation frames."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, code=code, key=key, text=key if kind == "keyDown" and len(key) == 1 else "")
            if kind == "keyDown":
                self.wait(until)

    def mouse(self, kind, x, y, button="left", **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=more.pop("clicks", 1), **more)

    def drag(self, x, y, dx, dy, button="left"):
        self.mouse("mousePressed", x, y, button)
        for i in range(1, 5):
            self.mouse("mouseMoved", x + dx * i / 4, y + dy * i / 4, button, buttons=1)
        self.mouse("mouseReleased", x + dx, y + dy, button)

    def screenshot(self, name):
        folder = os.environ.get("SCREENSHOTS")
        if folder:
            import base64
            (pathlib.Path(folder) / name).write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def close(self):
        self.browser.call("Target.closeTarget", targetId=self.target)


STILL = "viewer.frame && !viewer.frame.moving && viewer.frame.input === viewer.inputs && viewer.frame.a.samples > 1"


class ViewPage(Case):
    @classmethod
    def setUpClass(cls):
        if BROWSER is None:
            raise unittest.SkipTest("no Chromium: the page is not opened")
        cls.shared = tempfile.TemporaryDirectory(prefix="octrad-page-", ignore_cleanup_errors=True)
        cls.scene, cls.model = trained(cls.shared.name)
        cls.browser = Browser(os.path.join(cls.shared.name, "profile"))

    @classmethod
    def tearDownClass(cls):
        if BROWSER is not None:
            cls.browser.close()
            cls.shared.cleanup()

    def serve(self, *options):
        return self.begin("view", self.scene, "--model", self.model, "--json", "--width", "96", "--height", "72", *options)

    def begin(self, *arguments):
        self.process = start(*arguments)
        self.addCleanup(self.end, self.process)
        return json.loads(self.process.stdout.readline())["url"]

    def end(self, process):
        process.kill()
        process.communicate()

    def page(self, url, still=STILL, **options):
        page = Page(self.browser, url, **options)
        self.addCleanup(page.close)
        page.wait(still)
        return page

    def colors(self, page):
        """How many different colours the canvas shows, and the mean."""
        return page.js("""(() => { const c = document.getElementById("canvas"), p = viewer.place();
            const d = c.getContext("2d").getImageData(p.x + 2, p.y + 2, p.w - 4, p.h - 4).data, seen = new Set(); let sum = 0;
            for (let i = 0; i < d.length; i += 4) { seen.add(d[i] << 16 | d[i + 1] << 8 | d[i + 2]); sum += d[i]; }
            return [seen.size, sum / d.length * 4]; })()""")

    def wait_for_mean(self, page, condition):
        """Exposure and edits raise no number of the frame that shows them."""
        self.assertTrue(wait_for(lambda: condition(self.colors(page)[1])), self.colors(page))

    def test_walk(self):
        page = self.page(self.serve())
        self.assertGreater(self.colors(page)[0], 200)
        first = page.js("viewer.camera")
        # Keys, the mouse and the wheel.
        page.key("KeyW", "w", until="viewer.camera.origin[2] < %r" % (first["origin"][2] - 0.02))
        page.wait(STILL + " && viewer.inputs > 0")
        second = page.js("viewer.camera")
        self.assertEqual(page.js("viewer.frame.camera"), second)
        page.drag(400, 300, 60, 0)
        page.wait("viewer.camera.target[0] > %r" % (second["target"][0] + 0.01))
        turned = page.js("viewer.camera")
        self.assertEqual(turned["origin"], second["origin"])
        page.mouse("mouseWheel", 400, 300, deltaX=0, deltaY=-100)
        page.wait("viewer.speed === 0.5")
        page.key("KeyO", "o")
        page.drag(400, 300, 80, 10)
        page.wait("Math.abs(viewer.camera.origin[0] - %r) > 0.005" % turned["origin"][0])
        page.key("Digit1", "1")
        page.wait("Math.abs(viewer.camera.origin[2] - 0.9) < 1e-6")
        for kind in ("mousePressed", "mouseReleased"):
            page.mouse(kind, 300, 500)
        for kind in ("mousePressed", "mouseReleased"):
            page.mouse(kind, 300, 500, clicks=2)
        page.wait("viewer.pivot && viewer.camera.target[1] === viewer.pivot[1]")
        page.wait(STILL)

    def test_what_is_chosen_and_asked(self):
        page = self.page(self.serve())
        choose = lambda id, value: page.js("(() => { const s = document.getElementById(%s); s.value = %s; s.dispatchEvent(new Event('change')); s.dispatchEvent(new Event('input')); })()"
                                           % (json.dumps(id), json.dumps(value)))
        names = page.js("[...document.getElementById('integrator-a').options].map(o => o.value)")
        for name in ("path", "lhs", "rhs", "deferred", "disparity", "traced", "features1", "occupancy3"):
            self.assertIn(name, names)
        for name in ("path", "features2", "lhs"):
            choose("integrator-a", name)
            page.wait("viewer.frame.a.integrator === %s && !viewer.frame.moving" % json.dumps(name))
        dark = self.colors(page)[1]
        choose("exposure", "2")
        page.wait("viewer.state.exposure === 2 && document.getElementById('exposure-value').textContent === '+2.0'")
        self.wait_for_mean(page, lambda mean: mean > dark + 5)
        choose("exposure", "0")
        page.wait("viewer.state.exposure === 0")
        # The inspector says what octrad query says.
        page.key("KeyI", "i")
        for kind in ("mousePressed", "mouseReleased"):
            page.mouse(kind, 420, 560)
        page.wait("viewer.inspected && document.querySelectorAll('#inspected tr').length > 8")
        query = page.js("viewer.inspected.queries[0]")
        points = self.write("points.csv", "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n" +
                            ",".join("%.9g" % v for v in query["x"] + query["wo"] + query["n"] + query["albedo"] + [query["alpha"]]) + "\n")
        row = [float(v) for v in self.ok("query", self.model, "--points", points).out.splitlines()[1].split(",")]
        for ours, theirs in zip(query["radiance"], row[-3:]):
            self.assertAlmostEqual(ours, theirs, delta=1e-6 * abs(theirs))
        # The command line that is copied renders what is shown.
        choose("fov", "71")
        page.wait(STILL + " && viewer.frame.camera.fov === 71")
        # Once nothing more is added, picture and samples belong together.
        page.wait("viewer.frame.a.samples >= 256")
        words = shlex.split(page.js("viewer.commandLine()"))
        self.assertEqual(words[:2], ["octrad", "render"])
        rendered, saved = self.path("view.exr"), self.path("saved.exr")
        words[words.index("view.exr")] = rendered
        self.ok(*words[1:], "-q")
        parts = urllib.parse.urlsplit(page.js("location.href"))
        with open(saved, "wb") as out:
            out.write(request((parts.hostname, parts.port), "/picture-a.exr?" + parts.fragment)[2])
        self.assertEqual(read_exr(saved)[2], read_exr(rendered)[2])

    def test_comparison_and_paths(self):
        page = self.page(self.serve())
        page.key("KeyC", "c")
        page.wait("viewer.pictures.b && viewer.frame.b.samples > 40")
        self.assertEqual(page.js("[viewer.frame.a.integrator, viewer.frame.b.integrator, document.getElementById('divider').hidden]"), ["lhs", "path", False])
        middle = page.js("(() => { const b = document.getElementById('divider').getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()")
        page.drag(*middle, -200, 0)
        page.wait("viewer.split < 0.4")
        page.key("KeyX", "x")
        page.wait("viewer.pictures.errors && viewer.mode === 'errors'")
        page.screenshot("errors.png")
        page.key("KeyF", "f")
        page.wait("viewer.mode === 'a' && !viewer.state.errors")
        page.key("KeyF", "f")
        page.wait("viewer.mode === 'b'")
        page.key("KeyC", "c")
        page.wait("!viewer.state.b && !viewer.pictures.b")
        page.js("document.getElementById('duration').value = 0.4")
        page.key("KeyK", "k")
        page.key("KeyW", "w", until="viewer.camera.origin[2] < 0.88")
        page.wait(STILL)
        page.key("KeyK", "k")
        last = page.js("viewer.camera.origin[2]")
        page.key("Digit1", "1")
        page.key("KeyP", "p")
        page.wait("Math.abs(viewer.camera.origin[2] - %r) < 1e-5 && !viewer.playing" % last)
        path = self.write("path.json", page.js("JSON.stringify(viewer.path())"))
        self.ok("render", self.scene, "--path", path, "--integrator", "path", "--spp", "1", "--width", "8", "--height", "6", "-o", self.path("f##.png"), "-q")
        self.assertTrue(os.path.exists(self.path("f09.png")))

    def test_the_server_goes_and_comes(self):
        url = self.serve("--token", "token-for-the-test")
        port = url.split(":")[2].split("/")[0]
        page = self.page(url)
        page.js("viewer.frame.frame = viewer.newest = 1e6")  # as after a long walk
        self.process.kill()
        self.process.communicate()
        page.wait("!document.getElementById('message').hidden && /Trying again/.test(document.getElementById('message').textContent)")
        self.assertGreater(self.colors(page)[0], 200, "the last picture stays")
        self.serve("--token", "token-for-the-test", "--port", port)
        page.wait("viewer.state && document.getElementById('message').hidden && viewer.frame.frame < 1e6")
        page.js("window.old = true")
        page.call("Page.reload")
        page.wait("!window.old && " + STILL)
        wrong = Page(self.browser, url.replace("for-the", "for-no"))
        self.addCleanup(wrong.close)
        wrong.wait("/no valid token/.test(document.getElementById('message').textContent)")

    def test_a_training_is_watched_and_steered(self):
        model = self.path("m.octrad")
        page = self.page(self.begin("train", self.scene, "-o", model, "--view", "--json", "-D", "train.steps=1000000", *SMALL),
                         "viewer.frame && viewer.training.status && viewer.training.status.step > 50")
        click = lambda what: page.js("document.querySelector('[data-train=%s]').click()" % what)
        shown = lambda: page.js("document.getElementById('training-status').textContent")
        inked = """(() => { const c = document.getElementById("curves"), d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data; let n = 0;
            for (let i = 3; i < d.length; i += 4) n += d[i] > 0; return n; })()"""
        page.wait("viewer.training.curves.loss.length > 8")
        self.assertGreater(page.js(inked), 1000)
        self.assertIn("running", shown())
        before = page.js("viewer.frame.frame")
        page.wait("viewer.frame.frame > %d" % (before + 2))
        page.js("(() => { const s = document.getElementById('layer'); s.value = 'training points'; s.dispatchEvent(new Event('change')); })()")
        page.wait("viewer.state.layer === 'training points' && viewer.frame.frame > %d" % (before + 6))
        page.screenshot("training.png")
        click("pause")
        page.wait("viewer.training.status.state === 'paused' && !document.querySelector('[data-train=start]').disabled")
        click("save")
        page.wait("viewer.training.status.saved === viewer.training.status.step")
        self.assertTrue(os.path.exists(model))
        click("start")
        page.wait("viewer.training.status.state === 'running' && viewer.training.status.step > viewer.training.status.saved + 20")
        page.key("KeyW", "w", until="viewer.inputs > 0")
        page.wait("viewer.inputs > 0 && viewer.frame.input === viewer.inputs")

    def test_a_light_and_a_material_are_edited(self):
        page = self.page(self.serve("--train"))
        put = lambda where, value, event="input": page.js("(() => { const e = document.querySelector(%s); e.value = %s; e.dispatchEvent(new Event(%s)); })()"
                                                          % (json.dumps(where), json.dumps(value), json.dumps(event)))
        self.assertEqual(page.js("document.querySelector('.light span').textContent"), "lamp")
        bright = self.colors(page)[1]
        put(".light [data-part=power]", "-2")
        page.wait("viewer.training.scene.lights[0].factor[0] === 0.25")
        self.wait_for_mean(page, lambda mean: mean < 0.75 * bright)
        page.js("document.querySelector('.light [data-part=on]').click()")
        page.wait("viewer.training.scene.lights[0].factor[0] === 0")
        self.wait_for_mean(page, lambda mean: mean < 5)
        page.js("document.querySelector('.light [data-part=on]').click()")
        page.wait("viewer.training.scene.lights[0].factor[0] === 0.25")
        put("#material", page.js("[...document.getElementById('material').options].find(o => /white/.test(o.textContent)).value"), "change")
        put("#material-color", "#ff2020")
        page.wait("viewer.training.status.change > 0 && viewer.training.status.change < 0.9")
        page.screenshot("edits.png")
        page.wait("viewer.training.status.change === 0")
        page.wait(STILL + """ && (() => { const c = document.getElementById("canvas"), p = viewer.place();
            const d = c.getContext("2d").getImageData(p.x + 2, p.y + 2, p.w - 4, p.h - 4).data; let r = 0, g = 0;
            for (let i = 0; i < d.length; i += 4) { r += d[i]; g += d[i + 1]; } return r > 2 * g; })()""")
        page.screenshot("edited.png")
        page.js("document.getElementById('material-reset').click()")
        page.wait("!viewer.training.scene.materials.some(m => m.edit.color)")
        # All lights, by a slider that is let go at once, as the keyboard and a click on it do.
        put("#all-lights", "1")
        put("#all-lights", "1", "change")
        page.wait("viewer.training.scene.lights[0].factor[0] === 0.5")
        self.assertEqual(page.js("document.getElementById('all-lights').value"), "0")

    def test_windows(self):
        url = self.serve("--compare", "path")
        for name, options in (("light", {}), ("dark", {"dark": True}), ("phone", {"width": 390, "height": 844, "mobile": True}),
                              ("phone-dark", {"width": 390, "height": 844, "mobile": True, "dark": True})):
            page = self.page(url, **options)
            page.screenshot("view-%s.png" % name)
            self.assertLessEqual(page.js("document.documentElement.scrollWidth - innerWidth"), 0, name)
            self.assertGreater(page.js("document.getElementById('canvas').clientWidth"), 300)
            # Text against its background (WCAG contrast).
            contrast = page.js("""(() => { const l = c => { const [r, g, b] = c.match(/[\\d.]+/g).map(v => { v /= 255; return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; });
                return 0.2126 * r + 0.7152 * g + 0.0722 * b; }; const s = getComputedStyle(document.body);
                return ["color", "--quiet"].map(k => { const e = document.createElement("span"); e.style.color = k === "color" ? s.color : `var(${k})`; document.body.append(e);
                  const [x, y] = [l(getComputedStyle(e).color), l(s.backgroundColor)].sort((a, b) => b - a); e.remove(); return (x + 0.05) / (y + 0.05); }); })()""")
            self.assertGreater(min(contrast), 4.5, name)
            if "width" in options:
                self.assertTrue(page.js("document.getElementById('panel').hidden"))
                page.js("document.getElementById('panel-toggle').click()")
                page.screenshot("view-%s-panel.png" % name)
                self.assertGreater(page.js("document.getElementById('canvas').clientHeight"), 250)
            page.js("document.getElementById('help-open').click()")
            page.screenshot("view-%s-help.png" % name)
            self.assertTrue(page.js("document.getElementById('help').open"))


if __name__ == "__main__":
    unittest.main()
