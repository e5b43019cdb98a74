#!/usr/bin/env python3
"""docs/manual.md names every verb, option and configuration key of the program, with the presets' values.

    OCTRAD=path/to/octrad test_docs.py            checks
    OCTRAD=path/to/octrad test_docs.py --write    writes the table of keys into the manual
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("OCTRAD", str(ROOT / "build" / "octrad"))
MANUAL = ROOT / "docs" / "manual.md"
HYPOTHETICAL = ("velvet", "planes", "my_integrator")  # what docs/extending.md adds in thought
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
            for option in sorted(set(re.findall(r"(?<![\w-])(--[a-z][\w-]*)", section.group(1)))):
                with self.subTest("the manual's %s of %s exists" % (option, verb)):
                    self.assertRegex(help_text + octrad("info", "--help"), re.escape(option) + r"(?![\w-])")

    def test_keys(self):
        self.assertIn(key_table(), self.manual, "run tests/test_docs.py --write")

    def test_links(self):
        for path in [ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md")] + sorted((ROOT / "docs").glob("*.md")):
            for target in re.findall(r"\]\(([^)#]+)[^)]*\)", path.read_text()):
                if "://" not in target:
                    with self.subTest("%s: %s" % (path.name, target)):
                        self.assertTrue((path.parent / target).exists())

    def test_files_named_in_the_documents_exist(self):
        for path in [ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md")] + sorted((ROOT / "docs").glob("*.md")):
            for name in re.findall(r"`((?:src|tests|scripts|scenes|docs|bench|cmake)/[\w./-]*\w)`", path.read_text()):
                if not any(word in name for word in HYPOTHETICAL):
                    with self.subTest("%s: %s" % (path.name, name)):
                        self.assertTrue((ROOT / name).exists())


if __name__ == "__main__":
    if "--write" in sys.argv:
        text = MANUAL.read_text()
        head, rest = text.split(BEGIN)
        MANUAL.write_text(head + BEGIN + "\n" + key_table() + "\n" + END + rest.split(END)[1])
    else:
        unittest.main()
