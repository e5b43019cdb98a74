#!/usr/bin/env python3
"""scripts/install_deps.sh waits while another package run holds a lock, and reports other errors at once.

dpkg-query, apt-get, id and sleep are stand-ins: nothing is installed.
"""
import os
import pathlib
import subprocess
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parent.parent / "scripts" / "install_deps.sh"
LOCKED = "E: Could not get lock /var/lib/dpkg/lock-frontend. It is held by process 1 (apt-get)"


def stand_in(folder, name, text):
    path = pathlib.Path(folder, name)
    path.write_text("#!/bin/sh\n" + text)
    path.chmod(0o755)


class InstallDeps(unittest.TestCase):
    def install(self, failures, message, arguments=(), query="exit 1\n"):
        """Runs the script where apt-get fails so many times with this message -> process, apt-get's calls."""
        with tempfile.TemporaryDirectory() as folder:
            calls = pathlib.Path(folder, "calls")
            stand_in(folder, "dpkg-query", query)
            stand_in(folder, "id", "echo 0\n")
            stand_in(folder, "sleep", "exit 0\n")
            stand_in(folder, "apt-get", 'echo "$*" >>"%s"\n[ $(wc -l <"%s") -gt %d ] && exit 0\necho "%s" >&2\nexit 100\n'
                     % (calls, calls, failures, message))
            environment = dict(os.environ, PATH=folder + os.pathsep + os.environ["PATH"])
            done = subprocess.run([str(SCRIPT), *arguments], capture_output=True, text=True, env=environment, timeout=600)
            return done, calls.read_text().splitlines()

    def test_waits_for_a_lock(self):
        done, calls = self.install(3, LOCKED)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual([line.split()[1] for line in calls], ["update"] * 4 + ["install"])
        self.assertEqual(done.stdout.count("waiting"), 1)

    def test_gives_up_after_ten_minutes(self):
        done, calls = self.install(1000, LOCKED)
        self.assertNotEqual(done.returncode, 0)
        self.assertEqual(len(calls), 121)
        self.assertIn(LOCKED, done.stderr)

    def test_other_errors_end_at_once(self):
        done, calls = self.install(1000, "E: Unable to locate package")
        self.assertNotEqual(done.returncode, 0)
        self.assertEqual(len(calls), 1)
        self.assertIn("Unable to locate package", done.stderr)

    def test_does_without_the_browser(self):
        only_the_browser_is_missing = 'case "$*" in *chromium) exit 1 ;; *) echo installed ;; esac\n'
        done, calls = self.install(1000, "E: Unable to locate package", ["--test"], only_the_browser_is_missing)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("tests that need it are skipped: chromium", done.stdout)
        self.assertEqual(len(calls), 1)
        done, calls = self.install(0, "", ["--test"], only_the_browser_is_missing)
        self.assertEqual([line.split()[1] for line in calls], ["update", "install"])


if __name__ == "__main__":
    unittest.main()
