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

    def test_options_are_no_values(self):
        """Of variables that are not set and not quoted: "-o $OUT --resume"."""
        scene = self.write("room.xml", ROOM)
        self.fails(1, "the value is missing, and --resume is an option", "render", scene, "-o", "--resume")
        self.fails(1, "the value is missing, and --json is an option", "train", scene, "--steps", 1, "-o", "--json")
        self.assertEqual(os.listdir(self.folder), ["room.xml"])

    def test_two_names_of_one_new_file(self):
        scene = self.write("room.xml", ROOM)
        self.fails(1, "would overwrite", "render", scene, "--spp", 1, "-o", "./n.exr", "--log-json", "n.exr", cwd=self.folder)
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
        self.fails(1, 'did you mean "compare"', "compre", "a.exr", "-o", "b.exr")
        self.fails(1, 'did you mean "cuda"', "render", "a.xml", "-o", "a.exr", "--device", "gpu")
        self.fails(1, "at least one picture beside the reference", "compare", "a.exr")
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
        for word in ("4X", "nan", "inf", "1e19", "9" * 30 + "T"):
            self.fails(1, f'"{word}" is not an amount of memory', "info", "--max-memory", word)
        self.fails(1, "above 0", "info", "--max-memory", "0")
        for word in ("gpu", "cuda:", "cuda:-1", "cuda:x", "cpu:0"):
            self.fails(1, "expected auto, cpu, cuda or cuda:N", "info", "--device", word)
        self.fails(1, "required", "compare")
        self.fails(1, "one level of detail", "info", "-v", "-v")
        self.fails(1, "exclude each other", "info", "-v", "-q")
        self.fails(1, "unknown option --log-json", "info", "--log-json", "log.jsonl")

    def test_numbers_that_make_no_sense(self):
        """Not finite, beyond 64 bits, and beyond what the option takes: refused before a file is looked at."""
        render, compare = ("render", "a.xml", "-o", "a.exr"), ("compare", "a.exr", "b.exr")
        for verb, option, span, outside in ((("tonemap", "a.exr", "-o", "a.png"), "--gamma", "from 0.1 to 10", ("0", "-1", "1e30")), (render, "--fov", "from 0.01 to 179", ("0", "180", "-5", "1e-30")),
                                            (compare, "--alpha-below", "from 0 to 1000", ("-1e-9", "1001")), (compare, "--alpha-above", "from 0 to 1000", ("-1", "1e30")),
                                            (compare, "--flip-ppd", "from 1 to 1000", ("0", "1e9")), ((*compare, "--errors", "e"), "--error-max", "from 1e-30 to 1e+30", ("0", "-1", "1e-31"))):
            for word in ("nan", "-nan", "x", "1,5"):
                self.assertIn(f'{option}: "{word}" is not a number; expected a number {span}', self.fails(1, option, *verb, option, word, cwd=self.folder).err)
            for word in ("inf", "-inf", "1e999", *outside):
                self.assertIn(f'{option}: "{word}" is out of range; expected a number {span}', self.fails(1, option, *verb, option, word, cwd=self.folder).err)
        for word, why in (("nan", "not a whole number"), ("inf", "not a whole number"), ("1e30", "not a whole number"), ("0", "out of range"), ("9" * 20, "out of range")):
            self.fails(1, f'--spp: "{word}" is {why}', *render, "--spp", word, cwd=self.folder)
        self.assertEqual(os.listdir(self.folder), [])

    def test_camera_beyond_32_bits(self):
        """Is far away too."""
        self.write("room.xml", ROOM)
        self.fails(1, "is too far away", "render", "room.xml", "-o", "a.exr", "--target", "0,0,-1", "--origin", "1e39,0,0", cwd=self.folder)

    def test_crop_of_more_than_there_is(self):
        """Is a mistake on the command line, whatever the memory that so many pixels would take."""
        self.write("room.xml", ROOM)
        for word in ("0,0,33,24", "0,0,100000,100000", "2147483647,0,2147483647,1"):
            self.fails(1, "inside the picture of 32 x 24", "render", "room.xml", "-o", "a.exr", "--crop", word, cwd=self.folder)

    def test_places_that_make_no_sense(self):
        """Of a camera on the command line, and times."""
        self.write("room.xml", ROOM)
        render = ("render", "room.xml", "-o", "a.exr", "--spp", "1")
        views = {"--origin": ("--target", "0,0,-1"), "--target": ("--origin", "0,0,0.5"), "--up": ("--origin", "0,0,0.5", "--target", "0,0,-1")}
        for option, others in views.items():
            for word in ("nan,0,0", "0,inf,0", "0,0,-inf", "1e999,0,0", "1,2", "1,2,3,4", "0,0,", "a,0,0"):
                self.fails(1, f'{option} "{word}": expected 3 numbers with commas between them', *render, *others, option, word, cwd=self.folder)
        for option, word, why in (("--origin", "1e19,0,0", "the camera is too far away: its coordinates may be up to 1e12"), ("--origin", "0,0,-1.1e12", "the camera is too far away"),
                                  ("--origin", "0,0,-1", "define no view"), ("--up", "0,0,0", "define no view"), ("--up", "0,0,7", "define no view"), ("--target", "1e39,0,0", "what it looks at, is too far away")):
            self.fails(1, why, *render, *views[option], option, word, cwd=self.folder)
        for word in ("nan", "inf", "-1s", "1e308h", "1e999"):
            self.fails(1, f'"{word}" is not a duration', *render, "--time", word, cwd=self.folder)
        for word, why in (("nan,0,4,4", "expected 4 numbers"), ("0,0,inf,4", "expected 4 numbers"), ("0,0,1e19,4", "expected whole numbers"), ("0,0,0,4", "above 0"), ("30,0,4,4", "inside the picture of 32 x 24"),
                          ("2147483647,0,1,1", "inside the picture of 32 x 24")):
            self.fails(1, why, *render, "--crop", word, cwd=self.folder)
        self.assertEqual(os.listdir(self.folder), ["room.xml"])

    def test_closed_output_is_an_io_error(self):
        with open("/dev/full", "w") as full:
            result = run("info", stdout=full)
        self.assertEqual(result.code, 3)
        self.assertIn("standard output", result.err)


if __name__ == "__main__":
    unittest.main()
