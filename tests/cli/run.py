#!/usr/bin/env python3
"""Tests of the command line. Usage: run.py PATH-TO-OCTRAD [unittest arguments]"""
import os
import sys
import time
import unittest


class Timed(unittest.TextTestResult):
    took = []

    def startTest(self, test):
        self.began = time.monotonic()
        super().startTest(test)

    def stopTest(self, test):
        super().stopTest(test)
        self.took.append((time.monotonic() - self.began, test.id()))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    os.environ["OCTRAD"] = os.path.abspath(sys.argv[1])
    here = os.path.dirname(os.path.abspath(__file__))
    sys.path.insert(0, here)
    if len(sys.argv) > 2:
        unittest.main(module=None, argv=[sys.argv[0]] + sys.argv[2:])
    suite = unittest.defaultTestLoader.discover(here)
    result = unittest.TextTestRunner(verbosity=1, resultclass=Timed).run(suite)
    print("\nSlowest:")
    for seconds, name in sorted(Timed.took, reverse=True)[:10]:
        print("%6.1f s  %s" % (seconds, name))
    sys.exit(0 if result.wasSuccessful() else 1)
