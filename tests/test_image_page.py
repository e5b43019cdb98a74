#!/usr/bin/env python3
"""The page of `octrad compare --html`, opened in headless Chromium: values, tone mapping, error maps, keys, zoom, printing.
Usage: OCTRAD=path/to/octrad test_image_page.py"""
import html
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "cli"))

ROOT = pathlib.Path(__file__).resolve().parent.parent
os.environ.setdefault("OCTRAD", str(ROOT / "build" / "octrad"))
os.environ.pop("OCTRAD_LPIPS_WEIGHTS", None)
from support import PATIENCE, Case, write_pfm  # noqa: E402
from test_compare import read_png  # noqa: E402

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
WIDTH, HEIGHT = 64, 48
REFERENCE = (0.5, 0.25, 0.125)


def brighter(x, y):
    """Twice the reference in the left half, half of it in the right one."""
    return tuple(v * (2 if x < WIDTH // 2 else 0.5) for v in REFERENCE)


class Page(Case):
    def setUp(self):
        super().setUp()
        if BROWSER is None:
            self.skipTest("no Chromium: the page is not opened")
        reference, image, png = (self.path(n) for n in ("ref & <b>.pfm", "image.pfm", "shown.png"))
        self.page = self.path("page.html")
        write_pfm(reference, WIDTH, HEIGHT, lambda x, y: REFERENCE)
        write_pfm(image, WIDTH, HEIGHT, brighter)
        self.ok("tonemap", image, "-o", png, "-q")
        self.ok("compare", reference, image, png, "--html", self.page, "-q")

    def browser(self, address, *options):
        command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--user-data-dir=" + self.path("profile"),
                   "--virtual-time-budget=4000", "--window-size=1000,1000", *options, pathlib.Path(self.page).as_uri() + "#" + address]
        done = subprocess.run(command, capture_output=True, timeout=PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr.decode("utf-8", "replace"))
        return done.stdout.decode("utf-8")

    def opened(self, address=""):
        """The viewer's state, and the table of values: name -> cells."""
        page = self.browser(address, "--dump-dom")
        state = re.search(r'data-state="([^"]*)"', page)
        self.assertIsNotNone(state, "the script has not drawn")
        rows = re.findall(r"<tr[^>]*>(.*?)</tr>", page.split('class="octrad-values"')[1].split("</table>")[0], re.S)
        values = {html.unescape(cells[0]): cells[1:] for cells in (re.findall(r"<td[^>]*>(.*?)</td>", row) for row in rows) if cells}
        return json.loads(html.unescape(state.group(1))), {pathlib.Path(name).name: cells for name, cells in values.items()}

    def shot(self, address):
        """The colour at the middle of the left and of the right half of the first canvas."""
        file = self.path("shot.png")
        self.browser(address, "--screenshot=" + file)
        return file

    def test_values_under_the_cursor(self):
        state, values = self.opened("probe=3,5")
        self.assertEqual((state["image"], state["mode"], state["probe"]), (1, "color", [3, 5]))
        self.assertEqual(set(values), {"ref & <b>.pfm", "image.pfm", "shown.png"})
        self.assertEqual([float(v) for v in values["ref & <b>.pfm"][:3]], list(REFERENCE))
        self.assertEqual([float(v) for v in values["image.pfm"][:3]], [1, 0.5, 0.25])
        expected = sum(v / (v + 0.01) for v in REFERENCE) / 3
        self.assertAlmostEqual(float(values["image.pfm"][3]), expected, places=3)
        self.assertAlmostEqual(float(values["shown.png"][1]), 0.5, delta=0.003)  # linear again
        _, values = self.opened("probe=40,5")
        self.assertAlmostEqual(float(values["image.pfm"][4]), -expected / 2, places=3)
        self.assertEqual(self.opened("probe=64,5")[0]["probe"], None)

    def test_keys(self):
        keys = lambda *pressed: self.opened("&".join("key=" + key for key in pressed))[0]
        self.assertEqual(keys("1")["image"], 0)
        self.assertEqual(keys("3")["image"], 2)
        self.assertEqual(keys("9")["image"], 1)
        self.assertEqual(keys("ArrowRight", "ArrowRight")["image"], 0)
        self.assertEqual(keys("3", "%20")["image"], 1)
        self.assertEqual(keys("e")["mode"], "error")
        self.assertEqual(keys("s")["mode"], "signed")
        self.assertEqual(keys("e", "c", "]", "]", "[")["exposure"], 0.5)
        self.assertTrue(keys("g")["all"])
        state = keys("+", "+", "-", "+")
        self.assertEqual((state["zoom"], state["x"]), (4, WIDTH / 2))
        self.assertEqual(keys("+", "0")["zoom"], 1)

    def test_mouse_and_keyboard(self):
        """Events as a browser sends them, from a script that is added to the page."""
        text = pathlib.Path(self.page).read_text()
        events = """<script>addEventListener("load", () => setTimeout(() => {
            const canvas = document.querySelectorAll("canvas")[1], box = canvas.getBoundingClientRect();
            const at = (x, y) => ({ clientX: box.left + x * box.width, clientY: box.top + y * box.height, bubbles: true, cancelable: true });
            canvas.setPointerCapture = () => {};  // a made-up pointer cannot be captured
            %s
        }, 100));</script>"""
        key = lambda name: 'document.dispatchEvent(new KeyboardEvent("keydown", { key: "%s", bubbles: true }));' % name
        wheel = lambda x, y: 'canvas.dispatchEvent(new WheelEvent("wheel", { ...at(%g, %g), deltaY: -200 }));' % (x, y)
        pointer = lambda kind, x, y: 'canvas.dispatchEvent(new PointerEvent("pointer%s", at(%g, %g)));' % (kind, x, y)

        def after(*actions):
            pathlib.Path(self.page).write_text(text.replace("</body>", events % "\n".join(actions) + "</body>"))
            return self.opened()

        self.assertEqual(after(key("3"), key("e"))[0]["image"], 2)
        state, values = after(pointer("move", 0.75, 0.5))
        self.assertEqual(state["zoom"], 1)
        self.assertEqual([float(v) for v in values["image.pfm"][:3]], [v / 2 for v in REFERENCE])
        state, _ = after(wheel(0.5, 0.5), wheel(0.5, 0.5))
        self.assertEqual(state["zoom"], 4)
        self.assertAlmostEqual(state["y"], HEIGHT / 2, delta=0.1)  # events are at whole pixels of the screen
        state, _ = after(wheel(0.5, 0.5), pointer("down", 0.5, 0.5), pointer("move", 0.25, 0.5), pointer("up", 0.25, 0.5), pointer("move", 0.1, 0.1))
        self.assertGreater(state["x"], WIDTH / 2 + 2)  # dragging to the left shows what is on the right
        self.assertAlmostEqual(state["y"], HEIGHT / 2, delta=0.1)
        state, _ = after('const slider = document.querySelector("input[type=range]"); slider.value = 2; slider.dispatchEvent(new Event("input"));',
                         '[...document.querySelectorAll("button")].find(b => b.textContent === "all").click();')
        self.assertEqual((state["exposure"], state["all"]), (2, True))

    def test_pixels_on_the_screen(self):
        def halves(address):
            _, _, rows = read_png(self.shot(address))
            middle = rows[450]
            return tuple(middle[3 * 300:3 * 300 + 3]), tuple(middle[3 * 700:3 * 700 + 3])

        near = lambda a, b: all(abs(x - y) <= 1 for x, y in zip(a, b))
        encode = lambda v: round(255 * (12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055))
        color = lambda factor: tuple(encode(min(v * factor, 1)) for v in REFERENCE)
        left, right = halves("image=2")
        self.assertTrue(near(left, color(2)) and near(right, color(0.5)), (left, right))
        left, right = halves("image=1&exposure=-1")
        self.assertTrue(near(left, color(0.5)) and left == right, (left, right))
        # Half the largest error is the middle of the ramp; in signed errors left is red and right blue.
        left, right = halves("image=2&mode=error&most=%g" % (2 * sum(v / (v + 0.01) for v in REFERENCE) / 3))
        self.assertTrue(near(left, (184, 41, 102)), left)
        left, right = halves("image=2&mode=signed")
        self.assertTrue(left[0] > 2 * left[2] and right[2] > 2 * right[0], (left, right))
        # Zoomed in to the right half, both places are in it.
        left, right = halves("image=2&zoom=4&x=52&y=24")
        self.assertTrue(near(left, color(0.5)) and left == right, (left, right))

    def test_one_page_without_anything_else(self):
        text = pathlib.Path(self.page).read_text()
        self.assertNotRegex(text, r"https?:|src=|@import|<link")
        self.assertIn("ref &amp; &lt;b&gt;.pfm", text)
        self.assertEqual(text.count("<script type=\"text/plain\""), 3)
        self.assertLess(len(text), 3 * WIDTH * HEIGHT * 8 + 40000)

    def test_on_paper(self):
        file = self.path("page.pdf")
        self.browser("image=2", "--print-to-pdf=" + file)
        raw = pathlib.Path(file).read_bytes()
        self.assertEqual(raw[:5], b"%PDF-")
        self.assertGreaterEqual(len(re.findall(rb"/Subtype\s*/Image", raw)), 3, "all pictures are on paper")


if __name__ == "__main__":
    unittest.main()
