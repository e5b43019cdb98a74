#!/usr/bin/env python3
"""docs/manual.md names every verb, option and configuration key of the program, with the presets' values; links, files, method
sections and paper equations that documents and comments name exist; the figures are those that their script draws.

    OCTRAD=path/to/octrad test_docs.py            checks
    OCTRAD=path/to/octrad test_docs.py --write    writes the table of keys into the manual
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("OCTRAD", str(ROOT / "build" / "octrad"))
MANUAL = ROOT / "docs" / "manual.md"
DOCUMENTS = sorted(path for folder in (".", "docs", "bench/results") for path in (ROOT / folder).glob("*.md"))
SOURCES = sorted(path for folder in ("src", "tests", "bench", "scripts", "cmake", "scenes", "docs/figures") for path in (ROOT / folder).rglob("*")
                 if path.suffix in (".h", ".cc", ".cu", ".py", ".sh", ".cmake"))
HYPOTHETICAL = ("velvet", "planes", "occlusion")  # what docs/extending.md adds in thought
BEGIN, END = "<!-- keys: written by tests/test_docs.py --write -->\n", "<!-- end of keys -->\n"


def octrad(*words):
    return subprocess.run([PROGRAM, *words], check=True, capture_output=True, text=True).stdout


def key_table():
    presets = {name: json.loads(octrad("info", "--keys", "--json", "--preset", name))["keys"] for name in ("cpu", "default", "paper")}
    values = {name: {key["key"]: key["value"] for key in keys} for name, keys in presets.items()}
    lines = ["| key | `cpu` | `default` | `paper` | accepted | meaning |", "|---|---|---|---|---|---|"]
    for key in presets["cpu"]:
        row = [values[name][key["key"]] or " " for name in ("cpu", "default", "paper")]
        lines.append("| `%s` | %s | %s |" % (key["key"], " | ".join(row), " | ".join(t.replace("|", "\\|") for t in (key["accepted"], key["help"]))))
    return "\n".join(lines) + "\n"


class Manual(unittest.TestCase):
    def setUp(self):
        self.manual = MANUAL.read_text()

    def test_verbs_and_options(self):
        verbs = re.findall(r"^  (\w+)  ", octrad("--help").split("Subcommands:")[1], re.M)
        self.assertGreaterEqual(len(verbs), 5)
        for verb in verbs:
            section = re.search(r"^## %s\n(.*?)(?=^## |\Z)" % verb, self.manual, re.M | re.S)
            self.assertIsNotNone(section, "the manual has no section for %s" % verb)
            shared = re.search(r"^## What all verbs share\n(.*?)(?=^## )", self.manual, re.M | re.S).group(1)
            help_text = octrad(verb, "--help").split("Example:")[0]
            for option in sorted(set(re.findall(r"^  (?:-\w,)?(--[a-z][\w-]*)", help_text, re.M))):
                with self.subTest("%s %s" % (verb, option)):
                    self.assertRegex(section.group(1) + shared, re.escape(option) + r"(?![\w-])")
            own = re.sub(r"^octrad (?!%s\b)\w+ .*$" % verb, "", section.group(1), flags=re.M)  # examples also call other verbs
            for option in sorted(set(re.findall(r"(?<![\w-])(--[a-z][\w-]*)", own))):
                with self.subTest("the manual's %s of %s exists" % (option, verb)):
                    self.assertRegex(help_text + octrad("info", "--help"), re.escape(option) + r"(?![\w-])")

    def test_keys(self):
        self.assertIn(key_table(), self.manual, "run tests/test_docs.py --write")


def numbers(text):
    """Of "7", "4, 5 and 7" or "2-4"."""
    found = []
    for first, last in re.findall(r"(\d+)(?:(?:-| to )(\d+))?", text):
        found += range(int(first), int(last or first) + 1)
    return found


NUMBERS = r"((?:\d+)(?:(?:-| to |, | and )\d+)*)"


def headings(text):
    """Anchors as GitHub makes them."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)
    return {re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-") for title in re.findall(r"^#+ (.*)$", text, re.M)}


class Documents(unittest.TestCase):
    def test_links(self):
        count = 0
        for path in DOCUMENTS:
            for target, anchor in re.findall(r"\]\(([^)#]*)(?:#([^)]*))?\)", path.read_text()):
                if "://" in target:
                    continue
                count += 1
                with self.subTest("%s: %s#%s" % (path.name, target, anchor)):
                    file = path.parent / target if target else path
                    self.assertTrue(file.exists())
                    if anchor:
                        self.assertIn(anchor, headings(file.read_text()))
        self.assertGreater(count, 50)

    def test_files_named_in_documents_and_comments_exist(self):
        for path in DOCUMENTS:
            if path.name == "CHANGELOG.md":  # names what is gone, too
                continue
            for name in re.findall(r"`((?:src|tests|scripts|scenes|docs|bench|cmake|configs|templates|examples)/[\w./-]*\w)`", path.read_text()):
                if not any(word in name for word in HYPOTHETICAL):
                    with self.subTest("%s: %s" % (path.name, name)):
                        self.assertTrue((ROOT / name).exists())
        for path in SOURCES:
            for name in re.findall(r"[\w./-]*\w\.md\b", path.read_text()):
                with self.subTest("%s: %s" % (path.relative_to(ROOT), name)):
                    self.assertTrue(any((folder / name).exists() for folder in (ROOT, ROOT / "docs", path.parent)))

    def test_integrators(self):
        source = (ROOT / "src/octrad/render/integrators.cc").read_text()
        names = re.findall(r'(?:IntegratorInfo info\{|info\.name = |_info<[^>]*>\()"(\w+)"', source)
        self.assertGreaterEqual(len(names), 8)
        rows = re.findall(r"^\| (`[^|]*)\|", MANUAL.read_text(), re.M)
        for name in names:
            with self.subTest(name):
                self.assertTrue(any(re.search("`%s1?`" % name, row) for row in rows), "the manual has no row for it")

    def test_sections_of_the_method(self):
        """Comments cite docs/method.md as "method section 4"."""
        sections = {int(n) for n in re.findall(r"^## (\d+)\. ", (ROOT / "docs/method.md").read_text(), re.M)}
        count = 0
        for path in DOCUMENTS + SOURCES:
            for cited in re.findall(r"[Mm]ethod(?:\.md)?,? sections? " + NUMBERS, re.sub(r"\n\s*//", "", path.read_text())):
                for number in numbers(cited):
                    count += 1
                    with self.subTest("%s: section %d" % (path.relative_to(ROOT), number)):
                        self.assertIn(number, sections)
        self.assertGreater(count, 40)

    def test_equations_of_the_paper(self):
        """Everything cites them as "paper equation 10"; docs/paper-map.md leads from each to the code."""
        rows = re.findall(r"^\| (\d[\d, -]*) \|", (ROOT / "docs/paper-map.md").read_text().split("## Equations")[1].split("\n## ")[0], re.M)
        known = {number for row in rows for number in numbers(row)}
        self.assertEqual(known, set(range(1, 15)))
        count = 0
        for path in DOCUMENTS + SOURCES:
            for cited in re.findall(r"[Pp]aper equations? " + NUMBERS, re.sub(r"\n\s*(?://)? ?", " ", path.read_text())):
                for number in numbers(cited):
                    count += 1
                    with self.subTest("%s: equation %d" % (path.relative_to(ROOT), number)):
                        self.assertIn(number, known)
        self.assertGreater(count, 14)

    def test_names_of_the_maps_are_in_their_files(self):
        """A row of paper-map.md or glossary.md that names a file names only things that are in one of its files."""
        count = 0
        for document in ("docs/paper-map.md", "docs/glossary.md"):
            for row in re.findall(r"^\|.*$", (ROOT / document).read_text(), re.M):
                files = [ROOT / name for name in re.findall(r"`(src/[\w./]+\.\w+)`", row)]
                text = "".join(file.read_text() for file in files if file.exists())
                for name in re.findall(r"`([A-Za-z_]\w*(?:::\w+)?)(?:\(\))?`", row):
                    if files:
                        count += 1
                        with self.subTest("%s: %s" % (document, name)):
                            self.assertRegex(text, r"\b%s\b" % re.escape(name.split("::")[-1]))
        self.assertGreater(count, 30)

    def test_formulas_end_on_their_line(self):
        """GitHub ends an inline formula at the end of a line, and takes a backslash before punctuation for an escape."""
        for path in DOCUMENTS:
            text = re.sub(r"^```.*?^```", "", path.read_text(), flags=re.M | re.S)
            for line in re.sub(r"`[^`\n]*`", "", text).splitlines():
                if "$" in line and "](" not in line or line.count("$") > 1:
                    with self.subTest("%s: %s" % (path.name, line)):
                        self.assertEqual(line.count("$") % 2, 0)
                        for formula in re.findall(r"\$([^$]*)\$", line):
                            self.assertNotRegex(formula, r"\\[,;:!{}_]")

    def test_figures(self):
        folder = ROOT / "docs" / "figures"
        with tempfile.TemporaryDirectory() as scratch:
            subprocess.run([sys.executable, str(folder / "make_figures.py"), scratch], check=True, capture_output=True)
            drawn = {path.name: path.read_text() for path in pathlib.Path(scratch).iterdir()}
        self.assertEqual(set(drawn), {path.name for path in folder.glob("*.svg")})
        for name, text in drawn.items():
            self.assertTrue(text == (folder / name).read_text(), "%s is not what make_figures.py draws" % name)
            self.assertIn("figures/%s" % name, (ROOT / "docs/method.md").read_text())


if __name__ == "__main__":
    if "--write" in sys.argv:
        text = MANUAL.read_text()
        head, rest = text.split(BEGIN)
        MANUAL.write_text(head + BEGIN + "\n" + key_table() + "\n" + END + rest.split(END)[1])
    else:
        unittest.main()
