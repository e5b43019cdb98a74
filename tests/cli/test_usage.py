"""Help, unknown words, common options."""
import os
import re
import shlex
import unittest

from support import ROOM, Case, run

VERBS = re.findall(r"^  (\w+)  ", run("--help").out.split("Subcommands:")[1], re.M)


class Usage(Case):
    def test_empty_values(self):
        """Of variables that are not set: not the same as an option that is not given."""
        scene = self.write("room.xml", ROOM)
        for option in ("--model", "--camera", "--time", "--integrator"):
            self.fails(1, option + ": the value is empty", "render", scene, option, "", "-o", self.path("a.exr"))
        self.fails(1, "the value is empty", "render", scene, "-o", "")
        self.fails(1, "the value is empty", "info", "")
        self.assertEqual(os.listdir(self.folder), ["room.xml"])

    def test_verbs(self):
        self.assertTrue({"train", "render", "compare", "info", "query", "tonemap"} <= set(VERBS), VERBS)

    def test_every_verb_explains_itself(self):
        for verb in VERBS:
            with self.subTest(verb=verb):
                text = self.ok(verb, "--help").out
                example = re.search(r"Example:\n((?:  .*\n?)+)", text)
                self.assertIsNotNone(example, text)
                options = set(re.findall(r"(?<![\w-])(--?[A-Za-z][\w-]*)", text.split("Example:")[0]))
                for common in ("--threads", "--seed", "--max-memory", "--device", "--json", "-q", "-v"):
                    self.assertIn(common, options)
                self.assertEqual("--log-json" in options, verb in ("train", "render"), "where there is progress to write")
                for line in example.group(1).strip().splitlines():
                    words = shlex.split(line)
                    self.assertEqual(words[:2], ["octrad", verb])
                    for word in words[2:]:
                        if re.match(r"--?[A-Za-z]", word):
                            self.assertIn(word, options, f"the example of {verb} uses an option that does not exist")

    def test_version(self):
        self.assertRegex(self.ok("--version").out, r"^octrad \d+\.\d+\.\d+(-[a-z]+)?\n$")

    def test_unknown_words_are_suggested(self):
        self.fails(1, 'did you mean "compare"', "compre")
        self.fails(1, "which verb?")
        self.fails(1, 'did you mean "--version"', "--versio")
        for verb in VERBS:
            self.fails(1, 'did you mean "--threads"', verb, "--thread", "2", *({"compare": ["a", "b"], "info": []}.get(verb, ["a"])))
        self.fails(1, 'did you mean "--alpha-below"', "compare", "a", "b", "--alpha-bellow", "0.5")
        self.fails(1, "unexpected argument", "info", "a.exr", "b.exr")

    def test_bad_values(self):
        for option, word, why in (("--threads", "-1", "out of range"), ("--threads", "two", "not a whole number"), ("--threads", "", "not a whole number"),
                                  ("--threads", "4097", "expected a whole number from 0 to 4096"), ("--seed", "1.5", "not a whole number"),
                                  ("--seed", "9" * 30, "out of range"), ("--seed", "0x10", "not a whole number"), ("--seed", "1e3", "not a whole number")):
            self.assertIn(why, self.fails(1, option, "info", option, word).err, word)
        for word, why in (("two", "not a number"), ("nan", "not a number"), ("", "not a number"), ("100", "out of range"), ("inf", "out of range"),
                          ("1x", "expected a number from -64 to 64")):
            self.assertIn(why, self.fails(1, "--exposure", "tonemap", "a.exr", "-o", "a.png", "--exposure", word).err, word)
        self.fails(1, "amount of memory", "info", "--max-memory", "4X")
        self.fails(1, "above 0", "info", "--max-memory", "0")
        for word in ("gpu", "cuda:", "cuda:-1", "cuda:x", "cpu:0"):
            self.fails(1, "expected auto, cpu, cuda or cuda:N", "info", "--device", word)
        self.fails(1, "required", "compare")
        self.fails(1, "one level of detail", "info", "-v", "-v")
        self.fails(1, "exclude each other", "info", "-v", "-q")
        self.fails(1, "unknown option --log-json", "info", "--log-json", "log.jsonl")

    def test_closed_output_is_an_io_error(self):
        with open("/dev/full", "w") as full:
            result = run("info", stdout=full)
        self.assertEqual(result.code, 3)
        self.assertIn("standard output", result.err)


if __name__ == "__main__":
    unittest.main()
