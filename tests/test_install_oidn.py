#!/usr/bin/env python3
"""scripts/install_oidn.sh keeps the libraries of the package and nothing else. The package is a stand-in: nothing is fetched."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
import zipfile

SCRIPT = pathlib.Path(__file__).resolve().parent.parent / "scripts" / "install_oidn.sh"
LIBRARIES = ("libOpenImageDenoise.so.2", "libOpenImageDenoise_core.so.2.9.1", "libOpenImageDenoise_device_cpu.so.2.9.1",
             "libOpenImageDenoise_device_cuda.so.2.9.1", "libtbb.so.12")


def has_pip():
    return any(subprocess.run([python, "-m", "pip", "--version"], capture_output=True, check=False).returncode == 0
               for python in ("python3", "/usr/bin/python3"))


class InstallOidn(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = pathlib.Path(scratch.name)

    def install(self, libraries, *arguments, **environment):
        with zipfile.ZipFile(self.folder / "pyoidn-2.9.1.0-py3-none-any.whl", "w") as wheel:
            for name in (*libraries, "libOpenImageDenoise_device_hip.so.2.9.1"):
                wheel.writestr("pyoidn/oidn/lib/" + name, name)
            wheel.writestr("pyoidn/__init__.py", "")
            wheel.writestr("pyoidn-2.9.1.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: pyoidn\nVersion: 2.9.1.0\n")
            wheel.writestr("pyoidn-2.9.1.0.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
            wheel.writestr("pyoidn-2.9.1.0.dist-info/RECORD", "")
        environment = dict(os.environ, HOME=str(self.folder), PIP_NO_INDEX="1", PIP_FIND_LINKS=str(self.folder), **environment)
        return subprocess.run([str(SCRIPT), *arguments], env=environment, capture_output=True, text=True, timeout=600, check=False)

    @unittest.skipUnless(has_pip(), "needs pip")
    def test_keeps_the_libraries(self):
        for arguments, target in (((), self.folder / ".local/lib/octrad"), ((str(self.folder / "here"),), self.folder / "here")):
            done = self.install(LIBRARIES, *arguments)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn(str(target), done.stdout)
            self.assertEqual(sorted(os.listdir(target)), sorted(LIBRARIES))
            self.assertEqual((target / LIBRARIES[0]).read_text(), LIBRARIES[0])

    @unittest.skipUnless(has_pip(), "needs pip")
    def test_a_package_without_them_changes_nothing(self):
        target = self.folder / "here"
        self.assertEqual(self.install(LIBRARIES, str(target)).returncode, 0)
        done = self.install(LIBRARIES[1:], str(target))
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("libOpenImageDenoise.so.2", done.stderr)
        self.assertEqual(sorted(os.listdir(target)), sorted(LIBRARIES))

    def test_usage(self):
        self.assertEqual(subprocess.run([str(SCRIPT), "--help"], capture_output=True, check=False).returncode, 1)


if __name__ == "__main__":
    sys.exit(unittest.main())
